"""Jobs by their ids: submitted ones, which outlive the connection, and all others for those who look."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from numpy.typing import ArrayLike

from marble import errors
from marble.base.lazy import lazy
from marble.calls.array import ArrayAnswer, ArrayItem, ArrayReader, submission_of
from marble.connection.rpc import Rpc
from marble.message import answers, requests
from marble.message import coupled as tied
from marble.message import scenarios as worlds
from marble.message.job import Job, JobDetails, JobEvent, JobPage, JobState, Priority, Submitted, SubmittedArray
from marble.message.requests import Call
from marble.model.coupled import Coupled, CoupledAnswer, Pieces, PiecesAnswer
from marble.model.derivatives import SensitivityRequest
from marble.model.lcqp import LCQP, MatrixLike
from marble.model.problem import Problem, compiled, in_terms_of
from marble.model.scenarios import ScenarioAnswer, Scenarios
from marble.model.solution import Solution

grpc: Any = lazy("grpc")


class Jobs:
    """The jobs of a server. NotFound: never heard of it, no longer kept, or not the caller's to see."""

    def __init__(self, rpc: Rpc) -> None:
        self._rpc = rpc

    def submit(self, problem: LCQP | Problem, *, options: Mapping[str, Any] | None = None,
               priority: Priority | str | None = None, request_id: str = "", deadline: float | None = None,
               scenarios: Scenarios | None = None, sensitivity: SensitivityRequest | None = None,
               **more_options: Any) -> Submitted:
        """Queues a job that outlives this process.

        deadline: of the submission alone, seconds. Where the server has no room for another job, it is asked again
        after the time that it names, until there is some, or until the deadline would pass first: then Refused is
        raised.
        scenarios: makes it one plan for many worlds, of which `problem` is the base; scenarios() has its answer.
        request_id: one of the caller's, by which the same submission made again is the same job; a random one without.
        sensitivity: as in Client.solve.
        """
        options = requests.wishes(options, more_options)
        call = Call(options, priority, request_id, sensitivity=sensitivity)
        return answers.submitted(self._rpc.call("Jobs/Submit", submission(problem, call, scenarios), deadline))

    def submit_coupled(self, blocks: Sequence[LCQP | Problem], coupling: Sequence[MatrixLike | None],
                       total: ArrayLike, *, prices: ArrayLike | None = None,
                       options: Mapping[str, Any] | None = None, priority: Priority | str | None = None,
                       request_id: str = "", deadline: float | None = None, problem_name: str = "",
                       **settings: Any) -> Submitted:
        """Queues problems that rows tie together: all as in Client.coupled and submit. coupled() has the answer."""
        settings, options = tied.split(settings, options)
        part = tied.blocks(Coupled(blocks, coupling, total, prices), settings)
        request = requests.coupled_submission(problem_name, Call(options, priority, request_id), part)
        return answers.submitted(self._rpc.call("Jobs/Submit", request, deadline))

    def submit_pieces(self, problem: LCQP | Problem, stages: ArrayLike, pieces: int, *, look_ahead: int = -1,
                      options: Mapping[str, Any] | None = None, priority: Priority | str | None = None,
                      request_id: str = "", deadline: float | None = None, **settings: Any) -> Submitted:
        """The same of one long problem in pieces; all as in Client.pieces. pieces() has the answer."""
        settings, options = tied.split(settings, options)
        part = tied.pieces(problem, Pieces(stages, pieces, look_ahead), settings)
        request = requests.coupled_submission(compiled(problem), Call(options, priority, request_id), part)
        return answers.submitted(self._rpc.call("Jobs/Submit", request, deadline))

    def submit_array(self, elements: Iterable[LCQP | Problem | Mapping[str, Any] | ArrayItem], *,
                     base: LCQP | Problem | None = None, options: Mapping[str, Any] | None = None,
                     priority: Priority | str | None = None, request_id: str = "", name: str = "",
                     deadline: float | None = None) -> SubmittedArray:
        """Queues many problems as one job, which outlives this process: for more than a batch may wait for.

        elements: problems, or new numbers for `base` by the letters of the equation, {"g": …, "A": …}, as in
        Session.update; ArrayItem for options of one's own. All are encoded before the first is sent.
        options, priority: of all elements; batch, if no priority is given. name: for the server's log and page.
        deadline, request_id: as in submit; room is waited for alike.
        array() tells the answers.
        """
        call = Call(options, priority, request_id)
        messages = submission_of(elements, None if base is None else compiled(base), name, call)
        data = self._rpc.repeated(
            self._rpc.tries("Jobs/SubmitArray", deadline),
            lambda seconds: self._rpc.result(self._rpc.upload("Jobs/SubmitArray", iter(messages), seconds)))
        return answers.submitted_array(data)

    def array(self, job_id: str, *, after: int = 0,
              problems: Sequence[LCQP | Problem] | None = None) -> Iterator[ArrayAnswer]:
        """Yields the answers of an array, each once: those that are there, and each of the others as it comes.

        A connection that is lost meanwhile is made again. Raises what the array ended with, if that was before all its
        elements had an answer.
        after: the `sequence` of the last answer that was received before, to go on there in another process.
        problems: what was submitted, for the answers' s and t and their own terms.
        """
        reader = ArrayReader(job_id, after, problems)
        tries = self._rpc.tries("Jobs/ArrayResults", math.inf)
        while True:
            tries.left()
            stream = self._rpc.stream("Jobs/ArrayResults", reader.request())
            try:
                for data in stream:
                    tries.reached()
                    yield reader.answer(data)
                return
            except grpc.RpcError as error:
                lost = errors.from_rpc(error)
            finally:
                stream.cancel()
            self._rpc.pause(tries.pause(lost))

    def result(self, job_id: str, *, wait: bool = False, deadline: float | None = None,
               problem: LCQP | Problem | None = None) -> Solution:
        """The answer of a submitted job; raises what it ended with if there is none.

        wait: until it is there, at most `deadline` seconds; else FailedPrecondition if the job has not finished.
        problem: what was submitted, for the answer's s and t and its own terms.
        """
        request = requests.job("JobResultRequest", job_id, wait=wait)
        return result_of(self._rpc.call("Jobs/Result", request, deadline), problem)

    def scenarios(self, job_id: str, *, wait: bool = False, deadline: float | None = None) -> ScenarioAnswer:
        """The same of a job that was submitted with scenarios."""
        request = requests.job("JobResultRequest", job_id, wait=wait)
        return worlds.response(self._rpc.call("Jobs/Result", request, deadline))

    def coupled(self, job_id: str, blocks: Sequence[LCQP | Problem], *, wait: bool = False,
                deadline: float | None = None) -> CoupledAnswer:
        """The same of a job that was submitted with submit_coupled; `blocks` as they were, for their sizes."""
        request = requests.job("JobResultRequest", job_id, wait=wait)
        return tied.blocks_answer(tied.response(self._rpc.call("Jobs/Result", request, deadline)), blocks)

    def pieces(self, job_id: str, *, wait: bool = False, deadline: float | None = None,
               problem: LCQP | Problem | None = None) -> PiecesAnswer:
        """The same of submit_pieces. problem: what was submitted, for the answer's s and t and its own terms."""
        request = requests.job("JobResultRequest", job_id, wait=wait)
        return tied.pieces_answer(tied.response(self._rpc.call("Jobs/Result", request, deadline)), problem)

    def list(self, *, states: Sequence[JobState | str] = (), client: str = "", limit: int = 0,
             before: str = "") -> JobPage:
        """A page of jobs, newest first.

        states: only these; none means all. client: only its jobs. limit: in [0, 10000]; 0 means 100. before: only jobs
        older than that id, to page on.
        """
        return answers.job_page(self._rpc.call("Jobs/List", requests.list_jobs(tuple(states), client, limit, before)))

    def get(self, job_id: str) -> JobDetails:
        """A job with its options and its convergence."""
        return answers.job_details(self._rpc.call("Jobs/Get", requests.job("GetJobRequest", job_id)))

    def cancel(self, job_id: str) -> Job:
        """Ends a job: a waiting one at once, a running one within an iteration, with its best iterate."""
        return answers.cancelled_job(self._rpc.call("Jobs/Cancel", requests.job("CancelJobRequest", job_id)))

    def delete(self, job_id: str) -> None:
        """Lets a submitted job and its answer go; ends it if it has not finished."""
        self._rpc.call("Jobs/Delete", requests.job("DeleteJobRequest", job_id))

    def watch(self, job_id: str = "", *, progress_interval: float = 0.25) -> Iterator[JobEvent]:
        """Yields what happens: of one job until it has finished, of all (no id) for ever.

        progress_interval: least time between two events about the progress of one job, seconds, ≥ 0.
        """
        request = requests.job("WatchJobsRequest", job_id, progress_interval_s=progress_interval)
        tries = self._rpc.tries("Jobs/Watch", math.inf)
        told = False
        while True:
            tries.left()
            stream = self._rpc.stream("Jobs/Watch", request)
            try:
                for data in stream:
                    tries.reached()
                    told = True
                    yield from answers.job_events(data)
                return
            except grpc.RpcError as error:
                lost = errors.from_rpc(error)
            finally:
                stream.cancel()
            if told:
                raise lost
            self._rpc.pause(tries.pause(lost))


def submission(problem: LCQP | Problem, call: Call, scenarios: Scenarios | None) -> bytes:
    """What Submit is sent."""
    if scenarios is None:
        return requests.submission(compiled(problem), call)
    return worlds.submission(problem, scenarios, call)


def result_of(data: bytes, problem: LCQP | Problem | None) -> Solution:
    """The answer in a SolveResponse to the problem, if that is known."""
    if problem is None:
        return answers.solve_response(data, None)
    return in_terms_of(problem, answers.solve_response(data, compiled(problem)))
