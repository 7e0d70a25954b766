"""Why a problem is infeasible: a smallest set of its rows and pairs that no point meets."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from marble.model.lcqp import LCQP

_MOST_TERMS = 8  # of a row that are printed

Indices = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Conflict:
    """Parts of a problem that contradict each other, whatever its other parts are: an irreducible infeasible subset.

    equalities: rows of A z + b = 0. inequalities: rows of C z + d ≥ 0. left_sides, right_sides: pairs whose L z + l ≥ 0
    or R z + r ≥ 0 takes part. complementarities: pairs that take part by having a side at zero. Indices start at 0.
    minimal: without any one of these parts the others have a point, which was found. False where a limit came first;
    the parts contradict each other all the same. detail: what was proved, or which limit came first.
    linear_programs, factorizations: the work; Solution.factorizations includes it.
    """

    equalities: Indices
    inequalities: Indices
    left_sides: Indices
    right_sides: Indices
    complementarities: Indices
    minimal: bool
    detail: str
    linear_programs: int
    factorizations: int

    @staticmethod
    def of(parts: Iterable[Sequence[int]], minimal: bool, detail: str, linear_programs: int,
           factorizations: int) -> Conflict:
        """Of the five lists of indices, in the order of the attributes."""
        equalities, inequalities, left, right, complementarities = (np.array(part, np.int32) for part in parts)
        return Conflict(equalities, inequalities, left, right, complementarities, minimal, detail, linear_programs,
                        factorizations)

    def __len__(self) -> int:
        """The number of parts."""
        return sum(part.size for part in (self.equalities, self.inequalities, self.left_sides, self.right_sides,
                                          self.complementarities))

    def lines(self, problem: LCQP, variables: Mapping[str, int] | None = None) -> list[str]:
        """One line for each part of the problem, with the names of its variables where they have any."""
        names = {index: name for name, index in (variables or {}).items()}
        return list(self._lines(problem, names))

    def _lines(self, problem: LCQP, names: Mapping[int, str]) -> Iterator[str]:
        def row(matrix: Any, offset: Any, i: int) -> str:
            return _text(matrix.tocsr()[[i]], float(offset[i]), names)

        for i in self.equalities:
            yield f"A[{i}]: {row(problem.A, problem.b, i)} = 0"
        for i in self.inequalities:
            yield f"C[{i}]: {row(problem.C, problem.d, i)} ≥ 0"
        pairs = sorted({*map(int, self.left_sides), *map(int, self.right_sides), *map(int, self.complementarities)})
        for i in pairs:
            left, right = row(problem.L, problem.l, i), row(problem.R, problem.r, i)
            if i in self.complementarities:
                yield (f"pair {i}: {left}{' ≥ 0' if i in self.left_sides else ''} ⊥ "
                       f"{right}{' ≥ 0' if i in self.right_sides else ''}")
            else:
                yield from (f"pair {i}: {side} ≥ 0" for side, parts in ((left, self.left_sides),
                                                                        (right, self.right_sides)) if i in parts)


def _text(row: Any, offset: float, names: Mapping[int, str]) -> str:
    terms = [(float(value), names.get(int(j), f"z[{j}]")) for j, value in zip(row.indices, row.data, strict=True)
             if value != 0]
    parts = [f"{'-' if value < 0 else '+'} {'' if abs(value) == 1 else f'{abs(value):g} '}{name}"
             for value, name in terms[:_MOST_TERMS]]
    if len(terms) > _MOST_TERMS:
        parts.append(f"+ … {len(terms) - _MOST_TERMS} more")
    if offset or not parts:
        parts.append(f"{'-' if offset < 0 else '+'} {abs(offset):g}")
    text = " ".join(parts)
    return text[2:] if text.startswith("+ ") else "-" + text[2:]
