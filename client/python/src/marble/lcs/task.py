"""What a controller plans for: horizon, costs, targets, bounds, contacts and the rate of its loop, checked."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from marble.base.checks import is_number, is_whole
from marble.errors import InvalidArgument
from marble.lcs.linearization import Linearization, positive
from marble.lcs.planner import MAX_STAGES
from marble.lcs.system import Array, one_each
from marble.model.lcqp import numbers

Target = tuple[ArrayLike, ArrayLike] | Callable[[Linearization, float], tuple[ArrayLike, ArrayLike]]

MAX_LINEARIZATIONS: Final = 100
_OF_TASK = ("dt", "u")
_SAME_TIME: Final = 1e-6
"""Relative to a control step."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Task:
    """A planning problem of a robot model, for Controller. nq, nv, nu: sizes of the model; N = stages.

    rate: control steps a second, Hz, > 0. dt: seconds of a stage, > 0; it may be longer than a control step.
    stages, Q (2 nv, 2 nv), R, P, R_change, regularization, u_ref, u_lb, u_ub, max_u_change: as of Planner, with the
    state x = (δq, v) of Linearization. u_lb and u_ub: None: the model's limits.
    target: the configuration q (nq,) and the velocity v (nv,) to reach, each also with a leading axis N + 1, one per
    stage; or a function that returns them, of the linearization at the present state and of the seconds since the first
    step, in the time of the loop: steps / rate.
    v_lb, v_ub: bounds of the velocities, one number or (nv,); infinite where there is none. Limits of joints are pairs
    with contacts={"joint_limits": True}; of MuJoCo models they are bounds of the plan's configurations with
    contacts={"joint_limits": "bounds"}, relaxed as Linearization.joint_bounds does it.
    contacts: options of marble.lcs.linearizer besides dt: contact, pairs, num_directions, friction, ….
    shift: stages by which the last plan moves on at each step, in [0, N]; None: as many as have ended since the last
    step, by the time of the loop.
    deadline: seconds from the measurement, > 0; the solve is stopped before it, in time for its result. None: the
    period, 1 / rate; inf: never, as where a simulation waits. A step that takes longer than the deadline or the period
    is late.
    linearize_along: "state": one system for all stages, linearized at the present state. "plan": a system per stage,
    each linearized at that stage's state of the last plan, moved on, as of marble.lcs.linearize_along: for motions that
    leave one linearization within the horizon, such as hops. It takes a linearization per stage; the first step, which
    has no plan yet, is as with "state".
    linearizations: plans per step, in [1, 100]; each after the first is made of the system along the one before, if
    that is solved. More than one needs linearize_along="plan". They share the deadline.
    kp, kd: gains of the feedback between plans, ≥ 0, one number or (nv,): N/m or N m/rad, and those by the velocity in
    N s/m or N m s/rad; see Controller.input. 0: none.

    Raises InvalidArgument with the field; what depends on the model's sizes is checked with it.
    """

    rate: float
    stages: int
    dt: float
    Q: ArrayLike
    R: ArrayLike
    target: Target
    P: ArrayLike | None = None
    R_change: ArrayLike | None = None
    regularization: float = 0.0
    u_ref: ArrayLike | None = None
    u_lb: ArrayLike | None = None
    u_ub: ArrayLike | None = None
    v_lb: ArrayLike | None = None
    v_ub: ArrayLike | None = None
    max_u_change: ArrayLike | None = None
    contacts: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    shift: int | None = None
    deadline: float | None = None
    linearize_along: str = "state"
    linearizations: int = 1
    kp: ArrayLike = 0.0
    kd: ArrayLike = 0.0

    def __post_init__(self) -> None:
        positive(self.rate, "rate", "Hz")
        positive(self.dt, "dt", "s")
        if not is_whole(self.stages, 1, MAX_STAGES):
            raise InvalidArgument("stages", f"must be a whole number in [1, {MAX_STAGES}]", value=repr(self.stages))
        if self.shift is not None and not is_whole(self.shift, 0, self.stages):
            raise InvalidArgument("shift", f"must be None or in [0, {self.stages}] (stages)", value=repr(self.shift))
        if self.deadline is not None and not (is_number(self.deadline) and self.deadline > 0):
            raise InvalidArgument("deadline", "must be > 0 seconds", value=self.deadline)
        if not isinstance(self.contacts, Mapping):
            raise InvalidArgument("contacts", "must be a mapping of options", value=type(self.contacts).__name__)
        if self.linearize_along not in ("state", "plan"):
            raise InvalidArgument("linearize_along", 'must be "state" or "plan"',
                                  value=repr(self.linearize_along)[:100])
        most = MAX_LINEARIZATIONS if self.linearize_along == "plan" else 1
        if not is_whole(self.linearizations, 1, most):
            raise InvalidArgument("linearizations", f'must be in [1, {most}] with linearize_along='
                                  f'"{self.linearize_along}"', value=repr(self.linearizations))
        for name in _OF_TASK:
            if name in self.contacts:
                raise InvalidArgument("contacts", "must not have dt, which the task has, nor u", value=repr(name))
        if not callable(self.target):
            _pair(self.target)

    @property
    def period_s(self) -> float:
        """Seconds of a control step: 1 / rate."""
        return 1.0 / float(self.rate)

    @property
    def deadline_s(self) -> float:
        """Seconds from the measurement before which the solve is stopped; inf if it is not."""
        return self.period_s if self.deadline is None else float(self.deadline)

    def substeps(self, dt: float, rate: str) -> int:
        """Steps of dt seconds in a control step. InvalidArgument of "rate" unless it is that `rate` divided by a whole
        number."""
        count = round(self.period_s / dt)
        if count < 1 or abs(count * dt - self.period_s) > _SAME_TIME * self.period_s:
            raise InvalidArgument("rate", f"must be {rate} divided by a whole number", value=f"{self.rate:g} Hz")
        return count

    def planner_arguments(self, now: Linearization) -> dict[str, Any]:
        """The keyword arguments of Planner for a model, of which `now` is a linearization."""
        made = {name: getattr(self, name) for name in ("Q", "R", "P", "R_change", "regularization", "u_ref",
                                                       "max_u_change")}
        made["u_lb"] = now.u_min if self.u_lb is None else self.u_lb
        made["u_ub"] = now.u_max if self.u_ub is None else self.u_ub
        return {**made, **self._state_bounds(now, now.x0)}

    def step_bounds(self, now: Linearization, x: Array) -> dict[str, Array]:
        """Those of Planner.step in a step at x (nx,): x_lb and x_ub, if they change from step to step."""
        return {} if now.joint_limits is None else self._state_bounds(now, x)

    def _state_bounds(self, now: Linearization, x: Array) -> dict[str, Array]:
        made, nv, stages = {}, now.v.size, int(self.stages)
        of_joints = now.joint_bounds(x, stages) or (None, None)
        for name, free, of_q in (("lb", -np.inf, of_joints[0]), ("ub", np.inf, of_joints[1])):
            given = getattr(self, f"v_{name}")
            if given is None and of_q is None:
                continue
            bound = np.full(2 * nv if of_q is None else (stages, 2 * nv), free)
            if of_q is not None:
                bound[:, :nv] = of_q
            if given is not None:
                bound[..., nv:] = one_each(given, f"v_{name}", nv)
            made[f"x_{name}"] = bound
        return made

    def input_bounds(self, now: Linearization) -> tuple[Array, Array]:
        """Lower and upper bounds of the inputs, (nu,) each."""
        nu = now.u.size
        return (one_each(now.u_min if self.u_lb is None else self.u_lb, "u_lb", nu),
                one_each(now.u_max if self.u_ub is None else self.u_ub, "u_ub", nu))

    def gains(self, nv: int) -> tuple[Array, Array] | None:
        """kp and kd, (nv,) each; None if all are 0."""
        made = _gain(self.kp, "kp", nv), _gain(self.kd, "kd", nv)
        return made if any(gain.any() for gain in made) else None

    def x_ref(self, now: Linearization, time_s: float) -> Array:
        """The target as states of a linearization, (nx,) or (N + 1, nx)."""
        q, v = _pair(self.target(now, time_s) if callable(self.target) else self.target)
        of_q = self._per_stage(q, "target.q", now.q.size)
        of_v = self._per_stage(v, "target.v", now.v.size)
        if of_q.ndim == of_v.ndim == 1:
            return now.state(of_q, of_v)
        count = self.stages + 1
        rows = zip(np.broadcast_to(of_q, (count, now.q.size)), np.broadcast_to(of_v, (count, now.v.size)), strict=True)
        return np.stack([now.state(*row) for row in rows])

    def _per_stage(self, values: ArrayLike, field: str, size: int) -> Array:
        array = numbers(values, field, "an array of numbers")
        if array.shape not in ((size,), (self.stages + 1, size)):
            raise InvalidArgument(field, f"must have the shape ({size},) or ({self.stages + 1}, {size})",
                                  value=f"of shape {array.shape}")
        if not np.isfinite(array).all():
            bad = int(np.argmin(np.isfinite(array)))
            raise InvalidArgument(field, "must be finite", index=bad, value=array.flat[bad])
        return array


def _pair(target: Any) -> tuple[ArrayLike, ArrayLike]:
    if not isinstance(target, Sequence) or isinstance(target, str) or len(target) != 2:
        raise InvalidArgument("target", "must be (q, v), or a function that returns them", value=repr(target)[:100])
    return target[0], target[1]


def _gain(values: ArrayLike, field: str, nv: int) -> Array:
    array = one_each(values, field, nv)
    for index, value in enumerate(array):
        if not (math.isfinite(value) and value >= 0):
            raise InvalidArgument(field, "must be finite and ≥ 0", index=index, value=value)
    return array
