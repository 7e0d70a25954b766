"""Calls on a channel: bytes there, bytes back, and errors as this package's exceptions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from marble import errors
from marble.base.checks import is_number
from marble.base.lazy import lazy
from marble.errors import Cancelled, FailedPrecondition, InvalidArgument

grpc: Any = lazy("grpc")

PACKAGE = "/marble.v1."
CLOSED = "the client is closed"
_LONGEST_S = 2.0**31


def check_deadline(deadline: float | None) -> float | None:
    """Seconds > 0; None where there is no deadline, as of one beyond what gRPC can count."""
    if deadline is None:
        return None
    if not is_number(deadline) or not deadline > 0:
        raise InvalidArgument("deadline", "must be > 0 seconds", value=deadline)
    return deadline if deadline < _LONGEST_S else None


class Calls:
    """A channel of grpc or of grpc.aio, who calls, and how long a call may take if nothing else is said."""

    def __init__(self, channel: Any, metadata: tuple[tuple[str, str], ...], timeout: float | None) -> None:
        self._channel, self._is_closed = channel, False
        self._metadata = metadata
        self._timeout = check_deadline(timeout)

    @property
    def channel(self) -> Any:
        """FailedPrecondition of a closed one."""
        if self._is_closed:
            raise FailedPrecondition(CLOSED)
        return self._channel

    def close(self) -> Any:
        """Ends the channel and all that is under way on it; to be awaited of grpc.aio."""
        self._is_closed = True
        return self._channel.close()

    def _deadline(self, deadline: float | None) -> float | None:
        return self._timeout if deadline is None else check_deadline(deadline)

    def stream(self, method: str, request: bytes, deadline: float | None = None) -> Any:
        """One message there, many back."""
        return self.channel.unary_stream(PACKAGE + method)(
            request, timeout=self._deadline(deadline), metadata=self._metadata)

    def endless(self, method: str, request: bytes) -> Any:
        """The same without a deadline."""
        return self.channel.unary_stream(PACKAGE + method)(request, metadata=self._metadata)

    def duplex(self, method: str, requests: Iterator[bytes] | None = None) -> Any:
        """Many there, many back; None: they are written one by one (grpc.aio)."""
        return self.channel.stream_stream(PACKAGE + method)(requests, metadata=self._metadata)


class Rpc(Calls):
    """On a channel of grpc."""

    def call(self, method: str, request: bytes, deadline: float | None = None) -> bytes:
        """One message there, one back."""
        future = self.channel.unary_unary(PACKAGE + method).future(
            request, timeout=self._deadline(deadline), metadata=self._metadata)
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
