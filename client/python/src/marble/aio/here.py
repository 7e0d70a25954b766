"""Solves in this process for asyncio: on threads of the loop's, so that nothing waits for them."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterable, AsyncIterator, Callable, Iterable
from typing import Any

from marble.aio.session import Session
from marble.calls.batch import BatchAnswer, BatchItem
from marble.calls.handle import Answer
from marble.calls.session_core import SessionEvent
from marble.errors import Cancelled, FailedPrecondition
from marble.in_process import session, solver
from marble.message.requests import Call
from marble.model.lcqp import LCQP
from marble.model.problem import Problem
from marble.model.solution import Progress, Solution


class _Told:
    """Rows that come on another thread, told on the loop's. What is raised there ends the solve."""

    def __init__(self, tell: Callable[..., object] | None, stop: Callable[[], object]) -> None:
        self._loop, self._tell, self._stop = asyncio.get_running_loop(), tell, stop
        self.failure: BaseException | None = None

    def __call__(self, *row: Any) -> None:
        self._loop.call_soon_threadsafe(self._here, row)

    def _here(self, row: tuple[Any, ...]) -> None:
        if self._tell is None or self.failure is not None:
            return
        try:
            self._tell(*row)
        except BaseException as error:
            self.failure = error
            self._stop()


async def on_thread(solve: Callable[..., Answer], *tell: Callable[..., object] | None) -> Answer:
    """solve(*told, stop) on another thread, where `told` tell on the loop's; to cancel the task stops it."""
    stop = solver.core().Stop()
    told = [None if one is None else _Told(one, stop.request) for one in tell]
    try:
        answer = await asyncio.to_thread(solve, *told, stop)
    except asyncio.CancelledError:
        stop.request()
        raise
    except Cancelled:
        _raise_failure(told)
        raise
    _raise_failure(told)
    return answer


def _raise_failure(told: Iterable[_Told | None]) -> None:
    for one in told:
        if one is not None and one.failure is not None:
            raise one.failure


async def batch(problems: Iterable[LCQP | Problem | BatchItem] | AsyncIterable[LCQP | Problem | BatchItem],
                call: Call) -> AsyncIterator[BatchAnswer]:
    """One after the other, in the order in which they come."""
    index = 0

    async def answers(item: LCQP | Problem | BatchItem) -> BatchAnswer:
        one, = await asyncio.to_thread(lambda: list(solver.batch([item], call)))
        return BatchAnswer(index, one.tag, one.solution, one.error)

    if isinstance(problems, AsyncIterable):
        async for item in problems:
            yield await answers(item)
            index += 1
    else:
        for item in problems:
            yield await answers(item)
            index += 1


class SessionHere(Session):
    """As marble.aio.Session; every update is solved as it comes, on a thread of the loop's."""

    def __init__(self, problem: LCQP | Problem, call: Call,
                 progress: Callable[[int, Progress], object] | None) -> None:
        self._given, self._call, self._tell = problem, call, progress
        self._session: Any = None

    async def __aenter__(self) -> Session:
        told = None if self._tell is None else _Told(self._tell, self.cancel)
        self._session = await asyncio.to_thread(session.SessionHere, self._given, self._call, told)
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
        """As marble.aio.Session.prepare; it is ready when this returns, and what is wrong is raised at once."""
        number: int = await asyncio.to_thread(self._opened().prepare, problem, **changes)
        return number

    async def send(self, problem: LCQP | Problem | None = None, **changes: Any) -> int:
        """Solves before it returns the update's number; next() has the answer."""
        number: int = await asyncio.to_thread(self._opened().send, problem, **changes)
        return number

    async def next(self) -> SessionEvent | None:
        """What came of the next of the updates sent; None if there is none."""
        event: SessionEvent | None = self._opened().next()
        return event

    async def update(self, problem: LCQP | Problem | None = None, **changes: Any) -> Solution:
        """Solves what has changed; see marble.Session.update."""
        answer: Solution = await asyncio.to_thread(self._opened().update, problem, **changes)
        return answer

    async def close(self) -> None:
        """Ends the session."""
        if self._session is not None:
            self._session.close()

    def cancel(self) -> None:
        """Gives the session up, with all that is under way."""
        if self._session is not None:
            self._session.cancel()
