"""A planar hopper over two steps up and two down, from the first line to a picture; cell by cell, as in a notebook.

Usage: MARBLE_SERVER=127.0.0.1:50051 python examples/hopper.py [PICTURE]
"""

# %% The problem: contact is a pair, 0 <= distance + slip ⊥ force >= 0, at every step of the horizon.
import sys

import marble
from marble import drawing
from marble.hopper import NAMES, Hopper, trajectory

hopper = Hopper()
problem = hopper.problem()
print(problem)

# %% Solve it, and look on.
kkt = []
with marble.Client() as client:
    plan = client.solve(problem, progress=lambda row: kkt.append(row.kkt_residual))
print(plan)
print(f"KKT residual: {kkt[0]:.1e} at first, {min(kkt):.1e} at best, over {len(kkt)} rows of progress")

# %% What the plan says: when the foot presses, it does not slip.
steps = trajectory(plan.z)
force = steps[:, NAMES.index("normal_force")]
speed = steps[:, NAMES.index("foot_vx")]
pressing = force > 1e-6
print(f"the foot presses in {pressing.sum()} of {hopper.steps} steps, and slips in them by at most "
      f"{abs(speed[pressing]).max():.1e} m/s")

# %% A picture; a name that ends in .gif makes an animation.
picture = sys.argv[1] if len(sys.argv) > 1 else "hopper.png"
try:
    drawing.save(hopper, plan.z, picture)
    print(f"drawn in {picture}")
except ImportError:
    print(drawing.text(hopper, plan.z))
