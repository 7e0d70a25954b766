"""A session's stream, for threads: gRPC's own, with a thread that sends, or one of many on a loop that all share."""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable, Iterator
from typing import Any, Final, Protocol, TypeVar, cast

from marble import errors
from marble.base.lazy import lazy
from marble.calls.session_core import Late
from marble.connection.rpc import Rpc
from marble.errors import Error

grpc: Any = lazy("grpc")
loop_link: Any = lazy("marble.calls.loop_link")  # and asyncio with it

# Streams of this process that have a thread. It makes an update a tenth faster, which counts in a control loop, and
# these are few.
_THREADS: Final = threading.BoundedSemaphore(64)
AHEAD: Final = 8  # messages that are read ahead; more wait at the server


class Link(Protocol):
    """A stream. Messages are sent once it is set up, after those in `again`."""

    again: list[bytes]

    def put(self, message: bytes | None, seconds: float) -> bool:
        """Whether a message was taken in time; the next is taken when the server can receive it. None is the last."""

    def receive(self, seconds: float | None = None) -> bytes | None:
        """Waits for the next message; None at the regular end. Raises what ended the stream otherwise, and Late if
        none comes in time; a later call gets it.
        """

    def begin(self) -> None:
        """Starts the sending: the session is set up."""

    def end(self) -> None:
        """Ends the sending of messages."""

    def cancel(self) -> None:
        """Cancels what is under way."""

    @property
    def is_active(self) -> bool:
        """Whether messages may still come and go."""

    def reason(self) -> Error | None:
        """Of one that is not active: what ended it, None if that was regular."""


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
        self._inbox: queue.Queue[bytes | Error | None] | None = None  # of a thread that reads, once a wait has a limit
        self._is_cancelled = False
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

    def receive(self, seconds: float | None = None) -> bytes | None:
        if self._inbox is None:
            if seconds is None:
                return self._next()
            self._inbox = queue.Queue(AHEAD)
            threading.Thread(target=self._read, args=(self._inbox,), daemon=True).start()
        return taken(self._inbox, seconds)

    def _next(self) -> bytes | None:
        try:
            data: bytes | None = next(self._stream, None)
            return data
        except grpc.RpcError as error:
            raise errors.from_rpc(error) from None

    def _read(self, inbox: queue.Queue[bytes | Error | None]) -> None:
        data: bytes | Error | None = b""
        while isinstance(data, bytes):
            try:
                data = self._next()
            except Error as error:
                data = error
            while not is_put(inbox, data, 1.0):
                if self._is_cancelled:  # data is dropped, the end never
                    with contextlib.suppress(queue.Empty):
                        inbox.get_nowait()

    def begin(self) -> None:
        self._is_set_up.set()

    def end(self) -> None:
        self._is_set_up.set()
        try:
            self._outbox.put_nowait(None)
        except queue.Full:  # no one waits for more
            pass

    def cancel(self) -> None:
        self._is_cancelled = True
        self._stream.cancel()
        self.end()

    @property
    def is_active(self) -> bool:
        return bool(self._stream.is_active())

    def reason(self) -> Error | None:
        return None if self._stream.code() is grpc.StatusCode.OK else errors.from_rpc(self._stream)


Item = TypeVar("Item")


def is_put(outbox: queue.Queue[Item], message: Item, seconds: float) -> bool:
    """Whether the queue took it in time."""
    try:
        outbox.put(message, timeout=seconds)
        return True
    except queue.Full:
        return False


def taken(inbox: queue.Queue[bytes | Error | None] | queue.SimpleQueue[bytes | Error | None],
          seconds: float | None) -> bytes | None:
    """The next message, as Link.receive; what ended the stream stays in the queue."""
    try:
        data = inbox.get(timeout=seconds)
    except queue.Empty:
        raise Late from None
    if not isinstance(data, bytes):
        inbox.put(data)
    if isinstance(data, Error):
        raise data
    return data
