"""Solutions, progress and jobs: read from the server's messages and from marble._core's values."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from marble.base import contract
from marble.base.log import logger
from marble.base.tables import Status
from marble.errors import Cancelled
from marble.message import records, sensitivity, wire
from marble.message.job import Job, JobEvent
from marble.model.lcqp import LCQP, Vector
from marble.model.solution import Progress, Solution

Report = Callable[[Progress], object]
Record = TypeVar("Record")
_SOLUTION = "marble.v1.Solution"


def solution(message: Any, arrays: records.Arrays, path: str, problem: LCQP | None, job_id: str) -> Solution:
    """A Solution whose arrays stand under `path` in `arrays`. problem: None where it is not known."""
    derivatives = None
    if message.HasField("sensitivity"):
        derivatives = sensitivity.answer(message.sensitivity, arrays, path + "sensitivity.")
    return _logged(records.read(Solution, message, arrays, path, _SOLUTION, job_id=job_id,
                                problem=problem or of_size(arrays.get(path + "z")), sensitivity=derivatives))


def of_size(z: Vector | None) -> LCQP:
    """A problem of which the number of variables is known alone."""
    return LCQP(None, np.zeros(max(1, 0 if z is None else z.size)))


def core_solution(values: dict[str, Any], problem: LCQP | None) -> Solution:
    """The solution of marble._core; also of a solve that was stopped."""
    if problem is None:
        problem = of_size(np.asarray(values["z"]))
    if (conflict := values["conflict"]) is not None:
        values["conflict"] = (*conflict[0], *conflict[1:])
    derivatives = sensitivity.core_answer(values["sensitivity"], problem.n)
    return _logged(records.of_core(Solution, values, job_id="", problem=problem, sensitivity=derivatives))


def _logged(answer: Solution) -> Solution:
    if logger.isEnabledFor(logging.DEBUG):
        logger.debug("solution of %r, job %r: %s, objective %.10g, %d iterations, %.3f ms", answer.problem.name,
                     answer.job_id, answer.status.value, answer.objective, answer.iterations,
                     1e3 * answer.times.total_s)
    return answer


def unless_cancelled(answer: Solution) -> Solution:
    """The solution; raises Cancelled for a solve that the caller ended."""
    if answer.status is Status.CANCELLED:
        raise Cancelled("given up by the caller")
    return answer


def solve_response(data: bytes, problem: LCQP | None) -> Solution:
    """The solution in a SolveResponse."""
    message, arrays = wire.decode("SolveResponse", data)
    return solution(message.solution, arrays, "solution.", problem, message.job_id)


def report_rows(event: Any, report: Report | None) -> None:
    """Passes the rows of an event of progress on, and to a method `show` what the solve is doing, in words."""
    if report is not None:
        for row in event.progress.rows:
            report(progress(row))
        show = getattr(report, "show", None)
        if show is not None and event.progress.activity.text:
            show(event.progress.activity.text)


def progress(row: Any) -> Progress:
    """One row."""
    return records.read(Progress, row, name="marble.v1.Progress")


def reads(kind: type[Record], message: str) -> Callable[[bytes], Record]:
    """A function that reads a record from the bytes of a message of that name."""
    return lambda data: records.read(kind, contract.message(message).FromString(data))


def cancelled_job(data: bytes) -> Job:
    """The job in a CancelJobResponse."""
    return records.read(Job, contract.message("CancelJobResponse").FromString(data).job)


def job_events(data: bytes) -> list[JobEvent]:
    """The events in a WatchJobsResponse."""
    message = contract.message("WatchJobsResponse").FromString(data)
    return [records.read(JobEvent, event, skipped=message.skipped) for event in message.events]
