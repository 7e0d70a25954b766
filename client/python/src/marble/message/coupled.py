"""Problems coupled by rows, or cut into segments: the requests of their solves, and their results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from marble.base import contract
from marble.errors import FailedPrecondition, InvalidArgument
from marble.message import answers, records, requests, wire
from marble.message.progress import ProgressOption
from marble.message.request import Run, core_options
from marble.message.requests import Call
from marble.message.scenarios import without_start
from marble.message.solve import Solve
from marble.message.wire import Encoder
from marble.model import coupled as model
from marble.model.coupled import Coordination, Coupled, CoupledSolution, Segments, SegmentsSolution
from marble.model.lcqp import LCQP
from marble.model.problem import Problem, compiled, in_terms_of
from marble.model.solution import Solution

SETTINGS: Final = ("proximal", "max_iterations", "freeze_after", "max_searches", "max_pair_switches", "tolerance",
                   "monolithic", "monolithic_search")


def split(given: Mapping[str, Any],
          options: Mapping[str, Any] | None) -> tuple[dict[str, Any], Mapping[str, Any] | None]:
    """The settings among what is given by name, and the options with the rest."""
    rest = {name: value for name, value in given.items() if name not in SETTINGS}
    return ({name: value for name, value in given.items() if name in SETTINGS},
            requests.merged(options, rest, (*SETTINGS, "sessions")))


def _message(kind: str, field: str, what: str, values: Mapping[str, Any]) -> Any:
    try:
        return contract.message(kind)(**values)
    except (TypeError, ValueError) as error:
        raise InvalidArgument(field, f"has a {what} of the wrong type ({error})") from None


def blocks_encoder(coupled: Coupled, settings: Mapping[str, Any]) -> Encoder:
    """A Coupled message of blocks."""
    part = Encoder("Coupled")
    part.others(_settings(settings))
    checked = model.checked(coupled)
    for lcqp, coupling in checked.blocks:
        one = Encoder("CoupledBlock")
        one.message("problem", requests.problem_encoder(lcqp))
        if coupling is not None:
            one.message("coupling", requests.matrix_encoder(coupling))
        part.message("blocks", one)
    part.doubles("coupling_rhs", checked.coupling_rhs)
    if checked.coupling_multipliers is not None:
        part.doubles("coupling_multipliers", checked.coupling_multipliers)
    return part


def segments_encoder(problem: LCQP | Problem, segments: Segments, settings: Mapping[str, Any]) -> Encoder:
    """A Coupled message of a problem in segments."""
    part, own = Encoder("Coupled"), Encoder("Segments")
    part.others(_settings(settings))
    own.integers("stages", model.stages_of(compiled(problem), segments))
    own.others(_numbers(segments))
    part.message("segments", own)
    return part


def _settings(given: Mapping[str, Any]) -> Any:
    return _message("Coupled", "coupled", "setting", given)


def _numbers(segments: Segments) -> Any:
    return _message("Segments", "segments", "number",
                    {"num_segments": segments.num_segments, "overlap": segments.overlap})


def _core_settings(given: Mapping[str, Any]) -> dict[str, Any]:
    message = _settings(given)
    return {name: getattr(message, name) for name in SETTINGS if message.HasField(name)}


class CoupledRequest(Solve[CoupledSolution]):
    """A solve of blocks that rows couple."""

    method, streams = "Solver/SolveCoupled", True

    def __init__(self, coupled: Coupled, settings: Mapping[str, Any], call: Call, progress: ProgressOption,
                 name: str) -> None:
        super().__init__(call, progress)
        self._coupled, self._settings, self.name = coupled, settings, name

    def encode(self) -> bytes:
        """See Request."""
        return requests.solve_stream(self.name, self.call, coupled=blocks_encoder(self._coupled, self._settings))

    def _result(self, response: Any, arrays: records.Arrays, path: str) -> CoupledSolution:
        return _blocks_solution(response, arrays, path, self._coupled.blocks)

    def compute(self, run: Run) -> CoupledSolution:
        """See Request."""
        chosen, checked = _core_settings(self._settings), model.checked(self._coupled)
        call = run.call(checked.blocks[0][0], self.call, self.report)
        values = run.core.solve_coupled(list(checked.blocks), checked.coupling_rhs, checked.coupling_multipliers,
                                        core_options(self.call.options), chosen, run.open_block, call)
        coordination = records.of_core(Coordination, values.pop("coupled"))
        multipliers = np.asarray(values.pop("coupling_multipliers"))
        return model.solution_of(answers.core_solution(values, None), self._coupled.blocks, multipliers, coordination)


class SegmentsRequest(Solve[SegmentsSolution]):
    """A solve of one long problem in segments."""

    method, streams = "Solver/SolveCoupled", True

    def __init__(self, problem: LCQP | Problem, segments: Segments, settings: Mapping[str, Any], call: Call,
                 progress: ProgressOption) -> None:
        super().__init__(call, progress)
        self._problem, self._segments, self._settings = problem, segments, settings
        self.name = compiled(problem).name

    def encode(self) -> bytes:
        """See Request."""
        return requests.solve_stream(compiled(self._problem), self.call,
                                     coupled=segments_encoder(self._problem, self._segments, self._settings))

    def _result(self, response: Any, arrays: records.Arrays, path: str) -> SegmentsSolution:
        return _segments_solution(response, arrays, path, self._problem)

    def compute(self, run: Run) -> SegmentsSolution:
        """See Request."""
        lcqp = without_start(compiled(self._problem), "coupled problems")
        chosen, numbers = _core_settings(self._settings), _numbers(self._segments)
        values = run.core.solve_in_segments(lcqp, model.stages_of(lcqp, self._segments), numbers.num_segments,
                                          numbers.overlap, core_options(self.call.options), chosen,
                                          run.open_block, run.call(lcqp, self.call, self.report))
        coordination = records.of_core(Coordination, values.pop("coupled"))
        return SegmentsSolution(in_terms_of(self._problem, answers.core_solution(values, lcqp)), coordination, "")


def _coordinated(response: Any, arrays: records.Arrays, path: str, problem: LCQP | None) -> tuple[Solution,
                                                                                                  Coordination]:
    if not response.solution.HasField("coupled"):
        raise FailedPrecondition("coupled", "is not in this answer: its problem was solved alone")
    return (answers.solution(response.solution, arrays, path + "solution.", problem, response.job_id),
            records.read(Coordination, response.solution.coupled))


def _blocks_solution(response: Any, arrays: records.Arrays, path: str,
                     blocks: Sequence[LCQP | Problem]) -> CoupledSolution:
    solution, coordination = _coordinated(response, arrays, path, None)
    coupling_multipliers = arrays.get(path + "solution.coupled.coupling_multipliers", np.zeros(0))
    return model.solution_of(solution, blocks, coupling_multipliers, coordination)


def _segments_solution(response: Any, arrays: records.Arrays, path: str,
                       problem: LCQP | Problem | None) -> SegmentsSolution:
    known = None if problem is None else compiled(problem)
    solution, coordination = _coordinated(response, arrays, path, known)
    return SegmentsSolution(solution if problem is None else in_terms_of(problem, solution), coordination,
                          response.job_id)


def blocks_response(data: bytes, blocks: Sequence[LCQP | Problem]) -> CoupledSolution:
    """The solution in a SolveResponse of blocks."""
    return _blocks_solution(*wire.decode("SolveResponse", data), "", blocks)


def segments_response(data: bytes, problem: LCQP | Problem | None) -> SegmentsSolution:
    """The solution in a SolveResponse of segments, of which the problem may be unknown."""
    return _segments_solution(*wire.decode("SolveResponse", data), "", problem)
