"""Problems that rows tie together: how they are solved, and what comes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from numpy.typing import ArrayLike

from marble.base.tables import Status
from marble.model.lcqp import LCQP, MatrixLike, Vector
from marble.model.problem import Problem
from marble.model.solution import Solution


@dataclass(frozen=True, eq=False)
class Coupled:
    """Blocks and what ties them: min Σ f_k(z_k), each z_k feasible for its own problem, Σ E_k z_k = total.

    blocks: at least one. coupling: E_k for each block, m × n_k; None where no row sees it. total: m numbers.
    prices: of the rows, to begin with, m; None is zeros.
    """

    blocks: Sequence[LCQP | Problem]
    coupling: Sequence[MatrixLike | None]
    total: ArrayLike
    prices: ArrayLike | None = None


@dataclass(frozen=True, eq=False)
class Pieces:
    """How one long problem is cut.

    stages: of each variable, from 0 on. pieces: how many, of equal length. look_ahead: stages that each piece looks
    ahead while they are first solved one after the other; -1 is a third of a piece, but at least 2.
    """

    stages: ArrayLike
    pieces: int
    look_ahead: int = -1


@dataclass(frozen=True)
class Coordination:
    """How the blocks came to agree, or did not.

    status, detail: SOLVED where they agree, ITERATION_LIMIT where they do not yet; else that of the block `failed`.
    iterations: of the coordinator. violation: of the rows between the blocks. step: the largest of a price.
    proximal: the last ρ. frozen_at: the iteration in which pairs were frozen, 0 never; flips: pairs that took their
    other side then. factorizations: of all blocks. objective: Σ f_k before the joint solve.
    sweep_objective, sweep_factorizations: of pieces, solved one after the other before they agreed; None and 0 else.
    """

    status: Status
    detail: str
    iterations: int
    violation: float
    step: float
    proximal: float
    frozen_at: int
    flips: int
    factorizations: int
    objective: float
    failed: int | None
    sweep_objective: float | None
    sweep_factorizations: int


@dataclass(frozen=True, eq=False)
class CoupledAnswer:
    """The answer to blocks.

    status, detail, objective: of the joint problem. z: of each block. prices: of the rows, m. solution: the whole, all
    blocks' vectors one after the other, the prices the last of y. coordination: how they came to it.
    """

    status: Status
    detail: str
    objective: float
    z: tuple[Vector, ...]
    prices: Vector
    solution: Solution
    coordination: Coordination
    job_id: str


@dataclass(frozen=True, eq=False)
class PiecesAnswer:
    """The answer to a problem in pieces. solution: of the problem itself. coordination: how the pieces came to it."""

    solution: Solution
    coordination: Coordination
    job_id: str
