"""A session for asyncio."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from typing import Any

from marble import errors
from marble.aio.awaited import awaited
from marble.base.lazy import lazy
from marble.calls import session
from marble.calls.session_core import SessionCore, SessionEvent, SessionInfo, answer_of, first_refused
from marble.connection.patience import Tries
from marble.connection.rpc import Calls
from marble.errors import Cancelled, Error, FailedPrecondition, Unavailable
from marble.message.requests import Call
from marble.model.lcqp import LCQP
from marble.model.problem import Problem
from marble.model.solution import Progress, Solution

grpc: Any = lazy("grpc")


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
        self._unread: dict[int, SessionEvent] = {}
        self._first_parts: list[int] = []
        self._writing, self._reading = asyncio.Lock(), asyncio.Lock()
        self._again: asyncio.Task[None] | None = None

    async def __aenter__(self) -> Session:
        tries = Tries(self._rpc.patience)
        while True:
            try:
                self._stream = await self._set_up(self._first, tries)
                return self
            except Unavailable as error:
                pause = tries.pause(error)
            await asyncio.sleep(pause)

    async def __aexit__(self, kind: object, *_: object) -> None:
        if kind is not None:
            self.cancel()
        else:
            await self.close()

    async def _set_up(self, first: bytes, tries: Tries) -> Any:
        tries.left()
        stream = self._rpc.duplex("Solver/Session")
        try:
            await self._write(stream, first)
            await self._event(stream)
            tries.reached()
        except BaseException:
            stream.cancel()
            raise
        return stream

    async def _write(self, stream: Any, message: bytes) -> None:
        try:
            await stream.write(message)
        except (grpc.RpcError, asyncio.InvalidStateError):
            pass  # the reader gets the reason

    async def _event(self, stream: Any) -> SessionEvent | None:
        """The next outcome, or None at the stream's end, or once all is set up."""
        try:
            while (data := await stream.read()) is not grpc.aio.EOF:
                done, event = self._core.take(data)
                if done:
                    return event
            code = await stream.code()
            if code is not grpc.StatusCode.OK:
                raise errors.from_rpc(grpc.aio.AioRpcError(
                    code, await stream.initial_metadata(), await stream.trailing_metadata(), await stream.details()))
        except grpc.RpcError as error:
            raise errors.from_rpc(error) from None
        return None

    async def _read(self, tries: Tries | None = None) -> SessionEvent | None:
        """The next outcome, or None at the session's end; the caller holds _reading."""
        while True:
            try:
                event = await self._event(self._stream)
                if event is not None:
                    return event
                break
            except Unavailable as error:
                if not self._core.reopen or self._core.ended:
                    self._core.ended = True
                    raise
                await self._reopen(error, tries or Tries(self._rpc.patience))
            except Error:
                self._core.ended = True
                raise
        self._core.ended = True
        return None

    async def _reopen(self, error: Unavailable, tries: Tries) -> None:
        """At once, as there may be another server; then repeatedly after pauses."""
        self._stream.cancel()
        if self._again is not None:
            self._again.cancel()
        try:
            while True:
                try:
                    stream = await self._set_up(self._core.set_up_again(), tries)
                    break
                except Unavailable as again:
                    error = again
                await asyncio.sleep(tries.pause(error))
                if self._core.ended:
                    raise Cancelled("the session was given up while its server was lost")
        except (Unavailable, asyncio.CancelledError):
            raise
        except BaseException:
            self._core.ended = True
            raise
        await self._writing.acquire()
        self._stream = stream
        # A task, as the server may take the last ones only once results of the first are read. Others send after it.
        self._again = asyncio.ensure_future(self._send_again(stream, self._core.again()))
        if self._core.ended:
            self.cancel()

    async def _send_again(self, stream: Any, messages: list[bytes]) -> None:
        try:
            for message in messages:
                await self._write(stream, message)
        finally:
            self._writing.release()

    @property
    def is_open(self) -> bool:
        """Whether updates may be sent."""
        return self._stream is not None and not self._core.ended and (self._core.reopen or not self._stream.done())

    async def send(self, problem: LCQP | Problem | None = None, **changes: Any) -> int:
        """Sends an update without waiting for its answer, and returns its number; see marble.Session.send."""
        if self._stream is None:
            raise FailedPrecondition("the session is not open yet: use `async with`")
        async with self._writing:
            message = self._core.update(problem, **changes)
            sequence = self._core.sequence
            await self._write(self._stream, message)
            return sequence

    async def prepare(self, problem: LCQP | Problem | None = None, **changes: Any) -> int:
        """Sends the preparation phase of an update; see marble.Session.prepare."""
        number = await self.send(problem, first_part=True, **changes)
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
        sequence = await self.send(problem, deadline=deadline, **changes)
        tries = Tries(self._rpc.patience, deadline)
        async with self._reading:
            while sequence not in self._unread:
                try:
                    event = await self._read(tries)
                except Unavailable:
                    self._core.give_up(sequence)
                    raise
                if event is None:
                    raise Cancelled("the session ended without an answer")
                self._unread[event.sequence] = event
            event = self._unread.pop(sequence)
            return answer_of(first_refused(self._unread, self._first_parts, sequence) or event)

    async def close(self) -> None:
        """Ends the session once every update has a result, and waits for that."""
        if self._stream is None or self._core.ended:
            return
        async with self._writing:
            self._core.ended = True
            with contextlib.suppress(grpc.RpcError, asyncio.InvalidStateError):  # the reader gets the reason
                await self._stream.done_writing()
        try:
            async with self._reading:
                while await self._read() is not None:
                    pass
        except Unavailable:  # a reopened session has all results that anyone waited for
            if not self._core.reopen:
                raise

    def cancel(self) -> None:
        """Ends the session at once, and cancels what is under way."""
        self._core.ended = True
        if self._stream is not None:
            self._stream.cancel()
