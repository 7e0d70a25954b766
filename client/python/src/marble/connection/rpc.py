"""Calls of bytes on a gRPC channel, with errors as this package's exceptions."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

from marble import errors
from marble.base.checks import is_number
from marble.base.lazy import lazy
from marble.connection.patience import Patience, Tries
from marble.errors import Cancelled, Error, FailedPrecondition, InvalidArgument

grpc: Any = lazy("grpc")
background: Any = lazy("marble.connection.background")  # and asyncio with it
Answer = TypeVar("Answer")

PACKAGE = "/marble.v1."
CLOSED = "the client is closed"
_LONGEST_S = 2.0**31
_HEALTH = "/grpc.health.v1.Health/Check"
# Of the 1024 streams that a server takes on a connection by default; gRPC silently holds further calls back. The first
# connection is shared by all clients of this process for the address, and has their calls as well.
_STREAMS_OF_FIRST, _STREAMS_OF_OTHERS = 100, 900


def check_deadline(deadline: float | None) -> float | None:
    """Seconds > 0; None where there is no deadline, as of one beyond what gRPC can count."""
    if deadline is None:
        return None
    if not is_number(deadline) or not deadline > 0:
        raise InvalidArgument("deadline", "must be > 0 seconds", value=deadline)
    return deadline if deadline < _LONGEST_S else None


class _Channel:
    """A channel, and the streams on it that stay open."""

    def __init__(self, channel: Any, most: int) -> None:
        self.channel, self.most, self.streams = channel, most, 0


class Calls:
    """Channels of grpc or of grpc.aio, the caller's identity, and the default deadline.

    make: a channel, with a connection of its own or not. patience: how long calls wait for a server that is lost.
    """

    def __init__(self, make: Callable[..., Any], metadata: tuple[tuple[str, str], ...], timeout: float | None,
                 patience: Patience) -> None:
        self._make, self._is_closed = make, False
        self._channels = [_Channel(make(False), _STREAMS_OF_FIRST)]
        self._channels_access = threading.Lock()
        self._metadata = metadata
        self._timeout = check_deadline(timeout)
        self.patience = patience

    def check_open(self) -> None:
        """FailedPrecondition once it is closed."""
        if self._is_closed:
            raise FailedPrecondition(CLOSED)

    @property
    def channel(self) -> Any:
        """FailedPrecondition of a closed one."""
        self.check_open()
        return self._channels[0].channel

    def _end(self) -> list[Any]:
        """Ends the channels and all that is under way on them; each to be awaited of grpc.aio."""
        with self._channels_access:
            self._is_closed = True
        return [one.channel.close() for one in self._channels]  # waits for streams, which then leave the count

    async def ended(self) -> None:
        """Of grpc.aio: ends the channels and all that is under way on them."""
        for closing in self._end():
            await closing

    def _free_channel(self) -> _Channel:
        """One that can take another stream, which counts from now on."""
        with self._channels_access:
            if self._is_closed:
                raise FailedPrecondition(CLOSED)
            own = next((one for one in self._channels if one.streams < one.most), None)
            if own is None:
                own = _Channel(self._make(True), _STREAMS_OF_OTHERS)
                self._channels.append(own)
            own.streams += 1
            return own

    def _leave(self, own: _Channel) -> None:
        with self._channels_access:
            own.streams -= 1

    def _begun(self, begin: Callable[[], Any]) -> Any:
        try:
            return begin()
        except ValueError:  # another thread has closed the channel just now
            if self._is_closed:
                raise FailedPrecondition(CLOSED) from None
            raise

    def _deadline(self, deadline: float | None) -> float | None:
        return self._timeout if deadline is None else check_deadline(deadline)

    def tries(self, method: str, deadline: float | None = None) -> Tries:
        """Of a call that is about to begin."""
        return Tries.of(self.patience, method, self._deadline(deadline))

    def stream(self, method: str, request: bytes, seconds: float | None = None) -> Any:
        """One message sent, many received, for so many seconds at most."""
        return self._begun(lambda: self.channel.unary_stream(PACKAGE + method)(
            request, timeout=seconds, metadata=self._metadata))

    def upload(self, method: str, requests: Iterator[bytes], seconds: float | None = None) -> Any:
        """Many messages sent, one received: a future of it."""
        return self._begun(lambda: self.channel.stream_unary(PACKAGE + method).future(
            requests, timeout=seconds, metadata=self._metadata))

    def duplex(self, method: str, requests: Iterator[bytes] | None = None) -> Any:
        """Messages both ways; requests: None where they are written one by one (grpc.aio)."""
        own = self._free_channel()
        try:
            stream = self._begun(lambda: own.channel.stream_stream(PACKAGE + method)(
                requests, metadata=self._metadata))
        except BaseException:
            self._leave(own)
            raise
        stream.add_done_callback(lambda _: self._leave(own))
        return stream


class Rpc(Calls):
    """On a channel of grpc."""

    def __init__(self, make: Callable[..., Any], metadata: tuple[tuple[str, str], ...], timeout: float | None,
                 patience: Patience) -> None:
        super().__init__(make, metadata, timeout, patience)
        self._closing = threading.Event()
        self._loops: Calls | None = None
        self._loops_access = threading.Lock()

    def by_loop(self) -> Calls:
        """Calls on channels of grpc.aio's, each with a connection of its own, for the loop that all clients share."""
        async def made() -> Calls:
            return Calls(lambda _: self._make(True, grpc.aio), self._metadata, None, self.patience)

        with self._loops_access:
            if self._is_closed:
                raise FailedPrecondition(CLOSED)
            if self._loops is None:
                self._loops = background.shared().run(made())
            loops: Calls = self._loops
            return loops

    def close(self) -> None:
        """Ends the channels and all that is under way on them, or waits for a server."""
        self._end()
        self._closing.set()
        with self._loops_access:
            if self._loops is not None:
                background.shared().run(self._loops.ended())

    def pause(self, seconds: float, until: threading.Event | None = None) -> bool:
        """Waits, or until the client is closed, or until what is given instead; whether that has happened."""
        search = self.find_server(seconds)
        try:
            return (until or self._closing).wait(seconds)
        finally:
            search.cancel()

    def find_server(self, seconds: float | None = None) -> Any:
        """Searches for a lost server in the background: gRPC connects only while a call waits for a connection.

        A future: it ends when there is a server, after the seconds, or when it is cancelled.
        """
        return self._begun(lambda: self.channel.unary_unary(_HEALTH).future(
            b"", timeout=seconds, metadata=self._metadata, wait_for_ready=True))

    def repeated(self, tries: Tries, once: Callable[[float | None], Answer],
                 pause: Callable[[float], object] | None = None) -> Answer:
        """What `once` returns, which makes the call for as many seconds as it is given; again, where that may help."""
        while True:
            try:
                answer = once(tries.left())
            except Error as error:
                (pause or self.pause)(tries.pause(error))
            else:
                tries.reached()
                return answer

    def unary(self, method: str, request: bytes, seconds: float | None = None) -> Any:
        """One message sent, one received: a future of it."""
        return self._begun(lambda: self.channel.unary_unary(PACKAGE + method).future(
            request, timeout=seconds, metadata=self._metadata))

    @staticmethod
    def result(future: Any) -> bytes:
        """What a call answers; its error as this package's."""
        try:
            answer: bytes = future.result()
            return answer
        except grpc.FutureCancelledError:
            raise Cancelled("the call was cancelled") from None
        except grpc.RpcError as error:
            raise errors.from_rpc(error) from None
        except BaseException:  # Ctrl-C: the server need not finish
            future.cancel()
            raise
