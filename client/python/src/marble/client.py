"""A connection to a Marble server, or to several that are alike."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from typing import Any

import grpc
from numpy.typing import ArrayLike

from marble import errors
from marble.calls.batch import BatchAnswer, BatchCore, BatchItem
from marble.calls.jobs import Jobs
from marble.calls.progress import teller
from marble.calls.session import Session
from marble.connection import connect
from marble.connection.rpc import Rpc
from marble.errors import Cancelled, Error
from marble.message import answers, requests
from marble.message.info import ServerInfo, server_info
from marble.message.job import Job, JobEvent, Priority
from marble.message.requests import Call, ProgressWish
from marble.model.lcqp import LCQP, MatrixLike
from marble.model.problem import Problem, compiled, in_terms_of, problem_of
from marble.model.solution import Progress, Solution


class SolveHandle:
    """A solve under way. Its methods may be called by any thread."""

    def __init__(self, rpc: Rpc) -> None:
        self._rpc = rpc
        self._answer: Future[Solution] = Future()
        self._accepted = threading.Event()
        self._call: Any = None
        self._job_id = ""

    def result(self, timeout: float | None = None) -> Solution:
        """The answer, once it is there. TimeoutError after `timeout` seconds; else what the solve ended with."""
        return self._answer.result(timeout)

    def done(self) -> bool:
        """Whether there is an answer, or an error."""
        return self._answer.done()

    def job_id(self, timeout: float | None = None) -> str:
        """The server's id of the job, once it has accepted it; empty if it did not, or not within `timeout` seconds."""
        self._accepted.wait(timeout)
        return self._job_id

    def cancel(self) -> None:
        """Gives the solve up: the server stops it within one iteration, and result() raises Cancelled."""
        self._call.cancel()

    def stop(self) -> None:
        """Ends the solve with what it has: result() is its best iterate, of status CANCELLED."""
        Jobs(self._rpc).cancel(self.job_id())

    def add_done_callback(self, happened: Callable[[SolveHandle], object]) -> None:
        """Calls happened(self) when it is done, on a thread of the handle's; at once if it is."""
        self._answer.add_done_callback(lambda _: happened(self))

    def _start(self, call: Any, problem: LCQP, given: LCQP | Problem,
               tell: Callable[[Progress], object] | None) -> None:
        self._call = call
        threading.Thread(target=self._read, args=(problem, given, tell), name="marble-solve", daemon=True).start()

    def _accept(self, job_id: str) -> None:
        self._job_id = job_id
        self._accepted.set()

    def _read(self, problem: LCQP, given: LCQP | Problem, tell: Callable[[Progress], object] | None) -> None:
        try:
            self._answer.set_result(in_terms_of(given, _read_stream(self._call, problem, tell, self._accept)))
        except BaseException as error:
            self._call.cancel()
            self._answer.set_exception(error)
        finally:
            self._accepted.set()


def _read_stream(call: Any, problem: LCQP, tell: Callable[[Progress], object] | None,
                 accept: Callable[[str], None] = lambda _: None) -> Solution:
    try:
        for data in call:
            kind, content = answers.stream_event(data, problem)
            if kind == "accepted":
                accept(content)
            elif kind == "progress" and tell is not None:
                for row in content:
                    tell(row)
            elif kind == "result":
                answer: Solution = content
                return answer
    except grpc.RpcError as error:
        raise errors.from_rpc(error) from None
    raise Cancelled("the stream ended without an answer")


class Client:
    """A connection; thread-safe, and any number of calls may be under way at once.

    address: host:port or unix:PATH; several host:port (a list, or with commas), or every address of a name
    (dns:///host:port), are taken in turns while healthy.
    None is MARBLE_SERVER, else 127.0.0.1:50051. "local" is a `marble-server` of this process alone, from PATH.
    The connection is made by the first call, and again by a later one if it broke.
    token, name, tls…: as in ConnectOptions; None is the environment's.
    timeout: deadline in seconds of calls that have none of their own; None is none. Sessions, batches and watches have
    none.

    Raises InvalidArgument with the field, and Unavailable where "local" cannot be started. Calls raise the exceptions
    of marble.errors; one that changes nothing on the server is repeated if the server was unavailable.
    """

    def __init__(self, address: str | Sequence[str] | None = None, *, token: str | None = None,
                 name: str | None = None, tls: bool = False, tls_ca: str | None = None,
                 tls_certificate: str | None = None, tls_key: str | None = None, tls_server_name: str | None = None,
                 timeout: float | None = None) -> None:
        who = connect.ConnectOptions.from_environment(
            token=token, name=name, tls=tls, tls_ca=tls_ca, tls_certificate=tls_certificate, tls_key=tls_key,
            tls_server_name=tls_server_name)
        self.address, channel = connect.channel(grpc, address, who)
        self._rpc = Rpc(channel, who.metadata(), timeout)
        self.jobs = Jobs(self._rpc)

    def close(self) -> None:
        """Ends the connection and all that is under way on it."""
        self._rpc.channel.close()

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<marble.Client {self.address}>"

    def solve(self, problem: LCQP | Problem, *, options: Mapping[str, Any] | None = None,
              priority: Priority | str | None = None, progress: ProgressWish = None, deadline: float | None = None,
              request_id: str = "", progress_interval: float = 0.0, iterate_every: int = 0) -> Solution:
        """Solves, and waits for the answer; solved or not, its status says.

        options: solver options by name (info().options tells them). priority: None is interactive. progress: True
        shows a bar, a callable is given each Progress on this thread. deadline: seconds after which the call is given
        up (DeadlineExceeded); the option time_limit_s returns the best iterate instead. request_id,
        progress_interval, iterate_every: as in requests.Call. Ctrl-C gives the solve up.
        """
        call = Call(options, priority, request_id, progress_interval, iterate_every)
        lcqp = compiled(problem)
        tell, close = teller(progress)
        if tell is None:
            data = self._rpc.call("Solver/Solve", requests.solve(lcqp, call), deadline)
            return in_terms_of(problem, answers.solve_response(data, lcqp))
        stream = self._rpc.stream("Solver/SolveStream", requests.solve_stream(lcqp, call), deadline)
        try:
            return in_terms_of(problem, _read_stream(stream, lcqp, tell))
        finally:
            stream.cancel()
            close()

    def solve_async(self, problem: LCQP | Problem, *, options: Mapping[str, Any] | None = None,
                    priority: Priority | str | None = None, progress: Callable[[Progress], object] | None = None,
                    deadline: float | None = None, request_id: str = "", progress_interval: float = 0.0,
                    iterate_every: int = 0) -> SolveHandle:
        """Begins to solve; the handle waits, cancels or stops. As solve, but progress is told on another thread."""
        call = Call(options, priority, request_id, progress_interval, iterate_every)
        lcqp = compiled(problem)
        handle = SolveHandle(self._rpc)
        stream = self._rpc.stream("Solver/SolveStream", requests.solve_stream(lcqp, call), deadline)
        handle._start(stream, lcqp, problem.copy() if isinstance(problem, Problem) else problem, progress)
        return handle

    def batch(self, problems: Iterable[LCQP | Problem | BatchItem], *, options: Mapping[str, Any] | None = None,
              priority: Priority | str | None = None) -> Iterator[BatchAnswer]:
        """Solves many problems on one stream, and yields answers as they finish, each problem's exactly once.

        `problems` is read on a thread of gRPC's, as fast as the server takes them: it may be a generator without end.
        An item may have its own options. What `problems` raises ends the batch and is raised here, as is an invalid
        item. To leave the loop gives the rest up.
        """
        core = BatchCore(Call(options, priority))
        failure: list[BaseException] = []

        def messages() -> Iterator[bytes]:
            try:
                for item in problems:
                    yield core.request(item)
            except BaseException as error:
                failure.append(error)
                stream.cancel()

        stream = self._rpc.duplex("Solver/SolveBatch", messages())
        try:
            for data in stream:
                yield core.answer(data)
        except grpc.RpcError as error:
            if not failure:
                raise errors.from_rpc(error) from None
        finally:
            stream.cancel()
        if failure:
            raise failure[0]

    def session(self, problem: LCQP | Problem, *, options: Mapping[str, Any] | None = None,
                priority: Priority | str | None = None, latest_only: bool = False,
                progress: Callable[[int, Progress], object] | None = None, request_id: str = "",
                progress_interval: float = 0.0, iterate_every: int = 0) -> Session:
        """Sets a problem up once, to be solved again and again with new numbers.

        latest_only: an update that still waits when the next one comes is not solved, and the next one takes its
        numbers along. progress: is given the update's number and each row, within update() or next().
        priority: None is realtime. Use it as a context manager.
        """
        call = Call(options, priority, request_id, progress_interval, iterate_every)
        return Session(self._rpc, problem, call, latest_only, progress)

    def info(self) -> ServerInfo:
        """What the server is: version, limits, the schema of options, counters, and who the caller is there."""
        return server_info(self._rpc.call("Server/GetInfo", b""))

    def watch(self, *, progress_interval: float = 0.25) -> Iterator[JobEvent]:
        """Yields what happens to all jobs that the caller may see, for ever."""
        return self.jobs.watch("", progress_interval=progress_interval)


def solve(Q: MatrixLike | LCQP | Problem | None, g: ArrayLike | None = None,
          A: MatrixLike | None = None, b: ArrayLike | None = None, C: MatrixLike | None = None,
          d: ArrayLike | None = None, L: MatrixLike | None = None, l: ArrayLike | None = None,
          R: MatrixLike | None = None, r: ArrayLike | None = None, *, c0: float = 0.0, z0: ArrayLike | None = None,
          options: Mapping[str, Any] | None = None, server: str | Sequence[str] | Client | None = None,
          name: str = "", priority: Priority | str | None = None, progress: ProgressWish = None,
          deadline: float | None = None, request_id: str = "", **more_options: Any) -> Solution:
    """Solves min ½ zᵀQz + gᵀz + c0  s.t.  A z + b = 0,  C z + d ≥ 0,  0 ≤ L z + l ⊥ R z + r ≥ 0 on a server.

    Q … r, c0, z0, name: as in LCQP: dense (a vector is one row), lists or any scipy.sparse. Instead of Q and all
    other data an LCQP or a Problem may be given.
    server: an address, several, or a Client; None is the server that MARBLE_SERVER names, else 127.0.0.1:50051: the
    environment decides, not the program. "local" is one of this process alone, started by the first call and gone with
    the process.
    options, or any option by its name: solve(Q, g, max_iterations=50); global, a word of Python's own, is global_.
    priority, progress, deadline, request_id: as in Client.solve.

    Returns a Solution, solved or not: see its status, or call raise_if_unsolved(). Raises InvalidProblem and the other
    exceptions of marble.errors. Each call makes a connection of its own; a loop is faster with a Client.
    """
    problem = problem_of(Q, g, A, b, C, d, L, l, R, r, c0, z0, name)
    wishes = {**(options or {}), **more_options}
    if isinstance(server, Client):
        return server.solve(problem, options=wishes, priority=priority, progress=progress, deadline=deadline,
                            request_id=request_id)
    with Client(server) as client:
        return client.solve(problem, options=wishes, priority=priority, progress=progress, deadline=deadline,
                            request_id=request_id)


__all__ = ["Client", "Error", "Job", "SolveHandle", "solve"]
