"""Derivatives of a solution with respect to its problem's numbers, by marble._core in this process."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from marble.in_process import core, core_errors
from marble.message import records
from marble.model import derivatives
from marble.model.derivatives import ANSWER, LETTERS, AnswerChange, RowResponse, SensitivityRequest
from marble.model.lcqp import LCQP, MatrixLike, Vector
from marble.model.solution import Solution


class Sensitivity:
    """Derivatives of a solution, wherever it was solved: one factorization in this process, none for its methods.

    answer: a Solution; one that is not solved raises Unsolved, one that is no exact solution of its branch
    FailedPrecondition; its problem is kept. weak_inequalities: rows of C at zero whose multiplier is zero too.
    biactive_pairs: both sides are zero, and not both multipliers are positive. smooth: there are none of both; else
    derivatives are the branch's, and hold in some directions only.
    """

    def __init__(self, answer: Solution) -> None:
        s = answer.raise_if_unsolved()
        self._take(s.problem, (s.z, s.y, s.nu, s.xi, s.eta, s.reference_objective))

    def _take(self, problem: LCQP, parts: tuple[Any, ...]) -> None:
        self._problem = problem
        with core_errors():
            self._core = core().Sensitivity(problem, parts)
        self.weak_inequalities = np.array(self._core.weak_inequalities, dtype=np.int32)
        self.biactive_pairs = np.array(self._core.biactive_pairs, dtype=np.int32)
        self.smooth = not (self.weak_inequalities.size or self.biactive_pairs.size)

    @classmethod
    def at(cls, problem: LCQP, z: Vector, y: Vector, nu: Vector, xi: Vector, eta: Vector) -> Sensitivity:
        """Of a solution that is given by its vectors alone, close to an exact one."""
        made = cls.__new__(cls)
        made._take(problem, (z, y, nu, xi, eta, 0.0))
        return made

    def jvp(self, **direction: ArrayLike) -> AnswerChange:
        """Forward mode: the change of the solution by a direction, the new numbers minus the old ones.

        By the letters of the equation. A matrix's numbers are those of its stored entries, as LCQP has it (of Q the
        upper triangle); absent parts do not change.
        """
        derivatives.of_letters(direction, LETTERS, "direction")
        with core_errors():
            return records.of_core(AnswerChange, self._core.along(_all_numbers(direction)))

    def vjp(self, **weights: ArrayLike) -> dict[str, Vector]:
        """Adjoint mode: the gradient of a loss with respect to the problem's numbers.

        weights: the loss's derivatives with respect to z, y, nu, xi and eta. The gradient is by the letters of the
        equation; a matrix's has one number per stored entry, as LCQP has it.
        """
        derivatives.of_letters(weights, ANSWER, "weights")
        with core_errors():
            return {name: np.asarray(v) for name, v in self._core.gradient(_all_numbers(weights)).items()}

    def rows(self, rows: MatrixLike, *, proximal: ArrayLike | None = None, g: ArrayLike | None = None,
             columns: bool = False) -> RowResponse:
        """How rows E z respond to a multiplier on them; all as in SensitivityRequest."""
        asked = derivatives.asked(SensitivityRequest(rows, proximal, g, columns), self._problem)
        with core_errors():
            return derivatives.response(*(np.asarray(part, np.float64) for part in self._core.rows(asked)))


def _all_numbers(parts: Mapping[str, Any]) -> dict[str, Vector]:
    return {name: np.ascontiguousarray(derivatives.numbers_of(values), dtype=np.float64)
            for name, values in parts.items()}
