"""The system of a horizon with matrices per stage: each stage linearized at its state of a plan (time-varying MPC).

A plan that was made with one linearization leaves it as it goes on. Linearized along the last plan, each step is one
iteration of sequential programming: M. Diehl, H. G. Bock, J. P. Schlöder, A real-time iteration scheme for nonlinear
optimization in optimal feedback control, SIAM J. Control Optim. 43 (2005) 1714-1736; here with complementarity.
"""

from __future__ import annotations

from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import ArrayLike

from marble.errors import InvalidArgument
from marble.lcs.linearization import Linearization
from marble.lcs.planner import MAX_STAGES
from marble.lcs.system import FIELDS, LCS, Array
from marble.model.lcqp import numbers

_STEP: Final = 1e-6  # rad, of differences
_SAME: Final = 1e-12  # rad or m


class _At(Protocol):
    def at(self, state: Any, q: ArrayLike, v: ArrayLike, u: ArrayLike | None = None) -> Linearization: ...


def linearize_along(linearizer: _At, state: Any, now: Linearization, q: ArrayLike, v: ArrayLike,
                    u: ArrayLike) -> LCS:
    """The system of N stages of which stage 0 is `now`, and stage k ≥ 1 is linearized at row k of q, v and u.

    linearizer: of marble.lcs.linearizer, or any with its method `at`. state: as of it. q (N, nq), v (N, nv), u (N, nu):
    configurations, velocities and inputs at the beginning of the stages; row 0 does not count. The states of all
    stages are those of `now`. A step without contact forces from a row's state with its inputs is that of the row's
    own linearization; where the configuration has rotations, other states are converted to first order.

    Takes N − 1 linearizations. Raises InvalidArgument of q, v and u.
    """
    sizes = (("q", q, now.q.size), ("v", v, now.v.size), ("u", u, now.u.size))
    rows = {field: _rows(values, field, size) for field, values, size in sizes}
    stages = len(rows["q"])
    for field, values in rows.items():
        if len(values) != stages:
            raise InvalidArgument(field, f"must have {stages} rows, as many as q", value=f"{len(values)} rows")
    parts = [{field: getattr(now.lcs, field) for field in FIELDS}]
    for k in range(1, stages):
        at = linearizer.at(state, rows["q"][k], rows["v"][k], rows["u"][k])
        parts.append(_in_states_of(now, at))
    return LCS(**{field: np.stack([part[field] for part in parts]) for field in FIELDS}, dt=now.lcs.dt,
               names=now.lcs.names)


def _in_states_of(now: Linearization, at: Linearization) -> dict[str, Array]:
    """The matrices of a linearization in the states of another one."""
    lcs, nv = at.lcs, now.v.size
    here = now.state(at.q, at.v)
    after = lcs.A @ at.x0 + lcs.B @ at.u + lcs.d
    made = now.state(*at.configuration(after))
    to = _by_tangent(lambda x: at.state(*now.configuration(x)), here, nv)
    back = _by_tangent(lambda x: now.state(*at.configuration(x)), after, nv)
    offset = at.x0 - to @ here
    return {"A": back @ lcs.A @ to, "B": back @ lcs.B, "D": back @ lcs.D,
            "d": back @ (lcs.A @ offset + lcs.d - after) + made,
            "E": lcs.E @ to, "F": lcs.F, "H": lcs.H, "c": lcs.E @ offset + lcs.c}


def _by_tangent(change: Any, x: Array, nv: int) -> Array:
    """The derivative (nx, nx) of a change of states, which leaves velocities as they are, at x: the identity unless
    the configuration has rotations."""
    probe = x + np.concatenate([0.1 + 0.05 * np.cos(np.arange(nv)), np.zeros(nv)])
    made = np.eye(2 * nv)
    if np.abs(change(probe) - change(x) - (probe - x)).max() <= _SAME:
        return made
    for j in range(nv):
        step = _STEP * np.eye(2 * nv)[j]
        made[:, j] = (change(x + step) - change(x - step)) / (2 * _STEP)
    return made


def _rows(values: ArrayLike, field: str, size: int) -> Array:
    array = numbers(values, field, "an array of numbers")
    if array.ndim != 2 or array.shape[1] != size or not 1 <= len(array) <= MAX_STAGES:
        raise InvalidArgument(field, f"must have the shape (N, {size})", value=f"of shape {array.shape}")
    finite = np.isfinite(array)
    if not finite.all():
        row, column = (int(i) for i in np.unravel_index(int(np.argmin(finite)), array.shape))
        raise InvalidArgument(field, "must be finite", index=(row, column), value=array[row, column])
    return array
