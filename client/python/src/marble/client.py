"""The client for threads, and a solve by one function."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from numpy.typing import ArrayLike

from marble.base.html import table
from marble.base.tables import LOCAL_ADDRESS
from marble.calls.batch import BatchAnswer, BatchItem
from marble.calls.jobs import Jobs
from marble.calls.session import Session
from marble.connection import connect
from marble.connection.rpc import check_deadline
from marble.errors import Error
from marble.in_process import IN_PROCESS
from marble.message import coupled as coupled_problems
from marble.message import requests
from marble.message import scenarios as two_stage
from marble.message.info import ServerInfo, server_info
from marble.message.job import Job, JobEvent, Priority
from marble.message.progress import ProgressOption
from marble.message.request import Unary
from marble.message.requests import Call
from marble.message.solve import SolveRequest
from marble.model.coupled import Coupled, CoupledSolution, Segments, SegmentsSolution
from marble.model.derivatives import SensitivityRequest
from marble.model.lcqp import LCQP, MatrixLike
from marble.model.problem import Problem, problem_of, without_objective
from marble.model.scenarios import SampleAverageStage, Scenarios, ScenarioSolution
from marble.model.solution import Progress, Solution
from marble.transport.local import LocalTransport
from marble.transport.remote import RemoteTransport
from marble.transport.transport import SolveHandle, Transport


class Connected:
    """What marble.Client and marble.aio.Client have in common: their transport."""

    _transports: tuple[Callable[..., Any], Callable[..., Any]]
    _jobs: Callable[[Any], Any]

    def __init__(self, address: str | Sequence[str] | None = None, *, token: str | None = None,
                 name: str | None = None, tls: bool = False, tls_ca: str | None = None,
                 tls_certificate: str | None = None, tls_key: str | None = None, tls_server_name: str | None = None,
                 timeout: float | None = None, wait: float | None = None,
                 keepalive: float | str | None = None) -> None:
        local, remote = self._transports
        timeout = check_deadline(timeout)
        self._transport = local(timeout) if connect.named(address) == LOCAL_ADDRESS else remote(
            address, connect.ConnectOptions.from_environment(
                token=token, name=name, tls=tls, tls_ca=tls_ca, tls_certificate=tls_certificate, tls_key=tls_key,
                tls_server_name=tls_server_name, keepalive=keepalive), timeout, wait)
        self.address: str = self._transport.address
        self.jobs = self._jobs(self._transport)


class Client(Connected):
    """A connection to a server, or to several that are alike; thread-safe, for any number of calls at once.

    address: host:port or unix:PATH; several host:port (a list, or with commas), or every address of a name
    (dns:///host:port), are used in turns while healthy.
    None is MARBLE_SERVER, else 127.0.0.1:50051. "local" uses no server: solves run in this process, in the threads that
    call them, and give the same bits; jobs, info() and watch() raise Unavailable then, for only a server has them.
    The first call opens the connection, and a later one opens it again if it broke.
    token, name, tls…, keepalive: as in ConnectOptions; None is the environment's, and a keepalive of 30 s.
    timeout: deadline in seconds of calls that have none of their own; None is none. Sessions, batches and watches have
    none.
    wait: seconds, ≥ 0, that a call waits for a lost server, for example one that is restarted, never beyond its
    deadline: a call that is safe to repeat is repeated every 0.1 to 1 s, and raises Unavailable after that. None is
    10 s, and less than a second while no server has answered this client, so that a wrong address is reported.

    Raises InvalidArgument with the field, and Unavailable of "local" where the package has no solver of its own. Calls
    raise the exceptions of marble.errors.
    """

    _transports = (LocalTransport, RemoteTransport)
    _transport: Transport
    _jobs = Jobs
    jobs: Jobs

    def close(self) -> None:
        """Ends the connection and all calls on it."""
        self._transport.close()

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<marble.Client {self.address}>"

    def _repr_html_(self) -> str:
        here = self.address == IN_PROCESS
        return table("marble.Client", [
            ("address", self.address), ("solves", "in this process" if here else "on the server"),
            ("to try", "solve, session, batch, explain" + ("" if here else ", jobs, info, watch"))])

    # marble.aio.Client has these methods too: each must end in one call of the transport.

    def solve(self, /, Q: MatrixLike | LCQP | Problem | None, g: ArrayLike | None = None,
              A: MatrixLike | None = None, b: ArrayLike | None = None, C: MatrixLike | None = None,
              d: ArrayLike | None = None, L: MatrixLike | None = None, l: ArrayLike | None = None,
              R: MatrixLike | None = None, r: ArrayLike | None = None, *, c0: float = 0.0,
              z0: ArrayLike | None = None, name: str = "", options: Mapping[str, Any] | None = None,
              priority: Priority | str | None = None, progress: ProgressOption = None, deadline: float | None = None,
              request_id: str = "", progress_interval: float = 0.0, iterate_every: int = 0,
              warm_start: Solution | None = None, sensitivity: SensitivityRequest | None = None,
              **more_options: Any) -> Solution:
        """Solves, and waits for the solution; its status says whether it is solved.

        Q: an LCQP or a Problem; or Q … r, c0, z0, name: the data of one, as in marble.solve and LCQP.
        options, or any option by its name, as in marble.solve; info().options describes them. priority: None is
        interactive. progress: True shows a bar, a callable receives each Progress on this thread; its method `show`, if
        it has one, receives what the solve is doing, in words ("further starts: 3 of 16, best 12.5"), also while no
        iteration ends (in process on a thread of its own). deadline: seconds after which the call is given up
        (DeadlineExceeded); the option time_limit_s returns the best iterate instead. warm_start: a solution of this
        problem or one like it, of the same sizes, whose branch is tried before anything else. sensitivity: derivatives
        to compute with the solution, in Solution.sensitivity. request_id, progress_interval, iterate_every: as in
        requests.Call. Ctrl-C gives the solve up.
        """
        problem = problem_of(Q, g, A, b, C, d, L, l, R, r, c0, z0, name)
        options = requests.merged(options, more_options)
        call = Call(options, priority, request_id, progress_interval, iterate_every, warm_start, sensitivity)
        return self._transport.run(SolveRequest(problem, call, progress), deadline)

    def explain(self, /, problem: LCQP | Problem, *, options: Mapping[str, Any] | None = None,
                priority: Priority | str | None = None, progress: ProgressOption = None,
                deadline: float | None = None, request_id: str = "", **more_options: Any) -> Solution:
        """Why a problem is infeasible: Solution.conflict, parts of it that no point meets; None where none is proved.

        The objective plays no role: ½ zᵀz takes its place, as in `marble explain`, so that the solution of a feasible
        problem is its point nearest to 0. All else as in solve.
        """
        call = Call({**(requests.merged(options, more_options) or {}), "explain": True}, priority, request_id)
        return self._transport.run(SolveRequest(without_objective(problem), call, progress), deadline)

    def scenarios(self, /, problem: LCQP | Problem, scenarios: Scenarios | None = None, *,
                  stage: Callable[[SampleAverageStage], object] | None = None, options: Mapping[str, Any] | None = None,
                  priority: Priority | str | None = None, progress: ProgressOption = None,
                  deadline: float | None = None, request_id: str = "", progress_interval: float = 0.0,
                  **parts: Any) -> ScenarioSolution:
        """Solves a two-stage problem: min Σ π q(x, y_s) over x and a recourse y_s in every sampled scenario.

        problem: the base over x and y. scenarios, or its parts by their names: first_stage=…, sampler=…, seed=0, …; see
        Scenarios; other names are options. stage: receives each SampleAverageStage on this thread. All else as in
        solve.
        """
        asked, options = two_stage.split(scenarios, parts, options)
        call = Call(options, priority, request_id, progress_interval)
        return self._transport.run(two_stage.ScenarioRequest(problem, asked, call, progress, stage), deadline)

    def coupled(self, /, blocks: Sequence[LCQP | Problem], coupling: Sequence[MatrixLike | None],
                coupling_rhs: ArrayLike, *,
                coupling_multipliers: ArrayLike | None = None, options: Mapping[str, Any] | None = None,
                priority: Priority | str | None = None, progress: ProgressOption = None, deadline: float | None = None,
                request_id: str = "", problem_name: str = "", sessions: bool = False,
                **settings: Any) -> CoupledSolution:
        """Solves problems coupled by rows: min Σ f_k(z_k), each z_k feasible for its own block, Σ E_k z_k =
        coupling_rhs.

        blocks, coupling (E_k), coupling_rhs, coupling_multipliers: see Coupled. Solved on one server, blocks on idle
        workers, block by block for multipliers of the rows; last the branch that was found, as one problem. progress: a
        row an iteration, whose violations.equality is of the rows and kkt_residual the largest step of a multiplier.
        settings: proximal, max_iterations, freeze_after, max_searches, max_pair_switches, tolerance, monolithic,
        monolithic_search, described with their defaults in coupled.proto; other names are options, as in solve. All
        else as in solve.

        sessions: this process coordinates instead, and blocks are sessions, assigned to the servers of the client's
        address in turns, which do not see other servers' blocks; needs marble._core, and is not available in
        marble.aio. A step whose server or session is lost is repeated elsewhere (`repeated`). Ctrl-C ends it once the
        blocks under way are solved.
        """
        settings, options = coupled_problems.split(settings, options)
        request = coupled_problems.CoupledRequest(Coupled(blocks, coupling, coupling_rhs, coupling_multipliers),
                                                  settings, Call(options, priority, request_id), progress, problem_name)
        return self._transport.coordinate(request, deadline) if sessions else self._transport.run(request, deadline)

    def segments(self, /, problem: LCQP | Problem, stages: ArrayLike, num_segments: int, *, overlap: int = -1,
               options: Mapping[str, Any] | None = None, priority: Priority | str | None = None,
               progress: ProgressOption = None, deadline: float | None = None, request_id: str = "",
               sessions: bool = False, **settings: Any) -> SegmentsSolution:
        """Solves one long problem in segments, as coupled() does; stages, num_segments, overlap: see Segments.

        sessions: as in coupled; the segments are first solved one after the other, and last as one, in this process.
        """
        settings, options = coupled_problems.split(settings, options)
        request = coupled_problems.SegmentsRequest(problem, Segments(stages, num_segments, overlap), settings,
                                                 Call(options, priority, request_id), progress)
        return self._transport.coordinate(request, deadline) if sessions else self._transport.run(request, deadline)

    def info(self) -> ServerInfo:
        """The server's version, limits, options and counters, and who the caller is for it."""
        return self._transport.run(Unary("Server/GetInfo", b"", server_info))

    def watch(self, *, progress_interval: float = 0.25) -> Iterator[JobEvent]:
        """Yields the events of all jobs that the caller may see, without end."""
        return self.jobs.watch("", progress_interval=progress_interval)

    # The methods below are the threads' own.

    def solve_async(self, Q: MatrixLike | LCQP | Problem | None, g: ArrayLike | None = None,
                    A: MatrixLike | None = None, b: ArrayLike | None = None, C: MatrixLike | None = None,
                    d: ArrayLike | None = None, L: MatrixLike | None = None, l: ArrayLike | None = None,
                    R: MatrixLike | None = None, r: ArrayLike | None = None, *, c0: float = 0.0,
                    z0: ArrayLike | None = None, name: str = "", options: Mapping[str, Any] | None = None,
                    priority: Priority | str | None = None, progress: Callable[[Progress], object] | None = None,
                    deadline: float | None = None, request_id: str = "", progress_interval: float = 0.0,
                    iterate_every: int = 0, warm_start: Solution | None = None,
                    sensitivity: SensitivityRequest | None = None, **more_options: Any) -> SolveHandle:
        """Begins a solve; the handle waits, cancels or stops. As solve, but progress is called on another thread."""
        problem = problem_of(Q, g, A, b, C, d, L, l, R, r, c0, z0, name)
        options = requests.merged(options, more_options)
        call = Call(options, priority, request_id, progress_interval, iterate_every, warm_start, sensitivity)
        return self._transport.start(SolveRequest(problem, call, progress, streams=True), deadline)

    def batch(self, problems: Iterable[LCQP | Problem | BatchItem], *, options: Mapping[str, Any] | None = None,
              priority: Priority | str | None = None, **more_options: Any) -> Iterator[BatchAnswer]:
        """Solves many problems on one stream, and yields results as they are computed, one for each problem.

        `problems` is read on a thread of gRPC's, as fast as the server takes them: it may be a generator without end.
        An item may have its own options. An exception of `problems` ends the batch and is raised here, as is an invalid
        item. Leaving the loop cancels the rest.

        If the server is lost or leaves, the batch continues at the next one, or at the same one once it is back, with
        the unsolved problems; Unavailable is raised after `wait` seconds (see Client) without any. A problem that a
        full server refuses is sent again after the time that it names.
        """
        return self._transport.batch(problems, Call(requests.merged(options, more_options), priority))

    def session(self, problem: LCQP | Problem, *, options: Mapping[str, Any] | None = None,
                priority: Priority | str | None = None, latest_only: bool = False, reopen: bool = True,
                progress: Callable[[int, Progress], object] | None = None, request_id: str = "",
                progress_interval: float = 0.0, iterate_every: int = 0,
                answer_grace: float = requests.ANSWER_GRACE_S, **more_options: Any) -> Session:
        """Sets a problem up once, to solve it repeatedly with new numbers.

        latest_only: an update that still waits when the next one arrives is not solved, and its numbers become part of
        the next one. reopen: if the server is lost or leaves, the session is set up again as it was, see Session;
        otherwise it ends. progress: receives the update's number and each row, within update() or next(). priority:
        None is realtime. answer_grace: seconds in [0, 3600] that update() waits for an answer after its deadline; the
        server sends it before the deadline, and this is for its way. Use it as a context manager.
        """
        call = Call(requests.merged(options, more_options), priority, request_id, progress_interval, iterate_every,
                    answer_grace=answer_grace)
        return self._transport.session(problem, call, latest_only, progress, reopen)


def solve(Q: MatrixLike | LCQP | Problem | None, g: ArrayLike | None = None,
          A: MatrixLike | None = None, b: ArrayLike | None = None, C: MatrixLike | None = None,
          d: ArrayLike | None = None, L: MatrixLike | None = None, l: ArrayLike | None = None,
          R: MatrixLike | None = None, r: ArrayLike | None = None, *, c0: float = 0.0, z0: ArrayLike | None = None,
          options: Mapping[str, Any] | None = None, server: str | Sequence[str] | Client | None = None,
          name: str = "", priority: Priority | str | None = None, progress: ProgressOption = None,
          deadline: float | None = None, request_id: str = "", progress_interval: float = 0.0,
          iterate_every: int = 0, warm_start: Solution | None = None,
          sensitivity: SensitivityRequest | None = None, **more_options: Any) -> Solution:
    """Solves min ½ zᵀQz + gᵀz + c0  s.t.  A z + b = 0,  C z + d ≥ 0,  0 ≤ L z + l ⊥ R z + r ≥ 0.

    Q … r, c0, z0, name: as in LCQP: dense (a vector is one row), lists or any scipy.sparse. Instead of Q and all
    other data an LCQP or a Problem may be given.
    server: an address, several, or a Client; None is the server that MARBLE_SERVER names, and this process where it
    names none or is "local": the environment decides, not the program.
    options, or any option by its name: solve(Q, g, max_iterations=50).
    priority, progress, deadline, request_id, progress_interval, iterate_every, warm_start, sensitivity: as in
    Client.solve.

    Returns a Solution, solved or not: see its status, or call raise_if_unsolved(). Raises InvalidProblem and the other
    exceptions of marble.errors. With a server each call opens a connection of its own; a loop is faster with a Client.
    """
    problem = problem_of(Q, g, A, b, C, d, L, l, R, r, c0, z0, name)
    call: dict[str, Any] = {
        "options": requests.merged(options, more_options), "priority": priority, "progress": progress,
        "deadline": deadline, "request_id": request_id, "progress_interval": progress_interval,
        "iterate_every": iterate_every, "warm_start": warm_start, "sensitivity": sensitivity}
    if isinstance(server, Client):
        return server.solve(problem, **call)
    with Client(connect.server_of(server)) as client:
        return client.solve(problem, **call)


__all__ = ["Client", "Error", "Job", "SolveHandle", "solve"]
