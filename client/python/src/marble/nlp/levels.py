"""Retrospective approximation: functions that are expectations, by averages over more and more samples."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from marble.base.tables import Status
from marble.errors import InvalidArgument
from marble.in_process import core
from marble.message import records
from marble.nlp.functions import Multipliers, problem_of
from marble.nlp.loop import Answer, run


@dataclass(frozen=True)
class Estimate:
    """A mean of fresh samples, and half its 95 % interval."""

    mean: float
    half_width: float


@dataclass(frozen=True)
class Level:
    """What a level came to; its fields as marble/retrospective.h has them."""

    level: int
    samples: int
    status: Status
    objective: float
    violation: float
    kkt_residual: float
    iterations: int
    ticks: int
    evaluations: int
    linearisations: int
    estimate: Estimate | None
    x: NDArray[np.float64]


@dataclass(frozen=True)
class RetrospectiveAnswer:
    """The last level's answer, whose counts are those of all levels; and the levels."""

    answer: Answer
    levels: list[Level]

    @property
    def x(self) -> NDArray[np.float64]:
        """Of the answer."""
        return self.answer.x

    @property
    def solved(self) -> bool:
        """Whether the last level met its tolerance."""
        return self.answer.solved


def uniform(seed: int, first: int, count: int, numbers: int = 1) -> NDArray[np.float64]:
    """Uniform in [0, 1): a row for each of the samples first … first + count − 1, with `numbers` columns.

    Sample i is a function of seed and i alone (Philox4x32-10), the same bits everywhere and as CounterRandom of C++:
    samples that are drawn later do not change those drawn before. Errors: InvalidArgument.
    """
    for name, value, most in (("seed", seed, 2**64), ("first", first, 2**63), ("count", count, 2**31),
                              ("numbers", numbers, 2**31)):
        if not 0 <= value < most:
            raise InvalidArgument(name, f"must be >= 0 and < {most}; it is {value}")
    return np.asarray(core().uniform(seed, first, count, numbers)).reshape(count, numbers)


def retrospective(
    values: Callable[[NDArray[np.float64], int], Mapping[str, Any]],
    derivatives: Callable[[NDArray[np.float64], int], Mapping[str, Any]],
    x0: ArrayLike,
    *,
    first_samples: int = 2,
    growth: float = 2.0,
    levels: int = 10,
    largest_samples: int = 1_000_000_000,
    test: str = "merit",
    reduction: float | None = None,
    tolerance: float = 0.0,
    carry_curvature: bool = True,
    sample_cost: Callable[[NDArray[np.float64], int], float] | None = None,
    fresh_samples: int = 1000,
    level: Callable[[Level], object] | None = None,
    hessian: Callable[[NDArray[np.float64], Multipliers, int], Any] | None = None,
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
    scale: ArrayLike | None = None,
    blocks: Sequence[int] | None = None,
    **settings: Any,
) -> RetrospectiveAnswer:
    """Solves a problem of expectations, level after level on nested samples (RA-SQP).

    values, derivatives and hessian are those of `solve`, averaged over the samples 0 … N − 1; N is their last argument.
    Sample i must be the same whenever it is asked for: `uniform` has such numbers. Level k has ⌈first_samples·growthᵏ⌉
    samples, and begins with the last one's x, multipliers, BFGS matrix, merit weights and trust region. It ends once
    the `test`, "merit" for the decrease that a step promises or "step" for its length, has fallen to `reduction` (0.1
    of the merit, 0.5 of the step) times its first value, plus tolerance/√N. The level that would have more than
    largest_samples has these, and is the last.

    sample_cost(x, i): the cost of sample i; with it each level is evaluated on fresh_samples out-of-sample ones. level:
    receives every one. settings: `Settings` by their names, of which iteration_limit is of each level and
    time_limit_s of all; the rest as `solve` has it. Errors: InvalidArgument, and what a function raises.
    """
    N = 0
    reached: list[Level] = []

    def use_samples(count: int) -> None:
        nonlocal N
        N = count

    def report(row: dict[str, Any]) -> None:
        reached.append(records.of_core(Level, row))
        if level is not None:
            level(reached[-1])

    def of_hessian(x: NDArray[np.float64], multipliers: Multipliers) -> Any:
        assert hessian is not None
        return hessian(x, multipliers, N)

    problem = problem_of(lambda x: values(x, N), lambda x: derivatives(x, N), None if hessian is None else of_hessian,
                         x0, lower, upper, scale, blocks)
    growing = {"first_samples": first_samples, "growth": growth, "levels": levels, "largest_samples": largest_samples,
               "test": test, "reduction": reduction, "tolerance": tolerance, "carry_curvature": carry_curvature,
               "fresh_samples": fresh_samples}
    cost = None if sample_cost is None else lambda x, i: float(sample_cost(np.asarray(x), i))
    answer = run("solve_retrospective", problem, settings, growing, use_samples, cost, report)
    return RetrospectiveAnswer(answer, reached)
