"""Many problems on one stream, or on several one after the other where servers are lost."""

from __future__ import annotations

import dataclasses
import heapq
import threading
import time
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

from marble import errors
from marble.base.lazy import lazy
from marble.connection.patience import Tries
from marble.connection.rpc import Rpc
from marble.errors import Error, Refused, Unavailable
from marble.message import answers, requests, wire
from marble.message.requests import Call
from marble.model.derivatives import SensitivityRequest
from marble.model.lcqp import LCQP
from marble.model.problem import Problem, compiled, in_terms_of
from marble.model.solution import Solution

grpc: Any = lazy("grpc")
# A problem that a server does not take any more is for the next stream; should this one go on, it is sent after that.
_LEAVING_S: Final = 1.0


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


class Answered:
    """One of many problems: its solution, or the error that says why there is none."""

    solution: Solution | None
    error: errors.Error | None

    def result(self) -> Solution:
        """The solution; raises the error if there is none."""
        if self.solution is None:
            raise self.error or errors.ServerError("no answer")
        return self.solution


@dataclass(frozen=True, eq=False)
class BatchAnswer(Answered):
    """The answer to one problem of many.

    index: its position in the batch, from 0. tag: the item's. solution: the answer, or None where error says why there
    is none.
    """

    index: int
    tag: Any
    solution: Solution | None
    error: errors.Error | None


Read = tuple[BatchItem, LCQP, bytes]  # with the message


class BatchCore:
    """What was sent and is not answered yet, and what is to be sent again; does no input or output.

    Several streams follow one another, each after the loss of the one before. What a stream did not answer is sent
    again on the next one, before anything new.
    """

    def __init__(self, call: Call) -> None:
        self._call = call
        self._taken = 0
        self._open: dict[int, tuple[BatchItem, LCQP]] = {}
        self._again: deque[int] = deque()
        self._refused: list[tuple[float, int]] = []  # a heap: when to send again what there was no room for
        self.exhausted = False  # whether the source has no more

    @property
    def done(self) -> bool:
        """Whether all is answered."""
        return self.exhausted and not self._open

    def begin(self) -> None:
        """On another stream: nothing of what is open was sent on it."""
        self._again, self._refused = deque(sorted(self._open)), []

    def read(self, item: LCQP | Problem | BatchItem) -> Read:
        """The next problem of the source, made ready; what is wrong with it is raised."""
        if not isinstance(item, BatchItem):
            item = BatchItem(item)
        lcqp = compiled(item.problem)
        if isinstance(item.problem, Problem):
            item = dataclasses.replace(item, problem=item.problem.copy())
        return item, lcqp, self._message(self._taken, item, lcqp)

    def take(self, read: Read) -> int:
        """Its number; from now on it waits for an answer."""
        number = self._taken
        self._open[number] = read[:2]
        self._taken += 1
        return number

    def send_again(self, number: int) -> None:
        """It came too late for the stream that it was for."""
        self._again.append(number)

    def due(self) -> tuple[bytes | None, float | None]:
        """What is to be sent again now; else after how many seconds there is something, None if that is not known."""
        now = time.monotonic()
        while self._refused and self._refused[0][0] <= now:
            self._again.append(heapq.heappop(self._refused)[1])
        while self._again:
            if (number := self._again.popleft()) in self._open:
                return self._message(number, *self._open[number]), None
        return None, self._refused[0][0] - now if self._refused else None

    def answer(self, data: bytes) -> BatchAnswer | None:
        """What came back for one of them; None where it was refused and is sent again, or is answered already."""
        message, arrays = wire.decode("SolveBatchResponse", data)
        if message.tag not in self._open:
            return None
        item, lcqp = self._open[message.tag]
        if message.WhichOneof("outcome") == "error":
            error = errors.from_status(message.error)
            if (seconds := _pause_after(error)) is not None:
                heapq.heappush(self._refused, (time.monotonic() + seconds, message.tag))
                return None
            answer = BatchAnswer(message.tag, item.tag, None, error)
        else:
            result = message.result
            solution = answers.solution(result.solution, arrays, "result.solution.", lcqp, result.job_id)
            answer = BatchAnswer(message.tag, item.tag, in_terms_of(item.problem, solution), None)
        del self._open[message.tag]
        return answer

    def _message(self, number: int, item: BatchItem, lcqp: LCQP) -> bytes:
        return requests.batch(number, lcqp, item_call(self._call, item))


def item_call(call: Call, item: BatchItem) -> Call:
    """What accompanies one problem of a batch."""
    return dataclasses.replace(call, request_id=item.request_id, sensitivity=item.sensitivity,
                               options=call.options if item.options is None else item.options)


def _pause_after(error: Error) -> float | None:
    """After how many seconds a problem that ended so is sent again; None where that does not help."""
    if isinstance(error, Unavailable) and error.lost:
        return _LEAVING_S
    return error.retry_after if isinstance(error, Refused) else None


class Batch:
    """A batch for threads: gRPC's, of the streams, read the source, and the caller's reads the answers."""

    def __init__(self, rpc: Rpc, problems: Iterable[LCQP | Problem | BatchItem], call: Call) -> None:
        self._rpc, self._source, self._core = rpc, iter(problems), BatchCore(call)
        self._changed = threading.Condition()
        self._streams = 0  # the newest one's number
        self._stream: Any = None
        self._reads_source = False  # whether a thread does
        self._failure: BaseException | None = None  # of the source

    def answers(self) -> Iterator[BatchAnswer]:
        """One result for each problem, as they are computed."""
        tries = Tries(self._rpc.patience)
        try:
            while True:
                try:
                    yield from self._answers_of(self._begin(), tries)
                    if self._core.done:
                        return
                    raise Unavailable("the stream ended without all answers")
                except Error as error:
                    if self._failure is None:
                        if self._core.done:
                            return
                        self._rpc.pause(tries.pause(error))
                if self._failure is not None:
                    raise self._failure
        finally:
            with self._changed:
                self._streams += 1
                self._changed.notify_all()
            if self._stream is not None:
                self._stream.cancel()

    def _begin(self) -> Any:
        with self._changed:
            self._streams += 1
            self._core.begin()
            self._changed.notify_all()
        stream = self._rpc.duplex("Solver/SolveBatch", iter(partial(self._next, self._streams), None))
        with self._changed:
            self._stream = stream
            if self._failure is not None:
                stream.cancel()
        return stream

    def _answers_of(self, stream: Any, tries: Tries) -> Iterator[BatchAnswer]:
        tries.left()
        try:
            for data in stream:
                tries.reached()
                with self._changed:
                    answer = self._core.answer(data)
                    self._changed.notify_all()
                if answer is not None:
                    yield answer
        except grpc.RpcError as error:
            raise errors.from_rpc(error) from None
        finally:
            stream.cancel()

    def _next(self, stream: int) -> bytes | None:
        """What this stream sends next; None at its end. gRPC's thread waits here."""
        while self._failure is None:
            with self._changed:
                if stream != self._streams or self._core.done:
                    return None
                message, seconds = self._core.due()
                if message is not None:
                    return message
                if self._reads_source or self._core.exhausted:
                    self._changed.wait(seconds)
                    continue
                self._reads_source = True
            if (message := self._read_source(stream)) is not None:
                return message
        return None

    def _read_source(self, stream: int) -> bytes | None:
        """The message of one more problem. The lock is not held meanwhile: the source may wait for answers."""
        read: Read | None = None
        failure: BaseException | None = None
        try:
            read = self._core.read(next(self._source))
        except StopIteration:
            pass
        except BaseException as error:
            failure = error
        with self._changed:
            self._changed.notify_all()
            self._reads_source = False
            if read is None:
                self._core.exhausted, self._failure = True, failure
                if failure is not None and self._stream is not None:
                    self._stream.cancel()
                return None
            number = self._core.take(read)
            if stream == self._streams:
                return read[2]
            self._core.send_again(number)
            return None
