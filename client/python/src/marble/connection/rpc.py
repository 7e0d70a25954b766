"""Calls on a channel: bytes there, bytes back, and errors as this package's exceptions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from marble import errors
from marble.base.lazy import lazy
from marble.errors import Cancelled, InvalidArgument

grpc: Any = lazy("grpc")

PACKAGE = "/marble.v1."


def check_deadline(deadline: float | None) -> float | None:
    """Seconds > 0, or None."""
    if deadline is not None and not deadline > 0:
        raise InvalidArgument("deadline", "must be > 0 seconds", value=deadline)
    return deadline


class Calls:
    """A channel of grpc or of grpc.aio, who calls, and how long a call may take if nothing else is said."""

    def __init__(self, channel: Any, metadata: tuple[tuple[str, str], ...], timeout: float | None) -> None:
        self.channel = channel
        self._metadata = metadata
        self._timeout = check_deadline(timeout)

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
