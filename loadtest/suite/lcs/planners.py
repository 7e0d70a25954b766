"""Marble's planner as a controller, no control, and a record of the LCQPs of slow steps."""

import dataclasses
import os
import pathlib
from typing import Any

import numpy as np
from loop import Step

import marble
from marble.lcs import Planner, linearize_along, linearizer
from marble.model import problem_file

_PARTS = ("g", "b", "d", "l", "r", "c0", "Q", "A", "C", "L", "R")


class Nothing:
    """No control: inputs of zero."""

    def __init__(self, task, *_):
        self._u = np.zeros(task.R.shape[0])

    def step(self, _):
        return Step(self._u)

    def close(self):
        pass


class Recorder:
    """A session that remembers the numbers of its problem, and writes those of slow solves as JSON with their start, and
    those of the step before with its solution."""

    def __init__(self, session, problem, folder, bound):
        self._session, self._problem, self._folder, self._bound = session, problem, folder, bound
        self._tick, self._before = 0, None

    def update(self, **given):
        problem = self._problem.replaced(**{name: self._values(name, given[name]) for name in _PARTS
                                            if given.get(name) is not None})
        start = given.get("z0")
        solution = self._session.update(**given)
        if solution.factorizations > self._bound:
            self._folder.mkdir(parents=True, exist_ok=True)
            file = f"step{self._tick:04d}_{solution.factorizations}"
            name = f"{self._folder.name} step {self._tick}"
            problem_file.save(problem.replaced(z0=start, name=name), self._folder / f"{file}.json")
            if self._before is not None:
                problem_file.save(self._before.named(f"{name}, before"), self._folder / f"{file}_before.json")
        self._problem, self._before = problem, problem.replaced(z0=solution.z)
        self._tick += 1
        return solution

    def _values(self, name, value):
        old = getattr(self._problem, name)
        if name == "c0":
            return float(value)
        if not isinstance(value, np.ndarray) or isinstance(old, np.ndarray):
            return value
        made = old.copy()  # a matrix by its values alone
        made.data[:] = value
        return made

    def __getattr__(self, name):
        return getattr(self._session, name)


class RecordingClient(marble.Client):
    """A client whose sessions are recorded."""

    def record(self, folder, bound):
        """Where to write the problems of solves with more factorizations than this."""
        self._folder, self._bound = pathlib.Path(folder), bound

    def session(self, problem, **options):
        return Recorder(super().session(problem, **options), problem, self._folder, self._bound)


@dataclasses.dataclass
class Marble:
    """Makes controllers that plan by marble.lcs.Planner. options: of the solver. dump: None, or (folder, bound)."""

    options: dict[str, Any] = dataclasses.field(default_factory=dict)
    dump: tuple | None = None

    def __call__(self, task, model, view):
        server = os.environ.get("MARBLE_SERVER") or "local"
        client = marble.Client(server) if self.dump is None else RecordingClient(server)
        if self.dump is not None:
            client.record(*self.dump)
        return _Planned(client, Planner(
            view.now.lcs, task.stages, Q=task.Q, R=task.R, P=task.P, regularization=task.regularization,
            u_lb=view.now.u_min, u_ub=view.now.u_max, x_ref=view.x_ref, **bounds(task, view.now), server=client,
            **self.options), task, linearizer(model, view.data, dt=task.dt, **task.contacts) if task.along_plan else None)


class _Planned:
    """linearizer: to linearize along the last plan; None: the plan is made with the linearization that it is given."""

    def __init__(self, client, planner, task, linearizer):
        self._client, self._planner, self._task, self._linearizer = client, planner, task, linearizer
        self._along = None
        """The last plan's configurations, velocities and inputs at the stages of the next step."""
        self._steps = 0

    def step(self, view):
        lcs = view.now.lcs if self._along is None else self._along_plan(view, *self._along)
        shift = self._stages(self._steps) - self._stages(self._steps - 1) if self._linearizer else 1
        plan = self._planner.step(view.now.x0, lcs=lcs, x_ref=view.x_ref, shift=shift if self._steps else 0,
                                  **bounds(self._task, view.now))
        plans = [plan]
        for _ in range(1, self._task.along_plan):
            lcs = self._along_plan(view, *self._moved(view.now, plan, 0.0))
            plan = self._planner.step(view.now.x0, lcs=lcs, x_ref=view.x_ref, shift=0, **bounds(self._task, view.now))
            plans.append(plan)
        self._steps += 1
        if self._linearizer:
            self._along = self._moved(view.now, plan, 1 / self._task.rate / self._task.dt)
        return Step(plan.u[0], sum(one.times.solve_s for one in plans),
                    plan.status is not marble.Status.SOLVED or not plan.feasible, complementarity(lcs, plan.x[:-1], plan.u, plan.lam),
                    (plan.objective - plan.start_objective) / max(1.0, abs(plan.start_objective)),
                    None if plan.solution is None else sum(one.solution.factorizations for one in plans))

    def _stages(self, steps):
        """Stages that have ended after so many steps."""
        return int(max(steps, 0) / self._task.rate / self._task.dt + 1e-6)

    def _along_plan(self, view, q, v, u):
        return linearize_along(self._linearizer, view.data, view.now, q, v, u)

    @staticmethod
    def _moved(now, plan, stages):
        """Configurations, velocities and inputs of the stages that many stages later."""
        count = len(plan.u)
        at = np.arange(count) + stages
        k = np.minimum(at.astype(int), count - 1)
        x = plan.x[k] + (at - k)[:, None] * (plan.x[k + 1] - plan.x[k])
        q, v = zip(*map(now.configuration, x), strict=True)
        return np.array(q), np.array(v), plan.u[k]

    def close(self):
        self._planner.close()
        self._client.close()


def bounds(task, now):
    """Limits of joints as bounds of states, if the task has them so."""
    limits = now.joint_bounds(now.x0, task.stages)
    if limits is None:
        return {}
    lower, upper = limits
    return {"x_lb": np.hstack([lower, np.full_like(lower, -np.inf)]),
            "x_ub": np.hstack([upper, np.full_like(upper, np.inf)])}


def complementarity(lcs, x, u, lam):
    """The largest |min(λ, E x + F λ + H u + c)| of a plan of stages with x, u, λ as rows."""
    if lam.size == 0:
        return 0.0
    parts = ((lcs.E, x), (lcs.F, lam), (lcs.H, u))
    return float(np.abs(np.minimum(lam, sum((M @ v[:, :, None])[:, :, 0] for M, v in parts) + lcs.c)).max())
