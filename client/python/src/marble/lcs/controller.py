"""A controller: measures, linearizes the model, plans within a deadline, and falls back if a plan is late.

    with marble.lcs.Controller(model, task, state=data) as controller:
        while True:
            apply(controller.step(data).u)      # a MuJoCo model and its data; or Drake's, or Pinocchio's
            controller.prepare(data)            # optional, while nothing new is measured
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Mapping, Sequence
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import ArrayLike

import marble
from marble.base.checks import is_number
from marble.errors import FailedPrecondition, InvalidArgument
from marble.lcs.along_plan import linearize_along
from marble.lcs.dispatch import linearizer
from marble.lcs.guarded import GuardedPlanner
from marble.lcs.linearization import Linearization
from marble.lcs.planner import Plan, Planner, PlanOrigin
from marble.lcs.statistics import ControlStatistics
from marble.lcs.system import LCS, Array
from marble.lcs.task import Task

_SAME_TIME: Final = 1e-6
"""Of a stage."""


class StateLinearizer(Protocol):
    """What a controller needs of a model; marble.lcs.linearizer makes it for models of MuJoCo, Drake and Pinocchio."""

    def __call__(self, state: Any, u: ArrayLike | None = None) -> Linearization:
        """The linearization at a state and inputs u (nu,)."""

    def at(self, state: Any, q: ArrayLike, v: ArrayLike, u: ArrayLike | None = None) -> Linearization:
        """The same at another configuration q (nq,) and velocity v (nv,), with all else as in the state."""

    def measure(self, state: Any) -> tuple[Array, Array]:
        """The configuration (nq,) and the velocity (nv,) of a state."""


@dataclasses.dataclass(frozen=True, eq=False)
class ControlStep:
    """The result of Controller.step.

    u: (nu,), the inputs to apply. plan: of N stages; if it is not feasible, u is that of the last plan, moved on.
    linearization: where the plan's states are defined: `linearization.configuration(plan.x[k])`.
    is_late: whether it took longer than the deadline or the period. is_fallback: whether u is not that of the solver's
    solution. linearize_s, total_s: seconds of measuring and linearizing before the first plan, and of the whole step.
    """

    u: Array
    plan: Plan
    linearization: Linearization
    is_late: bool
    is_fallback: bool
    linearize_s: float
    total_s: float


@dataclasses.dataclass(frozen=True, eq=False)
class _Trajectory:
    """What is applied: inputs (N, nu), and the states (N + 1, nx) of a linearization that they lead through."""

    u: Array
    x: Array
    base: Linearization

    def moved(self, stages: int) -> _Trajectory:
        def shifted(values: Array) -> Array:
            made: Array = values[np.minimum(np.arange(len(values)) + stages, len(values) - 1)]
            return made

        return _Trajectory(shifted(self.u), shifted(self.x), self.base)

    def state(self, stages: float) -> Array:
        """The state after that many stages, between two of them in proportion."""
        at = min(max(stages, 0.0), float(len(self.u)))
        k = min(int(at), len(self.u) - 1)
        made: Array = self.x[k] + (at - k) * (self.x[k + 1] - self.x[k])
        return made

    def after(self, stages: float) -> tuple[Array, Array]:
        """Configurations (N, nq) and velocities (N, nv) at the beginning of N stages, that many stages later; beyond
        the end as the last stage goes on."""
        count = len(self.u)
        at = stages + np.arange(count)
        k = np.minimum(at.astype(int), count - 1)
        x = self.x[k] + (at - k)[:, None] * (self.x[k + 1] - self.x[k])
        q, v = zip(*map(self.base.configuration, x), strict=True)
        return np.array(q), np.array(v)


class Controller:
    """Controls a robot through its contacts: each step linearizes the model and plans, over one session.

    model: a mujoco.MjModel, a pydrake MultibodyPlant or a pinocchio.Model; or any StateLinearizer.
    state: as of marble.lcs.linearizer: a mujoco.MjData, the plant's context, or (q, v). The contacts are chosen there,
    and the first plan is made there, without a deadline, as nothing is known yet; None: both in the first step.
    server: as in marble.solve; a marble.Client stays open. options: of the solver, by name, as of Planner.

    Each step has inputs, also if its solve is late, fails or has no answer as of a server that is lost or hangs: the
    plan is then the last one, moved on and rolled out from the measured state, until another session is open. A step
    with a deadline takes at most a tenth of a second more. `statistics` counts that. A context manager: leaving it
    ends the session. One thread at a time.

    Raises InvalidArgument with the field of the task or of the model, and the errors of Planner, from where the first
    plan is made.
    """

    def __init__(self, model: Any, task: Task, *, state: Any = None,
                 server: str | Sequence[str] | marble.Client | None = None, options: Mapping[str, Any] | None = None,
                 **more_options: Any) -> None:
        if not isinstance(task, Task):
            raise InvalidArgument("task", "must be a marble.lcs.Task", value=type(task).__name__)
        self.task: Task = task
        self.statistics: ControlStatistics = ControlStatistics(float(task.rate))
        self._model, self._server = model, server
        self._options = {**(options or {}), **more_options}
        self._linearize: StateLinearizer | None = None
        self._plans: GuardedPlanner | None = None
        self._ahead: tuple[Linearization, LCS] | None = None
        """Of the next step, after prepare: the linearization where it begins, and the system of its stages."""
        self._current: _Trajectory | None = None
        self._applied: Array | None = None
        self._bounds: tuple[Array, Array] = (np.array(-np.inf), np.array(np.inf))
        self._gains: tuple[Array, Array] | None = None
        self._steps = 0
        self._linearize_s = 0.0
        self._is_closed = False
        if state is not None:
            self._begin(state)

    def step(self, state: Any) -> ControlStep:
        """One control step: the inputs to apply from now on, planned from the state.

        It is called once in each period of the task. After `prepare` it only measures and solves.
        """
        begin = time.perf_counter()
        self._check_open()
        if self._current is None:
            shift, error = 0, ""
            plan, now = self._begin(state)
            linearized = begin + self._linearize_s
        else:
            shift = self._shift()
            is_prepared = self._ahead is not None
            now, lcs, x0 = self._measured(state, shift)
            linearized = time.perf_counter()
            x_ref = None if is_prepared else self.task.x_ref(now, self.time_s)
            plan, error = self._guarded().step(lcs, x0, x_ref, self._applied,
                                               self._bounded(self._current.moved(shift).u), shift,
                                               self.task.deadline_s - (time.perf_counter() - begin),
                                               self.task.step_bounds(now, x0))
            for _ in range(1, int(self.task.linearizations)):
                if error or not (plan.feasible and plan.status.solved):
                    break
                along = _Trajectory(plan.u, plan.x, now)
                lcs = linearize_along(self._linearizer(), state, now, *along.after(0.0), along.u)
                plan, error = self._guarded().step(lcs, x0, self.task.x_ref(now, self.time_s), self._applied, plan.u, 0,
                                                   self.task.deadline_s - (time.perf_counter() - begin),
                                                   self.task.step_bounds(now, x0))
        return self._finish(plan, now, error, shift, begin, linearized - begin)

    def prepare(self, state: Any) -> None:
        """Optional: the preparation phase of the next step, after the last one and before the next state is measured.

        The model is linearized at the state that the plan predicts for the next step, and the numbers are sent; the
        solver prepares for them. state: any of the model; its configuration and velocity do not count, all else does.
        It takes the time of the linearization, by which the next step is shorter. An error of the server is that of
        the next step.
        """
        self._check_open()
        if self._current is None or self._linearize is None:
            raise FailedPrecondition("prepare: a step must come first")
        if self._ahead is not None:
            return
        current = self._current
        q, v = current.base.configuration(current.state(self.task.period_s / self.task.dt))
        ahead = self._linearize.at(state, q, v, self._applied)
        lcs = self._system(state, ahead, self._shift())
        if self._guarded().prepare(lcs, self.task.x_ref(ahead, self.time_s), self._shift(),
                                   self.task.step_bounds(ahead, ahead.x0)):
            self._ahead = ahead, lcs

    def input(self, state: Any, elapsed: float) -> Array:
        """The inputs (nu,) between two steps, `elapsed` ≥ 0 seconds after the last one.

        They are the plan's at that time, and of a task with gains also f_u⁺ (kp (δq* − δq) + kd (v* − v)), where x* =
        (δq*, v*) is the plan's state at that time, and f_u⁺ the pseudo-inverse of the derivative of the generalized
        forces by the inputs. They keep the bounds of the inputs.
        """
        if not (is_number(elapsed) and math.isfinite(elapsed) and elapsed >= 0):
            raise InvalidArgument("elapsed", "must be finite and ≥ 0 seconds", value=elapsed)
        if self._current is None or self._linearize is None:
            raise FailedPrecondition("input: a step must come first")
        current = self._current
        stages = min(elapsed / self.task.dt, float(len(current.u)))
        u = current.u[min(int(stages + _SAME_TIME), len(current.u) - 1)]
        if self._gains is not None:
            error = current.state(stages) - current.base.state(*self._linearize.measure(state))
            kp, kd = self._gains
            nv = kp.size
            u = u + np.linalg.pinv(current.base.smooth.f_u) @ (kp * error[:nv] + kd * error[nv:])
        return self._bounded(u)

    def reset(self, state: Any = None) -> None:
        """Forgets the last plan, as of an episode that ends, and ends the session; the contacts stay.

        state: as in Controller. The statistics go on.
        """
        self._check_open()
        self._close_planner()
        self._current = self._applied = None
        if state is not None:
            self._begin(state)

    @property
    def time_s(self) -> float:
        """Seconds since the first step in the time of the loop: steps / rate."""
        return self._steps * self.task.period_s

    @property
    def planner(self) -> Planner:
        """The planner, with the session. FailedPrecondition before the first step."""
        if self._plans is None:
            raise FailedPrecondition("planner: a step must come first")
        return self._plans.planner

    @property
    def pairs(self) -> tuple[Any, ...]:
        """The contacts, as of Linearization. FailedPrecondition before the first step."""
        if self._current is None:
            raise FailedPrecondition("pairs: a step must come first")
        return self._current.base.pairs

    def close(self) -> None:
        """Ends the session."""
        self._is_closed = True
        self._close_planner()

    def __enter__(self) -> Controller:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _begin(self, state: Any) -> tuple[Plan, Linearization]:
        """Opens the session, and makes the first plan in it."""
        begin = time.perf_counter()
        if self._linearize is None:
            self._linearize = self._model if _is_linearizer(self._model) else linearizer(
                self._model, state, dt=self.task.dt, **self.task.contacts)
        now = self._linearize(state)
        self._linearize_s = time.perf_counter() - begin
        self._bounds = self.task.input_bounds(now)
        self._gains = self.task.gains(now.v.size)
        self._steps = 0
        x_ref = self.task.x_ref(now, 0.0)
        arguments = self.task.planner_arguments(now)
        self._plans = GuardedPlanner(lambda lcs: Planner(lcs, int(self.task.stages), **arguments, server=self._server,
                                                         reopen=False, options=self._options), now.lcs)
        arguments["P"] = self.planner.P  # of another session too
        try:
            plan = self.planner.step(now.x0, x_ref=x_ref, last_u=now.u)
        except BaseException:
            self._close_planner()
            raise
        self._current = _Trajectory(plan.u, plan.x, now)
        return plan, now

    def _guarded(self) -> GuardedPlanner:
        assert self._plans is not None
        return self._plans

    def _shift(self) -> int:
        """Stages by which the last plan moves on."""
        if self._steps == 0:
            return 0
        if self.task.shift is not None:
            return int(self.task.shift)

        def ended(steps: int) -> int:
            return int(steps * self.task.period_s / self.task.dt + _SAME_TIME)

        return min(ended(self._steps) - ended(self._steps - 1), int(self.task.stages))

    def _measured(self, state: Any, shift: int) -> tuple[Linearization, LCS, Array]:
        assert self._linearize is not None
        if self._ahead is None:
            now = self._linearize(state, self._applied)
            return now, self._system(state, now, shift), now.x0
        now, lcs = self._ahead
        x0 = now.state(*self._linearize.measure(state))
        self._ahead = None
        return now, lcs, x0

    def _system(self, state: Any, now: Linearization, shift: int) -> LCS:
        """The system to plan with: that of `now`, or of a task that wants it so, the one along the last plan."""
        if self.task.linearize_along == "state":
            return now.lcs
        assert self._current is not None
        q, v = self._current.after(self.task.period_s / self.task.dt)
        return linearize_along(self._linearizer(), state, now, q, v, self._current.moved(shift).u)

    def _linearizer(self) -> StateLinearizer:
        assert self._linearize is not None
        return self._linearize

    def _finish(self, plan: Plan, now: Linearization, error: str, shift: int, begin: float,
                linearize_s: float) -> ControlStep:
        assert self._current is not None
        self._current = _Trajectory(plan.u, plan.x, now) if plan.feasible else self._current.moved(shift)
        self._applied = self._bounded(self._current.u[0])
        is_fallback = plan.origin is not PlanOrigin.SOLVE or not plan.feasible
        self._steps += 1
        total_s = time.perf_counter() - begin
        is_late = total_s > min(self.task.deadline_s, self.task.period_s)
        counts = self.statistics
        counts.steps += 1
        counts.late += is_late
        counts.fallbacks += is_fallback
        counts.unsolved += not plan.status.solved
        counts.infeasible += not plan.feasible
        counts.errors += bool(error)
        if not (plan.status.solved and plan.feasible):
            counts.last_detail = f"{plan.status.value}: {plan.detail}"
        counts.add_times(begin, total_s, plan.times.solve_s)
        return ControlStep(self._applied.copy(), plan, now, is_late, is_fallback, linearize_s, total_s)

    def _bounded(self, u: Array) -> Array:
        made: Array = np.clip(u, *self._bounds)
        return made

    def _check_open(self) -> None:
        if self._is_closed:
            raise FailedPrecondition("the controller is closed")

    def _close_planner(self) -> None:
        self._ahead = None
        plans, self._plans = self._plans, None
        if plans is not None:
            plans.close()


def _is_linearizer(model: Any) -> bool:
    return callable(model) and all(callable(getattr(model, name, None)) for name in ("at", "measure"))
