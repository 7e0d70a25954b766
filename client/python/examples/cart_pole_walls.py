"""A cart balances its pole with the help of soft walls: MuJoCo simulates, Marble plans at 50 Hz. Requires mujoco.

The push at the start is more than the motor alone can catch. The walls are springs in the plan; the model is linearized
at each control step.

Usage: MARBLE_SERVER=127.0.0.1:50051 python examples/cart_pole_walls.py [SECONDS]    (MARBLE_SERVER=local: in process)
"""

import sys

import mujoco
import numpy as np

from marble.lcs import Controller, Task
from marble.lcs.simulation import simulate

MODEL = """<mujoco><option timestep="0.001"/><default><geom contype="0" conaffinity="0"/></default><worldbody>
  <geom name="left" type="plane" pos="-.35 0 .6" zaxis="1 0 0" size=".3 .3 .1" contype="1" solref=".05 .3"/>
  <geom name="right" type="plane" pos=".35 0 .6" zaxis="-1 0 0" size=".3 .3 .1" contype="1" solref=".05 .3"/>
  <body name="cart"><joint name="cart" type="slide" axis="1 0 0" damping=".1"/>
    <geom type="box" size=".1 .05 .05" mass="1"/>
    <body name="pole"><joint name="pole" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 .6" size=".01" mass=".1"/>
      <geom name="tip" pos="0 0 .6" size=".03" mass=".2" conaffinity="1"/></body></body></worldbody>
  <actuator><motor name="motor" joint="cart" ctrlrange="-8 8"/></actuator></mujoco>"""

TASK = Task(rate=50, dt=0.02, stages=25, Q=np.diag([10, 50, 1, 1]), R=[[0.01]], target=([0, 0], [0, 0]),
            deadline=np.inf,  # the simulation waits for each plan; on a robot leave it out: it is the period
            contacts={"contact": "soft", "stiffness": 150.0, "pairs": [("left", "tip"), ("right", "tip")]})

seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 4.0
model = mujoco.MjModel.from_xml_string(MODEL)
data = mujoco.MjData(model)
data.qpos[:], data.qvel[:] = [0, 0.2], [0, 1.8]


def show(step):
    """One line in ten steps."""
    if controller.statistics.steps % 10 == 1:
        plan = step.plan
        print(f"{data.time:5.2f} {data.qpos[0]:7.3f} {data.qpos[1]:8.3f} {plan.lam[0].max():7.2f} {step.u[0]:7.2f} "
              f"{plan.status.value:<15} {1e3 * plan.times.solve_s:8.2f} {1e3 * step.total_s:8.2f}")


print(f"{'s':>5} {'cart m':>7} {'pole rad':>8} {'wall N':>7} {'motor N':>7} {'status':<15} {'solve ms':>8} "
      f"{'step ms':>8}")
with Controller(model, TASK, state=data) as controller:
    simulate(controller, model, data, seconds, on_step=show)
print(controller.statistics)
print(f"the cart is at {data.qpos[0]:.3f} m, the pole at {data.qpos[1]:.3f} rad")
