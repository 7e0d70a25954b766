"""Derivatives of an answer by its problem's numbers: core's Sensitivity, in this process."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from marble.base.tables import MATRICES, VECTORS
from marble.errors import InvalidArgument
from marble.in_process import solver
from marble.model.lcqp import Vector
from marble.model.solution import Solution


@dataclass(frozen=True, eq=False)
class AnswerChange:
    """Changes of an answer's z and multipliers by one unit of a direction, with the names and sizes of Solution.

    holds: whether the answer goes this way for small positive steps; always true where the sensitivity is smooth.
    """

    z: Vector
    y: Vector
    nu: Vector
    xi: Vector
    eta: Vector
    holds: bool


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
        parts = (answer.raise_if_unsolved().z, answer.y, answer.nu, answer.xi, answer.eta, answer.cold_objective)
        with solver.faults():
            self._core = solver.core().Sensitivity(answer.problem, parts)
        self.weak_inequalities = np.array(self._core.weak_inequalities, dtype=np.int32)
        self.biactive_pairs = np.array(self._core.biactive_pairs, dtype=np.int32)
        self.smooth = not (self.weak_inequalities.size or self.biactive_pairs.size)

    def along(self, **direction: ArrayLike) -> AnswerChange:
        """The change of the answer by a direction: new numbers less the old ones, by the letters of the equation.

        A matrix's are those of its stored entries, as LCQP has it (of Q the upper triangle); what is absent stays.
        """
        others = sorted(set(direction) - {*VECTORS, *MATRICES})
        if others:
            raise InvalidArgument("direction", f"must be of {', '.join((*VECTORS, *MATRICES))}", value=others[0])
        with solver.faults():
            return AnswerChange(**_told(self._core.along({name: _numbers(v) for name, v in direction.items()})))

    def gradient(self, **weights: ArrayLike) -> dict[str, Vector]:
        """The gradient of a loss by every number of the problem, from its derivatives by z, y, nu, xi and eta.

        By the letters of the equation; a matrix's is one per stored entry, as LCQP has it.
        """
        others = sorted(set(weights) - {"z", "y", "nu", "xi", "eta"})
        if others:
            raise InvalidArgument("weights", "must be of z, y, nu, xi, eta", value=others[0])
        with solver.faults():
            return _told(self._core.gradient({name: _numbers(v) for name, v in weights.items()}))


def _numbers(values: Any) -> Vector:
    return np.ascontiguousarray(values.data if hasattr(values, "nnz") else values, dtype=np.float64)
