"""A solve under way, and the stream of one on a server."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, Final, TypeVar

from marble import errors
from marble.base.lazy import lazy
from marble.calls.jobs import Jobs
from marble.connection.patience import Tries
from marble.connection.rpc import Rpc
from marble.errors import Cancelled
from marble.message import answers
from marble.model.lcqp import LCQP
from marble.model.problem import Problem, in_terms_of
from marble.model.solution import Progress, Solution

grpc: Any = lazy("grpc")
_METHOD: Final = "Solver/SolveStream"
Answer = TypeVar("Answer")


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
    """On a stream of a server's, and on another one where the server is lost."""

    def __init__(self, rpc: Rpc, request: bytes, deadline: float | None, problem: LCQP, given: LCQP | Problem,
                 tell: Callable[[Progress], object] | None) -> None:
        super().__init__()
        self._rpc, self._request = rpc, request
        self._given_up = threading.Event()  # no other try is made
        self._is_cancelled = False
        self._call: Any = None
        tries = rpc.tries(_METHOD, deadline)
        threading.Thread(target=self._run, args=(tries, problem, given, tell), name="marble-solve", daemon=True).start()

    def cancel(self) -> None:
        """Gives the solve up: the server stops it within one iteration, and result() raises Cancelled."""
        self._is_cancelled = True
        self._given_up.set()
        if (call := self._call) is not None:
            call.cancel()

    def stop(self) -> None:
        """Ends the solve with what it has: result() is its best iterate, of status CANCELLED.

        Where the server is lost, there is none, and result() raises Cancelled.
        """
        self._given_up.set()
        Jobs(self._rpc).cancel(self.job_id())

    def _run(self, tries: Tries, problem: LCQP, given: LCQP | Problem,
             tell: Callable[[Progress], object] | None) -> None:
        def read(data: bytes) -> Solution | None:
            return answers.read(data, problem, tell, self._accept)

        def once(seconds: float | None) -> Solution:
            self._call = call = self._rpc.stream(_METHOD, self._request, seconds)
            if self._is_cancelled:
                call.cancel()
            return read_answer(call, read)

        def pause(seconds: float) -> None:
            if self._rpc.pause(seconds, self._given_up):
                raise Cancelled("the solve was ended while its server was lost")

        try:
            self._answer.set_result(in_terms_of(given, self._rpc.repeated(tries, once, pause)))
        except BaseException as error:
            if self._call is not None:
                self._call.cancel()
            self._answer.set_exception(error)
        finally:
            self._accepted.set()


def read_answer(call: Any, read: Callable[[bytes], Answer | None]) -> Answer:
    """The answer at the stream's end: what `read` makes of its last event, and None of the others."""
    try:
        for data in call:
            if (answer := read(data)) is not None:
                return answer
    except grpc.RpcError as error:
        raise errors.from_rpc(error) from None
    raise Cancelled("the stream ended without an answer")
