"""Two-stage problems with scenarios: the request of a solve, and its result."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from marble.base import contract
from marble.errors import FailedPrecondition, InvalidArgument, InvalidProblem
from marble.message import answers, records, requests, wire
from marble.message.progress import ProgressOption
from marble.message.request import Run, core_options
from marble.message.requests import Call
from marble.message.solve import Solve
from marble.message.wire import Encoder
from marble.model import scenarios as model
from marble.model.lcqp import LCQP, Vector
from marble.model.problem import Problem, compiled
from marble.model.scenarios import Quantity, SampleAverageStage, ScenarioOutcome, Scenarios, ScenarioSolution

SETTINGS: Final = ("initial_sample_size", "growth", "max_sample_size", "tolerance", "min_sample_size",
                   "max_infeasible_fraction", "out_of_sample_scenarios")


def split(scenarios: Scenarios | None, given: Mapping[str, Any],
          options: Mapping[str, Any] | None) -> tuple[Scenarios, Mapping[str, Any] | None]:
    """The Scenarios, given whole or by its parts, and the options with all other names."""
    names = [field.name for field in dataclasses.fields(Scenarios)]
    parts = {name: value for name, value in given.items() if name in names}
    options = requests.merged(options, {name: value for name, value in given.items() if name not in names}, names)
    if scenarios is not None and parts:
        raise InvalidArgument("scenarios", "must be alone or absent", value=", ".join(parts))
    if scenarios is not None:
        if not isinstance(scenarios, Scenarios):
            raise InvalidArgument("scenarios", "must be a Scenarios", value=type(scenarios).__name__)
        return scenarios, options
    try:
        return Scenarios(**parts), options
    except TypeError as error:
        raise InvalidArgument("scenarios", f"lacks a part ({error})") from None


def _entries(part: str, places: NDArray[np.intp]) -> Encoder:
    named = Encoder("ScenarioEntries")
    named.others(contract.message("ScenarioEntries")(part=model.PARTS.index(part) + 1))
    named.integers("positions", places)
    return named


def _samples(table: model.Table) -> Encoder:
    part = Encoder("ScenarioSamples")
    for name, places in table.entries.items():
        part.message("entries", _entries(name, places))
    part.doubles("values", table.values.reshape(-1))
    part.doubles("weights", table.weights)
    return part


def _sampler(seed: int, quantities: Sequence[tuple[Quantity, Mapping[str, Vector]]]) -> Encoder:
    kinds = contract.descriptor("ScenarioQuantity").enum_types_by_name["Distribution"].values_by_name
    part = Encoder("ScenarioSampler")
    part.others(contract.message("ScenarioSampler")(seed=seed))
    for quantity, gains in quantities:
        one = Encoder("ScenarioQuantity")
        one.others(contract.message("ScenarioQuantity")(
            distribution=kinds[f"DISTRIBUTION_{quantity.distribution.upper()}"].number, location=quantity.location,
            scale=quantity.scale, least=quantity.least, most=quantity.most))
        for name, values in gains.items():
            places = np.flatnonzero(values)
            if places.size:
                effect = Encoder("ScenarioEffect")
                effect.message("entries", _entries(name, places))
                effect.doubles("gains", values[places])
                one.message("effects", effect)
        part.message("quantities", one)
    return part


def settings(scenarios: Scenarios) -> Any:
    """A Scenarios message with its settings alone."""
    try:
        return contract.message("Scenarios")(**{name: getattr(scenarios, name) for name in SETTINGS})
    except (TypeError, ValueError) as error:
        raise InvalidArgument("scenarios", f"has a setting of the wrong type ({error})") from None


def encoder(problem: LCQP | Problem, scenarios: Scenarios) -> Encoder:
    """A Scenarios message."""
    part = Encoder("Scenarios")
    part.others(settings(scenarios))
    drawn = model.drawn(problem, scenarios)
    part.integers("first_stage", drawn.plan)
    if drawn.table is None:
        part.message("sampler", _sampler(scenarios.seed, drawn.quantities))
    else:
        part.message("samples", _samples(drawn.table))
    for field in ("own_equalities", "own_inequalities", "own_pairs"):
        part.integers(field, getattr(drawn, field))
    return part


class ScenarioRequest(Solve[ScenarioSolution]):
    """A solve of a problem with scenarios."""

    method, streams = "Solver/SolveScenarios", True

    def __init__(self, problem: LCQP | Problem, scenarios: Scenarios, call: Call, progress: ProgressOption,
                 stage: Callable[[SampleAverageStage], object] | None) -> None:
        super().__init__(call, progress)
        self._problem, self._scenarios, self.stage = problem, scenarios, stage

    def wrap(self, wrapper: Callable[[Callable[..., object]], Callable[..., object]]) -> None:
        """See Request."""
        super().wrap(wrapper)
        if self.stage is not None:
            self.stage = wrapper(self.stage)

    def encode(self) -> bytes:
        """See Request."""
        return requests.solve_stream(compiled(self._problem), self.call,
                                     scenarios=encoder(self._problem, self._scenarios))

    def _result(self, response: Any, arrays: records.Arrays, path: str) -> ScenarioSolution:
        return _solution(response, arrays, path + "solution.")

    def compute(self, run: Run) -> ScenarioSolution:
        """See Request."""
        lcqp, drawn = without_start(compiled(self._problem), "scenarios"), model.drawn(self._problem, self._scenarios)
        chosen = settings(self._scenarios)
        asked: dict[str, Any] = {
            "first_stage": drawn.plan, "own_equalities": drawn.own_equalities,
            "own_inequalities": drawn.own_inequalities, "own_pairs": drawn.own_pairs,
            "settings": {name: getattr(chosen, name) for name in SETTINGS}}
        number = model.PARTS.index
        if drawn.table is not None:
            entries = [(number(part), places) for part, places in drawn.table.entries.items()]
            asked["table"] = (entries, drawn.table.values, drawn.table.weights)
        else:
            asked["sampler"] = (self._scenarios.seed, [
                (one.distribution, one.location, one.scale, one.least, one.most,
                 [(number(part), np.flatnonzero(gains), gains[np.flatnonzero(gains)]) for part, gains in moves.items()
                  if gains.any()])
                for one, moves in drawn.quantities])
        stage = self.stage
        report_stage = None if stage is None else lambda values: stage(records.of_core(SampleAverageStage, values))
        values = run.core.solve_scenarios(lcqp, core_options(self.call.options), asked, report_stage,
                                          run.call(lcqp, self.call, self.report))
        outcome = records.of_core(ScenarioOutcome, values.pop("scenarios"), first_stage=drawn.plan.size)
        return model.solution_of(answers.core_solution(values, None), outcome)


def without_start(problem: LCQP, whose: str) -> LCQP:
    """The problem; InvalidProblem where it has a z0."""
    if problem.z0 is not None:
        raise InvalidProblem("z0", f"must be absent: {whose} have their own starts")
    return problem


def _solution(response: Any, arrays: records.Arrays, path: str) -> ScenarioSolution:
    message = response.solution
    if not message.HasField("scenarios"):
        raise FailedPrecondition("scenarios", "are none in this answer: its problem was solved alone")
    solution = answers.solution(message, arrays, path, None, response.job_id)
    return model.solution_of(solution, records.read(ScenarioOutcome, message.scenarios))


def response(data: bytes) -> ScenarioSolution:
    """The solution in a SolveResponse."""
    return _solution(*wire.decode("SolveResponse", data), "solution.")
