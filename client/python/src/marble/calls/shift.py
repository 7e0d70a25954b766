"""How a session's last answer moves on with a receding horizon."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from marble.base import contract
from marble.errors import InvalidArgument
from marble.model.lcqp import LCQP, Vector
from marble.model.problem import Problem, compiled

_SHIFTED: Final = ("variables", "equalities", "inequalities", "pairs")


@dataclass(frozen=True)
class ShiftBlock:
    """A stretch of a vector that moves on.

    Of `count` entries from `first`, each takes the value `by` further on, and the last `by` keep theirs.
    All are ≥ 0, and by ≤ count.
    """

    first: int
    count: int
    by: int


@dataclass(frozen=True)
class Shift:
    """A receding horizon's hint: how the last answer moves one stage on before it is started from.

    Blocks of z, of the multipliers of equalities and inequalities, and of both multipliers of the pairs. Those of a
    vector may move as many entries together as it has; one that moves none counts as one.
    """

    variables: Sequence[ShiftBlock] = ()
    equalities: Sequence[ShiftBlock] = ()
    inequalities: Sequence[ShiftBlock] = ()
    pairs: Sequence[ShiftBlock] = ()

    @staticmethod
    def by_stage(problem: LCQP | Problem, stages: int) -> Shift:
        """For a problem whose vectors all hold `stages` equal parts, one stage after the other.

        InvalidArgument of field "stages" unless it is ≥ 1 and divides the size of every vector.
        """
        if stages < 1 or stages % 1:
            raise InvalidArgument("stages", "must be a whole number >= 1", value=stages)
        blocks = []
        for name, size in zip(_SHIFTED, compiled(problem).sizes, strict=True):
            if size % stages:
                raise InvalidArgument("stages", f"must divide the number of {name}, {size}", value=stages)
            blocks.append((ShiftBlock(0, size, size // stages),) if size else ())
        return Shift(*blocks)

    def blocks(self) -> tuple[tuple[tuple[int, int, int], ...], ...]:
        """Of the four kinds of vectors: first, count and by of each block."""
        return tuple(tuple((b.first, b.count, b.by) for b in getattr(self, name)) for name in _SHIFTED)

    def moved(self, z: Vector) -> Vector:
        """The point z, n, moved on."""
        z = np.array(z)
        for block in self.variables:
            end = block.first + block.count
            if 0 <= block.first and 0 <= block.by <= block.count and end <= z.size:  # else the server refuses it
                z[block.first:end - block.by] = z[block.first + block.by:end]
        return z

    def message(self) -> Any:
        """The Shift of marble.v1."""
        kind, block = contract.message("Shift"), contract.message("ShiftBlock")
        return kind(**{name: [block(first=b.first, count=b.count, by=b.by) for b in getattr(self, name)]
                       for name in _SHIFTED})
