"""A session for asyncio."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from typing import Any

from numpy.typing import ArrayLike

from marble import errors
from marble.base.lazy import lazy
from marble.calls.session_core import SessionCore, SessionEvent, SessionFacts, Shift, answer_of, first_refused
from marble.errors import Cancelled, FailedPrecondition
from marble.message.requests import Call
from marble.model.derivatives import SensitivityRequest
from marble.model.lcqp import LCQP, MatrixLike
from marble.model.problem import Problem
from marble.model.solution import Progress, Solution

grpc: Any = lazy("grpc")


class Session(SessionFacts):
    """As marble.Session, awaited; from marble.aio.Client.session, set up by `async with`.

    One task may send while another one waits in next(); else one at a time.
    """

    def __init__(self, open_stream: Callable[[str], Any], problem: LCQP | Problem, call: Call, latest_only: bool,
                 progress: Callable[[int, Progress], object] | None) -> None:
        self._core = SessionCore(problem, progress)
        self._first = self._core.set_up(call, latest_only)
        self._open_stream = open_stream
        self._stream: Any = None
        self._unread: dict[int, SessionEvent] = {}
        self._first_parts: list[int] = []
        self._writing, self._reading = asyncio.Lock(), asyncio.Lock()

    async def __aenter__(self) -> Session:
        self._stream = self._open_stream("Solver/Session")
        try:
            await self._write(self._first)
            await self._read()
        except BaseException:
            self.cancel()
            raise
        return self

    async def __aexit__(self, kind: object, *_: object) -> None:
        if kind is not None:
            self.cancel()
        else:
            await self.close()

    async def _write(self, message: bytes) -> None:
        try:
            await self._stream.write(message)
        except (grpc.RpcError, asyncio.InvalidStateError):
            pass  # the reader learns why

    async def _read(self) -> SessionEvent | None:
        try:
            while (data := await self._stream.read()) is not grpc.aio.EOF:
                done, event = self._core.take(data)
                if done:
                    return event
            code = await self._stream.code()
            if code is not grpc.StatusCode.OK:
                raise errors.from_rpc(grpc.aio.AioRpcError(
                    code, await self._stream.initial_metadata(), await self._stream.trailing_metadata(),
                    await self._stream.details()))
        except grpc.RpcError as error:
            self._core.ended = True
            raise errors.from_rpc(error) from None
        except errors.Error:
            self._core.ended = True
            raise
        self._core.ended = True
        return None

    @property
    def is_open(self) -> bool:
        """Whether updates may be sent."""
        return self._stream is not None and not self._core.ended and not self._stream.done()

    async def send(self, problem: LCQP | Problem | None = None, **changes: Any) -> int:
        """Sends an update without waiting for its answer, and returns its number; see marble.Session.send."""
        if self._stream is None:
            raise FailedPrecondition("the session is not open yet: use `async with`")
        async with self._writing:
            message = self._core.update(problem, **changes)
            sequence = self._core.sequence
            await self._write(message)
            return sequence

    async def prepare(self, problem: LCQP | Problem | None = None, **changes: Any) -> int:
        """Sends the first part of an update ahead of what is not known yet; see marble.Session.prepare."""
        number = await self.send(problem, first_part=True, **changes)
        self._first_parts.append(number)
        return number

    async def next(self) -> SessionEvent | None:
        """Waits for what comes of the next of the updates sent; None after close() and the last."""
        async with self._reading:
            if self._unread:
                return self._unread.pop(min(self._unread))
            return await self._read()

    async def update(self, problem: LCQP | Problem | None = None, *, g: ArrayLike | None = None,
                     b: ArrayLike | None = None, d: ArrayLike | None = None, l: ArrayLike | None = None,
                     r: ArrayLike | None = None, c0: float | None = None, Q: MatrixLike | None = None,
                     A: MatrixLike | None = None, C: MatrixLike | None = None, L: MatrixLike | None = None,
                     R: MatrixLike | None = None, options: Mapping[str, Any] | None = None,
                     z0: ArrayLike | None = None, cold: bool = False, shift: Shift | int | None = None,
                     deadline: float | None = None,
                     sensitivity: SensitivityRequest | None = None) -> Solution:
        """Sends what has changed, and waits for the answer; see marble.Session.update."""
        sequence = await self.send(problem, g=g, b=b, d=d, l=l, r=r, c0=c0, Q=Q, A=A, C=C, L=L, R=R, options=options,
                                   z0=z0, cold=cold, shift=shift, deadline=deadline, sensitivity=sensitivity)
        async with self._reading:
            while sequence not in self._unread:
                event = await self._read()
                if event is None:
                    raise Cancelled("the session ended without an answer")
                self._unread[event.sequence] = event
            event = self._unread.pop(sequence)
            return answer_of(first_refused(self._unread, self._first_parts, sequence) or event)

    async def close(self) -> None:
        """Ends the session once everything is answered, and waits for that."""
        if self._stream is None or self._core.ended:
            return
        async with self._writing:
            self._core.ended = True
            await self._stream.done_writing()
        async with self._reading:
            while await self._read() is not None:
                pass

    def cancel(self) -> None:
        """Gives the session up, with all that is under way."""
        self._core.ended = True
        if self._stream is not None:
            self._stream.cancel()
