"""Coupled problems as messages, there and back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

from marble.base import contract
from marble.base.tables import Status
from marble.errors import FailedPrecondition, InvalidArgument
from marble.message import answers, requests, wire
from marble.message.requests import Call
from marble.message.wire import Encoder
from marble.model.coupled import Coordination, Coupled, CoupledAnswer, Pieces, PiecesAnswer
from marble.model.lcqp import LCQP, matrix, vector
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


def blocks_request(wish: Coupled, call: Call, settings: Mapping[str, Any], name: str) -> bytes:
    """A SolveStreamRequest of blocks."""
    part = _encoder(settings)
    total = vector(wish.total, "total")
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
    return requests.made_stream(name, call, part)


def pieces_request(problem: LCQP | Problem, wish: Pieces, call: Call, settings: Mapping[str, Any]) -> bytes:
    """A SolveStreamRequest of pieces."""
    part, lcqp = _encoder(settings), compiled(problem)
    stages = np.asarray(wish.stages)
    if stages.shape != lcqp.g.shape or not np.issubdtype(stages.dtype, np.integer) or stages.min(initial=0) < 0:
        raise InvalidArgument("stages", f"must be {lcqp.g.size} whole numbers >= 0, one a variable")
    pieces = Encoder("Pieces")
    pieces.integers("stages", stages)
    try:
        pieces.others(contract.message("Pieces")(pieces=wish.pieces, look_ahead=wish.look_ahead))
    except (TypeError, ValueError) as error:
        raise InvalidArgument("pieces", f"has a number of the wrong type ({error})") from None
    part.message("pieces", pieces)
    return requests.made_stream(lcqp, call, part)


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


Told = tuple[Any, answers.Arrays]


def read(data: bytes, tell: Callable[[Progress], object] | None) -> Told | None:
    """An event of the stream: its SolveResponse with its arrays, if it is the result."""
    message, arrays = wire.decode("SolveStreamResponse", data)
    kind = message.WhichOneof("event")
    if kind == "progress":
        answers.tell_rows(message, tell)
    if kind != "result":
        return None
    if not message.result.solution.HasField("coupled"):
        raise FailedPrecondition("coupled", "is not in this answer")
    return message.result, arrays


def blocks_answer(told: Told, wish: Coupled) -> CoupledAnswer:
    """The answer of blocks."""
    result, arrays = told
    sizes = [compiled(block).g.size for block in wish.blocks]
    solution = answers.solution(result.solution, arrays, "result.solution.", LCQP(None, np.zeros(sum(sizes))),
                                result.job_id)
    z = tuple(np.split(solution.z, np.cumsum(sizes)[:-1]))
    prices = arrays.get("result.solution.coupled.prices", np.zeros(0))
    return CoupledAnswer(solution.status, solution.detail, solution.objective, z, prices, solution,
                         _coordination(result.solution.coupled), result.job_id)


def pieces_answer(told: Told, problem: LCQP | Problem) -> PiecesAnswer:
    """The answer of pieces."""
    result, arrays = told
    solution = answers.solution(result.solution, arrays, "result.solution.", compiled(problem), result.job_id)
    return PiecesAnswer(in_terms_of(problem, solution), _coordination(result.solution.coupled), result.job_id)
