"""Why a problem is infeasible: a smallest set of its rows and pairs that no point meets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from marble.model.lcqp import LCQP, Vector

_MOST_TERMS: Final = 8
_MOST_LINES: Final = 100


def _row(matrix: Any, offsets: Vector, row: int, equality: bool, names: Mapping[int, str]) -> str:
    """"x + 2 y >= 4" for x + 2 y - 4 ≥ 0, and "x <= 4" for 4 - x ≥ 0."""
    entries = [(int(column), float(matrix.data[k])) for column in range(matrix.shape[1])
               for k in range(matrix.indptr[column], matrix.indptr[column + 1]) if matrix.indices[k] == row]
    sign = -1.0 if entries and entries[0][1] < 0.0 else 1.0
    text = "" if entries else "0"
    for k, (column, value) in enumerate(entries[:_MOST_TERMS]):
        minus = sign * value < 0.0
        text += ("-" if minus else "") if k == 0 else (" - " if minus else " + ")
        text += ("" if abs(value) == 1.0 else f"{abs(value):.6g} ") + names.get(column, f"z[{column}]")
    if len(entries) > _MOST_TERMS:
        text += f" + ... ({len(entries)} terms)"
    relation = "=" if equality else ">=" if sign > 0.0 else "<="
    return f"{text} {relation} {0.0 - sign * float(offsets[row]):.6g}"


@dataclass(frozen=True)
class Conflict:
    """Parts of a problem that no point meets together, whatever the others are: what option explain finds.

    All indices are 0-based, ascending and of the rows of the LCQP that was solved, Solution.problem. A pair enters by
    up to three parts: each of its sides being nonnegative, and one of them being zero.

    equalities: rows of A z + b = 0. inequalities: rows of C z + d ≥ 0. left_sides: pairs of which L z + l ≥ 0 is
    needed. right_sides: pairs of which R z + r ≥ 0 is needed. complementarities: pairs of which L z + l = 0 or
    R z + r = 0 is needed.
    minimal: irreducible: without any one of these parts the others have a point, which was found and meets the
    tolerances. False where a limit came first: the parts conflict all the same, but fewer of them may.
    detail: one sentence: what was proved, or which limit came first; and the work. linear_programs: solved for it.
    factorizations: of them; Solution.factorizations has them too.
    """

    equalities: tuple[int, ...]
    inequalities: tuple[int, ...]
    left_sides: tuple[int, ...]
    right_sides: tuple[int, ...]
    complementarities: tuple[int, ...]
    minimal: bool
    detail: str
    linear_programs: int
    factorizations: int

    def __len__(self) -> int:
        """How many parts it has."""
        return sum(len(indices) for _, indices in self._parts())

    def __bool__(self) -> bool:
        """It is there, however many parts it has."""
        return True

    def __str__(self) -> str:
        return "\n".join([self.detail, *(f"{kind} {index}" for kind, indices in self._parts() for index in indices)])

    def lines(self, problem: LCQP, variables: Mapping[str, int] | None = None) -> list[str]:
        """One line a part, "equality 3: x + 2 y = 4". problem: the one that was solved. variables: indices of
        variables by their names; z[0], z[1], ... where there is no name.
        """
        names = {index: name for name, index in (variables or {}).items()}

        def text(kind: str, index: int) -> str:
            if kind == "equality":
                return _row(problem.A, problem.b, index, True, names)
            if kind == "inequality":
                return _row(problem.C, problem.d, index, False, names)
            left, right = (problem.L, problem.l), (problem.R, problem.r)
            if kind != "complementarity":
                return _row(*(left if kind == "left side" else right), index, False, names)
            return f"{_row(*left, index, True, names)}  or  {_row(*right, index, True, names)}"

        all_parts = [(kind, index) for kind, indices in self._parts() for index in indices]
        lines = [f"{kind} {index}: {text(kind, index)}" for kind, index in all_parts[:_MOST_LINES]]
        more = len(all_parts) - _MOST_LINES
        return [*lines, f"... and {more} more"] if more > 0 else lines

    def _parts(self) -> tuple[tuple[str, tuple[int, ...]], ...]:
        return (("equality", self.equalities), ("inequality", self.inequalities), ("left side", self.left_sides),
                ("right side", self.right_sides), ("complementarity", self.complementarities))
