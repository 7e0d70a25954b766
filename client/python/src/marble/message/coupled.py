"""Coupled problems as messages, there and back."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from marble.base import contract
from marble.base.tables import Status
from marble.errors import FailedPrecondition, InvalidArgument
from marble.message import answers, requests, wire
from marble.message.wire import Encoder
from marble.model import coupled as model
from marble.model.coupled import Coordination, Coupled, CoupledAnswer, Pieces, PiecesAnswer
from marble.model.lcqp import LCQP
from marble.model.problem import Problem, compiled, in_terms_of
from marble.model.solution import Progress

SETTINGS: Final = ("proximal", "max_iterations", "freeze_after", "searches", "flips", "tolerance", "joint",
                   "joint_search")


def split(given: Mapping[str, Any],
          options: Mapping[str, Any] | None) -> tuple[dict[str, Any], Mapping[str, Any] | None]:
    """The settings among what is given by name, and the options with the rest."""
    rest = {name: value for name, value in given.items() if name not in SETTINGS}
    return ({name: value for name, value in given.items() if name in SETTINGS},
            requests.wishes(options, rest, (*SETTINGS, "sessions")))


def message(settings: Mapping[str, Any]) -> Any:
    """A Coupled message with its settings alone."""
    try:
        return contract.message("Coupled")(**settings)
    except (TypeError, ValueError) as error:
        raise InvalidArgument("coupled", f"has a setting of the wrong type ({error})") from None


def blocks(wish: Coupled, settings: Mapping[str, Any]) -> Encoder:
    """A Coupled message of blocks."""
    part = Encoder("Coupled")
    part.others(message(settings))
    tied = model.checked(wish)
    for lcqp, coupling in tied.blocks:
        one = Encoder("CoupledBlock")
        one.message("problem", requests.problem_encoder(lcqp))
        if coupling is not None:
            one.message("coupling", requests.matrix_encoder(coupling))
        part.message("blocks", one)
    part.doubles("total", tied.total)
    if tied.prices is not None:
        part.doubles("prices", tied.prices)
    return part


def cut(wish: Pieces) -> Any:
    """A Pieces message without its stages."""
    try:
        return contract.message("Pieces")(pieces=wish.pieces, look_ahead=wish.look_ahead)
    except (TypeError, ValueError) as error:
        raise InvalidArgument("pieces", f"has a number of the wrong type ({error})") from None


def pieces(problem: LCQP | Problem, wish: Pieces, settings: Mapping[str, Any]) -> Encoder:
    """A Coupled message of a problem in pieces."""
    part, own = Encoder("Coupled"), Encoder("Pieces")
    part.others(message(settings))
    own.integers("stages", model.stages_of(compiled(problem), wish))
    own.others(cut(wish))
    part.message("pieces", own)
    return part


def _coordination(outcome: Any) -> Coordination:
    return Coordination(
        status=Status(contract.enum_names("Status")[outcome.status]),
        detail=outcome.detail,
        iterations=outcome.iterations,
        violation=outcome.coupling_violation,
        step=outcome.step,
        proximal=outcome.proximal,
        frozen_at=outcome.frozen_at,
        flips=outcome.flips,
        factorizations=outcome.factorizations,
        objective=outcome.blocks_objective,
        failed=outcome.failed_block if outcome.HasField("failed_block") else None,
        sweep_objective=outcome.sweep_objective if outcome.HasField("sweep_objective") else None,
        sweep_factorizations=outcome.sweep_factorizations)


class Told(NamedTuple):
    """A SolveResponse of a coupled problem, and its solution's arrays, which stand under `path`."""

    response: Any
    arrays: answers.Arrays
    path: str


def _told(response: Any, arrays: answers.Arrays, path: str) -> Told:
    if not response.solution.HasField("coupled"):
        raise FailedPrecondition("coupled", "is not in this answer: its problem was solved alone")
    return Told(response, arrays, path)


def read(data: bytes, tell: Callable[[Progress], object] | None) -> Told | None:
    """Tells what an event of the stream says; what there is to the answer, if it is the result."""
    message, arrays = wire.decode("SolveStreamResponse", data)
    kind = message.WhichOneof("event")
    if kind == "progress":
        answers.tell_rows(message, tell)
    return _told(message.result, arrays, "result.solution.") if kind == "result" else None


def response(data: bytes) -> Told:
    """The same of a SolveResponse."""
    message, arrays = wire.decode("SolveResponse", data)
    return _told(message, arrays, "solution.")


def blocks_answer(told: Told, blocks: Sequence[LCQP | Problem]) -> CoupledAnswer:
    """The answer of blocks."""
    result, arrays, path = told
    whole = LCQP(None, np.zeros_like(arrays.get(path + "z", np.zeros(1))))
    solution = answers.solution(result.solution, arrays, path, whole, result.job_id)
    prices = arrays.get(path + "coupled.prices", np.zeros(0))
    return model.answer_of(solution, blocks, prices, _coordination(result.solution.coupled))


def pieces_answer(told: Told, problem: LCQP | Problem | None) -> PiecesAnswer:
    """The answer of pieces, to the problem if that is known."""
    result, arrays, path = told
    known = LCQP(None, np.zeros_like(arrays.get(path + "z", np.zeros(1)))) if problem is None else compiled(problem)
    solution = answers.solution(result.solution, arrays, path, known, result.job_id)
    return PiecesAnswer(solution if problem is None else in_terms_of(problem, solution),
                        _coordination(result.solution.coupled), result.job_id)
