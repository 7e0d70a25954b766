"""Two-stage problems with scenarios: the data that differ by scenario, and the solution."""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from marble.base.tables import MATRICES, Status
from marble.errors import InvalidArgument, InvalidProblem
from marble.model.lcqp import LCQP, Vector, vector
from marble.model.lcqp import numbers as real
from marble.model.problem import Problem, compiled
from marble.model.solution import Solution, Violations

PARTS: Final = ("c0", "g", "b", "d", "l", "r", "Q", "A", "C", "L", "R")
"""Parts of a problem, in the order of marble.v1.ProblemPart."""

DISTRIBUTIONS: Final = ("uniform", "normal", "lognormal")

Scenario = LCQP | Problem | Mapping[str, ArrayLike]
Entries = dict[str, NDArray[np.intp]]


@dataclass(frozen=True, eq=False)
class Quantity:
    """A random number that is drawn once for each scenario, by the solver, and what it changes.

    moves: by part, of "c0", "g", "b", "d", "l", "r" or the values of "Q" (upper triangle), "A", "C", "L", "R" in the
    order of LCQP's csc_matrix: what one unit of the number adds to each of its entries; 0 leaves an entry alone.
    distribution: "uniform" in [location, location + scale), "normal" with that mean and deviation, or "lognormal", the
    exponential of such. least, most: what is below or above becomes this.
    """

    moves: Mapping[str, ArrayLike]
    distribution: str = "uniform"
    location: float = 0.0
    scale: float = 1.0
    least: float = -math.inf
    most: float = math.inf


@dataclass(frozen=True, eq=False)
class Scenarios:
    """The variables of the first stage, the scenarios, and how many of them are solved.

    first_stage: the variables that are decided once, by number or, of a Problem, by name; all others are decided anew
    in every scenario.
    sampler: the scenarios, one of

    - a callable, which is given a numpy Generator of this scenario alone and returns what differs: {"l": …, "A": …},
      each a part as Quantity names them, or a whole LCQP or Problem of the base's pattern;
    - {"l": array of as many rows as there are scenarios, …};
    - a list of Quantity: they are drawn by the solver.

    seed: of the generators; scenario i is a function of the seed and i alone. weights: of a mapping's scenarios, > 0.
    initial_sample_size, growth, max_sample_size: stages have N = initial_sample_size · growth^k scenarios up to the
    most. tolerance: ends when the 95 % interval of the out-of-sample cost is this part of it; 0 never, and not before N
    is min_sample_size, nor while a larger share of these scenarios than max_infeasible_fraction is infeasible.
    out_of_sample_scenarios: in how many out-of-sample scenarios a plan is tried at least.
    """

    first_stage: Sequence[int | str] | NDArray[np.integer[Any]]
    sampler: Callable[[np.random.Generator], Scenario] | Mapping[str, ArrayLike] | Sequence[Quantity]
    seed: int = 0
    weights: ArrayLike | None = None
    initial_sample_size: int = 1
    growth: float = 2.0
    max_sample_size: int = 64
    tolerance: float = 0.0
    min_sample_size: int = 8
    max_infeasible_fraction: float = 0.05
    out_of_sample_scenarios: int = 16


@dataclass(frozen=True, eq=False)
class Table:
    """Scenarios as rows of numbers of the same entries: by part which of its numbers, and a column for each."""

    entries: Entries
    values: NDArray[np.float64]
    weights: Vector


@dataclass(frozen=True, eq=False)
class Drawn:
    """A checked request: the plan's variables, the rows of the plan alone that differ by scenario all the same, and the
    scenarios as a table or, where that is None, as quantities with the gains of each by part.
    """

    plan: NDArray[np.intp]
    own_equalities: NDArray[np.integer[Any]]
    own_inequalities: NDArray[np.integer[Any]]
    own_pairs: NDArray[np.integer[Any]]
    table: Table | None
    quantities: Sequence[tuple[Quantity, Mapping[str, Vector]]]


class ScenarioEnd(enum.Enum):
    """Why the stages ended. NOT_SOLVED: the last one has another end than solved, see status. TOO_LARGE: the next one
    needs more memory than allowed.
    """

    INTERVAL = "interval"
    SAMPLES = "samples"
    NOT_SOLVED = "not_solved"
    TOO_LARGE = "too_large"
    TIME_LIMIT = "time_limit"
    CANCELLED = "cancelled"


@dataclass(frozen=True)
class OutOfSample:
    """A plan in out-of-sample scenarios, each with its best recourse.

    scenarios, infeasible: that were tried, and those of them where the plan has no feasible recourse. mean,
    half_width: of the costs of the others, the 95 % interval is mean ± half_width. factorizations, seconds: of all.
    """

    scenarios: int
    infeasible: int
    mean: float
    half_width: float
    factorizations: int
    seconds: float


@dataclass(frozen=True)
class SampleAverageStage:
    """The result of a stage.

    stage: from 0. scenarios: N, those numbered 0 … N − 1. status, detail, objective: of its LCQP; the objective is the
    mean over the N. variables, pairs, factorizations, seconds, memory_bytes: of its LCQP. warm: it kept the branch of
    the stage before. searched: it was solved cold too. out_of_sample: its plan out of sample; None where that was not
    tried.
    """

    stage: int
    scenarios: int
    status: Status
    detail: str
    objective: float
    variables: int
    pairs: int
    factorizations: int
    seconds: float
    warm: bool
    searched: bool
    memory_bytes: int
    out_of_sample: OutOfSample | None = None


@dataclass(eq=False, repr=False)
class ScenarioOutcome:
    """What a scenario solve returns beside the solution of its last stage; see ScenarioSolution."""

    end: ScenarioEnd
    scenarios: int
    first_stage: int
    infeasible: tuple[int, ...]
    stages: tuple[SampleAverageStage, ...]


@dataclass(frozen=True, eq=False)
class ScenarioSolution:
    """The newest plan of a solved stage.

    end: why it ended. status, detail: of the last stage; TIME_LIMIT and CANCELLED where that ended it.
    scenarios: N of the stage that x is of; 0 where none was solved, and all is empty. x: the plan, in the order of
    first_stage. recourse: N rows, the other variables of each scenario in their order. objective, violations: over the
    N. infeasible: numbers of scenarios that are infeasible even by themselves. stages: all of them.
    solution: of the stage's LCQP, whose z is x and then each scenario's recourse, rows and pairs likewise.
    """

    end: ScenarioEnd
    status: Status
    detail: str
    scenarios: int
    x: Vector
    recourse: NDArray[np.float64]
    objective: float
    violations: Violations
    infeasible: tuple[int, ...]
    stages: tuple[SampleAverageStage, ...]
    solution: Solution = field(repr=False)
    job_id: str = ""


def numbers(problem: LCQP, part: str) -> Vector:
    """The numbers of a part."""
    value = getattr(problem, part)
    found: Vector = np.array([value]) if part == "c0" else value.data if part in MATRICES else value
    return found


def _checked(problem: LCQP, part: str, values: ArrayLike, place: str) -> Vector:
    if part not in PARTS:
        raise InvalidArgument(place, f"has no part {part!r}: the parts are {', '.join(PARTS)}")
    return vector(values, f"{place}[{part!r}]", numbers(problem, part).size)


def _differences(problem: LCQP, given: Scenario, place: str) -> dict[str, Vector]:
    if isinstance(given, Mapping):
        return {part: _checked(problem, part, values, place) for part, values in given.items()}
    whole = compiled(given)
    for part in PARTS:
        mine, other = getattr(problem, part), getattr(whole, part)
        same = part == "c0" or (mine.shape == other.shape and (part not in MATRICES or (
            np.array_equal(mine.indptr, other.indptr) and np.array_equal(mine.indices, other.indices))))
        if not same:
            raise InvalidProblem(f"{place}.{part}", "must have the base problem's pattern")
    return {part: numbers(whole, part) for part in PARTS}


def _drawn(problem: LCQP, asked: Scenarios) -> tuple[list[dict[str, Vector]], Vector]:
    """The differences of each scenario, and the weights."""
    sampler = asked.sampler
    if callable(sampler):
        if asked.weights is not None:
            raise InvalidArgument("weights", "must be None: scenarios of a callable have equal weights")
        count = int(asked.max_sample_size) + max(int(asked.out_of_sample_scenarios), 0)
        generators = (np.random.Generator(np.random.Philox(key=asked.seed, counter=[0, 0, 0, i])) for i in range(count))
        return [_differences(problem, sampler(generator), f"scenario[{i}]")
                for i, generator in enumerate(generators)], np.zeros(0)
    if not isinstance(sampler, Mapping) or not sampler:
        raise InvalidArgument("sampler", "must be a callable, arrays by part, or a list of Quantity")
    arrays = {part: np.atleast_1d(real(rows, part)) for part, rows in sampler.items()}
    counts = {rows.shape[0] for rows in arrays.values()}
    if len(counts) != 1:
        raise InvalidArgument("sampler", "must have as many rows in every array", value=sorted(counts))
    count = counts.pop()
    weights = np.zeros(0) if asked.weights is None else vector(asked.weights, "weights", count)
    return [_differences(problem, {part: rows[i] for part, rows in arrays.items()}, f"scenario[{i}]")
            for i in range(count)], weights


def table(problem: LCQP, asked: Scenarios) -> Table:
    """The scenarios of a callable or of arrays: the numbers that are not the base's in all of them."""
    scenarios, weights = _drawn(problem, asked)
    entries: Entries = {}
    columns = []
    for part in PARTS:
        base = numbers(problem, part)
        if not base.size or all(part not in one for one in scenarios):
            continue
        rows = np.stack([one.get(part, base) for one in scenarios])
        places = np.flatnonzero((rows != base).any(axis=0))
        if places.size:
            entries[part] = places
            columns.append(rows[:, places])
    if not entries:  # all scenarios are the base
        entries, columns = {"c0": np.zeros(1, dtype=np.intp)}, [np.full((len(scenarios), 1), problem.c0)]
    return Table(entries, np.concatenate(columns, axis=1), weights)


def moved(problem: LCQP, quantities: Sequence[Quantity]) -> list[dict[str, Vector]]:
    """The gains of each quantity by part, one for each entry."""
    return [{part: _checked(problem, part, gains, f"sampler[{q}].moves") for part, gains in quantity.moves.items()}
            for q, quantity in enumerate(quantities)]


def plan_of(problem: LCQP | Problem, asked: Scenarios) -> NDArray[np.intp]:
    """Numbers of the first stage's variables, ascending, as they were given."""
    indices = [problem.index(v) if isinstance(problem, Problem) else int(v) for v in asked.first_stage]
    plan = np.array(indices, dtype=np.intp)
    n = compiled(problem).n
    if not plan.size or (plan < 0).any() or (plan >= n).any() or (np.diff(plan) <= 0).any():
        raise InvalidArgument("first_stage", f"must ascend within [0, {n}), one variable at least", value=indices)
    return plan


def own_rows(problem: LCQP, plan: NDArray[np.intp], entries: Sequence[Entries]) -> tuple[Any, Any, Any]:
    """Equalities, inequalities and pairs of the plan alone that differ by scenario all the same."""
    second = np.ones(problem.n, dtype=bool)
    second[plan] = False
    of_plan = {letter: np.asarray(abs(getattr(problem, letter)) @ second.astype(float)).reshape(-1) == 0
               for letter in "ACLR"}
    of_plan["L"] = of_plan["R"] = of_plan["L"] & of_plan["R"]
    result = []
    for letters in (("A", "b"), ("C", "d"), ("L", "l", "R", "r")):
        rows = [places if part.islower() else getattr(problem, part).indices[places]
                for named in entries for part, places in named.items() if part in letters]
        changed = np.unique(np.concatenate(rows)) if rows else np.zeros(0, dtype=np.intp)
        result.append(changed[of_plan[letters[0]][changed]])
    return result[0], result[1], result[2]


def drawn(problem: LCQP | Problem, asked: Scenarios) -> Drawn:
    """The data that differ by scenario, as a message and marble._core take them."""
    lcqp, plan = compiled(problem), plan_of(problem, asked)
    if not (isinstance(asked.sampler, Sequence) and all(isinstance(one, Quantity) for one in asked.sampler)):
        rows = table(lcqp, asked)
        return Drawn(plan, *own_rows(lcqp, plan, [rows.entries]), rows, ())
    quantities: Sequence[Any] = asked.sampler
    if not 0 <= asked.seed < 2**64:
        raise InvalidArgument("seed", "must be in [0, 2**64)", value=asked.seed)
    for quantity in quantities:
        if quantity.distribution not in DISTRIBUTIONS:
            raise InvalidArgument("distribution", "must be uniform, normal or lognormal",
                                  value=repr(quantity.distribution))
    moves = moved(lcqp, quantities)
    entries = [{part: np.flatnonzero(values) for part, values in gains.items()} for gains in moves]
    return Drawn(plan, *own_rows(lcqp, plan, entries), None, list(zip(quantities, moves, strict=True)))


def solution_of(solution: Solution, outcome: ScenarioOutcome) -> ScenarioSolution:
    """The plan and the recourses in the solution of the last stage's LCQP."""
    x, rest = solution.z[:outcome.first_stage], solution.z[outcome.first_stage:]
    return ScenarioSolution(
        outcome.end, solution.status, solution.detail, outcome.scenarios, x,
        rest.reshape(outcome.scenarios, -1) if outcome.scenarios else np.zeros((0, 0)), solution.objective,
        solution.violations, outcome.infeasible, outcome.stages, solution, solution.job_id)
