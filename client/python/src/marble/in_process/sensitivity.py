"""Derivatives of an answer by its problem's numbers: core's Sensitivity, in this process."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from marble.in_process import solver
from marble.model import derivatives
from marble.model.derivatives import ANSWER, LETTERS, AnswerChange, RowResponse, SensitivityRequest
from marble.model.lcqp import LCQP, MatrixLike, Vector
from marble.model.solution import Solution


def _told(told: dict[str, Any]) -> dict[str, Any]:
    return {name: value if isinstance(value, bool) else np.asarray(value) for name, value in told.items()}


class Sensitivity:
    """Derivatives of a solved answer, wherever it was solved: one factorization here, none for what is asked of it.

    answer: one that is not solved raises Unsolved, one that is no exact solution of its branch FailedPrecondition; its
    problem is kept. weak_inequalities: rows of C at zero whose multiplier is zero too. biactive_pairs: both sides are
    zero, and not both multipliers are positive. smooth: there are none of both; else derivatives are the branch's, and
    hold in some directions only.
    """

    def __init__(self, answer: Solution) -> None:
        s = answer.raise_if_unsolved()
        self._take(s.problem, (s.z, s.y, s.nu, s.xi, s.eta, s.cold_objective))

    def _take(self, problem: LCQP, parts: tuple[Any, ...]) -> None:
        self._problem = problem
        with solver.faults():
            self._core = solver.core().Sensitivity(problem, parts)
        self.weak_inequalities = np.array(self._core.weak_inequalities, dtype=np.int32)
        self.biactive_pairs = np.array(self._core.biactive_pairs, dtype=np.int32)
        self.smooth = not (self.weak_inequalities.size or self.biactive_pairs.size)

    @classmethod
    def at(cls, problem: LCQP, z: Vector, y: Vector, nu: Vector, xi: Vector, eta: Vector) -> Sensitivity:
        """Of an answer that is known by its vectors alone, near one that is exact."""
        made = cls.__new__(cls)
        made._take(problem, (z, y, nu, xi, eta, 0.0))
        return made

    def along(self, **direction: ArrayLike) -> AnswerChange:
        """The change of the answer by a direction: new numbers less the old ones, by the letters of the equation.

        A matrix's are those of its stored entries, as LCQP has it (of Q the upper triangle); what is absent stays.
        """
        derivatives.of_letters(direction, LETTERS, "direction")
        with solver.faults():
            return AnswerChange(**_told(self._core.along({name: _numbers(v) for name, v in direction.items()})))

    def gradient(self, **weights: ArrayLike) -> dict[str, Vector]:
        """The gradient of a loss by every number of the problem, from its derivatives by z, y, nu, xi and eta.

        By the letters of the equation; a matrix's is one per stored entry, as LCQP has it.
        """
        derivatives.of_letters(weights, ANSWER, "weights")
        with solver.faults():
            return _told(self._core.gradient({name: _numbers(v) for name, v in weights.items()}))

    def rows(self, rows: MatrixLike, *, proximal: ArrayLike | None = None, g: ArrayLike | None = None,
             columns: bool = False) -> RowResponse:
        """How rows E z follow a price on them; all as in SensitivityRequest."""
        asked = derivatives.asked(SensitivityRequest(rows, proximal, g, columns), self._problem)
        with solver.faults():
            return derivatives.response(*(np.asarray(part, np.float64) for part in self._core.rows(asked)))


def _numbers(values: Any) -> Vector:
    return np.ascontiguousarray(derivatives.numbers_of(values), dtype=np.float64)
