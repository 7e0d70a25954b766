"""A batch for asyncio."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncGenerator, AsyncIterable, AsyncIterator, Iterable
from typing import Any

from marble import errors
from marble.base.lazy import lazy
from marble.calls.batch import BatchAnswer, BatchCore, BatchItem
from marble.connection.patience import Tries
from marble.connection.rpc import Calls
from marble.errors import Error, Unavailable
from marble.message.requests import Call
from marble.model.lcqp import LCQP
from marble.model.problem import Problem

grpc: Any = lazy("grpc")
Source = Iterable[LCQP | Problem | BatchItem] | AsyncIterable[LCQP | Problem | BatchItem]


async def each(problems: Source) -> AsyncIterator[LCQP | Problem | BatchItem]:
    """The problems one by one."""
    if isinstance(problems, AsyncIterable):
        async for item in problems:
            yield item
    else:
        for item in problems:
            yield item


class Batch:
    """One task reads the source, for all streams; another one writes to each."""

    def __init__(self, rpc: Calls, problems: Source, call: Call) -> None:
        self._rpc, self._source, self._core = rpc, each(problems), BatchCore(call)
        self._changed, self._wanted = asyncio.Event(), asyncio.Event()
        self._failure: BaseException | None = None  # of the source
        self._stream: Any = None

    async def answers(self) -> AsyncGenerator[BatchAnswer, None]:
        """One result for each problem, as they are computed."""
        tries = Tries(self._rpc.patience)
        reader = asyncio.ensure_future(self._read_source())
        try:
            while True:
                try:
                    async with contextlib.aclosing(self._answers_of_one(tries)) as one:
                        async for answer in one:
                            yield answer
                    if self._core.done and self._failure is None:
                        return
                    raise self._failure or Unavailable("the stream ended without all answers")
                except (Error, asyncio.CancelledError) as error:
                    if self._failure is not None:
                        raise self._failure from None
                    if not isinstance(error, Error):
                        raise
                    if self._core.done:
                        return
                    pause = tries.pause(error)
                await asyncio.sleep(pause)
        finally:
            reader.cancel()
            if self._stream is not None:
                self._stream.cancel()

    async def _answers_of_one(self, tries: Tries) -> AsyncGenerator[BatchAnswer, None]:
        """On one stream."""
        self._core.begin()
        tries.left()
        self._stream = stream = self._rpc.duplex("Solver/SolveBatch")
        writer = asyncio.ensure_future(self._write(stream))
        try:
            async for data in stream:
                tries.reached()
                answer = self._core.answer(data)
                self._changed.set()
                if answer is not None:
                    yield answer
        except grpc.RpcError as error:
            raise errors.from_rpc(error) from None
        finally:
            writer.cancel()
            stream.cancel()

    async def _write(self, stream: Any) -> None:
        with contextlib.suppress(grpc.RpcError, asyncio.InvalidStateError):  # the reader gets the reason
            while not self._core.done:
                self._changed.clear()
                message, seconds = self._core.due()
                if message is not None:
                    await stream.write(message)
                    continue
                self._wanted.set()
                with contextlib.suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(self._changed.wait(), seconds)
            await stream.done_writing()

    async def _read_source(self) -> None:
        try:
            await self._wanted.wait()
            async for item in self._source:
                self._wanted.clear()
                self._core.send_again(self._core.take(self._core.read(item)))
                self._changed.set()
                await self._wanted.wait()
        except asyncio.CancelledError:
            raise
        except BaseException as error:
            self._failure = error
            self._stream.cancel()
        self._core.exhausted = True
        self._changed.set()
