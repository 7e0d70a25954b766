"""New numbers for a problem whose pattern stays: what sessions and arrays send instead of a problem."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from marble.base import contract
from marble.base.lazy import lazy
from marble.base.tables import VALUES, VECTORS
from marble.errors import InvalidProblem
from marble.message.wire import Encoder
from marble.model import lcqp
from marble.model.lcqp import LCQP, Vector
from marble.model.problem import Problem, compiled

sp: Any = lazy("scipy.sparse")


def changes_of(now: LCQP, problem: LCQP | Problem | None, parts: Mapping[str, Any]) -> dict[str, Any]:
    """What differs from a problem of the same pattern, by letters: of another problem, or of new parts."""
    if problem is not None:
        other = compiled(problem)
        if other.sizes != now.sizes:
            raise InvalidProblem("problem", f"must have the sizes {now.sizes} of the set-up", value=other.sizes)
        whole = {"c0": other.c0, **{name: getattr(other, name) for name in VECTORS},
                 **{name: _same_pattern(getattr(other, name), getattr(now, name), name) for name in VALUES}}
        return {name: value for name, value in whole.items() if not _equal(value, getattr(now, name))}
    changes: dict[str, Any] = {}
    for name, value in parts.items():
        if name not in ("c0", *VECTORS, *VALUES):
            raise TypeError(f"an update has no argument {name!r}")
        if value is None:
            continue
        if name == "c0":
            changes[name] = float(lcqp.vector(value, name, 1)[0])
        elif name in VECTORS:
            changes[name] = lcqp.vector(value, name, getattr(now, name).size, ", as at the set-up")
        else:
            changes[name] = _with_pattern(value, getattr(now, name), name)
    return changes


def update_encoder(changes: Mapping[str, Any]) -> Encoder:
    """A ProblemUpdate."""
    part = Encoder("ProblemUpdate")
    if "c0" in changes:
        part.others(contract.message("ProblemUpdate")(constant=changes["c0"]))
    for name, value in changes.items():
        if name in VECTORS:
            part.doubles(VECTORS[name], value)
        elif name in VALUES:
            part.doubles(VALUES[name], value.data)
    return part


def _equal(value: Any, old: Any) -> bool:
    if value is old:
        return True
    if isinstance(value, float):
        return value == float(old)
    return np.array_equal(getattr(value, "data", value), getattr(old, "data", old))


def _with_pattern(value: Any, old: Any, name: str) -> Any:
    """A matrix as it may be given, or its values alone in the order of the set-up, as a matrix like `old`."""
    if not sp.issparse(value) and np.ndim(value) == 1 and np.size(value) == old.nnz and old.shape[0] != 1:
        data: Vector = lcqp.vector(value, name + ".values")
        return lcqp.csc(data, old.indices, old.indptr, old.shape)
    rows, n = old.shape
    new = lcqp.upper_triangle(value, n) if name == "Q" else lcqp.matrix(value, name, n, rows)
    return _same_pattern(new, old, name)


def _same_pattern(new: Any, old: Any, name: str) -> Any:
    if new.indptr is old.indptr and new.indices is old.indices:
        return new
    if new.nnz == old.nnz and np.array_equal(new.indptr, old.indptr) and np.array_equal(new.indices, old.indices):
        return new
    rows = np.int64(old.shape[0])
    old_keys = _columns(old) * rows + old.indices  # ascending, as entries are sorted
    new_keys = _columns(new) * rows + new.indices
    places = np.searchsorted(old_keys, new_keys)
    known = places < old_keys.size
    known[known] = old_keys[places[known]] == new_keys[known]
    outside = np.flatnonzero(~known & (new.data != 0.0))
    if outside.size:
        entry = int(outside[0])
        raise InvalidProblem(name, "must be zero, as at the set-up: the pattern stays",
                             index=lcqp.position(new, entry), value=new.data[entry])
    data = np.zeros(old.nnz)
    data[places[known]] = new.data[known]
    return lcqp.csc(data, old.indices, old.indptr, old.shape)


def _columns(values: Any) -> Any:
    return np.repeat(np.arange(values.shape[1], dtype=np.int64), np.diff(values.indptr))
