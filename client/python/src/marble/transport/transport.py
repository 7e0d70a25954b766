"""The interface of both transports, and a solve under way."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from typing import Any, Protocol, TypeVar

from marble.calls.batch import BatchAnswer, BatchItem
from marble.calls.session import Session
from marble.message.request import Request, Stream
from marble.message.requests import Call
from marble.message.solve import SolveRequest
from marble.model.lcqp import LCQP
from marble.model.problem import Problem
from marble.model.solution import Progress, Solution


class SolveHandle:
    """A solve under way. Its methods may be called by any thread."""

    def __init__(self, cancel: Callable[[], object], stop: Callable[[], object]) -> None:
        self._cancel, self._stop = cancel, stop
        self._solution: Future[Solution] = Future()
        self._accepted = threading.Event()
        self._job_id = ""

    def result(self, timeout: float | None = None) -> Solution:
        """Waits for the solution. TimeoutError after `timeout` seconds; else the error that the solve ended with."""
        return self._solution.result(timeout)

    def done(self) -> bool:
        """Whether there is a solution, or an error."""
        return self._solution.done()

    def job_id(self, timeout: float | None = None) -> str:
        """The server's id of the job, once it has accepted it; empty if it did not, or not within `timeout` seconds."""
        self._accepted.wait(timeout)
        return self._job_id

    def cancel(self) -> None:
        """Gives the solve up: it stops within one iteration, and result() raises Cancelled."""
        self._cancel()

    def stop(self) -> None:
        """Ends the solve: result() is its best iterate, of status CANCELLED.

        If the server is lost, there is none, and result() raises Cancelled.
        """
        self._stop()

    def add_done_callback(self, happened: Callable[[SolveHandle], object]) -> None:
        """Calls happened(self) when it is done, on a thread of the handle's; at once if it is."""
        self._solution.add_done_callback(lambda _: happened(self))

    def accept(self, job_id: str) -> None:
        """Sets the job's id. For transports, as is begin()."""
        self._job_id = job_id
        self._accepted.set()

    def begin(self, solve: Callable[[], Solution]) -> None:
        """Solves on a thread of its own."""
        def run() -> None:
            try:
                self._solution.set_result(solve())
            except BaseException as error:
                self._solution.set_exception(error)
            finally:
                self._accepted.set()

        threading.Thread(target=run, name="marble-solve", daemon=True).start()


Result = TypeVar("Result")
Item = TypeVar("Item")


class Transport(Protocol):
    """Runs requests. All methods raise FailedPrecondition once it is closed.

    address: as it is shown. The transports of marble.aio have the same methods, whose results are awaited or, of
    iterators, iterated asynchronously.
    """

    address: str

    def run(self, request: Request[Result], deadline: float | None = None) -> Result:
        """The result of a request, within `deadline` seconds; None is the client's timeout."""

    def coordinate(self, request: Request[Result], deadline: float | None = None) -> Result:
        """The same of coupled problems, of which this process is the coordinator wherever the blocks are solved."""
        return self.run(request, deadline)

    def start(self, request: SolveRequest, deadline: float | None) -> SolveHandle:
        """Begins a solve."""

    def stream(self, stream: Stream[Item]) -> Iterator[Item]:
        """The results of a stream, as they come."""

    def batch(self, problems: Iterable[LCQP | Problem | BatchItem], call: Call) -> Iterator[BatchAnswer]:
        """The results of many problems."""

    def session(self, problem: LCQP | Problem, call: Call, latest_only: bool = False,
                progress: Callable[[int, Progress], object] | None = None, reopen: bool = True) -> Session:
        """An open session."""

    def subproblems(self, open_session: Callable[..., Any]) -> Callable[..., Any] | None:
        """What marble._core's loops solve their subproblems by: sessions that are opened so; None is marble._core."""

    def close(self) -> None:
        """Ends all that is under way."""
