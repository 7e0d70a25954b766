"""A solve under way."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future

from marble.model.solution import Solution


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
