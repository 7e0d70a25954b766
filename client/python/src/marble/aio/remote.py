"""Calls on servers for asyncio, over grpc.aio."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from typing import Any, TypeVar, cast

from marble import errors
from marble.aio.batch import Batch, Source
from marble.aio.session import Session
from marble.base.lazy import lazy
from marble.calls.batch import BatchAnswer
from marble.connection import connect
from marble.connection.connect import ConnectOptions
from marble.connection.patience import Patience, Tries
from marble.connection.rpc import PACKAGE, Calls
from marble.errors import Cancelled, Error, InvalidArgument
from marble.message.request import Message, Request, Stream
from marble.message.requests import Call
from marble.model.lcqp import LCQP
from marble.model.problem import Problem
from marble.model.solution import Progress

grpc: Any = lazy("grpc")
Result = TypeVar("Result")
Item = TypeVar("Item")


class AioRpc(Calls):
    """As connection.rpc.Rpc, awaited."""

    close = Calls.ended

    async def repeated(self, tries: Tries, once: Callable[[float | None], Awaitable[Result]]) -> Result:
        """The result of `once`, which makes the call within the seconds it is given; repeated where that may help."""
        while True:
            try:
                result = await once(tries.left())
            except Error as error:
                pause = tries.pause(error)
            else:
                tries.reached()
                return result
            await asyncio.sleep(pause)

    async def call(self, method: str, message: Message, seconds: float | None) -> bytes:
        """The response to one message, or to several."""
        several = not isinstance(message, bytes)
        begin = self.channel.stream_unary if several else self.channel.unary_unary
        response: bytes = await begin(PACKAGE + method)(iter(message) if several else message, timeout=seconds,
                                                        metadata=self._metadata)
        return response


class AioRemoteTransport:
    """As marble.transport.remote.RemoteTransport, awaited."""

    def __init__(self, address: str | Sequence[str] | None, who: ConnectOptions, timeout: float | None,
                 wait: float | None) -> None:
        patience = Patience(wait)
        self.address, make = connect.channels(grpc.aio, address, who)
        self._rpc = AioRpc(make, who.metadata(), timeout, patience)

    async def run(self, request: Request[Result], deadline: float | None = None) -> Result:
        """See Transport."""
        try:
            message = request.encode()
            return await self._rpc.repeated(self._rpc.tries(request.method, deadline),
                                            lambda seconds: self._once(request, message, seconds))
        finally:
            request.close()

    async def _once(self, request: Request[Result], message: Message, seconds: float | None) -> Result:
        result: Any
        try:
            if not (request.streams and isinstance(message, bytes)):
                result = request.read(await self._rpc.call(request.method, message, seconds))
                return cast(Result, result)
            stream = self._rpc.stream(request.method, message, seconds)
            try:
                async for data in stream:
                    if (result := request.read(data)) is not None:
                        return result
            finally:
                stream.cancel()
        except grpc.RpcError as error:
            raise errors.from_rpc(error) from None
        raise Cancelled("the stream ended without an answer")

    async def coordinate(self, request: Request[Result], deadline: float | None = None) -> Result:
        """InvalidArgument: only marble.Client coordinates blocks."""
        request.close()
        raise InvalidArgument("sessions", "is not available with asyncio: use marble.Client")

    async def stream(self, stream: Stream[Item]) -> AsyncIterator[Item]:
        """See Transport. A lost stream is opened again where that repeats nothing."""
        tries = self._rpc.tries(stream.method, math.inf)
        received = False
        while True:
            tries.left()
            messages = self._rpc.stream(stream.method, stream.encode())
            try:
                async for data in messages:
                    tries.reached()
                    received = True
                    for item in stream.read(data):
                        yield item
                return
            except grpc.RpcError as error:
                lost = errors.from_rpc(error)
            finally:
                messages.cancel()
            if received and not stream.resumes:
                raise lost
            await asyncio.sleep(tries.pause(lost))

    async def batch(self, problems: Source, call: Call) -> AsyncIterator[BatchAnswer]:
        """See Transport."""
        async with contextlib.aclosing(Batch(self._rpc, problems, call).answers()) as results:
            async for result in results:
                yield result

    def session(self, problem: LCQP | Problem, call: Call, latest_only: bool = False,
                progress: Callable[[int, Progress], object] | None = None, reopen: bool = True) -> Session:
        """See Transport."""
        return Session(self._rpc, problem, call, latest_only, progress, reopen)

    async def close(self) -> None:
        """See Transport."""
        await self._rpc.close()
