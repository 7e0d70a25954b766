"""Many problems on one stream: which is which, whoever moves the messages."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from marble import errors
from marble.message import answers, requests, wire
from marble.message.requests import Call
from marble.model.derivatives import SensitivityRequest
from marble.model.lcqp import LCQP
from marble.model.problem import Problem, compiled, in_terms_of
from marble.model.solution import Solution


@dataclass(frozen=True, eq=False)
class BatchItem:
    """One problem of many.

    tag: anything; comes back with the answer. options: in place of the batch's. request_id: for the server's log.
    sensitivity: derivatives of its answer that are wanted with it.
    """

    problem: LCQP | Problem
    tag: Any = None
    options: Mapping[str, Any] | None = None
    request_id: str = ""
    sensitivity: SensitivityRequest | None = None


@dataclass(frozen=True, eq=False)
class BatchAnswer:
    """The answer to one problem of many.

    index: its position in the batch, from 0. tag: the item's. solution: the answer, or None where error says why there
    is none.
    """

    index: int
    tag: Any
    solution: Solution | None
    error: errors.Error | None

    def result(self) -> Solution:
        """The solution; raises the error if there is none."""
        if self.solution is None:
            raise self.error or errors.ServerError("no answer")
        return self.solution


class BatchCore:
    """Which problems were sent and are not answered yet."""

    def __init__(self, call: Call) -> None:
        self._call = call
        self._sent = 0
        self._open: dict[int, tuple[BatchItem, LCQP]] = {}

    def request(self, item: LCQP | Problem | BatchItem) -> bytes:
        """The message of the next problem."""
        if not isinstance(item, BatchItem):
            item = BatchItem(item)
        call = dataclasses.replace(self._call, request_id=item.request_id, sensitivity=item.sensitivity)
        if item.options is not None:
            call = dataclasses.replace(call, options=item.options)
        lcqp = compiled(item.problem)
        if isinstance(item.problem, Problem):
            item = dataclasses.replace(item, problem=item.problem.copy())
        data = requests.batch(self._sent, lcqp, call)
        self._open[self._sent] = (item, lcqp)
        self._sent += 1
        return data

    def answer(self, data: bytes) -> BatchAnswer:
        """What came back for one of them."""
        message, arrays = wire.decode("SolveBatchResponse", data)
        item, lcqp = self._open.pop(message.tag)
        if message.WhichOneof("outcome") == "error":
            return BatchAnswer(message.tag, item.tag, None, errors.from_status(message.error))
        result = message.result
        solution = answers.solution(result.solution, arrays, "result.solution.", lcqp, result.job_id)
        return BatchAnswer(message.tag, item.tag, in_terms_of(item.problem, solution), None)
