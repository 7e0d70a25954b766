"""A cart balances its pole with the help of soft walls: MuJoCo simulates, Marble plans at 50 Hz. Requires mujoco.

The push at the start is more than the motor alone can catch. The walls are springs in the plan; the model is linearized
at each control step.

Usage: MARBLE_SERVER=127.0.0.1:50051 python examples/cart_pole_walls.py [SECONDS]    (MARBLE_SERVER=local: in process)
"""

import sys
import time

import mujoco
import numpy as np

from marble.lcs import Planner, linearizer

MODEL = """<mujoco><option timestep="0.001"/><default><geom contype="0" conaffinity="0"/></default><worldbody>
  <geom name="left" type="plane" pos="-.35 0 .6" zaxis="1 0 0" size=".3 .3 .1" contype="1" solref=".05 .3"/>
  <geom name="right" type="plane" pos=".35 0 .6" zaxis="-1 0 0" size=".3 .3 .1" contype="1" solref=".05 .3"/>
  <body name="cart"><joint name="cart" type="slide" axis="1 0 0" damping=".1"/>
    <geom type="box" size=".1 .05 .05" mass="1"/>
    <body name="pole"><joint name="pole" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 .6" size=".01" mass=".1"/>
      <geom name="tip" pos="0 0 .6" size=".03" mass=".2" conaffinity="1"/></body></body></worldbody>
  <actuator><motor name="motor" joint="cart" ctrlrange="-8 8"/></actuator></mujoco>"""

seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 4.0
model = mujoco.MjModel.from_xml_string(MODEL)
data = mujoco.MjData(model)
data.qpos[:], data.qvel[:] = [0, 0.2], [0, 1.8]
mujoco.mj_forward(model, data)
linearize = linearizer(model, data, dt=0.02, contact="soft", stiffness=150.0,
                       pairs=[("left", "tip"), ("right", "tip")])
now = linearize(data)

with Planner(now.lcs, 25, Q=np.diag([10, 50, 1, 1]), R=[[0.01]], u_lb=now.u_min, u_ub=now.u_max) as planner:
    print(f"{'s':>5} {'cart m':>7} {'pole rad':>8} {'wall N':>7} {'motor N':>7} {'status':<15} {'solve ms':>8} "
          f"{'step ms':>8}")
    late = 0
    for tick in range(round(50 * seconds)):
        begin = time.perf_counter()
        now = linearize(data)
        plan = planner.step(now.x0, lcs=now.lcs, x_ref=now.state([0, 0], [0, 0]))
        elapsed = time.perf_counter() - begin
        late += elapsed > 0.02
        data.ctrl[:] = plan.u[0]
        if tick % 10 == 0:
            print(f"{data.time:5.2f} {data.qpos[0]:7.3f} {data.qpos[1]:8.3f} {plan.lam[0].max():7.2f} "
                  f"{plan.u[0, 0]:7.2f} {plan.status.value:<15} {1e3 * plan.times.solve_s:8.2f} {1e3 * elapsed:8.2f}")
        for _ in range(20):
            mujoco.mj_step(model, data)
print(f"the cart is at {data.qpos[0]:.3f} m, the pole at {data.qpos[1]:.3f} rad; {late} steps took more than 20 ms")
