"""A session's stream that is one of many on a loop in the background."""

from __future__ import annotations

import asyncio
import queue
from typing import Any

from marble import errors
from marble.base.lazy import lazy
from marble.calls.links import AHEAD, Link, is_put, taken
from marble.connection.background import Background, shared
from marble.connection.rpc import Calls, Rpc
from marble.errors import Cancelled, Error

grpc: Any = lazy("grpc")


class OfLoop(Link):
    """As Link."""

    def __init__(self, rpc: Rpc, first: bytes) -> None:
        self.again = []
        self._outbox: queue.Queue[bytes | None] = queue.Queue(maxsize=1)
        self._inbox: queue.SimpleQueue[bytes | Error | None] = queue.SimpleQueue()  # an error or None is the end
        self._reason: Error | None = None
        self._active, self._is_full = True, False
        self._loop: Background = shared()
        self._loop.run(self._open(rpc.by_loop(), first))

    async def _open(self, calls: Calls, first: bytes) -> None:
        self._wake, self._is_set_up, self._room = asyncio.Event(), asyncio.Event(), asyncio.Event()
        self._stream = calls.duplex("Solver/Session")
        self._loop.keep(self._write(first))
        self._loop.keep(self._read())

    async def _write(self, first: bytes) -> None:
        stream = self._stream
        try:
            await stream.write(first)
            await self._is_set_up.wait()
            for message in self.again:
                await stream.write(message)
            while (newest := await self._next()) is not None:
                await stream.write(newest)
            await stream.done_writing()
        except (grpc.RpcError, asyncio.InvalidStateError, asyncio.CancelledError):
            pass  # the reader gets the reason

    async def _next(self) -> bytes | None:
        while True:
            try:
                return self._outbox.get_nowait()
            except queue.Empty:
                self._wake.clear()  # put() sets it later, on this thread
                await self._wake.wait()

    async def _read(self) -> None:
        stream = self._stream
        try:
            while (data := await stream.read()) is not grpc.aio.EOF:
                self._inbox.put(data)
                self._is_full = True  # before the size is read: receive() reads it after taking a message
                if self._inbox.qsize() >= AHEAD:
                    self._room.clear()
                    await self._room.wait()
                self._is_full = False
            code = await stream.code()
            if code is not grpc.StatusCode.OK:
                self._reason = errors.from_rpc(grpc.aio.AioRpcError(
                    code, await stream.initial_metadata(), await stream.trailing_metadata(), await stream.details()))
        except grpc.RpcError as error:
            self._reason = errors.from_rpc(error)
        except asyncio.CancelledError:
            self._reason = Cancelled("the session was given up")
        finally:
            self._active = False
            self._inbox.put(self._reason)
            self._is_set_up.set()
            self.end()

    def put(self, message: bytes | None, seconds: float) -> bool:
        """Whether it was taken in time; see Link."""
        if not is_put(self._outbox, message, seconds):
            return False
        self._loop.soon(self._wake.set)
        return True

    def receive(self, seconds: float | None = None) -> bytes | None:
        """Waits for the next message; see Link."""
        data = taken(self._inbox, seconds)
        if self._is_full:
            self._loop.soon(self._room.set)
        return data

    def begin(self) -> None:
        """Starts the sending; see Link."""
        self._loop.soon(self._is_set_up.set)

    def end(self) -> None:
        """Ends the tasks that wait for messages."""
        try:
            self._outbox.put_nowait(None)
        except queue.Full:
            pass
        self._loop.soon(self._release)

    def _release(self) -> None:
        for event in (self._is_set_up, self._wake, self._room):
            event.set()

    def cancel(self) -> None:
        """Cancels what is under way."""
        self._loop.soon(self._stream.cancel)
        self.end()

    @property
    def is_active(self) -> bool:
        """Whether messages may still come and go."""
        return self._active

    def reason(self) -> Error | None:
        """What ended it, None if that was regular."""
        return self._reason
