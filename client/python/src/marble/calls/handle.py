"""A solve under way, and the stream of one on a server."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from marble import errors
from marble.base.lazy import lazy
from marble.calls.jobs import Jobs
from marble.connection.rpc import Rpc
from marble.errors import Cancelled
from marble.message import answers, coupled
from marble.message import scenarios as worlds
from marble.model.lcqp import LCQP
from marble.model.problem import Problem, in_terms_of
from marble.model.scenarios import ScenarioAnswer, ScenarioLevel
from marble.model.solution import Progress, Solution

grpc: Any = lazy("grpc")


class SolveHandle:
    """A solve under way. Its methods may be called by any thread."""

    def __init__(self) -> None:
        self._answer: Future[Solution] = Future()
        self._accepted = threading.Event()
        self._job_id = ""

    def result(self, timeout: float | None = None) -> Solution:
        """The answer, once it is there. TimeoutError after `timeout` seconds; else what the solve ended with."""
        return self._answer.result(timeout)

    def done(self) -> bool:
        """Whether there is an answer, or an error."""
        return self._answer.done()

    def job_id(self, timeout: float | None = None) -> str:
        """The server's id of the job, once it has accepted it; empty if it did not, or not within `timeout` seconds."""
        self._accepted.wait(timeout)
        return self._job_id

    def cancel(self) -> None:
        """Gives the solve up: it stops within one iteration, and result() raises Cancelled."""
        raise NotImplementedError

    def stop(self) -> None:
        """Ends the solve with what it has: result() is its best iterate, of status CANCELLED."""
        raise NotImplementedError

    def add_done_callback(self, happened: Callable[[SolveHandle], object]) -> None:
        """Calls happened(self) when it is done, on a thread of the handle's; at once if it is."""
        self._answer.add_done_callback(lambda _: happened(self))

    def _accept(self, job_id: str) -> None:
        self._job_id = job_id
        self._accepted.set()


class HandleThere(SolveHandle):
    """On a stream of a server's."""

    def __init__(self, rpc: Rpc, call: Any, problem: LCQP, given: LCQP | Problem,
                 tell: Callable[[Progress], object] | None) -> None:
        super().__init__()
        self._rpc, self._call = rpc, call
        threading.Thread(target=self._read, args=(problem, given, tell), name="marble-solve", daemon=True).start()

    def cancel(self) -> None:
        """Gives the solve up: the server stops it within one iteration, and result() raises Cancelled."""
        self._call.cancel()

    def stop(self) -> None:
        """Ends the solve with what it has: result() is its best iterate, of status CANCELLED."""
        Jobs(self._rpc).cancel(self.job_id())

    def _read(self, problem: LCQP, given: LCQP | Problem, tell: Callable[[Progress], object] | None) -> None:
        try:
            self._answer.set_result(in_terms_of(given, read_stream(self._call, problem, tell, self._accept)))
        except BaseException as error:
            self._call.cancel()
            self._answer.set_exception(error)
        finally:
            self._accepted.set()


def read_stream(call: Any, problem: LCQP, tell: Callable[[Progress], object] | None,
                accept: Callable[[str], None] = lambda _: None) -> Solution:
    """The answer at the stream's end; tells progress on the way."""
    try:
        for data in call:
            kind, content = answers.stream_event(data, problem)
            if kind == "accepted":
                accept(content)
            elif kind == "progress" and tell is not None:
                for row in content:
                    tell(row)
            elif kind == "result":
                answer: Solution = content
                return answer
    except grpc.RpcError as error:
        raise errors.from_rpc(error) from None
    raise Cancelled("the stream ended without an answer")


def read_scenarios(call: Any, level: Callable[[ScenarioLevel], object] | None,
                   tell: Callable[[Progress], object] | None) -> ScenarioAnswer:
    """The same of a scenario solve."""
    try:
        for data in call:
            kind, content = worlds.stream_event(data)
            worlds.tell(kind, content, level, tell)
            if kind == "result":
                answer: ScenarioAnswer = content
                return answer
    except grpc.RpcError as error:
        raise errors.from_rpc(error) from None
    raise Cancelled("the stream ended without an answer")


def read_coupled(call: Any, tell: Callable[[Progress], object] | None) -> coupled.Told:
    """The same of a coupled solve."""
    try:
        for data in call:
            if (told := coupled.read(data, tell)) is not None:
                return told
    except grpc.RpcError as error:
        raise errors.from_rpc(error) from None
    raise Cancelled("the stream ended without an answer")
