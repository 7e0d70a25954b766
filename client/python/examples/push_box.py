"""A ball pushes a box to its place, through contacts: MuJoCo simulates, Marble plans at 50 Hz. Requires mujoco.

At each control step the model is linearized at the measured state, with the contacts as pairs, and a session plans ten
stages ahead. MuJoCo's own soft contacts, at 2 ms, are not the controller's.

Usage: MARBLE_SERVER=127.0.0.1:50051 python examples/push_box.py [SECONDS]    (MARBLE_SERVER=local: in this process)
"""

import sys
import time

import mujoco
import numpy as np

from marble.lcs import Planner, linearizer

GOAL = 0.3  # m
MODEL = """<mujoco><option timestep="0.002" cone="elliptic"/><default><geom friction="0.4"/></default>
  <worldbody><geom name="floor" type="plane" size="5 5 .1"/>
    <body pos="0 0 .1"><joint name="box x" type="slide" axis="1 0 0"/><joint name="box z" type="slide" axis="0 0 1"/>
      <joint name="box turn" axis="0 1 0"/><geom name="box" type="box" size=".1 .1 .1" mass="1"/></body>
    <body pos="-.2 0 .1" gravcomp="1"><joint name="ball x" type="slide" axis="1 0 0" damping="1"/>
      <joint name="ball z" type="slide" axis="0 0 1" damping="1"/>
      <geom name="ball" type="sphere" size=".03" mass=".5"/></body></worldbody>
  <actuator><motor joint="ball x" ctrlrange="-20 20"/><motor joint="ball z" ctrlrange="-20 20"/></actuator></mujoco>"""

seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 3.0
model = mujoco.MjModel.from_xml_string(MODEL)
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
pairs = [("floor", "box", "corner0"), ("floor", "box", "corner4"), ("box", "ball")]  # of a planar box, two corners
linearize = linearizer(model, data, dt=0.04, num_directions=2, pairs=pairs)
now = linearize(data)
Q = np.diag([200, 1, 20, 2, 20, 1, 1, 1, 0.2, 0.2])  # of box x, z, turn, ball x, z, and their velocities

# A little regularization decides between contact forces that move the bodies alike.
options = {"Q": Q, "P": 10 * Q, "R": 1e-3 * np.eye(2), "regularization": 1e-6, "u_lb": now.u_min, "u_ub": now.u_max}
with Planner(now.lcs, 10, **options) as planner:
    print(f"{'s':>5} {'box x':>7} {'ball x':>7} {'force N':>8} {'status':<15} {'solve ms':>8} {'step ms':>8}")
    late = 0
    for tick in range(round(50 * seconds)):
        begin = time.perf_counter()
        now = linearize(data)
        at_box = [GOAL, 0, 0, data.qpos[0] + 0.07, 0]  # the box at its goal, the ball at the box's left side
        plan = planner.step(now.x0, lcs=now.lcs, x_ref=now.state(at_box, np.zeros(5)))
        elapsed = time.perf_counter() - begin
        late += elapsed > 0.02
        data.ctrl[:] = plan.u[0]
        if tick % 10 == 0:
            print(f"{data.time:5.2f} {data.qpos[0]:7.3f} {data.qpos[3] - 0.2:7.3f} {plan.u[0, 0]:8.2f} "
                  f"{plan.status.value:<15} {1e3 * plan.times.solve_s:8.2f} {1e3 * elapsed:8.2f}")
        for _ in range(10):
            mujoco.mj_step(model, data)
print(f"the box is at {data.qpos[0]:.3f} m, its goal at {GOAL:.3f} m; {late} steps took more than 20 ms")
