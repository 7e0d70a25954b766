"""One run of a task in MuJoCo's own physics, with one controller; and what is counted of it."""

import copy
import dataclasses
import time
from typing import Any

import mujoco as mj
import numpy as np

import marble.lcs
from marble.lcs import linearizer


@dataclasses.dataclass
class Step:
    """What a controller returns: the input (nu,), and what is counted. Of a plan: the largest |min(λ, E x + F λ + H u +
    c)|, and how far its objective is above that of the rolled-out start, over max(1, |that|)."""

    u: np.ndarray
    solve_s: float = 0.0
    unsolved: bool = False
    complementarity: float | None = None
    above_start: float | None = None
    factorizations: int | None = None
    wall_s: float = 0.0


@dataclasses.dataclass
class View:
    """What a controller sees at a step: MuJoCo's data, to read; the linearization; and targets (N + 1, nx)."""

    data: Any
    now: Any
    x_ref: np.ndarray


@dataclasses.dataclass
class Run:
    """The result of a run; cost: the integral of the task's cost over its time."""

    task: str
    seed: int
    controller: str
    done: bool
    cost: float
    steps: list[Step]
    seconds: float


def targets(task, scenario, now, data):
    """The targets of the stages 0 to N as states of the linearization."""
    return np.array([now.state(*task.target(scenario, data, data.time + k * task.dt)) for k in range(task.stages + 1)])


def as_controlled(task, scenario, data, deadline):
    """The task as marble.lcs.Controller has it, with targets for the state of data."""
    def target(_, __):
        rows = [task.target(scenario, data, data.time + k * task.dt) for k in range(task.stages + 1)]
        return np.array([q for q, _ in rows]), np.array([v for _, v in rows])

    return marble.lcs.Task(
        rate=task.rate, stages=task.stages, dt=task.dt, Q=task.Q, R=task.R, P=task.P, target=target, deadline=deadline,
        regularization=task.regularization, contacts=task.contacts, shift=None if task.along_plan else 1,
        linearize_along="plan" if task.along_plan else "state", linearizations=max(1, task.along_plan))


def pairs(task):
    """Pairs of a stage of its plans."""
    model, scenario = task.load(), task.of_seed(0)
    data = mj.MjData(model)
    data.qpos[:] = scenario.q
    return int(linearizer(model, data, dt=task.dt, **task.contacts)(data).lcs.nl)


def simulated(model, scenario):
    """The model that is simulated; controllers have the nominal one."""
    made = copy.copy(model)
    made.body_mass[:] *= scenario.mass
    made.body_inertia[:] *= scenario.mass
    made.geom_friction[:, 0] *= scenario.friction
    mj.mj_setConst(made, mj.MjData(made))
    return made


def push(model, data, scenario):
    """Applies the scenario's pushes at the present time."""
    data.xfrc_applied[:] = 0
    for start, end, body, force in scenario.pushes:
        if start <= data.time < end:
            data.xfrc_applied[model.body(body).id, :3] += force


def run(task, seed, name, controller, recorder=None):
    """controller(task, model, view) -> an object with step(view), and close(). If the task fails, the remaining time
    costs what the last step did. recorder: a marble.lcs.simulation.Recorder."""
    model, scenario = task.load(), task.of_seed(seed)
    plant = simulated(model, scenario)
    data = mj.MjData(plant)
    data.qpos[:], data.qvel[:] = scenario.q, scenario.v
    mj.mj_forward(plant, data)
    linearize = linearizer(model, data, dt=task.dt, **task.contacts)
    now = linearize(data)
    ticks, substeps = round(task.rate * task.seconds), round(1 / task.rate / model.opt.timestep)
    made = controller(task, model, View(data, now, targets(task, scenario, now, data)))
    steps, cost = [], 0.0
    try:
        for tick in range(ticks):
            begun = time.perf_counter()
            now = linearize(data)
            view = View(data, now, targets(task, scenario, now, data))
            step = made.step(view)
            step.wall_s = time.perf_counter() - begun
            step.u = np.clip(step.u, now.u_min, now.u_max)
            steps.append(step)
            error = now.x0 - view.x_ref[0]
            price = (error @ task.Q @ error + step.u @ task.R @ step.u) / task.rate
            cost += price
            data.ctrl[:] = step.u
            for _ in range(substeps):
                if recorder is not None:
                    recorder.capture(data)
                push(plant, data, scenario)
                mj.mj_step(plant, data)
            if task.failed(scenario, data):
                cost += (ticks - tick - 1) * price
                return Run(task.name, seed, name, False, cost, steps, data.time)
    finally:
        made.close()
    return Run(task.name, seed, name, bool(task.done(scenario, data)), cost, steps, data.time)
