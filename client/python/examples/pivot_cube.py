"""Two fingers turn a cube by 90 degrees about its lower edge: MuJoCo simulates, Marble plans at 50 Hz. Requires mujoco.

One finger pushes at the left side; the other one rests on the top, which becomes the right side, and holds the cube
back once it would fall over. Nothing prescribes when they touch: each plan finds that out.

Usage: MARBLE_SERVER=127.0.0.1:50051 python examples/pivot_cube.py [SECONDS [ANIMATION]]    (MARBLE_SERVER=local: in
this process). ANIMATION: a .gif, with pillow, or an .mp4, with imageio[ffmpeg].
"""

import contextlib
import sys

import mujoco
import numpy as np

from marble.lcs import Controller, Task
from marble.lcs.simulation import Recorder, simulate

HALF, SECONDS = 0.1, 2.0  # of the cube in m; of the turn
STAGE, STAGES = 0.04, 10  # s
FINGER = """<body name="{0}" pos="0 0 .1" gravcomp="1"><joint name="{0} x" type="slide" axis="1 0 0" damping="1"/>
  <joint name="{0} z" type="slide" axis="0 0 1" damping="1"/>
  <geom name="{0}" type="sphere" size=".02" mass=".2" rgba=".9 .4 .1 1"/></body>"""
MOTORS = """<motor joint="{0} x" ctrlrange="-20 20"/><motor joint="{0} z" ctrlrange="-20 20"/>"""
MODEL = f"""<mujoco><option timestep="0.002" cone="elliptic"/><default><geom friction="0.8"/></default>
  <visual><headlight ambient=".4 .4 .4"/></visual>
  <worldbody><light pos="0 -1 3"/><camera name="side" pos=".1 -.9 .25" xyaxes="1 0 0 0 .15 1"/>
    <geom name="floor" type="plane" size="5 5 .1" rgba=".8 .8 .8 1"/>
    <body pos="0 0 .1"><joint name="cube x" type="slide" axis="1 0 0"/><joint name="cube z" type="slide" axis="0 0 1"/>
      <joint name="cube turn" axis="0 1 0"/>
      <geom name="cube" type="box" size=".1 .1 .1" mass="1" rgba=".2 .5 .8 1"/>
      <geom type="box" size=".1 .101 .01" pos="0 0 .085" contype="0" conaffinity="0" mass="0" rgba=".1 .2 .4 1"/></body>
    {FINGER.format("left")}{FINGER.format("top")}</worldbody>
  <actuator>{MOTORS.format("left")}{MOTORS.format("top")}</actuator></mujoco>"""


def target(now, time):
    """For each stage: the cube on its way about the edge at x = 0.1, the fingers on its left side and its top."""
    turn = np.pi / 2 * np.clip((time + STAGE * np.arange(STAGES + 1)) / SECONDS, 0, 1)
    c, s = np.cos(turn), np.sin(turn)
    cube = np.stack([HALF * (1 - c + s), HALF * (c + s - 1), turn], axis=1)
    c, s = np.cos(now.q[2]), np.sin(now.q[2])
    right, up = HALF * np.array([c, -s]), HALF * np.array([s, c])
    fingers = np.concatenate([now.q[:2] - right + up / 2, now.q[:2] + up])
    return np.hstack([cube, np.tile(fingers, (STAGES + 1, 1))]), np.zeros(7)


Q = np.diag([100, 100, 50, 5, 5, 5, 5, 1, 1, 0.5, 0.1, 0.1, 0.1, 0.1])  # of cube x, z, turn, fingers; velocities
TASK = Task(
    # The simulation waits for each plan. On a robot leave out the deadline: it is the period, 20 ms.
    deadline=np.inf,
    rate=50, dt=STAGE, stages=STAGES, Q=Q, P=5 * Q, R=1e-3 * np.eye(4), shift=1, regularization=1e-6, target=target,
    # Of a planar cube that turns to the right, three corners.
    contacts={"num_directions": 2, "pairs": [*(("floor", "cube", f"corner{i}") for i in (0, 4, 5)), ("cube", "left"),
                                             ("cube", "top")]})

seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 3.0
animation = sys.argv[2] if len(sys.argv) > 2 else None
model = mujoco.MjModel.from_xml_string(MODEL)
data = mujoco.MjData(model)
data.qpos[3:] = [-0.15, 0.05, 0, 0.15]


def show(step):
    """One line in ten steps."""
    if controller.statistics.steps % 10 == 1:
        forces = step.plan.lam[0].reshape(5, 2).sum(axis=1)[3:]
        print(f"{data.time:5.2f} {np.degrees(data.qpos[2]):7.1f} {forces[0]:7.2f} {forces[1]:7.2f} "
              f"{step.plan.status.value:<15} {1e3 * step.plan.times.solve_s:8.2f} {1e3 * step.total_s:8.2f}")


print(f"{'s':>5} {'turn':>7} {'left N':>7} {'top N':>7} {'status':<15} {'solve ms':>8} {'step ms':>8}")
with Controller(model, TASK, state=data) as controller, \
        Recorder(model, camera="side") if animation else contextlib.nullcontext() as recorder:
    simulate(controller, model, data, seconds, on_step=show, recorder=recorder)
    if animation:
        recorder.save(animation)
print(controller.statistics)
print(f"the cube has turned by {np.degrees(data.qpos[2]):.1f} degrees, and is at {data.qpos[0]:.3f} m")
