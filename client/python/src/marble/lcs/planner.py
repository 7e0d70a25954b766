"""Plans over a horizon of a linear complementarity system: one LCQP a control step, over a session.

    with marble.lcs.Planner(lcs, 10, Q=Q, R=R, u_lb=-20, u_ub=20, server="local") as planner:
        while True:
            plan = planner.step(measured_state())
            apply(plan.u[0])
"""

from __future__ import annotations

import contextlib
import enum
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

import marble
from marble.base.checks import is_whole
from marble.base.tables import Status
from marble.calls.session import Session
from marble.calls.shift import Shift, ShiftBlock
from marble.connection.connect import server_of
from marble.errors import DeadlineExceeded, InvalidArgument, InvalidProblem, Unavailable
from marble.in_process import core, core_errors
from marble.lcs.system import LCS, Array, one_each
from marble.message import records
from marble.message.request import core_options
from marble.model.lcqp import LCQP, csc, numbers, problem_of, vector
from marble.model.solution import Solution, Violations


class PlanOrigin(enum.Enum):
    """Where a plan comes from.

    SOLVE: the solver's solution. SOLVE_ROLLOUT: the inputs of the solver's solution, rolled out, as the solution itself
    is not feasible. START_ROLLOUT: the start: the last plan's inputs, shifted and rolled out.
    """

    SOLVE = "solve"
    SOLVE_ROLLOUT = "solve_rollout"
    START_ROLLOUT = "start_rollout"


@dataclass(frozen=True)
class PlanTimes:
    """Seconds of a control step: numbers of the LCQP, roll-outs, the solve itself, and all of the step."""

    assembly_s: float
    rollout_s: float
    solve_s: float
    total_s: float


@dataclass(frozen=True, eq=False)
class Plan:
    """The result of a control step.

    x: (N + 1, nx), from the measured state on. u: (N, nu). lam: (N, nl).
    objective: of the plan, as Planner defines it.
    status: why the solve ended; its solution may not be the plan. origin: where the plan comes from.
    feasible: whether the violations, of dynamics, bounds and complementarity, are within the tolerances of the options;
    False only if neither the solve nor a roll-out has found a feasible plan: detail says why.
    start_objective: of the rolled-out start, which a feasible plan does not exceed; inf if that is not feasible.
    solution: of the solver; None after a deadline.
    """

    x: Array
    u: Array
    lam: Array
    objective: float
    status: Status
    origin: PlanOrigin
    feasible: bool
    violations: Violations
    start_objective: float
    detail: str
    times: PlanTimes
    solution: Solution | None


MAX_STAGES: Final = 1_000_000


def native() -> Any:
    """marble._core; Unavailable where the package was built without it."""
    try:
        return core()
    except Unavailable as error:
        raise Unavailable("marble.lcs needs marble._core for matrices and roll-outs, also where a server solves: "
                          f"install a wheel of marble-solver, or build with pybind11 ({error.__context__})") from None


def rollout(lcs: LCS, x0: ArrayLike, u: ArrayLike) -> tuple[Array, Array]:
    """Simulates a system: x (N + 1, nx), from x0 on, and λ (N, nl), given x0 (nx,) and inputs u (N, nu).

    Each stage is one LCP, solved by Lemke's method; where it has several solutions, λ is one of them. Raises
    FailedPrecondition with the stage if the method ends in a ray: then it has found no λ, and for many classes of F
    there is none.
    """
    _check_system(lcs)
    inputs = _shaped(u, "u", (lcs.stages or -1, lcs.nu))
    module = native()
    with core_errors():
        x, lam = module.lcs_rollout(lcs, vector(x0, "x0", lcs.nx, " (nx)"), inputs)
    stages = inputs.shape[0]
    return np.asarray(x).reshape(stages + 1, lcs.nx), np.asarray(lam).reshape(stages, lcs.nl)


class Planner:
    """Plans N stages ahead, over a session in process or on a server; a context manager: leaving it ends the session.

        min Σ_{k<N} |x_k − x_ref,k|²_Q + |u_k − u_ref,k|²_R + |u_k − u_{k−1}|²_R_change + regularization |λ_k|²
            + |x_N − x_ref,N|²_P,                                                               with |v|²_W = vᵀWv

    lcs: constant, or of N stages. stages: N ≥ 1.
    Q (nx, nx), R (nu, nu): symmetric; with a leading axis N one per stage. P (nx, nx): symmetric; None: the solution of
    the discrete algebraic Riccati equation of the last stage. R_change (nu, nu): None: none. regularization: ≥ 0, makes
    λ unique where contact forces are not.
    x_ref: (nx,), or (N + 1, nx) with one per stage; None: zeros. u_ref: (nu,), or (N, nu).
    x_lb, x_ub (of the states 1 to N), u_lb, u_ub: one number for all entries, (nx,) or (nu,), or (N, nx) or (N, nu)
    with one per stage; infinite where there is no bound, which is in all stages or in none; None: none. max_u_change
    (of |u_k − u_{k−1}|, ≥ 0): one number or (nu,).
    server: as in marble.solve; a Client stays open. reopen: as in Client.session. options: of the solver, by name;
    effort=0 shortens the first step, a cold solve.

    Each plan is feasible and not worse than its start, which is the last plan's inputs, shifted and rolled out, if that
    start is feasible: also where a solve fails, or is stopped by time_limit_s or by a deadline. Needs marble._core,
    also with a server. Raises InvalidArgument with the field; FailedPrecondition of P if there is no Riccati solution.
    One thread at a time.
    """

    def __init__(self, lcs: LCS, stages: int, *, Q: ArrayLike, R: ArrayLike, P: ArrayLike | None = None,
                 R_change: ArrayLike | None = None, regularization: float = 0.0, x_ref: ArrayLike | None = None,
                 u_ref: ArrayLike | None = None, x_lb: ArrayLike | None = None, x_ub: ArrayLike | None = None,
                 u_lb: ArrayLike | None = None, u_ub: ArrayLike | None = None, max_u_change: ArrayLike | None = None,
                 server: str | Sequence[str] | marble.Client | None = None, reopen: bool = True,
                 options: Mapping[str, Any] | None = None, **more_options: Any) -> None:
        _check_system(lcs)
        if not is_whole(stages, 1, MAX_STAGES):
            raise InvalidArgument("stages", f"must be a whole number in [1, {MAX_STAGES}]", value=repr(stages))
        self.nx, self.nu, self.nl, self.stages = lcs.nx, lcs.nu, lcs.nl, int(stages)
        self._check_stages(lcs, "stages")
        nx, nu = self.nx, self.nu
        task = {"stages": self.stages, "regularization": float(vector(regularization, "regularization", 1)[0]),
                "Q": self._per_stage(Q, "Q", (nx, nx), self.stages),
                "R": self._per_stage(R, "R", (nu, nu), self.stages),
                "P": None if P is None else _shaped(P, "P", (nx, nx)),
                "R_change": None if R_change is None else _shaped(R_change, "R_change", (nu, nu)),
                **self._targets(x_ref, u_ref), **self._limits(x_lb, x_ub, u_lb, u_ub),
                "max_u_change": None if max_u_change is None else one_each(max_u_change, "max_u_change", nu)}
        given = {**(options or {}), **more_options}
        module = native()
        with core_errors():
            self._planner = module.LcsPlanner(lcs, task, core_options(given))
        self.P: Array = np.asarray(self._planner.terminal_cost()).reshape(nx, nx)
        """The terminal cost, as given or computed."""
        with _overflow_of("x_ref"):
            self.problem: LCQP = problem_of(self._planner.problem()).named("lcs")
        """The LCQP of the first control step, with x0 = 0; z = (u_0, λ_0, x_1, …, u_{N−1}, λ_{N−1}, x_N)."""
        self._client, self._owns_client = (server, False) if isinstance(server, marble.Client) else (
            marble.Client(server_of(server)), True)
        try:
            self._session: Session = self._client.session(self.problem, options=given, reopen=reopen)
        except BaseException:
            self._close_client()
            raise
        self._shift = Shift.by_stage(self.problem, self.stages)

    def step(self, x0: ArrayLike, *, lcs: LCS | None = None, x_ref: ArrayLike | None = None,
             u_ref: ArrayLike | None = None, last_u: ArrayLike | None = None, u: ArrayLike | None = None,
             shift: int = 1, x_lb: ArrayLike | None = None, x_ub: ArrayLike | None = None,
             u_lb: ArrayLike | None = None, u_ub: ArrayLike | None = None, deadline: float | None = None,
             **options: Any) -> Plan:
        """One control step: sends the new numbers, and returns the plan.

        x0: (nx,), the measured state. lcs: a system of the same sizes; None: as before. x_ref, u_ref: as in Planner;
        None: as before. last_u: (nu,), the input before stage 0; None: that of the last plan before its new start,
        zeros before the first plan. u: (N, nu), inputs to roll out instead of the last plan's. shift: stages by which
        the last plan moves on first, in [0, N]. x_lb, x_ub, u_lb, u_ub: as in Planner, finite exactly where Planner's
        are, as the pattern is fixed; they belong to the stages of this step, and are not shifted with the plan; None:
        as before. deadline: seconds after which the solve is given up; the plan is a roll-out then. options: of the
        solver, by name, from here on.
        """
        begun = time.perf_counter()
        changes, start, shifted = self._begin(lcs, vector(x0, "x0", self.nx, " (nx)"), x_ref, u_ref, last_u, u, shift,
                                              False, self._limits(x_lb, x_ub, u_lb, u_ub))
        try:
            with _overflow_of("x0"):
                solution = self._session.update(**changes, z0=start, shift=shifted, deadline=deadline, **options)
        except DeadlineExceeded as error:
            return self._finish(Status.TIME_LIMIT, None, str(error), begun)
        except Exception:
            self._planner.resend()
            raise
        return self._finish(solution.status, solution, solution.detail, begun)

    def prepare(self, *, lcs: LCS | None = None, x_ref: ArrayLike | None = None, u_ref: ArrayLike | None = None,
                u: ArrayLike | None = None, shift: int = 1, x_lb: ArrayLike | None = None,
                x_ub: ArrayLike | None = None, u_lb: ArrayLike | None = None, u_ub: ArrayLike | None = None,
                **options: Any) -> None:
        """The preparation phase of a step: all that is known before the state is measured, as in step.

        Returns once it is sent. The solver prepares for the state that the last plan predicts.
        """
        changes, start, shifted = self._begin(lcs, None, x_ref, u_ref, None, u, shift, True,
                                              self._limits(x_lb, x_ub, u_lb, u_ub))
        try:
            with _overflow_of("x_ref"):
                self._session.prepare(**changes, z0=start, shift=shifted, **options)
        except Exception:
            self._planner.resend()
            raise

    def feedback(self, x0: ArrayLike, *, last_u: ArrayLike | None = None, x_lb: ArrayLike | None = None,
                 x_ub: ArrayLike | None = None, deadline: float | None = None) -> Plan:
        """The feedback phase, after prepare: the plan for the measured state. Arguments as in step."""
        return self.step(x0, last_u=last_u, x_lb=x_lb, x_ub=x_ub, deadline=deadline)

    def fall_back(self, reason: str) -> Plan:
        """The plan of a step that has raised an error because no server answered: its start, rolled out.

        The next step sends the numbers again. reason: for Plan.detail. Plan.status is CANCELLED. FailedPrecondition
        unless step or feedback has raised Unavailable, Refused, Cancelled, Aborted, ServerError or, of a session that
        has ended, FailedPrecondition.
        """
        plan = self._finish(Status.CANCELLED, None, reason, time.perf_counter())
        self._planner.resend()
        return plan

    @property
    def session(self) -> Session:
        """The session that solves."""
        return self._session

    def _begin(self, lcs: LCS | None, x0: Array | None, x_ref: ArrayLike | None, u_ref: ArrayLike | None,
               last_u: ArrayLike | None, u: ArrayLike | None, shift: int, prepares: bool,
               limits: dict[str, Array | None]) -> tuple[dict[str, Any], Any, Shift | None]:
        if lcs is not None:
            _check_system(lcs)
            self._check_stages(lcs, "lcs.stages")
        if not is_whole(shift, 0, self.stages):
            raise InvalidArgument("shift", f"must be a whole number in [0, {self.stages}]", value=repr(shift))
        targets = self._targets(x_ref, u_ref)
        before = None if last_u is None else vector(last_u, "last_u", self.nu, " (nu)")
        guess = None if u is None else _shaped(u, "u", (self.stages, self.nu))
        with core_errors():
            changes, start, by = self._planner.begin(lcs, x0, targets["x_ref"], targets["u_ref"], before, guess,
                                                     int(shift), prepares, *limits.values())
        made = {name: value if name == "c0" else np.asarray(value) for name, value in changes.items()}
        for name in ("A", "R"):
            old = getattr(self.problem, name)
            if name in made and old.shape[0] == 1:  # a vector would be a row with its zeros
                made[name] = csc(made[name], old.indices, old.indptr, old.shape)
        return made, None if start is None else np.asarray(start), self._moved(by)

    def _moved(self, by: int) -> Shift | None:
        if by <= 1:
            return self._shift if by else None
        return Shift(*([ShiftBlock(b.first, b.count, by * b.by) for b in getattr(self._shift, name)]
                       for name in ("variables", "equalities", "inequalities", "pairs")))

    def _finish(self, status: Status, solution: Solution | None, detail: str, begun: float) -> Plan:
        with core_errors():
            values = self._planner.finish(status.value, None if solution is None else solution.z, detail)
        shapes = {"x": (self.stages + 1, self.nx), "u": (self.stages, self.nu), "lam": (self.stages, self.nl)}
        solve_s = 0.0 if solution is None else solution.times.solve_s
        times = PlanTimes(values.pop("assembly_s"), values.pop("rollout_s"), solve_s, time.perf_counter() - begun)
        arrays = {name: np.asarray(values[name]).reshape(shape) for name, shape in shapes.items()}
        return records.of_core(Plan, values, **arrays, times=times, solution=solution)

    def _check_stages(self, lcs: LCS, field: str) -> None:
        if lcs.stages is not None and lcs.stages != self.stages:
            raise InvalidArgument(field, f"must be {self.stages}, or constant" if field != "stages" else
                                  f"must be {lcs.stages}, as many as the system has",
                                  value=lcs.stages if field != "stages" else self.stages)

    def _targets(self, x_ref: ArrayLike | None, u_ref: ArrayLike | None) -> dict[str, Array | None]:
        return {"x_ref": None if x_ref is None else self._per_stage(x_ref, "x_ref", (self.nx,), self.stages + 1),
                "u_ref": None if u_ref is None else self._per_stage(u_ref, "u_ref", (self.nu,), self.stages)}

    def _limits(self, x_lb: ArrayLike | None, x_ub: ArrayLike | None, u_lb: ArrayLike | None,
                u_ub: ArrayLike | None) -> dict[str, Array | None]:
        given = {"x_lb": (x_lb, self.nx), "x_ub": (x_ub, self.nx), "u_lb": (u_lb, self.nu), "u_ub": (u_ub, self.nu)}
        return {name: self._limit(values, name, size) for name, (values, size) in given.items()}

    def _limit(self, values: ArrayLike | None, field: str, size: int) -> Array | None:
        if values is None:
            return None
        array = numbers(values, field, "an array of numbers")
        return one_each(array, field, size) if array.ndim == 0 else self._per_stage(array, field, (size,), self.stages)

    @staticmethod
    def _per_stage(values: ArrayLike, field: str, shape: tuple[int, ...], count: int) -> Array:
        array = numbers(values, field, "an array of numbers")
        if array.shape not in (shape, (count, *shape)):
            raise InvalidArgument(field, f"must have the shape {shape} or {(count, *shape)}",
                                  value=f"of shape {array.shape}")
        return np.ascontiguousarray(array)

    def _close_client(self) -> None:
        if self._owns_client:
            self._client.close()

    def close(self) -> None:
        """Ends the session, and the connection unless it was given."""
        self._session.close()
        self._close_client()

    def __enter__(self) -> Planner:
        return self

    def __exit__(self, kind: object, *rest: object) -> None:
        try:
            self._session.__exit__(kind, *rest)
        finally:
            self._close_client()


@contextlib.contextmanager
def _overflow_of(field: str) -> Iterator[None]:
    """Names the argument where numbers are so large that the LCQP's are not finite."""
    try:
        yield
    except InvalidProblem as error:
        raise InvalidArgument(field, f"must leave the numbers of the LCQP finite ({error})") from None


def _check_system(lcs: Any) -> None:
    if not isinstance(lcs, LCS):
        raise InvalidArgument("lcs", "must be a marble.lcs.LCS", value=type(lcs).__name__)


def _shaped(values: ArrayLike, field: str, shape: tuple[int, ...]) -> Array:
    """As an array of that shape, in which −1 stands for any number ≥ 1."""
    array = numbers(values, field, "an array of numbers")
    fits = array.ndim == len(shape) and all(size == one or (one < 0 < size)
                                            for size, one in zip(array.shape, shape, strict=True))
    if not fits:
        wanted = str(shape).replace("-1", "N")
        raise InvalidArgument(field, f"must have the shape {wanted}", value=f"of shape {array.shape}")
    return np.ascontiguousarray(array)
