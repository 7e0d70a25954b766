"""Marble's planner as a controller, no control, and a record of the LCQPs of slow steps."""

import dataclasses
import os
import pathlib
from typing import Any

import numpy as np
from loop import Step

import marble
from marble.lcs import Planner
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

    def __call__(self, task, _, view):
        server = os.environ.get("MARBLE_SERVER") or "local"
        client = marble.Client(server) if self.dump is None else RecordingClient(server)
        if self.dump is not None:
            client.record(*self.dump)
        return _Planned(client, Planner(
            view.now.lcs, task.stages, Q=task.Q, R=task.R, P=task.P, regularization=task.regularization,
            u_lb=view.now.u_min, u_ub=view.now.u_max, x_ref=view.x_ref, **bounds(task, view.now), server=client,
            **self.options), task)


class _Planned:
    def __init__(self, client, planner, task):
        self._client, self._planner, self._task = client, planner, task

    def step(self, view):
        lcs = view.now.lcs
        plan = self._planner.step(view.now.x0, lcs=lcs, x_ref=view.x_ref, **bounds(self._task, view.now))
        return Step(plan.u[0], plan.times.solve_s, plan.status is not marble.Status.SOLVED or not plan.feasible,
                    complementarity(lcs, plan.x[:-1], plan.u, plan.lam),
                    (plan.objective - plan.start_objective) / max(1.0, abs(plan.start_objective)),
                    None if plan.solution is None else plan.solution.factorizations)

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
    return float(np.abs(np.minimum(lam, x @ lcs.E.T + lam @ lcs.F.T + u @ lcs.H.T + lcs.c)).max())
