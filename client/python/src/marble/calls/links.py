"""A session's stream, for threads: gRPC's own, with a thread that sends, or one of many on a loop that all share."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator
from typing import Any, Final, cast

from marble import errors
from marble.base.lazy import lazy
from marble.connection.rpc import Rpc
from marble.errors import Error

grpc: Any = lazy("grpc")
loop_link: Any = lazy("marble.calls.loop_link")  # and asyncio with it

# Streams of this process that have a thread. It saves an update a tenth of its way, which is worth something in a
# control loop, and of these there are few.
_THREADS: Final = threading.BoundedSemaphore(64)


class Link:
    """A stream. What is put into it is sent once it is set up, behind what `again` has by then."""

    again: list[bytes]

    def put(self, message: bytes | None, seconds: float) -> bool:
        """Whether it was taken in time: one message at a time, the next when the server has room. None is the last."""
        raise NotImplementedError

    def receive(self) -> bytes | None:
        """Waits for the next message; None at the regular end. Raises what ended the stream otherwise."""
        raise NotImplementedError

    def begin(self) -> None:
        """All is set up."""
        raise NotImplementedError

    def end(self) -> None:
        """Lets what waits for messages go."""
        raise NotImplementedError

    def cancel(self) -> None:
        """Gives up what is under way."""
        raise NotImplementedError

    @property
    def is_active(self) -> bool:
        """Whether messages may still come and go."""
        raise NotImplementedError

    def reason(self) -> Error | None:
        """Of one that is not active: what ended it, None if that was regular."""
        raise NotImplementedError


def open_link(rpc: Rpc, first: bytes) -> Link:
    """A stream that begins with this message."""
    threads = _THREADS
    if not threads.acquire(blocking=False):
        return cast(Link, loop_link.OfLoop(rpc, first))
    try:
        return _OfThread(rpc, first, threads.release)
    except BaseException:
        threads.release()
        raise


class _OfThread(Link):
    def __init__(self, rpc: Rpc, first: bytes, ended: Callable[[], object]) -> None:
        self.again = []
        self._outbox: queue.Queue[bytes | None] = queue.Queue(maxsize=1)
        self._is_set_up = threading.Event()
        self._stream = rpc.duplex("Solver/Session", self._messages(first))
        self._stream.add_done_callback(lambda _: ended())

    def _messages(self, first: bytes) -> Iterator[bytes]:
        yield first
        self._is_set_up.wait()
        yield from self.again
        while (message := self._outbox.get()) is not None:
            yield message

    def put(self, message: bytes | None, seconds: float) -> bool:
        return is_put(self._outbox, message, seconds)

    def receive(self) -> bytes | None:
        try:
            data: bytes | None = next(self._stream, None)
            return data
        except grpc.RpcError as error:
            raise errors.from_rpc(error) from None

    def begin(self) -> None:
        self._is_set_up.set()

    def end(self) -> None:
        self._is_set_up.set()
        try:
            self._outbox.put_nowait(None)
        except queue.Full:  # nobody waits for more
            pass

    def cancel(self) -> None:
        self._stream.cancel()
        self.end()

    @property
    def is_active(self) -> bool:
        return bool(self._stream.is_active())

    def reason(self) -> Error | None:
        return None if self._stream.code() is grpc.StatusCode.OK else errors.from_rpc(self._stream)


def is_put(outbox: queue.Queue[bytes | None], message: bytes | None, seconds: float) -> bool:
    """Whether there was room in time."""
    try:
        outbox.put(message, timeout=seconds)
        return True
    except queue.Full:
        return False
