"""Scenario solves as messages, there and back."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from marble.base import contract
from marble.errors import FailedPrecondition, InvalidArgument
from marble.message import answers, requests, wire
from marble.message.requests import Call
from marble.message.wire import Encoder
from marble.model import scenarios as model
from marble.model.lcqp import LCQP, Vector
from marble.model.problem import Problem, compiled
from marble.model.scenarios import Quantity, ScenarioAnswer, ScenarioEnd, ScenarioLevel, Scenarios
from marble.model.solution import Progress

SETTINGS: Final = ("first_scenarios", "growth", "most_scenarios", "tolerance", "least_scenarios", "without_recourse",
                   "fresh_scenarios")


def wish(scenarios: Scenarios | None, given: Mapping[str, Any],
         options: Mapping[str, Any] | None) -> tuple[Scenarios, Mapping[str, Any] | None]:
    """What is asked for, whole or by parts, and the options with what is no part of it."""
    names = [field.name for field in dataclasses.fields(Scenarios)]
    parts = {name: value for name, value in given.items() if name in names}
    options = requests.wishes(options, {name: value for name, value in given.items() if name not in names}, names)
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


def settings(wish: Scenarios) -> Any:
    """A Scenarios message with its settings alone."""
    try:
        return contract.message("Scenarios")(**{name: getattr(wish, name) for name in SETTINGS})
    except (TypeError, ValueError) as error:
        raise InvalidArgument("scenarios", f"has a setting of the wrong type ({error})") from None


def encoder(problem: LCQP | Problem, wish: Scenarios) -> Encoder:
    """A Scenarios message."""
    part = Encoder("Scenarios")
    part.others(settings(wish))
    drawn = model.drawn(problem, wish)
    part.integers("first_stage", drawn.plan)
    if drawn.table is None:
        part.message("sampler", _sampler(wish.seed, drawn.quantities))
    else:
        part.message("samples", _samples(drawn.table))
    for field in ("own_equalities", "own_inequalities", "own_pairs"):
        part.integers(field, getattr(drawn, field))
    return part


def solve_stream(problem: LCQP | Problem, wish: Scenarios, call: Call) -> bytes:
    """A SolveStreamRequest."""
    return requests.solve_stream(compiled(problem), call, encoder(problem, wish))


def submission(problem: LCQP | Problem, wish: Scenarios, call: Call) -> bytes:
    """A SolveRequest by an id."""
    return requests.submission(compiled(problem), call, encoder(problem, wish))


def answer(message: Any, arrays: answers.Arrays, path: str, job_id: str) -> ScenarioAnswer:
    """The answer in a Solution, whose arrays stand under `path` in `arrays`."""
    if not message.HasField("scenarios"):
        raise FailedPrecondition("scenarios", "are none in this answer: its problem was solved alone")
    outcome = message.scenarios
    z = arrays.get(path + "z", np.zeros(1))
    solution = answers.solution(message, arrays, path, LCQP(None, np.zeros_like(z)), job_id)
    return model.answer_of(solution, ScenarioEnd(contract.enum_names("ScenarioEnd")[outcome.end]), outcome.scenarios,
                           outcome.first_stage, outcome.infeasible,
                           [answers.scenario_level(one) for one in outcome.levels])


def response(data: bytes) -> ScenarioAnswer:
    """The answer in a SolveResponse."""
    message, arrays = wire.decode("SolveResponse", data)
    return answer(message.solution, arrays, "solution.", message.job_id)


def read(data: bytes, level: Callable[[ScenarioLevel], object] | None,
         tell: Callable[[Progress], object] | None) -> ScenarioAnswer | None:
    """Tells what an event of the stream says; its answer, if it is the result."""
    message, arrays = wire.decode("SolveStreamResponse", data)
    kind = message.WhichOneof("event")
    if kind == "level" and level is not None:
        level(answers.scenario_level(message.level))
    elif kind == "progress":
        answers.tell_rows(message, tell)
    elif kind == "result":
        return answer(message.result.solution, arrays, "result.solution.", message.result.job_id)
    return None
