"""One call: as a message to a server, whose responses it reads, and as a call of marble._core in this process.

A transport runs a request. The requests of solves are in solve.py, scenarios.py and coupled.py; all others are Unary.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Generic, TypeVar

from marble.connection.rpc import check_deadline
from marble.errors import Unavailable
from marble.in_process import IN_PROCESS, core
from marble.message import records, requests
from marble.message.requests import Call
from marble.model import derivatives
from marble.model.lcqp import LCQP
from marble.model.solution import Progress

Result = TypeVar("Result")
Item = TypeVar("Item")
Callback = Callable[..., object]
Message = bytes | list[bytes]
"""Of a call; several of one that sends a stream."""


def no_server() -> Unavailable:
    """The error of a call that only a server has."""
    return Unavailable(f"there is no server: this client solves {IN_PROCESS} (local)")


class Request(Generic[Result]):
    """A call with one result.

    method: of the contract, such as Solver/Solve. streams: whether the server sends events, of which the last has the
    result. report: receives each Progress; None for none.
    """

    method = ""
    streams = False
    report: Callable[[Progress], object] | None = None

    def encode(self) -> Message:
        """What is sent to a server."""
        raise NotImplementedError

    def read(self, data: bytes) -> Result | None:
        """The result in a response; None of an event without one, which is passed to the callbacks."""
        raise NotImplementedError

    def compute(self, run: Run) -> Result:
        """The result by marble._core, on this thread."""
        raise no_server()

    def close(self) -> None:
        """Called once when the call has ended, however it has."""

    def wrap(self, wrapper: Callable[[Callback], Callback]) -> None:
        """Replaces each callback by what `wrapper` makes of it."""
        if self.report is not None:
            self.report = wrapper(self.report)


class Unary(Request[Result]):
    """A call that only a server has."""

    def __init__(self, method: str, message: Message, read: Callable[[bytes], Result]) -> None:
        self.method, self._message, self._read = method, message, read

    def encode(self) -> Message:
        """See Request."""
        return self._message

    def read(self, data: bytes) -> Result:
        """See Request."""
        return self._read(data)


class Stream(Generic[Item]):
    """A call with many results, which only a server has.

    method: of the contract. resumes: whether a lost stream is asked again for what was not received; else only one that
    nothing was received of.
    """

    method = ""
    resumes = False

    def encode(self) -> bytes:
        """The message, for what was not received yet."""
        raise NotImplementedError

    def read(self, data: bytes) -> Iterable[Item]:
        """The results in a response."""
        raise NotImplementedError


class Run:
    """What marble._core is given beside a problem.

    deadline: seconds, or None. stop: a Stop of marble._core, by which any thread ends the solve. open_block: solves the
    blocks of coupled problems in place of marble._core; None without.
    """

    def __init__(self, deadline: float | None, stop: Any, open_block: Any = None) -> None:
        self.deadline, self.stop, self.open_block = deadline, stop, open_block
        self.core = core()

    def call(self, problem: LCQP, call: Call, report: Callable[[Progress], object] | None) -> Any:
        """A Call of marble._core, checked."""
        if call.request_id:
            requests.check_request_id(call.request_id)
        if call.priority is not None:
            requests.priority_number(call.priority)
        requests.check_progress(call)
        main_thread = threading.get_ident() == threading.main_thread().ident
        s = call.warm_start
        start = None if s is None else (s.z, s.y, s.nu, s.xi, s.eta, s.reference_objective)
        rows = None if report is None else lambda *row: report(records.of_core(Progress, row))
        asked = None if call.sensitivity is None else derivatives.asked(call.sensitivity, problem)
        return self.core.Call(check_deadline(self.deadline), rows, call.progress_interval, call.iterate_every,
                              self.stop, main_thread, start, asked)


def core_options(options: Mapping[str, Any] | None) -> dict[str, Any]:
    """Options as marble._core takes them, checked by the contract as for a server."""
    return records.options(requests.options_message(options)) if options else {}
