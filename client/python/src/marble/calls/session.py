"""One problem again and again: set up once on the server, then only what changes is sent."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from numpy.typing import ArrayLike

from marble import errors
from marble.base.lazy import lazy
from marble.calls.session_core import SessionCore, SessionEvent, SessionFacts, Shift, answer_of, first_refused
from marble.connection.rpc import Rpc
from marble.errors import Cancelled, Error, FailedPrecondition
from marble.message.requests import Call
from marble.model.derivatives import SensitivityRequest
from marble.model.lcqp import LCQP, MatrixLike
from marble.model.problem import Problem
from marble.model.solution import Progress, Solution

grpc: Any = lazy("grpc")


class Turn:
    """A lock that its own thread must not take twice: a progress function that uses its session would wait for ever."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._owner: int | None = None

    def refuse_own(self) -> None:
        """FailedPrecondition where this thread has the lock already."""
        if self._owner == threading.get_ident():
            raise FailedPrecondition("the session is in use by the call whose progress function this is")

    def __enter__(self) -> None:
        self.refuse_own()
        self._lock.acquire()
        self._owner = threading.get_ident()

    def __exit__(self, *_: object) -> None:
        self._owner = None
        self._lock.release()


class Session(SessionFacts):
    """An open session, from Client.session. A context manager: leaving it closes it, an exception gives it up.

    One thread may send while another one waits in next(); else one thread at a time. An error of update() concerns that
    update alone, unless is_open is False afterwards: Aborted (idle for too long), Unavailable and others end it.
    """

    def __init__(self, rpc: Rpc, problem: LCQP | Problem, call: Call, latest_only: bool,
                 progress: Callable[[int, Progress], object] | None) -> None:
        self._core = SessionCore(problem, progress)
        # One message at a time: gRPC takes the next when the server has room for it.
        self._outbox: queue.Queue[bytes | None] = queue.Queue(maxsize=1)
        self._unread: dict[int, SessionEvent] = {}
        self._first_parts: list[int] = []
        self._writing, self._reading = Turn(), Turn()
        first = self._core.set_up(call, latest_only)
        self._stream = rpc.duplex("Solver/Session", self._messages(first))
        try:
            self._read()
        except BaseException:
            self._stream.cancel()
            self._finish()
            raise

    def _messages(self, first: bytes) -> Iterator[bytes]:
        yield first
        while (message := self._outbox.get()) is not None:
            yield message

    def _put(self, message: bytes | None) -> None:
        while True:
            try:
                self._outbox.put(message, timeout=0.1)
                return
            except queue.Full:
                if not self._stream.is_active():
                    raise self._reason() from None

    def _reason(self) -> Error:
        ended = self._stream.code() is grpc.StatusCode.OK
        return FailedPrecondition("the session has ended") if ended else errors.from_rpc(self._stream)

    def _finish(self) -> None:
        """Lets the thread that waits for messages go."""
        self._core.ended = True
        try:
            self._outbox.put_nowait(None)
        except queue.Full:  # nobody waits for more
            pass

    def _read(self) -> SessionEvent | None:
        """The next outcome, or None at the stream's end; the caller holds _reading."""
        try:
            for data in self._stream:
                done, event = self._core.take(data)
                if done:
                    return event
        except grpc.RpcError as error:
            self._finish()
            raise errors.from_rpc(error) from None
        self._finish()
        return None

    @property
    def is_open(self) -> bool:
        """Whether updates may be sent."""
        return not self._core.ended and bool(self._stream.is_active())

    def send(self, problem: LCQP | Problem | None = None, **changes: Any) -> int:
        """Sends an update without waiting, as update does, and returns its number; numbers ascend.

        Blocks while the server has as many waiting as it takes (64 by default): next() must be called meanwhile.
        """
        with self._writing:
            message = self._core.update(problem, **changes)
            sequence = self._core.sequence
            self._put(message)
            return sequence

    def prepare(self, problem: LCQP | Problem | None = None, **changes: Any) -> int:
        """Sends the first part of an update ahead of what is not known yet, and returns its number.

        The next update is the second part; its answer is that of one update of both, to the last bit. The server takes
        the numbers in and factorizes for the branch that the solve will begin on, and answers nothing; an error of it
        is raised by the update that follows, or comes from next(). problem and changes: as update has them, but for a
        deadline.
        """
        number = self.send(problem, first_part=True, **changes)
        self._first_parts.append(number)
        return number

    def next(self) -> SessionEvent | None:
        """Waits for what comes of the next of the updates sent, in the order it comes; None after close() and the last.

        An error that it raises is the session's end.
        """
        with self._reading:
            if self._unread:
                return self._unread.pop(min(self._unread))
            return self._read()

    def update(self, problem: LCQP | Problem | None = None, *, g: ArrayLike | None = None, b: ArrayLike | None = None,
               d: ArrayLike | None = None, l: ArrayLike | None = None, r: ArrayLike | None = None,
               c0: float | None = None, Q: MatrixLike | None = None, A: MatrixLike | None = None,
               C: MatrixLike | None = None, L: MatrixLike | None = None, R: MatrixLike | None = None,
               options: Mapping[str, Any] | None = None, z0: ArrayLike | None = None, cold: bool = False,
               shift: Shift | int | None = None, deadline: float | None = None,
               sensitivity: SensitivityRequest | None = None) -> Solution:
        """Sends what has changed, and waits for the answer; the solve starts from the last one.

        Without arguments it solves what is there. problem: a whole new one of the same sizes and patterns; what differs
        is sent. Or its parts: vectors of the sizes they had; matrices with entries where the set-up had some, or, as a
        vector, the values alone in its order.
        options: change from here on; scaling_passes is fixed. z0: start here instead. cold: forget the last answer.
        shift: the last answer moves on first; a number of stages is Shift.by_stage. deadline: seconds after the
        update's arrival from which on no answer is wanted (DeadlineExceeded; its numbers are kept). sensitivity:
        derivatives of this answer that are wanted with it, in Solution.sensitivity.
        """
        self._reading.refuse_own()
        sequence = self.send(problem, g=g, b=b, d=d, l=l, r=r, c0=c0, Q=Q, A=A, C=C, L=L, R=R, options=options, z0=z0,
                             cold=cold, shift=shift, deadline=deadline, sensitivity=sensitivity)
        with self._reading:
            while sequence not in self._unread:
                event = self._read()
                if event is None:
                    raise Cancelled("the session ended without an answer")
                self._unread[event.sequence] = event
            event = self._unread.pop(sequence)
            return answer_of(first_refused(self._unread, self._first_parts, sequence) or event)

    solve = update

    def close(self) -> None:
        """Ends the session once everything is answered, and waits for that. What was not fetched is let go."""
        if self._core.ended:
            return
        self._reading.refuse_own()
        with self._writing:
            self._core.ended = True
            try:
                self._put(None)
            except Error:
                return
        with self._reading:
            while self._read() is not None:
                pass

    def cancel(self) -> None:
        """Gives the session up, with all that is under way."""
        self._stream.cancel()
        self._finish()

    def __enter__(self) -> Session:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is not None:
            self.cancel()
        else:
            self.close()
