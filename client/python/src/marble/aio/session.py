"""A session for asyncio."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any

from marble import errors
from marble.aio.awaited import awaited
from marble.base.lazy import lazy
from marble.calls import session
from marble.calls.session_core import Late, SessionCore, SessionEvent, SessionInfo, answer_of, first_refused
from marble.connection.patience import Tries
from marble.connection.rpc import Calls
from marble.errors import Cancelled, Error, FailedPrecondition, Unavailable
from marble.message.requests import Call
from marble.model.lcqp import LCQP
from marble.model.problem import Problem
from marble.model.solution import Progress, Solution

grpc: Any = lazy("grpc")


class _Stream:
    """A stream of grpc.aio whose reads and writes may outlast the wait for them."""

    def __init__(self, call: Any) -> None:
        self.call = call
        self._reading: asyncio.Future[Any] | None = None
        self._written: asyncio.Future[None] | None = None

    def write(self, message: bytes | None) -> asyncio.Future[None]:
        """Sends a message after those before it, without waiting: ends once it is sent. None is the last."""
        self._written = asyncio.ensure_future(self._write(self._written, message))
        return self._written

    async def _write(self, before: asyncio.Future[None] | None, message: bytes | None) -> None:
        if before is not None and not before.done():
            await asyncio.wait({before})
        try:
            await (self.call.done_writing() if message is None else self.call.write(message))
        except (grpc.RpcError, asyncio.InvalidStateError, asyncio.CancelledError):
            pass  # the reader gets the reason

    async def read(self, until: float | None) -> Any:
        """The next message. Late where none has come by then: a later call gets it."""
        if self._reading is None:
            if until is None:
                return await self.call.read()
            self._reading = asyncio.ensure_future(self.call.read())
            self._reading.add_done_callback(lambda read: read.cancelled() or read.exception())  # no one may ask for it
        left = None if until is None else max(until - time.monotonic(), 0.0)
        try:
            done, _ = await asyncio.wait({self._reading}, timeout=left)
        except asyncio.CancelledError:
            self._reading.cancel()  # and the call with it
            raise
        if not done:
            raise Late
        reading, self._reading = self._reading, None
        return reading.result()

    def cancel(self) -> None:
        """Cancels what is under way."""
        self.call.cancel()


class Session(SessionInfo):
    """As marble.Session, awaited; from marble.aio.Client.session, set up by `async with`.

    One task may send while another one waits in next(); else one at a time.
    """

    def __init__(self, rpc: Calls, problem: LCQP | Problem, call: Call, latest_only: bool,
                 progress: Callable[[int, Progress], object] | None, reopen: bool) -> None:
        self._core = SessionCore(problem, progress, reopen)
        self._first = self._core.set_up(call, latest_only)
        self._rpc = rpc
        self._stream: Any = None
        self._opening: _Stream | None = None  # not set up yet
        self._open_by = 0.0
        self._unread: dict[int, SessionEvent] = {}
        self._first_parts: list[int] = []
        self._reading = asyncio.Lock()

    async def __aenter__(self) -> Session:
        tries = Tries(self._rpc.patience)
        while True:
            try:
                self._stream = await self._set_up(lambda: self._first, tries)
                return self
            except Unavailable as error:
                pause = tries.pause(error)
            await asyncio.sleep(pause)

    async def __aexit__(self, kind: object, *_: object) -> None:
        if kind is not None:
            self.cancel()
        else:
            await self.close()

    async def _set_up(self, first: Callable[[], bytes], tries: Tries, until: float | None = None) -> _Stream:
        """A stream whose session is set up. After Late the next call waits for the same one."""
        tries.left()
        stream, self._opening = self._opening, None
        if stream is not None and time.monotonic() > self._open_by:
            stream.cancel()
            stream = None
        if stream is None:
            stream, self._open_by = _Stream(self._rpc.duplex("Solver/Session")), self._core.open_by()
            stream.write(first())
        try:
            await self._event(stream, until)
            tries.reached()
        except Late:
            self._opening = stream
            raise
        except BaseException:
            stream.cancel()
            raise
        return stream

    async def _event(self, stream: _Stream, until: float | None = None) -> SessionEvent | None:
        """The next outcome, or None at the stream's end, or once all is set up. Late where it has not come in time."""
        try:
            while (data := await stream.read(until)) is not grpc.aio.EOF:
                done, event = self._core.take(data)
                if done:
                    return event
            call = stream.call
            code = await call.code()
            if code is not grpc.StatusCode.OK:
                raise errors.from_rpc(grpc.aio.AioRpcError(
                    code, await call.initial_metadata(), await call.trailing_metadata(), await call.details()))
        except grpc.RpcError as error:
            raise errors.from_rpc(error) from None
        return None

    async def _read(self, tries: Tries | None = None, until: float | None = None) -> SessionEvent | None:
        """The next outcome, or None at the session's end; the caller holds _reading. Late as of _event."""
        while True:
            try:
                if (lost := self._core.gone or self._core.lost) is not None:
                    raise lost
                event = await self._event(self._stream, until)
                if event is not None:
                    return event
                break
            except Unavailable as error:
                if not self._core.reopen or self._core.ended:
                    self._core.ended = True
                    raise
                await self._reopen(error, tries or Tries(self._rpc.patience), until)
            except Error:
                self._core.ended = True
                raise
        self._core.ended = True
        return None

    async def _reopen(self, error: Unavailable, tries: Tries, until: float | None) -> None:
        """At once, as there may be another server; then repeatedly after pauses."""
        self._core.gone = error
        self._stream.cancel()
        try:
            while True:
                try:
                    stream = await self._set_up(self._core.set_up_again, tries, until)
                    break
                except Unavailable as again:
                    error = again
                except Late:
                    raise Unavailable("the session was not set up again before the deadline") from error
                await asyncio.sleep(tries.pause(error))
                if self._core.ended:
                    raise Cancelled("the session was given up while its server was lost")
        except (Unavailable, asyncio.CancelledError):
            raise
        except BaseException:
            self._core.ended = True
            raise
        # Not awaited: the server may take the last ones only once results of the first are read. Others follow them.
        for message in self._core.again():
            stream.write(message)
        self._stream = stream
        if self._core.ended:
            self.cancel()

    @property
    def is_open(self) -> bool:
        """Whether updates may be sent."""
        return self._stream is not None and not self._core.ended and (self._core.reopen or not self._stream.call.done())

    async def send(self, problem: LCQP | Problem | None = None, **changes: Any) -> int:
        """Sends an update without waiting for its answer, and returns its number; see marble.Session.send."""
        sequence, written = self._sent(problem, changes)
        await asyncio.wait({written})
        return sequence

    def _sent(self, problem: LCQP | Problem | None, changes: dict[str, Any]) -> tuple[int, asyncio.Future[None]]:
        if self._stream is None:
            raise FailedPrecondition("the session is not open yet: use `async with`")
        message = self._core.update(problem, **changes)
        return self._core.sequence, self._stream.write(message)

    async def prepare(self, problem: LCQP | Problem | None = None, **changes: Any) -> int:
        """Sends the preparation phase of an update; see marble.Session.prepare."""
        number, _ = self._sent(problem, {"first_part": True, **changes})
        self._first_parts.append(number)
        return number

    async def next(self) -> SessionEvent | None:
        """Waits for the next result of an update; None after close() and the last one."""
        async with self._reading:
            if self._unread:
                return self._unread.pop(min(self._unread))
            return await self._read()

    update = awaited(session.Session.update)

    async def _update(self, problem: LCQP | Problem | None, *, deadline: float | None, **changes: Any) -> Solution:
        sequence, _ = self._sent(problem, {"deadline": deadline, **changes})
        until = self._core.answer_by(deadline)
        tries = Tries(self._rpc.patience, deadline)
        async with self._reading:
            while sequence not in self._unread:
                try:
                    event = await self._read(tries, until)
                except Unavailable:
                    self._core.give_up(sequence)
                    raise
                except Late:
                    assert deadline is not None
                    missed = self._core.miss(sequence, deadline)
                    if self._core.lost is not None:
                        self._stream.cancel()
                    raise missed from None
                if event is None:
                    raise Cancelled("the session ended without an answer")
                self._unread[event.sequence] = event
            event = self._unread.pop(sequence)
            return answer_of(first_refused(self._unread, self._first_parts, sequence) or event)

    async def close(self) -> None:
        """Ends the session once every update has a result, and waits for that; see marble.Session.close."""
        if self._stream is None or self._core.ended:
            return
        if self._core.is_last_missed:
            return self.cancel()
        self._core.ended = True
        self._stream.write(None)
        try:
            async with self._reading:
                while await self._read() is not None:
                    pass
        except Unavailable:  # a reopened session has all results that anyone waited for
            if not self._core.reopen:
                raise
        finally:
            if self._opening is not None:
                self._opening.cancel()

    def cancel(self) -> None:
        """Ends the session at once, and cancels what is under way."""
        self._core.ended = True
        for stream in (self._stream, self._opening):
            if stream is not None:
                stream.cancel()
