"""A ball pushes a box to its place, through contacts: MuJoCo simulates, Marble plans at 50 Hz. Requires mujoco.

At each control step the controller linearizes the model at the measured state, with the contacts as pairs, and plans
ten stages ahead. MuJoCo's own soft contacts, at 2 ms, are not the controller's.

Usage: MARBLE_SERVER=127.0.0.1:50051 python examples/push_box.py [SECONDS [ANIMATION]]    (MARBLE_SERVER=local: in this
process). ANIMATION: a .gif, with pillow, or an .mp4, with imageio[ffmpeg].
"""

import contextlib
import sys

import mujoco
import numpy as np

from marble.lcs import Controller, Task
from marble.lcs.simulation import Recorder, simulate

GOAL = 0.3  # m
MODEL = """<mujoco><option timestep="0.002" cone="elliptic"/><default><geom friction="0.4"/></default>
  <visual><headlight ambient=".4 .4 .4"/></visual>
  <worldbody><light pos="0 -1 3"/><geom name="floor" type="plane" size="5 5 .1"/>
    <body pos="0 0 .1"><joint name="box x" type="slide" axis="1 0 0"/><joint name="box z" type="slide" axis="0 0 1"/>
      <joint name="box turn" axis="0 1 0"/>
      <geom name="box" type="box" size=".1 .1 .1" mass="1" rgba=".2 .5 .8 1"/></body>
    <body pos="-.2 0 .1" gravcomp="1"><joint name="ball x" type="slide" axis="1 0 0" damping="1"/>
      <joint name="ball z" type="slide" axis="0 0 1" damping="1"/>
      <geom name="ball" type="sphere" size=".03" mass=".5" rgba=".9 .4 .1 1"/></body></worldbody>
  <actuator><motor joint="ball x" ctrlrange="-20 20"/><motor joint="ball z" ctrlrange="-20 20"/></actuator></mujoco>"""

Q = np.diag([200, 1, 20, 2, 20, 1, 1, 1, 0.2, 0.2])  # of box x, z, turn, ball x, z, and their velocities
TASK = Task(
    # The simulation waits for each plan. On a robot leave out the deadline: it is the period, 20 ms.
    deadline=np.inf,
    rate=50, dt=0.04, stages=10, Q=Q, P=10 * Q, R=1e-3 * np.eye(2),
    # A stage is two control steps; plans that move on by one at each step let the box rest nearer to its goal.
    shift=1,
    # A little regularization decides between contact forces that move the bodies alike.
    regularization=1e-6,
    # The box at its goal, the ball at the box's left side.
    target=lambda now, time: ([GOAL, 0, 0, now.q[0] + 0.07, 0], np.zeros(5)),
    # Of a planar box, two corners.
    contacts={"num_directions": 2,
              "pairs": [("floor", "box", "corner0"), ("floor", "box", "corner4"), ("box", "ball")]})

seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 3.0
animation = sys.argv[2] if len(sys.argv) > 2 else None
model = mujoco.MjModel.from_xml_string(MODEL)
data = mujoco.MjData(model)


def show(step):
    """One line in ten steps."""
    if controller.statistics.steps % 10 == 1:
        plan = step.plan
        print(f"{data.time:5.2f} {data.qpos[0]:7.3f} {data.qpos[3] - 0.2:7.3f} {step.u[0]:8.2f} "
              f"{plan.status.value:<15} {1e3 * plan.times.solve_s:8.2f} {1e3 * step.total_s:8.2f}")


print(f"{'s':>5} {'box x':>7} {'ball x':>7} {'force N':>8} {'status':<15} {'solve ms':>8} {'step ms':>8}")
with Controller(model, TASK, state=data) as controller, \
        Recorder(model) if animation else contextlib.nullcontext() as recorder:
    simulate(controller, model, data, seconds, on_step=show, recorder=recorder)
    if animation:
        recorder.save(animation)
print(controller.statistics)
print(f"the box is at {data.qpos[0]:.3f} m, its goal at {GOAL:.3f} m")
