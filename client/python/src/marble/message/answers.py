"""What comes back: messages of the server as objects of this package."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marble.base import contract
from marble.base.tables import Status
from marble.message import sensitivity, wire
from marble.message.job import (
    ArrayProgress,
    Job,
    JobDetails,
    JobEvent,
    JobKind,
    JobPage,
    JobState,
    PairSides,
    Priority,
    Submitted,
    SubmittedArray,
    Trace,
)
from marble.model.conflict import Conflict
from marble.model.lcqp import LCQP, Vector
from marble.model.scenarios import OutOfSample, ScenarioLevel
from marble.model.solution import PointOrigin, Progress, SecondOrder, Solution, Stationarity, Times, Violations

Arrays = dict[str, NDArray[np.float64]]
_NOTHING: Vector = np.zeros(0)


def _violations(message: Any) -> Violations:
    return Violations(message.equality, message.inequality, message.complementarity)


def _times(message: Any) -> Times:
    return Times(message.queue_s, message.setup_s, message.factorization_s, message.line_search_s, message.polish_s,
                 message.solve_s, message.total_s, message.tree_s)


def _tree(message: Any) -> dict[str, Any]:
    """What a Progress, a Solution or a JobInfo tells of a tree; what is not known is infinite."""
    unknown = {"incumbent": math.inf, "bound": -math.inf, "gap": math.inf}
    told = {name: getattr(message, name) if message.HasField(name) else value for name, value in unknown.items()
            if name in message.DESCRIPTOR.fields_by_name}
    return {**told, "nodes": message.nodes, "open_nodes": message.open_nodes}


@functools.cache
def _statuses() -> dict[int, Status]:
    return {number: Status(name) for number, name in contract.enum_names("Status").items() if number}


@functools.cache
def _stationarities() -> dict[int, Stationarity]:
    return {number: Stationarity(name) for number, name in contract.enum_names("Stationarity").items() if number}


@functools.cache
def _second_orders() -> dict[int, SecondOrder]:
    return {number: SecondOrder(name) for number, name in contract.enum_names("SecondOrder").items() if number}


@functools.cache
def _origins() -> dict[int, PointOrigin]:
    return {number: PointOrigin(name) for number, name in contract.enum_names("PointOrigin").items() if number}


def options(message: Any) -> dict[str, float | int | bool | str]:
    """The options that are set in a SolveOptions."""
    return {field.name: value if field.enum_type is None else contract.enum_names(field.enum_type.name)[value]
            for field, value in message.ListFields()}


def solution(message: Any, arrays: Arrays, path: str, problem: LCQP, job_id: str) -> Solution:
    """A Solution whose arrays stand under `path` in `arrays`."""
    def array(name: str) -> Vector:
        return arrays.get(path + name, _NOTHING)

    return Solution(
        status=_statuses()[message.status],
        detail=message.detail,
        origin=_origins().get(message.origin, PointOrigin.SOLVE),
        z=array("z"),
        y=array("equality_multipliers"),
        nu=array("inequality_multipliers"),
        xi=array("complementarity_multipliers_l"),
        eta=array("complementarity_multipliers_r"),
        certificate=array("certificate"),
        objective=message.objective,
        violations=_violations(message.violations),
        kkt_residual=message.kkt_residual,
        stationarity=_stationarities().get(message.stationarity),
        b_stationary=message.b_stationary if message.HasField("b_stationary") else None,
        second_order=_second_orders().get(message.second_order),
        proved=message.proved,
        **_tree(message),
        warm_nodes=message.warm_nodes,
        iterations=message.iterations,
        factorizations=message.factorizations,
        times=_times(message.times),
        options=options(message.options),
        cold_objective=message.cold_objective,
        job_id=job_id,
        problem=problem,
        sensitivity=(sensitivity.answer(message.sensitivity, arrays, path + "sensitivity.")
                     if message.HasField("sensitivity") else None),
        conflict=_conflict(message.conflict) if message.HasField("conflict") else None,
    )


def _conflict(message: Any) -> Conflict:
    parts = (message.equalities, message.inequalities, message.left_sides, message.right_sides,
             message.complementarities)
    return Conflict.of(parts, message.minimal, message.detail, message.linear_programs, message.factorizations)


def solve_response(data: bytes, problem: LCQP | None) -> Solution:
    """The answer in a SolveResponse. Without the problem its size is all that is known of it."""
    message, arrays = wire.decode("SolveResponse", data)
    return solution(message.solution, arrays, "solution.", problem or _of_size(arrays.get("solution.z")),
                    message.job_id)


def _of_size(z: Vector | None) -> LCQP:
    """What is known of a problem by its answer alone."""
    return LCQP(None, np.zeros_like(np.zeros(1) if z is None else z))


def element(message: Any, arrays: Arrays, problem: LCQP | None) -> Solution:
    """The answer in an ArrayResultsResponse that has one."""
    path = "result.solution."
    return solution(message.result.solution, arrays, path, problem or _of_size(arrays.get(path + "z")),
                    message.result.job_id)


def read(data: bytes, problem: LCQP, tell: Callable[[Progress], object] | None,
         accept: Callable[[str], object] = lambda _: None) -> Solution | None:
    """Tells what an event of a solve's stream says; its Solution, if it is the result."""
    message, arrays = wire.decode("SolveStreamResponse", data)
    kind = message.WhichOneof("event")
    if kind == "accepted":
        accept(message.accepted.job_id)
    elif kind == "progress":
        tell_rows(message, tell)
    elif kind == "result":
        result = message.result
        return solution(result.solution, arrays, "result.solution.", problem, result.job_id)
    return None


def tell_rows(event: Any, tell: Callable[[Progress], object] | None) -> None:
    """The rows of an event of progress, and to a method `show` what the solve is doing, in words."""
    if tell is not None:
        for row in event.progress.rows:
            tell(progress(row))
        show = getattr(tell, "show", None)
        if show is not None and event.progress.activity.text:
            show(event.progress.activity.text)


def progress(row: Any) -> Progress:
    """One row."""
    return Progress(row.iteration, row.outer_iteration, row.objective, _violations(row.violations), row.kkt_residual,
                    row.kappa, row.rho, row.step_length, row.regularization, row.factorizations, row.elapsed_s,
                    np.fromiter(row.z, float, len(row.z)), **(_tree(row) if row.nodes else {}))


def job(message: Any) -> Job:
    """What is known of a job."""
    return Job(
        job_id=message.job_id,
        kind=JobKind(contract.enum_names("JobKind")[message.kind]),
        state=JobState(contract.enum_names("JobState")[message.state]),
        priority=Priority(contract.enum_names("Priority")[message.priority]),
        client=message.client,
        request_id=message.request_id,
        problem_name=message.problem_name,
        sizes=(message.variables, message.equalities, message.inequalities, message.pairs),
        accepted_unix_s=message.accepted_unix_s,
        finished_unix_s=message.finished_unix_s,
        queue_position=message.queue_position,
        estimated_wait_s=message.estimated_wait_s,
        status=_statuses().get(message.status),
        error=message.error if message.HasField("error") else None,
        detail=message.detail,
        iterations=message.iterations,
        factorizations=message.factorizations,
        objective=message.objective,
        violations=_violations(message.violations),
        proved=message.proved,
        **_tree(message),
        times=_times(message.times),
        updates=message.updates,
        memory_bytes=message.memory_bytes,
        result_bytes=message.result_bytes,
        trace_id=message.trace_id, server=message.server,
        levels=tuple(scenario_level(level) for level in message.scenario_levels),
        activity=message.activity.text,
        array=(ArrayProgress(message.array.elements, message.array.done, message.array.solved, message.array.failed)
               if message.HasField("array") else None),
    )


def scenario_level(message: Any) -> ScenarioLevel:
    """A ScenarioLevel."""
    fresh = message.fresh
    return ScenarioLevel(
        message.level, message.scenarios, _statuses()[message.status], message.detail, message.objective,
        message.variables, message.pairs, message.factorizations, message.seconds, message.warm, message.searched,
        message.memory_bytes,
        OutOfSample(fresh.scenarios, fresh.without_recourse, fresh.mean, fresh.half_width, fresh.factorizations,
                    fresh.seconds) if message.HasField("fresh") else None)


def _pair_sides(message: Any) -> PairSides:
    return PairSides(message.iteration, message.kappa, np.fromiter(message.s, float, len(message.s)),
                     np.fromiter(message.t, float, len(message.t)))


def _trace(message: Any) -> Trace:
    return Trace([progress(row) for row in message.rows], max(1, message.stride),
                 [_pair_sides(sides) for sides in message.pairs])


def job_details(data: bytes) -> JobDetails:
    """The job in a GetJobResponse."""
    message = contract.message("GetJobResponse").FromString(data)
    return JobDetails(job(message.job), options(message.options), _trace(message.trace))


def job_page(data: bytes) -> JobPage:
    """The jobs in a ListJobsResponse."""
    message = contract.message("ListJobsResponse").FromString(data)
    return JobPage([job(entry) for entry in message.jobs], message.more)


def job_events(data: bytes) -> list[JobEvent]:
    """The events in a WatchJobsResponse."""
    message = contract.message("WatchJobsResponse").FromString(data)
    return [JobEvent(job(event.job), [progress(row) for row in event.rows],
                     _trace(event.trace) if event.HasField("trace") else None, message.skipped)
            for event in message.events]


def submitted(data: bytes) -> Submitted:
    """The job in a SubmitResponse."""
    message = contract.message("SubmitResponse").FromString(data)
    return Submitted(message.job_id, message.queue_position, message.estimated_wait_s)


def submitted_array(data: bytes) -> SubmittedArray:
    """The array in a SubmitArrayResponse."""
    message = contract.message("SubmitArrayResponse").FromString(data)
    return SubmittedArray(message.job_id, message.elements)


def cancelled_job(data: bytes) -> Job:
    """The job in a CancelJobResponse."""
    return job(contract.message("CancelJobResponse").FromString(data).job)
