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
from marble.model.coupled import Coordination, Coupled, CoupledAnswer, Pieces, PiecesAnswer
from marble.model.lcqp import LCQP, Vector, matrix, vector
from marble.model.problem import Problem, compiled, in_terms_of
from marble.model.solution import Progress

SETTINGS: Final = ("proximal", "max_iterations", "freeze_after", "searches", "flips", "tolerance", "joint",
                   "joint_search")


def _encoder(settings: Mapping[str, Any]) -> Encoder:
    for name in settings:
        if name not in SETTINGS:
            raise InvalidArgument(name, f"is no setting; they are {', '.join(SETTINGS)}")
    part = Encoder("Coupled")
    try:
        part.others(contract.message("Coupled")(**settings))
    except (TypeError, ValueError) as error:
        raise InvalidArgument("coupled", f"has a setting of the wrong type ({error})") from None
    return part


def blocks(wish: Coupled, settings: Mapping[str, Any]) -> Encoder:
    """A Coupled message of blocks."""
    part = _encoder(settings)
    total = vector(wish.total, "total")
    if not wish.blocks:
        raise InvalidArgument("blocks", "must be at least one")
    if len(wish.coupling) != len(wish.blocks):
        raise InvalidArgument("coupling", f"must be {len(wish.blocks)}, one a block", value=len(wish.coupling))
    for k, (block, coupling) in enumerate(zip(wish.blocks, wish.coupling, strict=True)):
        lcqp = compiled(block)
        one = Encoder("CoupledBlock")
        one.message("problem", requests.problem_encoder(lcqp))
        if coupling is not None:
            rows = matrix(coupling, f"coupling[{k}]", lcqp.g.size, total.size)
            one.message("coupling", requests.matrix_encoder(rows))
        part.message("blocks", one)
    part.doubles("total", total)
    if wish.prices is not None:
        part.doubles("prices", vector(wish.prices, "prices", total.size))
    return part


def pieces(problem: LCQP | Problem, wish: Pieces, settings: Mapping[str, Any]) -> Encoder:
    """A Coupled message of a problem in pieces."""
    part, lcqp = _encoder(settings), compiled(problem)
    stages = np.asarray(wish.stages)
    if stages.shape != lcqp.g.shape or not np.issubdtype(stages.dtype, np.integer) or stages.min(initial=0) < 0:
        raise InvalidArgument("stages", f"must be {lcqp.g.size} whole numbers >= 0, one a variable")
    cut = Encoder("Pieces")
    cut.integers("stages", stages)
    try:
        cut.others(contract.message("Pieces")(pieces=wish.pieces, look_ahead=wish.look_ahead))
    except (TypeError, ValueError) as error:
        raise InvalidArgument("pieces", f"has a number of the wrong type ({error})") from None
    part.message("pieces", cut)
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


def split(blocks: Sequence[LCQP | Problem], z: Vector) -> tuple[Vector, ...]:
    """The vectors of the blocks."""
    sizes = [compiled(block).g.size for block in blocks]
    if sum(sizes) != z.size:
        raise InvalidArgument("blocks", f"must have {z.size} variables, as the answer has", value=sum(sizes))
    return tuple(np.split(z, np.cumsum(sizes)[:-1]))


def blocks_answer(told: Told, blocks: Sequence[LCQP | Problem]) -> CoupledAnswer:
    """The answer of blocks."""
    result, arrays, path = told
    whole = LCQP(None, np.zeros_like(arrays.get(path + "z", np.zeros(1))))
    solution = answers.solution(result.solution, arrays, path, whole, result.job_id)
    return CoupledAnswer(solution.status, solution.detail, solution.objective, split(blocks, solution.z),
                         arrays.get(path + "coupled.prices", np.zeros(0)), solution,
                         _coordination(result.solution.coupled), result.job_id)


def pieces_answer(told: Told, problem: LCQP | Problem | None) -> PiecesAnswer:
    """The answer of pieces, to the problem if that is known."""
    result, arrays, path = told
    known = LCQP(None, np.zeros_like(arrays.get(path + "z", np.zeros(1)))) if problem is None else compiled(problem)
    solution = answers.solution(result.solution, arrays, path, known, result.job_id)
    return PiecesAnswer(solution if problem is None else in_terms_of(problem, solution),
                        _coordination(result.solution.coupled), result.job_id)
