"""The client for asyncio: the calls of marble.Client over a transport whose results are awaited."""

from __future__ import annotations

from collections.abc import AsyncIterable, AsyncIterator, Callable, Iterable, Mapping, Sequence
from typing import Any

from numpy.typing import ArrayLike

from marble import client as threads
from marble.aio.awaited import awaited, iterated
from marble.aio.local import AioLocalTransport
from marble.aio.remote import AioRemoteTransport
from marble.aio.session import Session
from marble.calls import jobs
from marble.calls.batch import BatchAnswer, BatchItem
from marble.connection import connect
from marble.message import requests
from marble.message.job import Priority
from marble.message.progress import ProgressOption
from marble.message.requests import Call
from marble.model.derivatives import SensitivityRequest
from marble.model.lcqp import LCQP, MatrixLike
from marble.model.problem import Problem, problem_of
from marble.model.solution import Progress, Solution


class Jobs(jobs.OnTransport):
    """As marble.Client.jobs; see there."""

    submit = awaited(jobs.Jobs.submit)
    submit_coupled = awaited(jobs.Jobs.submit_coupled)
    submit_segments = awaited(jobs.Jobs.submit_segments)
    submit_array = awaited(jobs.Jobs.submit_array)
    array = iterated(jobs.Jobs.array)
    result = awaited(jobs.Jobs.result)
    scenarios = awaited(jobs.Jobs.scenarios)
    coupled = awaited(jobs.Jobs.coupled)
    segments = awaited(jobs.Jobs.segments)
    list = awaited(jobs.Jobs.list)
    get = awaited(jobs.Jobs.get)
    cancel = awaited(jobs.Jobs.cancel)
    delete = awaited(jobs.Jobs.delete)
    watch = iterated(jobs.Jobs.watch)


class Client(threads.Connected):
    """As marble.Client; to be created and used within one event loop. `async with`, or await close()."""

    _transports = (AioLocalTransport, AioRemoteTransport)
    _jobs = Jobs
    jobs: Jobs

    solve = awaited(threads.Client.solve)
    explain = awaited(threads.Client.explain)
    scenarios = awaited(threads.Client.scenarios)
    coupled = awaited(threads.Client.coupled)
    segments = awaited(threads.Client.segments)
    info = awaited(threads.Client.info)
    watch = iterated(threads.Client.watch)

    async def close(self) -> None:
        """Ends the connection and all calls on it."""
        await self._transport.close()

    async def __aenter__(self) -> Client:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    def batch(self, problems: Iterable[LCQP | Problem | BatchItem] | AsyncIterable[LCQP | Problem | BatchItem], *,
              options: Mapping[str, Any] | None = None, priority: Priority | str | None = None,
              **more_options: Any) -> AsyncIterator[BatchAnswer]:
        """Yields results as they are computed; `problems` may be asynchronous. See marble.Client.batch."""
        call = Call(requests.merged(options, more_options), priority)
        results: AsyncIterator[BatchAnswer] = self._transport.batch(problems, call)
        return results

    def session(self, problem: LCQP | Problem, *, options: Mapping[str, Any] | None = None,
                priority: Priority | str | None = None, latest_only: bool = False, reopen: bool = True,
                progress: Callable[[int, Progress], object] | None = None, request_id: str = "",
                progress_interval: float = 0.0, iterate_every: int = 0,
                answer_grace: float = requests.ANSWER_GRACE_S, **more_options: Any) -> Session:
        """Sets a problem up once: `async with client.session(problem) as session`. See marble.Client.session."""
        call = Call(requests.merged(options, more_options), priority, request_id, progress_interval, iterate_every,
                    answer_grace=answer_grace)
        session: Session = self._transport.session(problem, call, latest_only, progress, reopen)
        return session


async def solve(Q: MatrixLike | LCQP | Problem | None, g: ArrayLike | None = None,
                A: MatrixLike | None = None, b: ArrayLike | None = None, C: MatrixLike | None = None,
                d: ArrayLike | None = None, L: MatrixLike | None = None, l: ArrayLike | None = None,
                R: MatrixLike | None = None, r: ArrayLike | None = None, *, c0: float = 0.0,
                z0: ArrayLike | None = None, options: Mapping[str, Any] | None = None,
                server: str | Sequence[str] | Client | None = None, name: str = "",
                priority: Priority | str | None = None, progress: ProgressOption = None, deadline: float | None = None,
                request_id: str = "", progress_interval: float = 0.0, iterate_every: int = 0,
                warm_start: Solution | None = None,
                sensitivity: SensitivityRequest | None = None, **more_options: Any) -> Solution:
    """As marble.solve, awaited; `server` may be a marble.aio.Client."""
    problem = problem_of(Q, g, A, b, C, d, L, l, R, r, c0, z0, name)
    call: dict[str, Any] = {
        "options": requests.merged(options, more_options), "priority": priority, "progress": progress,
        "deadline": deadline, "request_id": request_id, "progress_interval": progress_interval,
        "iterate_every": iterate_every, "warm_start": warm_start, "sensitivity": sensitivity}
    if isinstance(server, Client):
        return await server.solve(problem, **call)
    async with Client(connect.server_of(server)) as client:
        return await client.solve(problem, **call)


__all__ = ["Client", "Jobs", "Session", "solve"]
