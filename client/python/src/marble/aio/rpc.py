"""Calls on a channel of grpc.aio."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any, TypeVar

from marble import errors
from marble.base.lazy import lazy
from marble.connection.patience import Tries
from marble.connection.rpc import PACKAGE, Calls
from marble.errors import Cancelled, Error

grpc: Any = lazy("grpc")
Answer = TypeVar("Answer")


class AioRpc(Calls):
    """As connection.rpc.Rpc, awaited."""

    close = Calls.ended

    async def repeated(self, tries: Tries, once: Callable[[float | None], Awaitable[Answer]]) -> Answer:
        """What `once` returns, which makes the call for as many seconds as it is given; again, where that may help."""
        while True:
            try:
                answer = await once(tries.left())
            except Error as error:
                pause = tries.pause(error)
            else:
                tries.reached()
                return answer
            await asyncio.sleep(pause)

    async def call(self, method: str, request: bytes, deadline: float | None = None) -> bytes:
        """One message there, one back."""
        async def once(seconds: float | None) -> bytes:
            try:
                answer: bytes = await self.channel.unary_unary(PACKAGE + method)(
                    request, timeout=seconds, metadata=self._metadata)
                return answer
            except grpc.RpcError as error:
                raise errors.from_rpc(error) from None

        return await self.repeated(self.tries(method, deadline), once)

    async def call_with_many(self, method: str, requests: list[bytes], deadline: float | None = None) -> bytes:
        """Many messages there, one back."""
        async def once(seconds: float | None) -> bytes:
            try:
                answer: bytes = await self.channel.stream_unary(PACKAGE + method)(
                    iter(requests), timeout=seconds, metadata=self._metadata)
                return answer
            except grpc.RpcError as error:
                raise errors.from_rpc(error) from None

        return await self.repeated(self.tries(method, deadline), once)

    async def answer(self, method: str, request: bytes, deadline: float | None,
                     read: Callable[[bytes], Answer | None]) -> Answer:
        """The answer at a stream's end: what `read` makes of its last event, and None of the others."""
        async def once(seconds: float | None) -> Answer:
            stream = self.stream(method, request, seconds)
            try:
                async for data in stream:
                    if (answer := read(data)) is not None:
                        return answer
            except grpc.RpcError as error:
                raise errors.from_rpc(error) from None
            finally:
                stream.cancel()
            raise Cancelled("the stream ended without an answer")

        return await self.repeated(self.tries(method, deadline), once)
