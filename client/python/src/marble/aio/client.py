"""The client for asyncio."""

from __future__ import annotations

import asyncio
import contextlib
import math
import os
from collections.abc import AsyncIterable, AsyncIterator, Callable, Iterable, Mapping, Sequence
from typing import Any

from numpy.typing import ArrayLike

from marble import errors
from marble.aio import here
from marble.aio.batch import Batch
from marble.aio.rpc import AioRpc
from marble.aio.session import Session
from marble.base.lazy import lazy
from marble.base.tables import LOCAL_ADDRESS
from marble.calls.array import ArrayAnswer, ArrayItem, ArrayReader, submission_of
from marble.calls.batch import BatchAnswer, BatchItem
from marble.calls.handle import Answer
from marble.calls.jobs import result_of, submission
from marble.calls.progress import teller
from marble.connection import connect
from marble.connection.patience import Patience
from marble.connection.rpc import CLOSED, check_deadline
from marble.errors import FailedPrecondition
from marble.in_process import composite, solver
from marble.message import answers, requests
from marble.message import coupled as tied
from marble.message import scenarios as worlds
from marble.message.info import ServerInfo, server_info
from marble.message.job import Job, JobDetails, JobEvent, JobPage, JobState, Priority, Submitted, SubmittedArray
from marble.message.requests import Call, ProgressWish
from marble.model.coupled import Coupled, CoupledAnswer, Pieces, PiecesAnswer
from marble.model.derivatives import SensitivityRequest
from marble.model.lcqp import LCQP, MatrixLike
from marble.model.problem import Problem, compiled, in_terms_of, problem_of
from marble.model.scenarios import ScenarioAnswer, ScenarioLevel, Scenarios
from marble.model.solution import Progress, Solution

grpc: Any = lazy("grpc")


class Jobs:
    """As marble.Client.jobs; see there."""

    def __init__(self, rpc: AioRpc) -> None:
        self._rpc = rpc

    async def submit(self, problem: LCQP | Problem, *, options: Mapping[str, Any] | None = None,
                     priority: Priority | str | None = None, request_id: str = "", deadline: float | None = None,
                     scenarios: Scenarios | None = None, sensitivity: SensitivityRequest | None = None,
                     **more_options: Any) -> Submitted:
        """Queues a job that outlives this process, once there is room for it; see marble.Client.jobs.submit."""
        options = requests.wishes(options, more_options)
        call = Call(options, priority, request_id, sensitivity=sensitivity)
        request = submission(problem, call, scenarios)
        return answers.submitted(await self._rpc.call("Jobs/Submit", request, deadline))

    async def submit_coupled(self, blocks: Sequence[LCQP | Problem], coupling: Sequence[MatrixLike | None],
                             total: ArrayLike, *, prices: ArrayLike | None = None,
                             options: Mapping[str, Any] | None = None, priority: Priority | str | None = None,
                             request_id: str = "", deadline: float | None = None, problem_name: str = "",
                             **settings: Any) -> Submitted:
        """Queues problems that rows tie together: all as in Client.coupled and submit. coupled() has the answer."""
        settings, options = tied.split(settings, options)
        part = tied.blocks(Coupled(blocks, coupling, total, prices), settings)
        request = requests.coupled_submission(problem_name, Call(options, priority, request_id), part)
        return answers.submitted(await self._rpc.call("Jobs/Submit", request, deadline))

    async def submit_pieces(self, problem: LCQP | Problem, stages: ArrayLike, pieces: int, *, look_ahead: int = -1,
                            options: Mapping[str, Any] | None = None, priority: Priority | str | None = None,
                            request_id: str = "", deadline: float | None = None, **settings: Any) -> Submitted:
        """The same of one long problem in pieces; all as in Client.pieces. pieces() has the answer."""
        settings, options = tied.split(settings, options)
        part = tied.pieces(problem, Pieces(stages, pieces, look_ahead), settings)
        request = requests.coupled_submission(compiled(problem), Call(options, priority, request_id), part)
        return answers.submitted(await self._rpc.call("Jobs/Submit", request, deadline))

    async def submit_array(self, elements: Iterable[LCQP | Problem | Mapping[str, Any] | ArrayItem], *,
                           base: LCQP | Problem | None = None, options: Mapping[str, Any] | None = None,
                           priority: Priority | str | None = None, request_id: str = "", name: str = "",
                           deadline: float | None = None) -> SubmittedArray:
        """Queues many problems as one job, once there is room for it; see marble.Client.jobs.submit_array."""
        call = Call(options, priority, request_id)
        messages = submission_of(elements, None if base is None else compiled(base), name, call)
        return answers.submitted_array(await self._rpc.call_with_many("Jobs/SubmitArray", messages, deadline))

    async def array(self, job_id: str, *, after: int = 0,
                    problems: Sequence[LCQP | Problem] | None = None) -> AsyncIterator[ArrayAnswer]:
        """Yields the answers of an array, each once; see marble.Client.jobs.array."""
        reader = ArrayReader(job_id, after, problems)
        tries = self._rpc.tries("Jobs/ArrayResults", math.inf)
        while True:
            tries.left()
            stream = self._rpc.stream("Jobs/ArrayResults", reader.request())
            try:
                async for data in stream:
                    tries.reached()
                    yield reader.answer(data)
                return
            except grpc.RpcError as error:
                lost = errors.from_rpc(error)
            finally:
                stream.cancel()
            await asyncio.sleep(tries.pause(lost))

    async def result(self, job_id: str, *, wait: bool = False, deadline: float | None = None,
                     problem: LCQP | Problem | None = None) -> Solution:
        """The answer of a submitted job; raises what it ended with if there is none."""
        request = requests.job("JobResultRequest", job_id, wait=wait)
        return result_of(await self._rpc.call("Jobs/Result", request, deadline), problem)

    async def scenarios(self, job_id: str, *, wait: bool = False, deadline: float | None = None) -> ScenarioAnswer:
        """The same of a job that was submitted with scenarios."""
        request = requests.job("JobResultRequest", job_id, wait=wait)
        return worlds.response(await self._rpc.call("Jobs/Result", request, deadline))

    async def coupled(self, job_id: str, blocks: Sequence[LCQP | Problem], *, wait: bool = False,
                      deadline: float | None = None) -> CoupledAnswer:
        """The same of a job that was submitted with submit_coupled; `blocks` as they were, for their sizes."""
        request = requests.job("JobResultRequest", job_id, wait=wait)
        return tied.blocks_answer(tied.response(await self._rpc.call("Jobs/Result", request, deadline)), blocks)

    async def pieces(self, job_id: str, *, wait: bool = False, deadline: float | None = None,
                     problem: LCQP | Problem | None = None) -> PiecesAnswer:
        """The same of submit_pieces. problem: what was submitted, for the answer's s and t and its own terms."""
        request = requests.job("JobResultRequest", job_id, wait=wait)
        return tied.pieces_answer(tied.response(await self._rpc.call("Jobs/Result", request, deadline)), problem)

    async def list(self, *, states: Sequence[JobState | str] = (), client: str = "", limit: int = 0,
                   before: str = "") -> JobPage:
        """A page of jobs, newest first."""
        request = requests.list_jobs(tuple(states), client, limit, before)
        return answers.job_page(await self._rpc.call("Jobs/List", request))

    async def get(self, job_id: str) -> JobDetails:
        """A job with its options and its convergence."""
        return answers.job_details(await self._rpc.call("Jobs/Get", requests.job("GetJobRequest", job_id)))

    async def cancel(self, job_id: str) -> Job:
        """Ends a job, with its best iterate if it runs."""
        return answers.cancelled_job(await self._rpc.call("Jobs/Cancel", requests.job("CancelJobRequest", job_id)))

    async def delete(self, job_id: str) -> None:
        """Lets a submitted job and its answer go."""
        await self._rpc.call("Jobs/Delete", requests.job("DeleteJobRequest", job_id))

    async def watch(self, job_id: str = "", *, progress_interval: float = 0.25) -> AsyncIterator[JobEvent]:
        """Yields what happens: of one job until it has finished, of all (no id) for ever."""
        request = requests.job("WatchJobsRequest", job_id, progress_interval_s=progress_interval)
        tries = self._rpc.tries("Jobs/Watch", math.inf)
        told = False
        while True:
            tries.left()
            stream = self._rpc.stream("Jobs/Watch", request)
            try:
                async for data in stream:
                    tries.reached()
                    told = True
                    for event in answers.job_events(data):
                        yield event
                return
            except grpc.RpcError as error:
                lost = errors.from_rpc(error)
            finally:
                stream.cancel()
            if told:
                raise lost
            await asyncio.sleep(tries.pause(lost))


class Client:
    """As marble.Client; to be made and used within one event loop. `async with`, or await close()."""

    def __init__(self, address: str | Sequence[str] | None = None, *, token: str | None = None,
                 name: str | None = None, tls: bool = False, tls_ca: str | None = None,
                 tls_certificate: str | None = None, tls_key: str | None = None, tls_server_name: str | None = None,
                 timeout: float | None = None, wait: float | None = None,
                 keepalive: float | str | None = None) -> None:
        self._local, self._timeout = connect.is_local(address), check_deadline(timeout)
        patience = Patience(wait)
        self._closed = False
        self._rpc: Any
        if self._local:
            solver.core()
            self.address, self._rpc = solver.IN_PROCESS, solver.NoServer()
        else:
            who = connect.ConnectOptions.from_environment(
                token=token, name=name, tls=tls, tls_ca=tls_ca, tls_certificate=tls_certificate, tls_key=tls_key,
                tls_server_name=tls_server_name, keepalive=keepalive)
            self.address, make = connect.channels(grpc.aio, address, who)
            self._rpc = AioRpc(make, who.metadata(), timeout, patience)
        self.jobs = Jobs(self._rpc)

    async def close(self) -> None:
        """Ends the connection and all that is under way on it."""
        self._closed = True
        if not self._local:
            await self._rpc.close()

    @property
    def _here(self) -> bool:
        if self._closed:
            raise FailedPrecondition(CLOSED)
        return self._local

    async def __aenter__(self) -> Client:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def solve(self, problem: LCQP | Problem, *, options: Mapping[str, Any] | None = None,
                    priority: Priority | str | None = None, progress: ProgressWish = None,
                    deadline: float | None = None, request_id: str = "", progress_interval: float = 0.0,
                    iterate_every: int = 0, warm_start: Solution | None = None,
                    sensitivity: SensitivityRequest | None = None, **more_options: Any) -> Solution:
        """Solves; see marble.Client.solve."""
        options = requests.wishes(options, more_options)
        call = Call(options, priority, request_id, progress_interval, iterate_every, warm_start, sensitivity)
        lcqp = compiled(problem)
        tell, close = teller(progress)
        if self._here:
            return in_terms_of(problem, await self._solved(
                close, lambda told, stop: solver.solve(lcqp, call, told, self._limit(deadline), stop), tell))
        if tell is None:
            data = await self._rpc.call("Solver/Solve", requests.solve(lcqp, call), deadline)
            return in_terms_of(problem, answers.solve_response(data, lcqp))
        answer = await self._answer("Solver/SolveStream", requests.solve_stream(lcqp, call), deadline,
                                    lambda data: answers.read(data, lcqp, tell), close)
        return in_terms_of(problem, answer)

    async def scenarios(self, problem: LCQP | Problem, scenarios: Scenarios | None = None, *,
                        level: Callable[[ScenarioLevel], object] | None = None,
                        options: Mapping[str, Any] | None = None, priority: Priority | str | None = None,
                        progress: ProgressWish = None, deadline: float | None = None, request_id: str = "",
                        progress_interval: float = 0.0, **wishes: Any) -> ScenarioAnswer:
        """One plan for many worlds; see marble.Client.scenarios."""
        wish, options = worlds.wish(scenarios, wishes, options)
        call = Call(options, priority, request_id, progress_interval)
        tell, close = teller(progress)
        if self._here:
            return await self._solved(close, lambda level_told, told, stop: composite.solve_scenarios(
                problem, wish, call, level_told, told, self._limit(deadline), stop), level, tell)
        return await self._answer("Solver/SolveScenarios", worlds.solve_stream(problem, wish, call), deadline,
                                  lambda data: worlds.read(data, level, tell), close)

    async def coupled(self, blocks: Sequence[LCQP | Problem], coupling: Sequence[MatrixLike | None],
                      total: ArrayLike, *, prices: ArrayLike | None = None, options: Mapping[str, Any] | None = None,
                      priority: Priority | str | None = None, progress: ProgressWish = None,
                      deadline: float | None = None, request_id: str = "", problem_name: str = "",
                      **settings: Any) -> CoupledAnswer:
        """Problems that rows tie together; see marble.Client.coupled."""
        settings, options = tied.split(settings, options)
        wish, call = Coupled(blocks, coupling, total, prices), Call(options, priority, request_id)
        tell, close = teller(progress)
        if self._here:
            return await self._solved(close, lambda told, stop: composite.solve_coupled(
                wish, settings, call, told, self._limit(deadline), stop), tell)
        request = requests.coupled_stream(problem_name, call, tied.blocks(wish, settings))
        return tied.blocks_answer(await self._coupled(request, tell, close, deadline), blocks)

    async def pieces(self, problem: LCQP | Problem, stages: ArrayLike, pieces: int, *, look_ahead: int = -1,
                     options: Mapping[str, Any] | None = None, priority: Priority | str | None = None,
                     progress: ProgressWish = None, deadline: float | None = None, request_id: str = "",
                     **settings: Any) -> PiecesAnswer:
        """One long problem in pieces; see marble.Client.pieces."""
        settings, options = tied.split(settings, options)
        wish, call = Pieces(stages, pieces, look_ahead), Call(options, priority, request_id)
        tell, close = teller(progress)
        if self._here:
            return await self._solved(close, lambda told, stop: composite.solve_in_pieces(
                problem, wish, settings, call, told, self._limit(deadline), stop), tell)
        request = requests.coupled_stream(compiled(problem), call, tied.pieces(problem, wish, settings))
        return tied.pieces_answer(await self._coupled(request, tell, close, deadline), problem)

    def _limit(self, deadline: float | None) -> float | None:
        return self._timeout if deadline is None else deadline

    async def _solved(self, close: Callable[[], object], solve: Callable[..., Answer],
                      *tell: Callable[..., object] | None) -> Answer:
        try:
            return await here.on_thread(solve, *tell)
        finally:
            close()

    async def _coupled(self, request: bytes, tell: Callable[[Progress], object] | None, close: Callable[[], object],
                       deadline: float | None) -> tied.Told:
        return await self._answer("Solver/SolveCoupled", request, deadline, lambda data: tied.read(data, tell), close)

    async def _answer(self, method: str, request: bytes, deadline: float | None,
                      read: Callable[[bytes], Answer | None], close: Callable[[], object]) -> Answer:
        try:
            answer: Answer = await self._rpc.answer(method, request, deadline, read)
            return answer
        finally:
            close()

    async def batch(self, problems: Iterable[LCQP | Problem | BatchItem] | AsyncIterable[LCQP | Problem | BatchItem],
                    *, options: Mapping[str, Any] | None = None,
                    priority: Priority | str | None = None, **more_options: Any) -> AsyncIterator[BatchAnswer]:
        """Yields answers as they finish; `problems` may be asynchronous. See marble.Client.batch."""
        call = Call(requests.wishes(options, more_options), priority)
        if self._here:
            async for answer in here.batch(problems, call):
                yield answer
            return
        async with contextlib.aclosing(Batch(self._rpc, problems, call).answers()) as there:
            async for answer in there:
                yield answer

    def session(self, problem: LCQP | Problem, *, options: Mapping[str, Any] | None = None,
                priority: Priority | str | None = None, latest_only: bool = False, reopen: bool = True,
                progress: Callable[[int, Progress], object] | None = None, request_id: str = "",
                progress_interval: float = 0.0, iterate_every: int = 0, **more_options: Any) -> Session:
        """Sets a problem up once: `async with client.session(problem) as session`. See marble.Client.session."""
        options = requests.wishes(options, more_options)
        call = Call(options, priority, request_id, progress_interval, iterate_every)
        if self._here:
            return here.SessionHere(problem, call, progress)
        return Session(self._rpc, problem, call, latest_only, progress, reopen)

    async def info(self) -> ServerInfo:
        """What the server is."""
        return server_info(await self._rpc.call("Server/GetInfo", b""))

    def watch(self, *, progress_interval: float = 0.25) -> AsyncIterator[JobEvent]:
        """Yields what happens to all jobs that the caller may see, for ever."""
        return self.jobs.watch("", progress_interval=progress_interval)


async def solve(Q: MatrixLike | LCQP | Problem | None, g: ArrayLike | None = None,
                A: MatrixLike | None = None, b: ArrayLike | None = None, C: MatrixLike | None = None,
                d: ArrayLike | None = None, L: MatrixLike | None = None, l: ArrayLike | None = None,
                R: MatrixLike | None = None, r: ArrayLike | None = None, *, c0: float = 0.0,
                z0: ArrayLike | None = None, options: Mapping[str, Any] | None = None,
                server: str | Sequence[str] | Client | None = None, name: str = "",
                priority: Priority | str | None = None, progress: ProgressWish = None, deadline: float | None = None,
                request_id: str = "", warm_start: Solution | None = None,
                sensitivity: SensitivityRequest | None = None, **more_options: Any) -> Solution:
    """As marble.solve, awaited; `server` may be a marble.aio.Client."""
    problem = problem_of(Q, g, A, b, C, d, L, l, R, r, c0, z0, name)
    wishes = requests.wishes(options, more_options)
    if isinstance(server, Client):
        return await server.solve(problem, options=wishes, priority=priority, progress=progress, deadline=deadline,
                                  request_id=request_id, warm_start=warm_start, sensitivity=sensitivity)
    if server is None:
        server = os.environ.get("MARBLE_SERVER") or LOCAL_ADDRESS
    async with Client(server) as client:
        return await client.solve(problem, options=wishes, priority=priority, progress=progress, deadline=deadline,
                                  request_id=request_id, warm_start=warm_start, sensitivity=sensitivity)


__all__ = ["Client", "Jobs", "Session", "solve"]
