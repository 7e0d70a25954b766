"""Calls in this process for asyncio: on other threads, so that the loop does not wait for them."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable
from typing import Any, TypeVar

from marble.aio.batch import Source, each
from marble.aio.session import Session
from marble.calls.batch import BatchAnswer, BatchItem
from marble.calls.session_core import SessionEvent
from marble.errors import Cancelled, FailedPrecondition
from marble.in_process import core
from marble.message.request import Request, Stream
from marble.message.requests import Call
from marble.model.lcqp import LCQP
from marble.model.problem import Problem
from marble.model.solution import Progress, Solution
from marble.transport.local import LocalTransport
from marble.transport.local_session import LocalSession

Result = TypeVar("Result")
Item = TypeVar("Item")


class _Relay:
    """Calls a callback of another thread on the loop's. An exception of the callback ends the solve."""

    def __init__(self, callback: Callable[..., object], stop: Callable[[], object]) -> None:
        self._loop, self._callback, self._stop = asyncio.get_running_loop(), callback, stop
        self.failure: BaseException | None = None

    def __call__(self, *arguments: Any) -> None:
        self._loop.call_soon_threadsafe(self._pass_on, arguments)

    def _pass_on(self, arguments: tuple[Any, ...]) -> None:
        if self.failure is not None:
            return
        try:
            self._callback(*arguments)
        except BaseException as error:
            self.failure = error
            self._stop()


class AioLocalTransport:
    """As marble.transport.local.LocalTransport, awaited. To cancel the task stops the solve."""

    def __init__(self, timeout: float | None) -> None:
        self._local = LocalTransport(timeout)
        self.address = self._local.address

    async def run(self, request: Request[Result], deadline: float | None = None) -> Result:
        """See Transport; callbacks are called on the loop's thread."""
        stop = core().Stop()
        relays: list[_Relay] = []

        def relayed(callback: Callable[..., object]) -> Callable[..., object]:
            relays.append(_Relay(callback, stop.request))
            return relays[-1]

        request.wrap(relayed)
        try:
            result: Result = await asyncio.to_thread(lambda: self._local.run(request, deadline, stop))
        except asyncio.CancelledError:
            stop.request()
            raise
        except Cancelled:
            _raise_failure(relays)
            raise
        _raise_failure(relays)
        return result

    coordinate = run

    async def stream(self, stream: Stream[Item]) -> AsyncIterator[Item]:
        """See Transport."""
        for item in self._local.stream(stream):
            yield item

    async def batch(self, problems: Source, call: Call) -> AsyncIterator[BatchAnswer]:
        """One after the other, in their order."""
        index = 0

        def solved(item: LCQP | Problem | BatchItem) -> BatchAnswer:
            one, = self._local.batch([item], call)
            return BatchAnswer(index, one.tag, one.solution, one.error)

        async for item in each(problems):
            yield await asyncio.to_thread(solved, item)
            index += 1

    def session(self, problem: LCQP | Problem, call: Call, latest_only: bool = False,
                progress: Callable[[int, Progress], object] | None = None, reopen: bool = True) -> Session:
        """See Transport."""
        self._local.check_open()
        return _LocalSession(problem, call, progress)

    async def close(self) -> None:
        """See Transport."""
        self._local.close()


def _raise_failure(relays: Iterable[_Relay]) -> None:
    for relay in relays:
        if relay.failure is not None:
            raise relay.failure


class _LocalSession(Session):
    """As marble.aio.Session; each update is solved at once, on another thread."""

    def __init__(self, problem: LCQP | Problem, call: Call,
                 progress: Callable[[int, Progress], object] | None) -> None:
        self._given, self._call, self._report = problem, call, progress
        self._session: Any = None

    async def __aenter__(self) -> Session:
        report = None if self._report is None else _Relay(self._report, self.cancel)
        self._session = await asyncio.to_thread(LocalSession, self._given, self._call, report)
        self._core = self._session._core
        return self

    @property
    def is_open(self) -> bool:
        """Whether updates may be sent."""
        return self._session is not None and self._session.is_open

    def _opened(self) -> Any:
        if self._session is None:
            raise FailedPrecondition("the session is not open yet: use `async with`")
        return self._session

    async def prepare(self, problem: LCQP | Problem | None = None, **changes: Any) -> int:
        """As marble.aio.Session.prepare; returns when the preparation is complete, and raises its errors."""
        number: int = await asyncio.to_thread(self._opened().prepare, problem, **changes)
        return number

    async def send(self, problem: LCQP | Problem | None = None, **changes: Any) -> int:
        """Solves before it returns the update's number; next() has the result."""
        number: int = await asyncio.to_thread(self._opened().send, problem, **changes)
        return number

    async def next(self) -> SessionEvent | None:
        """The next result of the updates sent; None if there is none."""
        event: SessionEvent | None = self._opened().next()
        return event

    async def _update(self, problem: LCQP | Problem | None, **changes: Any) -> Solution:
        solution: Solution = await asyncio.to_thread(self._opened().update, problem, **changes)
        return solution

    async def close(self) -> None:
        """Ends the session."""
        if self._session is not None:
            self._session.close()

    def cancel(self) -> None:
        """Ends the session at once, and cancels what is under way."""
        if self._session is not None:
            self._session.cancel()
