"""A linear complementarity system: its matrices, checked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from marble.base.checks import is_number, is_whole
from marble.errors import Index, InvalidArgument, InvalidProblem
from marble.model.lcqp import numbers

Array = NDArray[np.float64]

FIELDS: Final = {"A": ("nx", "nx"), "B": ("nx", "nu"), "D": ("nx", "nl"), "d": ("nx",),
                 "E": ("nl", "nx"), "F": ("nl", "nl"), "H": ("nl", "nu"), "c": ("nl",)}
"""The matrices and vectors, and the shape of each in one stage."""
_NAMED: Final = {"states": "nx", "inputs": "nu", "pairs": "nl"}


class LCS:
    """x₊ = A x + B u + D λ + d,  0 ≤ λ ⊥ E x + F λ + H u + c ≥ 0, of nx ≥ 1 states, nu ≥ 1 inputs, nl ≥ 0 pairs.

    A (nx, nx), B (nx, nu), D (nx, nl), d (nx,), E (nl, nx), F (nl, nl), H (nl, nu), c (nl,): real and finite. Each is
    one for all stages, or one per stage with a leading axis N; all that have this axis have the same N.
    dt: seconds of a stage, > 0 and finite; None: not known.
    names: of "states", "inputs", "pairs", each with as many different texts as there are of them; for display.

    Everything is copied; the attributes have the same names and are read-only arrays. Raises InvalidProblem with the
    field, for one stage "A[3]" for example, with the index in it and the bound; InvalidArgument of dt and names.
    """

    A: Array
    B: Array
    D: Array
    d: Array
    E: Array
    F: Array
    H: Array
    c: Array

    def __init__(self, A: ArrayLike, B: ArrayLike, D: ArrayLike, d: ArrayLike, E: ArrayLike, F: ArrayLike,
                 H: ArrayLike, c: ArrayLike, dt: float | None = None,
                 names: Mapping[str, Sequence[str]] | None = None) -> None:
        given = {"A": A, "B": B, "D": D, "d": d, "E": E, "F": F, "H": H, "c": c}
        arrays = {field: numbers(values, field, "an array of numbers") for field, values in given.items()}
        self.nx: int = _size(arrays["A"], "A", -1)
        self.nu: int = _size(arrays["B"], "B", -1)
        self.nl: int = _size(arrays["c"], "c", -1, least=0)
        self.stages: int | None = None
        """N, if a matrix or vector has one per stage; None if all are constant."""
        sizes = {"nx": self.nx, "nu": self.nu, "nl": self.nl}
        for field, array in arrays.items():
            self._take(field, array, tuple(sizes[size] for size in FIELDS[field]))
        self.dt: float | None = _time(dt)
        self.names: Mapping[str, tuple[str, ...]] = _names(names, sizes)

    def _take(self, field: str, array: Array, shape: tuple[int, ...]) -> None:
        letters = ", ".join(FIELDS[field])
        per_stage = array.ndim == len(shape) + 1
        if array.shape != shape and not (per_stage and array.shape[1:] == shape and array.shape[0] > 0):
            raise InvalidProblem(field, f"must have the shape {_text(shape)} ({letters}), or (N, {letters}) with one "
                                 "per stage", value=f"of shape {_text(array.shape)}")
        if per_stage:
            if self.stages is not None and array.shape[0] != self.stages:
                raise InvalidProblem(field, f"must have {self.stages} stages, as many as the fields before it",
                                     value=f"{array.shape[0]} stages")
            self.stages = int(array.shape[0])
        finite = np.isfinite(array)
        if not finite.all():
            place = np.unravel_index(int(np.argmin(finite)), array.shape)
            stage, inside = (f"[{place[0]}]", place[1:]) if per_stage else ("", place)
            index: Index = int(inside[0]) if len(inside) == 1 else (int(inside[0]), int(inside[1]))
            raise InvalidProblem(field + stage, "must be finite", index=index, value=array[place])
        array = np.ascontiguousarray(array)
        array.flags.writeable = False
        setattr(self, field, array)

    def stage(self, k: int) -> LCS:
        """The constant system of stage k, from 0; itself if it is constant. InvalidArgument outside 0 ≤ k < N."""
        if self.stages is None:
            return self
        if not is_whole(k, 0, self.stages - 1):
            raise InvalidArgument("k", f"must be in [0, {self.stages})", value=repr(k))
        parts = {field: value[k] if value.ndim > len(FIELDS[field]) else value
                 for field in FIELDS for value in [getattr(self, field)]}
        return LCS(**parts, dt=self.dt, names=self.names)

    def __repr__(self) -> str:
        stages = "" if self.stages is None else f", {self.stages} stages"
        return f"<LCS: {self.nx} states, {self.nu} inputs, {self.nl} pairs{stages}>"


def _size(array: Array, field: str, axis: int, least: int = 1) -> int:
    shape = FIELDS[field]
    if array.ndim not in (len(shape), len(shape) + 1):
        raise InvalidProblem(field, f"must have the shape ({', '.join(shape)}), or with one more axis in front, one "
                             "per stage", value=f"of shape {_text(array.shape)}")
    size = int(array.shape[axis])
    if size < least:
        raise InvalidProblem(field, f"must have at least {least} columns ({shape[axis]})", value=f"{size} columns")
    return size


def one_each(values: ArrayLike, field: str, size: int) -> Array:
    """(size,), of one number for all or one for each."""
    array = numbers(values, field, "an array of numbers")
    if array.shape not in ((), (size,)):
        raise InvalidArgument(field, f"must be one number, or have the shape ({size},)",
                              value=f"of shape {array.shape}")
    return np.ascontiguousarray(np.broadcast_to(array, (size,)))


def _text(shape: tuple[int, ...]) -> str:
    return f"({shape[0]},)" if len(shape) == 1 else f"({', '.join(map(str, shape))})"


def _time(dt: Any) -> float | None:
    if dt is None:
        return None
    if not (is_number(dt) and math.isfinite(dt) and dt > 0):
        raise InvalidArgument("dt", "must be finite and > 0 seconds", value=dt)
    return float(dt)


def _names(names: Mapping[str, Sequence[str]] | None, sizes: Mapping[str, int]) -> Mapping[str, tuple[str, ...]]:
    made: dict[str, tuple[str, ...]] = {}
    if not isinstance(names, Mapping | None):
        raise InvalidArgument("names", "must be a mapping", value=type(names).__name__)
    for kind, given in (names or {}).items():
        if kind not in _NAMED:
            raise InvalidArgument("names", f"must have keys of {', '.join(_NAMED)}", value=repr(kind))
        field, size = f"names.{kind}", sizes[_NAMED[kind]]
        texts = () if isinstance(given, str) or not isinstance(given, Sequence) else tuple(given)
        if len(texts) != size:
            raise InvalidArgument(field, f"must have {size} texts", value=f"{len(texts)} texts")
        for index, text in enumerate(texts):
            if not isinstance(text, str) or text in texts[:index]:
                raise InvalidArgument(field, "must be a text that differs from those before it", index=index,
                                      value=repr(text))
        made[kind] = texts
    return made
