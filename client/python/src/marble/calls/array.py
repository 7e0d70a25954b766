"""Arrays: many problems as one job."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from marble import errors
from marble.calls.batch import Answered
from marble.calls.changes import changes_of, update_encoder
from marble.errors import InvalidArgument
from marble.message import answers, requests, wire
from marble.message.request import Stream
from marble.message.requests import Call
from marble.model.derivatives import SensitivityRequest
from marble.model.lcqp import LCQP
from marble.model.problem import Problem, compiled, in_terms_of
from marble.model.solution import Solution


@dataclass(frozen=True, eq=False)
class ArrayItem:
    """One element of an array.

    problem: its own, or None: the base problem. changes: new numbers for that, by the letters of the equation.
    options: in place of those of the array that it names. warm_start: an answer of these sizes to start from.
    sensitivity: derivatives of its answer that are wanted with it.
    """

    problem: LCQP | Problem | None = None
    changes: Mapping[str, Any] | None = None
    options: Mapping[str, Any] | None = None
    warm_start: Solution | None = None
    sensitivity: SensitivityRequest | None = None


@dataclass(frozen=True, eq=False)
class ArrayAnswer(Answered):
    """The answer to one element.

    index: its position in the array, from 0. sequence: that of its answer, from 1; it stays. solution: the answer, or
    None where error says why there is none.
    """

    index: int
    sequence: int
    solution: Solution | None
    error: errors.Error | None


def _item(given: LCQP | Problem | Mapping[str, Any] | ArrayItem) -> ArrayItem:
    if isinstance(given, ArrayItem):
        return given
    return ArrayItem(changes=given) if isinstance(given, Mapping) else ArrayItem(given)


def submission_of(elements: Iterable[LCQP | Problem | Mapping[str, Any] | ArrayItem], base: LCQP | None, name: str,
                  call: Call) -> list[bytes]:
    """All messages of one submission, however often they are sent."""
    messages = [requests.array_setup(base, name, call)]
    for number, given in enumerate(elements):
        try:
            messages.append(_element(_item(given), base))
        except InvalidArgument as error:
            field = f"elements[{number}].{error.field}"
            raise type(error)(field, error.bound, index=error.index, value=error.value) from None
    messages.append(requests.array_end(len(messages) - 1))
    return messages


def _element(item: ArrayItem, base: LCQP | None) -> bytes:
    call = Call(item.options, warm_start=item.warm_start, sensitivity=item.sensitivity)
    if item.problem is not None:
        if item.changes is not None:
            raise InvalidArgument("changes", "must not come with a problem of its own")
        return requests.array_element(compiled(item.problem), None, base, call)
    if base is None:
        raise InvalidArgument("problem", "must be there where the array has no base")
    update = update_encoder(changes_of(base, None, item.changes)) if item.changes else None
    return requests.array_element(None, update, base, call)


class ArrayResults(Stream[ArrayAnswer]):
    """The results of an array after the one of sequence number `after`."""

    method, resumes = "Jobs/ArrayResults", True

    def __init__(self, job_id: str, after: int, problems: Sequence[LCQP | Problem] | None) -> None:
        self._job_id, self._after, self._problems = job_id, after, problems

    def encode(self) -> bytes:
        """See Stream."""
        return requests.job("ArrayResultsRequest", self._job_id, after=self._after)

    def read(self, data: bytes) -> Iterable[ArrayAnswer]:
        """See Stream."""
        message, arrays = wire.decode("ArrayResultsResponse", data)
        self._after = message.sequence
        index = message.index
        if message.WhichOneof("outcome") == "error":
            return (ArrayAnswer(index, message.sequence, None, errors.from_status(message.error)),)
        problem = None if self._problems is None else self._problems[index]
        solution = answers.solution(message.result.solution, arrays, "result.solution.",
                                    None if problem is None else compiled(problem), message.result.job_id)
        return (ArrayAnswer(index, message.sequence,
                            solution if problem is None else in_terms_of(problem, solution), None),)
