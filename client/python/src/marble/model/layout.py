"""Two-sided rows and bounds as the solver's equalities and inequalities, and problems that differ in numbers only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marble.base.lazy import lazy
from marble.model.lcqp import LCQP, Vector, csc

sp: Any = lazy("scipy.sparse")

Places = NDArray[np.intp]

INFINITE = 1e20
"""A limit of this size or more is none, wherever limits are given, as in HiGHS."""


@dataclass(frozen=True, eq=False)
class Layout:
    """Where the rows of A and C come from: the caller's row or bound, and of which sign (+1 its lower limit)."""

    equality_source: Places
    inequality_source: Places
    inequality_sign: Vector

    @staticmethod
    def of(low: Vector, high: Vector) -> Layout:
        """Of rows with these limits."""
        equal, has_lower, has_upper = limit_kinds(low, high)
        lower = np.flatnonzero(~equal & has_lower)
        upper = np.flatnonzero(~equal & has_upper)
        source = np.concatenate([lower, upper])
        sign = np.concatenate([np.ones(lower.size), -np.ones(upper.size)])
        order = np.argsort(source, kind="stable")  # the two sides of a row stand together
        return Layout(np.flatnonzero(equal), source[order], sign[order])

    def duals(self, y: Vector, nu: Vector, rows: int) -> Vector:
        """One multiplier a row, as Solution.row_duals has it; 0 of those that the answer does not have."""
        duals = np.zeros(rows)
        if y.size == self.equality_source.size:
            duals[self.equality_source] = y
        if nu.size == self.inequality_source.size:
            np.add.at(duals, self.inequality_source, -self.inequality_sign * nu)
        return duals


def taken(blocks: Sequence[Any], source: Places, sign: Vector | None = None) -> Any:
    """Rows of blocks that stand above one another, csc_matrix each: those of `source`, which rises and may name a row
    twice, times `sign`; as a csc_matrix.
    """
    n = blocks[0].shape[1]
    starts = np.cumsum([0] + [block.shape[0] for block in blocks])
    row = np.concatenate([block.indices + start for block, start in zip(blocks, starts, strict=False)])
    column = np.concatenate([np.repeat(np.arange(n), np.diff(block.indptr)) for block in blocks])
    values = np.concatenate([block.data for block in blocks])
    first = source.searchsorted(np.arange(starts[-1] + 1))
    times = np.diff(first)[row]
    entry = np.repeat(np.arange(row.size), times)
    place = first[row[entry]] + np.arange(entry.size) - np.repeat(np.cumsum(times) - times, times)
    order = np.argsort(column[entry], kind="stable")  # rows rise within a column as they did before
    entry, place = entry[order], place[order]
    data = values[entry] if sign is None else values[entry] * sign[place]
    indptr = column[entry].searchsorted(np.arange(n + 1)).astype(np.int32)
    return csc(data, place.astype(np.int32), indptr, (source.size, n))


def stack(blocks: Sequence[Any]) -> Any:
    """Blocks of rows above one another; explicit zeros stay."""
    return blocks[0] if len(blocks) == 1 else taken(blocks, np.arange(sum(block.shape[0] for block in blocks)))


class Family:
    """Problems of one pattern: where each of their numbers goes is found once.

    patterns: of Q's upper triangle, of the rows, and of the pairs' sides L and R; csc_matrix each, whose numbers are
    not read. low, high: limits of the rows and then of the n variables. Which of them are there, and which
    are equal, belongs to the pattern.
    """

    def __init__(self, patterns: Sequence[Any], low: Vector, high: Vector, name: str = "") -> None:
        Q, rows, L, R = patterns
        self._kinds = limit_kinds(low, high)
        self.layout = Layout.of(low, high)
        self._patterns: dict[str, Any] = {"Q": Q, "L": L, "R": R}
        n = rows.shape[1]
        tags = sp.coo_matrix(sp.csc_matrix((np.arange(1.0, rows.nnz + 1), rows.indices, rows.indptr), shape=rows.shape))
        everything = np.arange(n)
        tagged = sp.csr_matrix(
            (np.concatenate([tags.data, rows.nnz + 1 + everything]),
             (np.concatenate([tags.row, rows.shape[0] + everything]), np.concatenate([tags.col, everything]))),
            shape=(rows.shape[0] + n, n))
        self._ones = np.ones(n)
        self._takes: dict[str, tuple[Places, Vector | None]] = {}
        for letter, source in (("A", self.layout.equality_source), ("C", self.layout.inequality_source)):
            part = tagged[source].tocsc()
            part.sort_indices()
            sign = self.layout.inequality_sign[part.indices] if letter == "C" else None
            self._takes[letter] = part.data.astype(np.intp) - 1, sign
            self._patterns[letter] = part
        self._last = LCQP(None, np.zeros(n), name=name).replaced(
            **{letter: _filled(pattern, np.zeros(pattern.nnz)) for letter, pattern in self._patterns.items()})

    def fits(self, low: Vector, high: Vector) -> bool:
        """Whether limits like these belong to it."""
        return all(np.array_equal(mine, other) for mine, other in zip(self._kinds, limit_kinds(low, high), strict=True))

    def problem(self, *, Q: Vector, g: Vector, c0: float, rows: Vector, constant: Vector, low: Vector, high: Vector,
                L: Vector, l: Vector, R: Vector, r: Vector) -> LCQP:
        """The one with these numbers: of a matrix its values, in the pattern's order; of the rows low ≤ rows z +
        constant ≤ high, and in low and high beyond them bounds of the variables. A matrix that has not changed since
        the last call is the same object.
        """
        layout = self.layout
        values = np.concatenate([rows, self._ones])
        offset = np.concatenate([constant, np.zeros(self._ones.size)])
        numbers = {"Q": Q, "L": L, "R": R}
        for letter, (take, sign) in self._takes.items():
            numbers[letter] = values[take] if sign is None else values[take] * sign
        source, sign = layout.inequality_source, layout.inequality_sign
        parts: dict[str, Any] = {
            letter: last if np.array_equal(last.data, numbers[letter]) else _filled(last, numbers[letter])
            for letter in "QACLR" for last in [getattr(self._last, letter)]}
        self._last = self._last.replaced(
            **parts, g=g.copy(), l=l.copy(), r=r.copy(), c0=float(c0),
            b=(offset - low)[layout.equality_source],
            d=np.where(sign > 0, (offset - low)[source], (high - offset)[source]))
        return self._last


def limit_kinds(low: Vector, high: Vector) -> tuple[Any, Any, Any]:
    """Which rows are equalities, which have a lower limit, and which an upper one."""
    return low == high, low > -INFINITE, high < INFINITE


def _filled(pattern: Any, values: Vector) -> Any:
    return csc(values.copy(), pattern.indices, pattern.indptr, pattern.shape)
