"""One plan for many worlds, and problems tied by rows: solved by marble._core on the thread that asks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from marble.base.tables import Status
from marble.errors import InvalidProblem
from marble.in_process import solver
from marble.in_process.ending import under_way
from marble.message import coupled as tied
from marble.message import scenarios as worlds
from marble.message.requests import Call
from marble.model import coupled, scenarios
from marble.model.coupled import Coordination, Coupled, CoupledAnswer, Pieces, PiecesAnswer
from marble.model.lcqp import LCQP
from marble.model.problem import Problem, compiled, in_terms_of
from marble.model.scenarios import OutOfSample, ScenarioAnswer, ScenarioEnd, ScenarioLevel, Scenarios
from marble.model.solution import Progress, Solution

Tell = Callable[[Progress], object] | None
OpenBlock = Callable[[Mapping[str, Any], str], Callable[[Mapping[str, Any], Any], Solution]]


def _level(told: dict[str, Any]) -> ScenarioLevel:
    fresh = told.pop("fresh")
    status = Status(told.pop("status"))
    return ScenarioLevel(**told, status=status, fresh=None if fresh is None else OutOfSample(*fresh))


def _without_start(problem: LCQP, whose: str) -> LCQP:
    if problem.z0 is not None:
        raise InvalidProblem("z0", f"must be absent: {whose} have their own starts")
    return problem


def _solution(told: dict[str, Any], problem: LCQP | None = None) -> Solution:
    known = problem or LCQP(None, np.zeros(np.asarray(told["z"]).size or 1))
    return solver.unless_cancelled(solver.solution(told, known))


def solve_scenarios(problem: LCQP | Problem, wish: Scenarios, call: Call,
                    level: Callable[[ScenarioLevel], object] | None, tell: Tell, deadline: float | None,
                    stop: Any = None) -> ScenarioAnswer:
    """As Client.scenarios; whoever has `stop` gives it up."""
    lcqp, drawn = _without_start(compiled(problem), "scenarios"), scenarios.drawn(problem, wish)
    settings = worlds.settings(wish)
    asked: dict[str, Any] = {
        "first_stage": drawn.plan, "own_equalities": drawn.own_equalities, "own_inequalities": drawn.own_inequalities,
        "own_pairs": drawn.own_pairs, "settings": {name: getattr(settings, name) for name in worlds.SETTINGS}}
    number = scenarios.PARTS.index
    if drawn.table is not None:
        entries = [(number(part), places) for part, places in drawn.table.entries.items()]
        asked["table"] = (entries, drawn.table.values, drawn.table.weights)
    else:
        asked["sampler"] = (wish.seed, [
            (one.distribution, one.location, one.scale, one.least, one.most,
             [(number(part), np.flatnonzero(gains), gains[np.flatnonzero(gains)]) for part, gains in moves.items()
              if gains.any()])
            for one, moves in drawn.quantities])
    tell_level = None if level is None else lambda told: level(_level(told))
    stop = stop or solver.core().Stop()
    with solver.faults(), under_way(stop), solver.showing(stop, tell):
        told = solver.core().solve_scenarios(lcqp, solver.option_values(call.options), asked, tell_level,
                                             solver.core_call(lcqp, call, tell, deadline, stop))
    outcome = told.pop("scenarios")
    return scenarios.answer_of(_solution(told), ScenarioEnd(outcome["end"]), outcome["scenarios"],
                               drawn.plan.size, outcome["infeasible"], [_level(one) for one in outcome["levels"]])


def _coordination(told: dict[str, Any]) -> Coordination:
    return Coordination(status=Status(told.pop("status")), **told)


def solve_coupled(wish: Coupled, settings: Mapping[str, Any], call: Call, tell: Tell, deadline: float | None,
                  stop: Any = None, open_block: OpenBlock | None = None) -> CoupledAnswer:
    """As Client.coupled; whoever has `stop` gives it up. open_block: None, or who solves the blocks."""
    chosen, checked = _settings(settings), coupled.checked(wish)
    stop = stop or solver.core().Stop()
    accompanied = solver.core_call(checked.blocks[0][0], call, tell, deadline, stop)
    with solver.faults(), under_way(stop), solver.showing(stop, tell):
        told = solver.core().solve_coupled(list(checked.blocks), checked.total, checked.prices,
                                           solver.option_values(call.options), chosen, open_block, accompanied)
    coordination, prices = _coordination(told.pop("coupled")), np.asarray(told.pop("prices"))
    return coupled.answer_of(_solution(told), wish.blocks, prices, coordination)


def solve_in_pieces(problem: LCQP | Problem, wish: Pieces, settings: Mapping[str, Any], call: Call, tell: Tell,
                    deadline: float | None, stop: Any = None, open_block: OpenBlock | None = None) -> PiecesAnswer:
    """As Client.pieces; whoever has `stop` gives it up. open_block: None, or who solves the pieces as they agree."""
    lcqp = _without_start(compiled(problem), "coupled problems")
    chosen, stages, cut = _settings(settings), coupled.stages_of(lcqp, wish), tied.cut(wish)
    stop = stop or solver.core().Stop()
    with solver.faults(), under_way(stop), solver.showing(stop, tell):
        told = solver.core().solve_in_pieces(lcqp, stages, cut.pieces, cut.look_ahead,
                                             solver.option_values(call.options), chosen, open_block,
                                             solver.core_call(lcqp, call, tell, deadline, stop))
    coordination = _coordination(told.pop("coupled"))
    return PiecesAnswer(in_terms_of(problem, _solution(told, lcqp)), coordination, "")


def _settings(given: Mapping[str, Any]) -> dict[str, Any]:
    message = tied.message(given)
    names: Sequence[str] = tied.SETTINGS
    return {name: getattr(message, name) for name in names if message.HasField(name)}
