"""A solve of one problem, and what all solves have in common."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from marble.message import answers, records, requests, wire
from marble.message.progress import ProgressOption, reporter
from marble.message.request import Request, Run, core_options
from marble.message.requests import Call
from marble.model.lcqp import LCQP
from marble.model.problem import Problem, compiled, in_terms_of
from marble.model.scenarios import SampleAverageStage
from marble.model.solution import Solution

Result = TypeVar("Result")


class Solve(Request[Result]):
    """A solve whose response is a SolveResponse, or the last event of a stream.

    call: what accompanies it. accepted: receives the id of the job. stage: receives each SampleAverageStage; None for
    none.
    """

    stage: Callable[[SampleAverageStage], object] | None = None

    def __init__(self, call: Call, progress: ProgressOption) -> None:
        self.call = call
        self.accepted: Callable[[str], object] = _ignored
        self.report, self._close = reporter(progress)

    def close(self) -> None:
        """See Request."""
        self._close()

    def read(self, data: bytes) -> Result | None:
        """See Request."""
        if not self.streams:
            return self._result(*wire.decode("SolveResponse", data), "")
        message, arrays = wire.decode("SolveStreamResponse", data)
        kind = message.WhichOneof("event")
        if kind == "result":
            return self._result(message.result, arrays, "result.")
        if kind == "progress":
            answers.report_rows(message, self.report)
        elif kind == "accepted":
            self.accepted(message.accepted.job_id)
        elif kind == "stage" and self.stage is not None:
            self.stage(records.read(SampleAverageStage, message.stage))
        return None

    def _result(self, response: Any, arrays: records.Arrays, path: str) -> Result:
        """Of a SolveResponse whose arrays stand under `path` in `arrays`."""
        raise NotImplementedError


def _ignored(_: str) -> None:
    pass


class SolveRequest(Solve[Solution]):
    """A solve of one problem. streams: events are wanted although there is no progress function."""

    def __init__(self, problem: LCQP | Problem, call: Call, progress: ProgressOption = None, *,
                 streams: bool = False) -> None:
        self._lcqp = compiled(problem)
        super().__init__(call, progress)
        self.streams = streams or self.report is not None
        self.method = "Solver/SolveStream" if self.streams else "Solver/Solve"
        self._problem = problem.copy() if streams and isinstance(problem, Problem) else problem

    def encode(self) -> bytes:
        """See Request."""
        return requests.solve_stream(self._lcqp, self.call) if self.streams else requests.solve(self._lcqp, self.call)

    def _result(self, response: Any, arrays: records.Arrays, path: str) -> Solution:
        solution = answers.solution(response.solution, arrays, path + "solution.", self._lcqp, response.job_id)
        return in_terms_of(self._problem, solution)

    def compute(self, run: Run) -> Solution:
        """See Request."""
        options, call = core_options(self.call.options), run.call(self._lcqp, self.call, self.report)
        values = run.core.solve(self._lcqp, options, call)
        return in_terms_of(self._problem, answers.core_solution(values, self._lcqp))
