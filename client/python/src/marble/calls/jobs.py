"""Jobs by their ids: submitted ones, which outlive the connection, and all others that the caller may see."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

from numpy.typing import ArrayLike

from marble.calls.array import ArrayAnswer, ArrayItem, ArrayResults, submission_of
from marble.message import answers, coupled, requests
from marble.message import scenarios as two_stage
from marble.message.job import Job, JobDetails, JobEvent, JobPage, JobState, Priority, Submitted, SubmittedArray
from marble.message.request import Message, Stream, Unary
from marble.message.requests import Call
from marble.model.coupled import Coupled, CoupledSolution, Segments, SegmentsSolution
from marble.model.derivatives import SensitivityRequest
from marble.model.lcqp import LCQP, MatrixLike
from marble.model.problem import Problem, compiled, in_terms_of
from marble.model.scenarios import Scenarios, ScenarioSolution
from marble.model.solution import Solution

Result = TypeVar("Result")
_SUBMITTED = answers.reads(Submitted, "SubmitResponse")


class JobEvents(Stream[JobEvent]):
    """The events of one job, or of all without an id."""

    method = "Jobs/Watch"

    def __init__(self, job_id: str, progress_interval: float) -> None:
        self._message = requests.job("WatchJobsRequest", job_id, progress_interval_s=progress_interval)

    def encode(self) -> bytes:
        """See Stream."""
        return self._message

    def read(self, data: bytes) -> Iterable[JobEvent]:
        """See Stream."""
        return answers.job_events(data)


class OnTransport:
    """Calls that only a server has, over a transport of marble or of marble.aio."""

    def __init__(self, transport: Any) -> None:
        self._transport = transport

    def _call(self, method: str, message: Message, read: Callable[[bytes], Result],
              deadline: float | None = None) -> Result:
        result: Result = self._transport.run(Unary(method, message, read), deadline)
        return result

    def _of_job(self, method: str, kind: str, job_id: str, read: Callable[[bytes], Result],
                deadline: float | None = None, **fields: Any) -> Result:
        return self._call(method, requests.job(kind, job_id, **fields), read, deadline)


class Jobs(OnTransport):
    """The jobs of a server. NotFound: unknown, no longer kept, or not visible to the caller."""

    def submit(self, /, problem: LCQP | Problem, *, options: Mapping[str, Any] | None = None,
               priority: Priority | str | None = None, request_id: str = "", deadline: float | None = None,
               scenarios: Scenarios | None = None, sensitivity: SensitivityRequest | None = None,
               **more_options: Any) -> Submitted:
        """Queues a job that outlives this process.

        deadline: of the submission alone, seconds. If the server is full, the submission is
        repeated after the time that it names, until it is accepted or the deadline would pass first: then Refused is
        raised.
        scenarios: makes it a two-stage problem with scenarios, of which `problem` is the base; see scenarios().
        request_id: a submission that is repeated with the same id is the same job; without one a random id is used.
        sensitivity: as in Client.solve.
        """
        options = requests.merged(options, more_options)
        call = Call(options, priority, request_id, sensitivity=sensitivity)
        parts = {} if scenarios is None else {"scenarios": two_stage.encoder(problem, scenarios)}
        return self._call("Jobs/Submit", requests.submission(compiled(problem), call, **parts), _SUBMITTED,
                          deadline)

    def submit_coupled(self, /, blocks: Sequence[LCQP | Problem], coupling: Sequence[MatrixLike | None],
                       coupling_rhs: ArrayLike, *, coupling_multipliers: ArrayLike | None = None,
                       options: Mapping[str, Any] | None = None, priority: Priority | str | None = None,
                       request_id: str = "", deadline: float | None = None, problem_name: str = "",
                       **settings: Any) -> Submitted:
        """Queues problems coupled by rows, as Client.coupled and submit take them; coupled() returns the solution."""
        settings, options = coupled.split(settings, options)
        part = coupled.blocks_encoder(Coupled(blocks, coupling, coupling_rhs, coupling_multipliers), settings)
        request = requests.submission(problem_name, Call(options, priority, request_id), coupled=part)
        return self._call("Jobs/Submit", request, _SUBMITTED, deadline)

    def submit_segments(self, /, problem: LCQP | Problem, stages: ArrayLike, num_segments: int, *, overlap: int = -1,
                      options: Mapping[str, Any] | None = None, priority: Priority | str | None = None,
                      request_id: str = "", deadline: float | None = None, **settings: Any) -> Submitted:
        """Queues one long problem in segments, as Client.segments takes it; segments() returns the solution."""
        settings, options = coupled.split(settings, options)
        part = coupled.segments_encoder(problem, Segments(stages, num_segments, overlap), settings)
        request = requests.submission(compiled(problem), Call(options, priority, request_id), coupled=part)
        return self._call("Jobs/Submit", request, _SUBMITTED, deadline)

    def submit_array(self, /, elements: Iterable[LCQP | Problem | Mapping[str, Any] | ArrayItem], *,
                     base: LCQP | Problem | None = None, options: Mapping[str, Any] | None = None,
                     priority: Priority | str | None = None, request_id: str = "", name: str = "",
                     deadline: float | None = None, **more_options: Any) -> SubmittedArray:
        """Queues many problems as one job, which outlives this process: for more than a batch may wait for.

        elements: problems, or new numbers for `base` by the letters of the equation, {"g": …, "A": …}, as in
        Session.update; ArrayItem for options of one's own. All are encoded before the first is sent.
        options, or any option by its name, and priority: of all elements; batch, if no priority is given. name: for the
        server's log and page.
        deadline, request_id: as in submit. array() yields the results.
        """
        call = Call(requests.merged(options, more_options), priority, request_id)
        messages = submission_of(elements, None if base is None else compiled(base), name, call)
        return self._call("Jobs/SubmitArray", messages, answers.reads(SubmittedArray, "SubmitArrayResponse"), deadline)

    def array(self, job_id: str, *, after: int = 0,
              problems: Sequence[LCQP | Problem] | None = None) -> Iterator[ArrayAnswer]:
        """Yields the results of an array, each once: those that exist, then each of the others as it is computed.

        A lost connection is restored. Raises the error that the array ended with, if it ended before all its elements.
        after: the `sequence` of the last result received before, to continue in another process. problems: what was
        submitted, for the solutions' s and t and their own terms.
        """
        results: Iterator[ArrayAnswer] = self._transport.stream(ArrayResults(job_id, after, problems))
        return results

    def result(self, job_id: str, *, wait: bool = False, deadline: float | None = None,
               problem: LCQP | Problem | None = None) -> Solution:
        """The solution of a submitted job; raises the error that it ended with if there is none.

        wait: for its end, at most `deadline` seconds; else FailedPrecondition if the job has not finished. problem:
        what was submitted, for the solution's s and t and its own terms.
        """
        known = None if problem is None else compiled(problem)

        def read(data: bytes) -> Solution:
            solution = answers.solve_response(data, known)
            return solution if problem is None else in_terms_of(problem, solution)

        return self._of_job("Jobs/Result", "JobResultRequest", job_id, read, deadline, wait=wait)

    def scenarios(self, job_id: str, *, wait: bool = False, deadline: float | None = None) -> ScenarioSolution:
        """The solution of a job that was submitted with scenarios."""
        return self._of_job("Jobs/Result", "JobResultRequest", job_id, two_stage.response, deadline, wait=wait)

    def coupled(self, job_id: str, blocks: Sequence[LCQP | Problem], *, wait: bool = False,
                deadline: float | None = None) -> CoupledSolution:
        """The solution of a job of submit_coupled; blocks: what was submitted, for their sizes."""
        return self._of_job("Jobs/Result", "JobResultRequest", job_id,
                            lambda data: coupled.blocks_response(data, blocks), deadline, wait=wait)

    def segments(self, job_id: str, *, wait: bool = False, deadline: float | None = None,
                 problem: LCQP | Problem | None = None) -> SegmentsSolution:
        """The solution of a job of submit_segments. problem: as in result."""
        return self._of_job("Jobs/Result", "JobResultRequest", job_id,
                            lambda data: coupled.segments_response(data, problem), deadline, wait=wait)

    def list(self, *, states: Sequence[JobState | str] = (), client: str = "", limit: int = 0,
             before: str = "") -> JobPage:
        """A page of jobs, newest first.

        states: only these; none means all. client: only its jobs. limit: in [0, 10000]; 0 means 100. before: only jobs
        older than that id, to page on.
        """
        return self._call("Jobs/List", requests.list_jobs(tuple(states), client, limit, before),
                          answers.reads(JobPage, "ListJobsResponse"))

    def get(self, job_id: str) -> JobDetails:
        """A job with its options, its convergence and, if its problem is infeasible, the reason."""
        return self._of_job("Jobs/Get", "GetJobRequest", job_id, answers.reads(JobDetails, "GetJobResponse"))

    def cancel(self, job_id: str) -> Job:
        """Ends a job: a waiting one at once, a running one within an iteration, with its best iterate."""
        return self._of_job("Jobs/Cancel", "CancelJobRequest", job_id, answers.cancelled_job)

    def delete(self, job_id: str) -> None:
        """Deletes a submitted job and its result; ends it if it has not finished."""
        return self._of_job("Jobs/Delete", "DeleteJobRequest", job_id, _nothing)

    def watch(self, job_id: str = "", *, progress_interval: float = 0.25) -> Iterator[JobEvent]:
        """Yields the events of one job until it has finished, or of all jobs (no id) without end.

        progress_interval: least time between two events about the progress of one job, seconds, ≥ 0.
        """
        events: Iterator[JobEvent] = self._transport.stream(JobEvents(job_id, progress_interval))
        return events


def _nothing(_: bytes) -> None:
    pass


__all__ = ["Jobs", "OnTransport"]
