"""A session for threads: one problem, set up once on the server and solved repeatedly; only changes are sent."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

from numpy.typing import ArrayLike

from marble.calls.links import Link, open_link
from marble.calls.session_core import Late, SessionCore, SessionEvent, SessionInfo, answer_of, first_refused
from marble.calls.shift import Shift
from marble.connection.patience import Tries
from marble.connection.rpc import Rpc
from marble.errors import Cancelled, Error, FailedPrecondition, Unavailable
from marble.message.requests import Call
from marble.model.derivatives import SensitivityRequest
from marble.model.lcqp import LCQP, MatrixLike
from marble.model.problem import Problem
from marble.model.solution import Progress, Solution


class Turn:
    """A lock that its own thread must not take twice: a progress function that uses its session would deadlock."""

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


class Session(SessionInfo):
    """An open session, from Client.session. A context manager: leaving it closes it, an exception gives it up.

    One thread may send while another one waits in next(); else one thread at a time. An error of update() concerns that
    update alone, unless is_open is False afterwards: Aborted (idle for too long) and others end the session, and
    Unavailable one that is not reopened. A server that leaves 20 updates in a row without an answer counts as lost.

    With `reopen`, update() and next() set it up again if its server is lost or leaves: there, once it is back, or at
    the next one. It has all current numbers and options, starts from the last z, shifted as the updates specify, and
    the updates without a result are sent again, so that each gets one; deadlines begin anew. `reopened` counts that,
    and the next solution has it set. Unavailable, after the client's `wait` seconds or before the update's own deadline
    would pass, ends nothing: the numbers of that update are kept, and the next one tries again.
    """

    def __init__(self, rpc: Rpc, problem: LCQP | Problem, call: Call, latest_only: bool,
                 progress: Callable[[int, Progress], object] | None, reopen: bool) -> None:
        self._core = SessionCore(problem, progress, reopen)
        self._unread: dict[int, SessionEvent] = {}
        self._first_parts: list[int] = []
        self._writing, self._reading = Turn(), Turn()
        self._given_up = threading.Event()
        self._rpc, self._search = rpc, None
        self._opening: Link | None = None  # not set up yet
        self._open_by = 0.0
        self._unsent: list[bytes | None] = []
        first, tries = self._core.set_up(call, latest_only), Tries(rpc.patience)
        while True:
            try:
                self._link = self._set_up(rpc, lambda: first, tries)
                break
            except Unavailable as error:
                rpc.pause(tries.pause(error))
        self._link.begin()

    def _set_up(self, rpc: Rpc, first: Callable[[], bytes], tries: Tries, until: float | None = None) -> Link:
        """A stream whose session is set up. After Late the next call waits for the same one."""
        tries.left()
        link, self._opening = self._opening, None
        if link is not None and time.monotonic() > self._open_by:
            link.cancel()
            link = None
        if link is None:
            link, self._open_by = open_link(rpc, first()), self._core.open_by()
        try:
            self._event(link, until)
            tries.reached()
        except Late:
            self._opening = link
            raise
        except BaseException:
            link.cancel()
            raise
        return link

    def _put(self, message: bytes | None, until: float | None = None) -> None:
        """Sends what has not been sent. Until then: a server that hangs takes no more; the next call tries again."""
        self._unsent.append(message)
        link = self._link
        while link.is_active:
            left = 0.1 if until is None else min(0.1, until - time.monotonic())
            if link.put(self._unsent[0], max(left, 0.0)):
                del self._unsent[0]
            if not self._unsent or left <= 0:
                return
        self._unsent.clear()
        if not self._core.reopen:
            raise self._reason()  # else the reader reopens the session, and sends it again

    def _reason(self) -> Error:
        return self._core.lost or self._link.reason() or FailedPrecondition("the session has ended")

    def _tries(self, deadline: float | None) -> Tries | None:
        return Tries(self._rpc.patience, deadline)

    def _finish(self) -> None:
        self._core.ended = True
        self._link.end()
        if (opening := self._opening) is not None:
            opening.cancel()
        self._stop_searching()

    def _stop_searching(self) -> None:
        if self._search is not None:
            self._search.cancel()
            self._search = None

    def _event(self, link: Link, until: float | None = None) -> SessionEvent | None:
        """The next outcome, or None at the stream's end, or once all is set up. Late where it has not come in time."""
        while (data := link.receive(None if until is None else max(until - time.monotonic(), 0.0))) is not None:
            done, event = self._core.take(data)
            if done:
                return event
        return None

    def _read(self, tries: Tries | None = None, until: float | None = None) -> SessionEvent | None:
        """The next outcome, or None at the session's end; the caller holds _reading. Late as of _event."""
        while True:
            try:
                if (lost := self._core.gone or self._core.lost) is not None:
                    raise lost
                event = self._event(self._link, until)
                if event is not None:
                    return event
                break
            except Unavailable as error:
                if not self._core.reopen or self._core.ended:
                    self._finish()
                    raise
                self._reopen(self._rpc, error, tries or Tries(self._rpc.patience), until)
            except Error:
                self._finish()
                raise
        self._finish()
        return None

    def _reopen(self, rpc: Rpc, error: Unavailable, tries: Tries, until: float | None) -> None:
        """At once, as there may be another server; then repeatedly after pauses, in which gRPC searches for one."""
        self._core.gone = error
        self._link.cancel()
        try:
            while True:
                if self._search is None or self._search.done():
                    self._search = rpc.find_server()
                try:
                    link = self._set_up(rpc, self._core.set_up_again, tries, until)
                    break
                except Unavailable as again:
                    error = again
                except Late:
                    raise Unavailable("the session was not set up again before the deadline") from error
                if rpc.pause(tries.pause(error), self._given_up):
                    raise Cancelled("the session was given up while its server was lost")
        except Unavailable:
            raise
        except BaseException:
            self._finish()
            raise
        with self._writing:
            link.again = self._core.again()
            self._link = link
            self._unsent.clear()
            link.begin()
        self._stop_searching()
        if self._given_up.is_set():
            link.cancel()

    @property
    def is_open(self) -> bool:
        """Whether updates may be sent."""
        return not self._core.ended and (self._core.reopen or self._link.is_active)

    def send(self, problem: LCQP | Problem | None = None, **changes: Any) -> int:
        """Sends an update as update does, without waiting, and returns its number; numbers ascend.

        Blocks while the server's queue of updates is full (64 by default): next() must be called meanwhile.
        """
        with self._writing:
            message = self._core.update(problem, **changes)
            sequence = self._core.sequence
            self._put(message)
            return sequence

    def prepare(self, problem: LCQP | Problem | None = None, **changes: Any) -> int:
        """Sends the preparation phase of an update ahead of the numbers that are not known yet, and returns its number.

        The next update is its feedback phase, and gives the same bits as one update with both. The server factorizes
        for the branch that the solve will begin on, and returns nothing; an error is raised by the update that follows,
        or comes from next(). problem and changes: as in update, without a deadline.
        """
        number, _ = self._sent(problem, {"first_part": True, **changes})
        self._first_parts.append(number)
        return number

    def _sent(self, problem: LCQP | Problem | None, changes: dict[str, Any]) -> tuple[int, float | None]:
        """Sends an update; its number, and until when its answer is waited for. A preparation blocks for that grace."""
        with self._writing:
            message = self._core.update(problem, **changes)
            until = self._core.answer_by(changes.get("deadline"))
            self._put(message, self._core.prepared_by() if changes.get("first_part") else until)
            return self._core.sequence, until

    def next(self) -> SessionEvent | None:
        """Waits for the next result of an update, in the order of arrival; None after close() and the last one.

        An error that it raises ends the session, except Unavailable of a session that is reopened: it tries again.
        """
        with self._reading:
            if self._unread:
                return self._unread.pop(min(self._unread))
            return self._read()

    def update(self, /, problem: LCQP | Problem | None = None, *, g: ArrayLike | None = None,
               b: ArrayLike | None = None, d: ArrayLike | None = None, l: ArrayLike | None = None,
               r: ArrayLike | None = None, c0: float | None = None, Q: MatrixLike | None = None,
               A: MatrixLike | None = None, C: MatrixLike | None = None, L: MatrixLike | None = None,
               R: MatrixLike | None = None, options: Mapping[str, Any] | None = None, z0: ArrayLike | None = None,
               cold: bool = False, shift: Shift | int | None = None, deadline: float | None = None,
               sensitivity: SensitivityRequest | None = None, **more_options: Any) -> Solution:
        """Sends the changes, and waits for the solution; the solve starts from the last one.

        Without arguments it solves the current problem. problem: a new one of the same sizes and patterns; differences
        are sent. Or its parts: vectors of their sizes; matrices with entries where the set-up had some, or the values
        alone in its order, as a vector.
        options, or any option by its name: change from here on; scaling_passes is fixed. z0: start here instead. cold:
        ignore the last solution. shift: shifts the last solution first; a number of stages is Shift.by_stage. deadline:
        seconds after the update's arrival after which it is given up (DeadlineExceeded; its numbers are kept). If the
        server is silent, as one that hangs, that comes `answer_grace` later; a later answer is discarded.
        sensitivity: derivatives to compute with the solution, in Solution.sensitivity.
        """
        return self._update(problem, g=g, b=b, d=d, l=l, r=r, c0=c0, Q=Q, A=A, C=C, L=L, R=R, options=options, z0=z0,
                            cold=cold, shift=shift, deadline=deadline, sensitivity=sensitivity, **more_options)

    def _update(self, problem: LCQP | Problem | None, *, deadline: float | None, **changes: Any) -> Solution:
        self._reading.refuse_own()
        sequence, until = self._sent(problem, {"deadline": deadline, **changes})
        tries = self._tries(deadline)
        with self._reading:
            while sequence not in self._unread:
                try:
                    event = self._read(tries, until)
                except Unavailable:
                    self._core.give_up(sequence)
                    raise
                except Late:
                    assert deadline is not None
                    missed = self._core.miss(sequence, deadline)
                    if self._core.lost is not None:
                        self._link.cancel()
                    raise missed from None
                if event is None:
                    raise Cancelled("the session ended without an answer")
                self._unread[event.sequence] = event
            event = self._unread.pop(sequence)
            return answer_of(first_refused(self._unread, self._first_parts, sequence) or event)

    solve = update

    def close(self) -> None:
        """Ends the session once every update has a result, and waits for that. Drops results that were not fetched.

        It does not wait for a server that has left the last update without an answer.
        """
        if self._core.ended:
            return
        if self._core.is_last_missed:
            return self.cancel()
        self._reading.refuse_own()
        with self._writing:
            self._core.ended = True
            try:
                self._put(None)
            except Error:
                return
        try:
            with self._reading:
                while self._read() is not None:
                    pass
        except Unavailable:  # a reopened session has all results that anyone waited for
            if not self._core.reopen:
                raise

    def cancel(self) -> None:
        """Ends the session at once, and cancels what is under way."""
        self._given_up.set()
        self._link.cancel()
        self._finish()

    def __enter__(self) -> Session:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is not None:
            self.cancel()
        else:
            self.close()
