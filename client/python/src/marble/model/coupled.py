"""Problems coupled by rows, or one problem in segments: the data, and the solution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from marble.base.fields import named
from marble.base.tables import Status
from marble.errors import InvalidArgument
from marble.model.lcqp import LCQP, MatrixLike, Vector, matrix, vector
from marble.model.problem import Problem, compiled
from marble.model.solution import Solution

_STAGES: Final = 2**31 - 1


@dataclass(frozen=True, eq=False)
class Coupled:
    """Blocks and their coupling rows: min Σ f_k(z_k), each z_k feasible for its own problem, Σ E_k z_k = coupling_rhs.

    blocks: at least one. coupling: E_k for each block, m × n_k; None where it is in no row. coupling_rhs: m numbers.
    coupling_multipliers: initial multipliers of the rows, m; None is zeros.
    """

    blocks: Sequence[LCQP | Problem]
    coupling: Sequence[MatrixLike | None]
    coupling_rhs: ArrayLike
    coupling_multipliers: ArrayLike | None = None


@dataclass(frozen=True, eq=False)
class Segments:
    """How one long problem is cut.

    stages: of each variable, from 0 on. num_segments: how many, of equal length. overlap: stages that each segment
    looks ahead while they are first solved one after the other; -1 is a third of a segment, but at least 2.
    """

    stages: ArrayLike
    num_segments: int
    overlap: int = -1


@dataclass(frozen=True, eq=False)
class Checked:
    """A Coupled, checked: E_k as csc matrices."""

    blocks: Sequence[tuple[LCQP, Any]]
    coupling_rhs: Vector
    coupling_multipliers: Vector | None


@dataclass(frozen=True)
class Coordination:
    """How the coordination of the blocks ended.

    status, detail: SOLVED if the blocks agree, ALMOST_SOLVED if they do but one is; ITERATION_LIMIT if they do not yet;
    else that of the block `failed`.
    iterations: of the coordinator. violation: of the coupling rows. step: the largest of a multiplier.
    proximal: the last ρ. frozen_at: the iteration in which pairs were frozen, 0 never; pair_switches: switches of pairs
    then. factorizations: of all blocks. objective: Σ f_k before the monolithic solve.
    sweep_objective, sweep_factorizations: of the forward pass over segments; None and 0 without one.
    """

    status: Status
    detail: str
    iterations: int
    violation: float = field(metadata=named("coupling_violation"))
    step: float
    proximal: float
    frozen_at: int
    pair_switches: int
    factorizations: int
    objective: float = field(metadata=named("blocks_objective"))
    failed: int | None = field(metadata=named("failed_block"))
    sweep_objective: float | None
    sweep_factorizations: int


@dataclass(frozen=True, eq=False)
class CoupledSolution:
    """The solution of coupled blocks.

    status, detail, objective: of the monolithic problem. z: of each block. coupling_multipliers: multipliers of the
    rows, m. solution: of the monolithic problem, all blocks' vectors one after the other, the coupling_multipliers the
    last of y. coordination: of the blocks. repeated: of blocks in sessions, steps that were repeated because the
    session or its server was lost.
    """

    status: Status
    detail: str
    objective: float
    z: tuple[Vector, ...]
    coupling_multipliers: Vector
    solution: Solution
    coordination: Coordination
    job_id: str
    repeated: int = 0


@dataclass(frozen=True, eq=False)
class SegmentsSolution:
    """The solution of a problem in segments.

    solution: of the problem itself. coordination: of the segments. repeated: as in CoupledSolution, of segments.
    """

    solution: Solution
    coordination: Coordination
    job_id: str
    repeated: int = 0


def checked(coupled: Coupled) -> Checked:
    """Raises InvalidArgument where parts do not fit together."""
    coupling_rhs = vector(coupled.coupling_rhs, "coupling_rhs")
    if not coupled.blocks:
        raise InvalidArgument("blocks", "must be at least one")
    if len(coupled.coupling) != len(coupled.blocks):
        raise InvalidArgument("coupling", f"must be {len(coupled.blocks)}, one a block", value=len(coupled.coupling))
    blocks: list[tuple[LCQP, Any]] = []
    for k, (block, coupling) in enumerate(zip(coupled.blocks, coupled.coupling, strict=True)):
        lcqp = compiled(block)
        rows = None if coupling is None else matrix(coupling, f"coupling[{k}]", lcqp.g.size, coupling_rhs.size)
        blocks.append((lcqp, rows))
    multipliers = coupled.coupling_multipliers
    if multipliers is not None:
        multipliers = vector(multipliers, "coupling_multipliers", coupling_rhs.size)
    return Checked(blocks, coupling_rhs, multipliers)


def stages_of(problem: LCQP, segments: Segments) -> NDArray[np.integer[Any]]:
    """The stage of each variable."""
    stages = np.asarray(segments.stages)
    if stages.shape != problem.g.shape or not np.issubdtype(stages.dtype, np.integer) or stages.min(initial=0) < 0:
        raise InvalidArgument("stages", f"must be {problem.g.size} whole numbers >= 0, one a variable")
    if (largest := stages.max(initial=0)) >= _STAGES:  # else they wrap around
        raise InvalidArgument("stages", f"must be < {_STAGES}", index=int(stages.argmax()), value=largest)
    return stages


def solution_of(solution: Solution, blocks: Sequence[LCQP | Problem], coupling_multipliers: Vector,
              coordination: Coordination) -> CoupledSolution:
    """The solution of the monolithic problem, block by block."""
    sizes = [compiled(block).g.size for block in blocks]
    if sum(sizes) != solution.z.size:
        raise InvalidArgument("blocks", f"must have {solution.z.size} variables, as the answer has", value=sum(sizes))
    z = tuple(np.split(solution.z, np.cumsum(sizes)[:-1]))
    return CoupledSolution(solution.status, solution.detail, solution.objective, z, coupling_multipliers, solution,
                           coordination, solution.job_id)
