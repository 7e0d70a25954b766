"""A connection to a Marble server, or to several that are alike."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

from numpy.typing import ArrayLike

from marble.base.lazy import lazy
from marble.calls.batch import Batch, BatchAnswer, BatchItem
from marble.calls.handle import Answer, HandleThere, SolveHandle, read_answer
from marble.calls.jobs import Jobs
from marble.calls.progress import teller
from marble.calls.session import Session
from marble.connection import connect
from marble.connection.patience import Patience
from marble.connection.rpc import CLOSED, Rpc, check_deadline
from marble.errors import Error, FailedPrecondition
from marble.in_process import composite, solver
from marble.in_process.block_sessions import BlockSessions
from marble.in_process.handle import HandleHere
from marble.in_process.session import SessionHere
from marble.message import answers, requests
from marble.message import coupled as tied
from marble.message import scenarios as worlds
from marble.message.info import ServerInfo, server_info
from marble.message.job import Job, JobEvent, Priority
from marble.message.requests import Call, ProgressWish
from marble.model.coupled import Coupled, CoupledAnswer, Pieces, PiecesAnswer
from marble.model.derivatives import SensitivityRequest
from marble.model.lcqp import LCQP, MatrixLike
from marble.model.problem import Problem, compiled, in_terms_of, problem_of
from marble.model.scenarios import ScenarioAnswer, ScenarioLevel, Scenarios
from marble.model.solution import Progress, Solution

grpc: Any = lazy("grpc")
Ended = TypeVar("Ended", CoupledAnswer, PiecesAnswer)


def _closed(close: Callable[[], object], solve: Callable[[], Answer]) -> Answer:
    try:
        return solve()
    finally:
        close()


class Client:
    """A connection; thread-safe, and any number of calls may be under way at once.

    address: host:port or unix:PATH; several host:port (a list, or with commas), or every address of a name
    (dns:///host:port), are taken in turns while healthy.
    None is MARBLE_SERVER, else 127.0.0.1:50051. "local" is no server: solves run in this process, in the threads that
    ask for them, to the same bits; what only a server has, jobs, info() and watch(), is Unavailable then.
    The connection is made by the first call, and again by a later one if it broke.
    token, name, tls…, keepalive: as in ConnectOptions; None is the environment's, and a keepalive of 30 s.
    timeout: deadline in seconds of calls that have none of their own; None is none. Sessions, batches and watches have
    none.
    wait: seconds, ≥ 0, that a call waits for a server that is lost, as one that is restarted, never beyond its
    deadline: it is made again every 0.1 to 1 s, if to make it twice does no harm, and raises Unavailable after that.
    None is 10 s, and less than a second while no server has answered this client, so that a wrong address is told.

    Raises InvalidArgument with the field, and Unavailable of "local" where the package has no solver of its own. Calls
    raise the exceptions of marble.errors.
    """

    def __init__(self, address: str | Sequence[str] | None = None, *, token: str | None = None,
                 name: str | None = None, tls: bool = False, tls_ca: str | None = None,
                 tls_certificate: str | None = None, tls_key: str | None = None, tls_server_name: str | None = None,
                 timeout: float | None = None, wait: float | None = None,
                 keepalive: float | str | None = None) -> None:
        self._local, self._timeout = connect.is_local(address), check_deadline(timeout)
        patience = Patience(wait)
        self._closed, self._wait = False, wait
        self._rpc: Any
        if self._local:
            solver.core()
            self.address, self._rpc = solver.IN_PROCESS, solver.NoServer()
        else:
            who = connect.ConnectOptions.from_environment(
                token=token, name=name, tls=tls, tls_ca=tls_ca, tls_certificate=tls_certificate, tls_key=tls_key,
                tls_server_name=tls_server_name, keepalive=keepalive)
            self._addresses, self._who = connect.each(address), who
            self.address, make = connect.channels(grpc, address, who)
            self._rpc = Rpc(make, who.metadata(), timeout, patience)
        self.jobs = Jobs(self._rpc)

    def close(self) -> None:
        """Ends the connection and all that is under way on it."""
        self._closed = True
        if not self._local:
            self._rpc.close()

    @property
    def _here(self) -> bool:
        if self._closed:
            raise FailedPrecondition(CLOSED)
        return self._local

    def _limit(self, deadline: float | None) -> float | None:
        return self._timeout if deadline is None else deadline

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<marble.Client {self.address}>"

    def solve(self, problem: LCQP | Problem, *, options: Mapping[str, Any] | None = None,
              priority: Priority | str | None = None, progress: ProgressWish = None, deadline: float | None = None,
              request_id: str = "", progress_interval: float = 0.0, iterate_every: int = 0,
              warm_start: Solution | None = None, sensitivity: SensitivityRequest | None = None,
              **more_options: Any) -> Solution:
        """Solves, and waits for the answer; solved or not, its status says.

        options, or any option by its name, as in marble.solve; info().options tells them. priority: None is
        interactive. progress: True shows a bar, a callable is given each Progress on this thread; its method `show`, if
        it has one, is told in words what the solve is doing ("further starts: 3 of 16, best 12.5"), also while no
        iteration ends (in process by a thread of its own). deadline: seconds after which the call is given up
        (DeadlineExceeded); the option time_limit_s returns the best iterate instead. warm_start: an answer to this
        problem or one like it, of the same sizes, whose branch is tried before anything else. sensitivity: derivatives
        of the answer that are wanted with it, in Solution.sensitivity. request_id,
        progress_interval, iterate_every: as in requests.Call. Ctrl-C gives the solve up.
        """
        options = requests.wishes(options, more_options)
        call = Call(options, priority, request_id, progress_interval, iterate_every, warm_start, sensitivity)
        lcqp = compiled(problem)
        tell, close = teller(progress)
        if self._here:
            limit = self._limit(deadline)
            return in_terms_of(problem, _closed(close, lambda: solver.solve(lcqp, call, tell, limit)))
        if tell is None:
            data = self._rpc.call("Solver/Solve", requests.solve(lcqp, call), deadline)
            return in_terms_of(problem, answers.solve_response(data, lcqp))
        answer = self._answer("Solver/SolveStream", requests.solve_stream(lcqp, call), deadline,
                              lambda data: answers.read(data, lcqp, tell), close)
        return in_terms_of(problem, answer)

    def solve_async(self, problem: LCQP | Problem, *, options: Mapping[str, Any] | None = None,
                    priority: Priority | str | None = None, progress: Callable[[Progress], object] | None = None,
                    deadline: float | None = None, request_id: str = "", progress_interval: float = 0.0,
                    iterate_every: int = 0, warm_start: Solution | None = None,
                    sensitivity: SensitivityRequest | None = None, **more_options: Any) -> SolveHandle:
        """Begins to solve; the handle waits, cancels or stops. As solve, but progress is told on another thread."""
        options = requests.wishes(options, more_options)
        call = Call(options, priority, request_id, progress_interval, iterate_every, warm_start, sensitivity)
        lcqp = compiled(problem)
        given: LCQP | Problem = problem.copy() if isinstance(problem, Problem) else problem
        if self._here:
            return HandleHere(lcqp, given, call, progress, self._limit(deadline))
        return HandleThere(self._rpc, requests.solve_stream(lcqp, call), deadline, lcqp, given, progress)

    def scenarios(self, problem: LCQP | Problem, scenarios: Scenarios | None = None, *,
                  level: Callable[[ScenarioLevel], object] | None = None, options: Mapping[str, Any] | None = None,
                  priority: Priority | str | None = None, progress: ProgressWish = None, deadline: float | None = None,
                  request_id: str = "", progress_interval: float = 0.0, **wishes: Any) -> ScenarioAnswer:
        """One plan x for many worlds: min Σ π q(x, y_s) over x and a recourse y_s in every sampled world.

        problem: the base over x and y. scenarios, or its parts by their names: first_stage=…, sampler=…, seed=0, …; see
        Scenarios; what is none of them is an option. level: is given each ScenarioLevel as it is there, on this thread.
        All else as in solve.
        """
        wish, options = worlds.wish(scenarios, wishes, options)
        call = Call(options, priority, request_id, progress_interval)
        tell, close = teller(progress)
        if self._here:
            return _closed(close, lambda: composite.solve_scenarios(problem, wish, call, level, tell,
                                                                    self._limit(deadline)))
        return self._answer("Solver/SolveScenarios", worlds.solve_stream(problem, wish, call), deadline,
                            lambda data: worlds.read(data, level, tell), close)

    def coupled(self, blocks: Sequence[LCQP | Problem], coupling: Sequence[MatrixLike | None], total: ArrayLike, *,
                prices: ArrayLike | None = None, options: Mapping[str, Any] | None = None,
                priority: Priority | str | None = None, progress: ProgressWish = None, deadline: float | None = None,
                request_id: str = "", problem_name: str = "", sessions: bool = False,
                **settings: Any) -> CoupledAnswer:
        """Problems that rows tie together: min Σ f_k(z_k), each z_k feasible for its own block, Σ E_k z_k = total.

        blocks, coupling (E_k), total, prices: see Coupled. Solved on one server, blocks on idle workers, block by block
        at prices on the rows; last the branch that was found as one problem. progress: a row an iteration, whose
        violations.equality is of the rows and kkt_residual the largest step of a price. settings: proximal,
        max_iterations, freeze_after, searches, flips, tolerance, joint, joint_search; what they do, and their defaults,
        is in coupled.proto; what is none of them is an option, as in solve. All else as in solve.

        sessions: this process coordinates instead, and blocks are sessions that are dealt to the servers of the
        client's address, which see no other's blocks; needs marble._core. A step whose server or session is lost is
        asked for again elsewhere (`repeated`). Ctrl-C ends it once the blocks that are under way have answered.
        """
        settings, options = tied.split(settings, options)
        wish, call = Coupled(blocks, coupling, total, prices), Call(options, priority, request_id)
        tell, close = teller(progress)
        if self._here:
            return _closed(close, lambda: composite.solve_coupled(wish, settings, call, tell, self._limit(deadline)))
        if sessions:
            return self._by_sessions(call, problem_name, deadline, close, lambda limit, opens: composite.solve_coupled(
                wish, settings, call, tell, limit, open_block=opens))
        request = requests.coupled_stream(problem_name, call, tied.blocks(wish, settings))
        return tied.blocks_answer(self._coupled(request, tell, close, deadline), blocks)

    def pieces(self, problem: LCQP | Problem, stages: ArrayLike, pieces: int, *, look_ahead: int = -1,
               options: Mapping[str, Any] | None = None, priority: Priority | str | None = None,
               progress: ProgressWish = None, deadline: float | None = None, request_id: str = "",
               sessions: bool = False, **settings: Any) -> PiecesAnswer:
        """One long problem cut into pieces, solved as coupled() does; stages, pieces, look_ahead: see Pieces.

        sessions: as in coupled; the pieces are first solved one after the other, and last as one, in this process.
        """
        settings, options = tied.split(settings, options)
        wish, call = Pieces(stages, pieces, look_ahead), Call(options, priority, request_id)
        tell, close = teller(progress)
        if self._here:
            return _closed(close, lambda: composite.solve_in_pieces(problem, wish, settings, call, tell,
                                                                    self._limit(deadline)))
        if sessions:
            return self._by_sessions(call, compiled(problem).name, deadline, close, lambda limit, opens:
                                     composite.solve_in_pieces(problem, wish, settings, call, tell, limit,
                                                               open_block=opens))
        request = requests.coupled_stream(compiled(problem), call, tied.pieces(problem, wish, settings))
        return tied.pieces_answer(self._coupled(request, tell, close, deadline), problem)

    def _by_sessions(self, call: Call, name: str, deadline: float | None, close: Callable[[], object],
                     solve: Callable[[float | None, composite.OpenBlock], Ended]) -> Ended:
        limit = self._limit(deadline)
        with contextlib.ExitStack() as ends:
            ends.callback(close)
            each = [ends.enter_context(client) for client in self._each()]
            blocks = BlockSessions(self, each, call.options, call.priority, name, limit)
            ends.callback(blocks.close)
            answer = solve(limit, blocks.open)
        return dataclasses.replace(answer, repeated=blocks.repeated)

    def _each(self) -> list[Client]:
        """A client of each server alone; of TLS the first name counts, as for all of them."""
        who = self._who
        if len(self._addresses) > 1 and who.credentials() is not None and not who.tls_server_name:
            who = dataclasses.replace(who, tls_server_name=connect.host(self._addresses[0]))
        # What one server of several has lost is for the others, at once.
        wait = 0.0 if len(self._addresses) > 1 else self._wait
        return [Client(address, **dataclasses.asdict(who), timeout=self._timeout, wait=wait)
                for address in self._addresses]

    def _coupled(self, request: bytes, tell: Callable[[Progress], object] | None, close: Callable[[], object],
                 deadline: float | None) -> tied.Told:
        return self._answer("Solver/SolveCoupled", request, deadline, lambda data: tied.read(data, tell), close)

    def _answer(self, method: str, request: bytes, deadline: float | None, read: Callable[[bytes], Answer | None],
                close: Callable[[], object]) -> Answer:
        def once(seconds: float | None) -> Answer:
            stream = self._rpc.stream(method, request, seconds)
            try:
                return read_answer(stream, read)
            finally:
                stream.cancel()

        try:
            answer: Answer = self._rpc.repeated(self._rpc.tries(method, deadline), once)
            return answer
        finally:
            close()

    def batch(self, problems: Iterable[LCQP | Problem | BatchItem], *, options: Mapping[str, Any] | None = None,
              priority: Priority | str | None = None, **more_options: Any) -> Iterator[BatchAnswer]:
        """Solves many problems on one stream, and yields answers as they finish, each problem's exactly once.

        `problems` is read on a thread of gRPC's, as fast as the server takes them: it may be a generator without end.
        An item may have its own options. What `problems` raises ends the batch and is raised here, as is an invalid
        item. To leave the loop gives the rest up.

        Where the server is lost or leaves, the batch goes on at the next one, or at the same one once it is there
        again, with what is not answered yet; Unavailable is raised after `wait` seconds (see Client) without any. What
        a server has no room for is sent again after the time that it names.
        """
        call = Call(requests.wishes(options, more_options), priority)
        if self._here:
            yield from solver.batch(problems, call)
            return
        yield from Batch(self._rpc, problems, call).answers()

    def session(self, problem: LCQP | Problem, *, options: Mapping[str, Any] | None = None,
                priority: Priority | str | None = None, latest_only: bool = False, reopen: bool = True,
                progress: Callable[[int, Progress], object] | None = None, request_id: str = "",
                progress_interval: float = 0.0, iterate_every: int = 0, **more_options: Any) -> Session:
        """Sets a problem up once, to be solved again and again with new numbers.

        latest_only: an update that still waits when the next one comes is not solved, and the next one takes its
        numbers along. reopen: where the server is lost or leaves, the session is set up again as it was, see Session;
        without it, that is its end. progress: is given the update's number and each row, within update() or next().
        priority: None is realtime. Use it as a context manager.
        """
        options = requests.wishes(options, more_options)
        call = Call(options, priority, request_id, progress_interval, iterate_every)
        if self._here:
            return SessionHere(problem, call, progress)
        return Session(self._rpc, problem, call, latest_only, progress, reopen)

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
          deadline: float | None = None, request_id: str = "", warm_start: Solution | None = None,
          sensitivity: SensitivityRequest | None = None, **more_options: Any) -> Solution:
    """Solves min ½ zᵀQz + gᵀz + c0  s.t.  A z + b = 0,  C z + d ≥ 0,  0 ≤ L z + l ⊥ R z + r ≥ 0.

    Q … r, c0, z0, name: as in LCQP: dense (a vector is one row), lists or any scipy.sparse. Instead of Q and all
    other data an LCQP or a Problem may be given.
    server: an address, several, or a Client; None is the server that MARBLE_SERVER names, and this process where it
    names none or is "local": the environment decides, not the program.
    options, or any option by its name: solve(Q, g, max_iterations=50); global, a word of Python's own, is global_.
    priority, progress, deadline, request_id, warm_start, sensitivity: as in Client.solve.

    Returns a Solution, solved or not: see its status, or call raise_if_unsolved(). Raises InvalidProblem and the other
    exceptions of marble.errors. With a server each call makes a connection of its own; a loop is faster with a Client.
    """
    problem = problem_of(Q, g, A, b, C, d, L, l, R, r, c0, z0, name)
    wishes = requests.wishes(options, more_options)
    if isinstance(server, Client):
        return server.solve(problem, options=wishes, priority=priority, progress=progress, deadline=deadline,
                            request_id=request_id, warm_start=warm_start, sensitivity=sensitivity)
    with Client(connect.server_of(server)) as client:
        return client.solve(problem, options=wishes, priority=priority, progress=progress, deadline=deadline,
                            request_id=request_id, warm_start=warm_start, sensitivity=sensitivity)


__all__ = ["Client", "Error", "Job", "SolveHandle", "solve"]
