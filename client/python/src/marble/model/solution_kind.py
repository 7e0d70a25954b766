"""What kind of answer a solution is, in words for its user, and what a better one costs.

The rules are those of marble/report/solution_kind.h; tests/answers/kinds.json is the table of cases for both.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from marble.base.tables import Status

_NO_GAP = 1e-6  # up to this gap the text says "proved optimal" alone


class SolutionKind(enum.Enum):
    """What a solution is worth, by its status, its proof and the tests of its stationary point.

    PROVED_OPTIMAL: within gap_tolerance of the bound. OPTIMAL: of a problem without pairs whose Q is known to be
    convex, by the tolerances. LOCAL_MINIMUM: no better point is near; one may be elsewhere.
    STATIONARY_POINT: solved, but not decided whether it is a local minimum. SADDLE_POINT: solved, and no local minimum.
    ALMOST_SOLVED: the reduced tolerances only. PROVED_INFEASIBLE: no point meets the constraints. NO_FEASIBLE_POINT:
    none was found; there may be one. PROVED_UNBOUNDED: the objective falls without end. STOPPED_FEASIBLE,
    STOPPED_INFEASIBLE: a limit or a cancel ended the solve, at a point that meets the tolerances, or does not. FAILED:
    no acceptable step was found.
    """

    PROVED_OPTIMAL = "proved_optimal"
    OPTIMAL = "optimal"
    LOCAL_MINIMUM = "local_minimum"
    STATIONARY_POINT = "stationary_point"
    SADDLE_POINT = "saddle_point"
    ALMOST_SOLVED = "almost_solved"
    PROVED_INFEASIBLE = "proved_infeasible"
    NO_FEASIBLE_POINT = "no_feasible_point"
    PROVED_UNBOUNDED = "proved_unbounded"
    STOPPED_FEASIBLE = "stopped_feasible"
    STOPPED_INFEASIBLE = "stopped_infeasible"
    FAILED = "failed"


_SPENT = "The search for better branches has spent local_search_budget: a larger one lets it go on. "
_BY_STATUS = {
    Status.SOLVED_REDUCED: SolutionKind.ALMOST_SOLVED,
    Status.INFEASIBLE: SolutionKind.PROVED_INFEASIBLE,
    Status.LOCALLY_INFEASIBLE: SolutionKind.NO_FEASIBLE_POINT,
    Status.UNBOUNDED: SolutionKind.PROVED_UNBOUNDED,
    Status.NUMERICAL_FAILURE: SolutionKind.FAILED,
}
_TEXTS = {
    SolutionKind.OPTIMAL: "optimal: Q is convex, and there are no pairs",
    SolutionKind.SADDLE_POINT: "saddle point: the objective falls along a direction of negative curvature",
    SolutionKind.ALMOST_SOLVED: "almost solved: the tolerances are met up to a factor of 100 only",
    SolutionKind.PROVED_INFEASIBLE: "proved infeasible: no point meets the constraints",
    SolutionKind.NO_FEASIBLE_POINT: "no feasible point found; infeasibility is not proved",
    SolutionKind.PROVED_UNBOUNDED: "proved unbounded: the objective falls without end",
    SolutionKind.STOPPED_INFEASIBLE: "stopped before a feasible point was found",
    SolutionKind.FAILED: "failed: no acceptable step was found",
}


@dataclass(frozen=True)
class SolutionFacts:
    """What the kind of a solution, its text and its advice follow from; second_order as a word, "unknown" without one.

    feasible: the point is within the tolerances. budget_spent: the factorizations have reached local_search_budget,
    which says nothing of an answer by segments, as each of them has that budget.
    starts, global_search: the options starts and global.
    """

    status: Status
    proved: bool = False
    b_stationary: bool | None = None
    second_order: str = "unknown"
    objective: float = 0.0
    gap: float = math.inf
    feasible: bool = False
    pairs: int = 0
    factorizations: int = 0
    budget_spent: bool = False
    starts: int = 1
    global_search: bool = False

    @property
    def kind(self) -> SolutionKind:
        """The kind of answer."""
        if self.status is not Status.SOLVED:
            stopped = SolutionKind.STOPPED_FEASIBLE if self.feasible else SolutionKind.STOPPED_INFEASIBLE
            return _BY_STATUS.get(self.status, stopped)
        if self.proved:
            return SolutionKind.PROVED_OPTIMAL
        if self.second_order == "saddle":
            return SolutionKind.SADDLE_POINT
        if self.second_order not in ("minimum", "convex") or self.b_stationary is False:
            return SolutionKind.STATIONARY_POINT
        optimal = self.second_order == "convex" and self.pairs == 0
        return SolutionKind.OPTIMAL if optimal else SolutionKind.LOCAL_MINIMUM

    @property
    def text(self) -> str:
        """In one line: "proved optimal", "local minimum; no bound is known"."""
        kind = self.kind
        if kind is SolutionKind.PROVED_OPTIMAL:
            near = _NO_GAP < self.gap < math.inf
            return f"proved optimal to within {self._distance()}" if near else "proved optimal"
        if kind is SolutionKind.LOCAL_MINIMUM:
            is_qp = self.pairs == 0 and self.gap == math.inf
            return f"local minimum; {'the optimum where Q is convex' if is_qp else self._bound()}"
        if kind is SolutionKind.STATIONARY_POINT:
            return f"stationary point only: {self._undecided()}; {self._bound()}"
        if kind is SolutionKind.STOPPED_FEASIBLE:
            return f"stopped at a feasible point; {self._bound()}"
        return _TEXTS[kind]

    @property
    def what_to_try(self) -> str:
        """What may give a better answer, and what that costs; empty where nothing does."""
        kind = self.kind
        if kind in (SolutionKind.PROVED_OPTIMAL, SolutionKind.OPTIMAL):
            return ""
        if kind is SolutionKind.LOCAL_MINIMUM:
            return ("Where Q is not convex: " if self.pairs == 0 else "") + self._starts() + self._global()
        if kind is SolutionKind.STATIONARY_POINT:
            return (_SPENT if self.budget_spent else "") + self._starts() + self._global()
        if kind is SolutionKind.SADDLE_POINT:
            return "Raise local_search_budget or time_limit_s: the descent from the saddle point was cut short."
        return self.status.advice

    # Rounded up, for the sentence says "at most". A gap is relative to the objective only where that is above 1.
    def _distance(self) -> str:
        if abs(self.objective) < 1.0:
            return f"{math.ceil(1e3 * self.gap) / 1e3:.3f}"
        percent = 100.0 * self.gap
        if percent >= 10.0:
            return f"{math.ceil(percent):.0f} %"
        if percent >= 1.0:
            return f"{math.ceil(10.0 * percent) / 10.0:.1f} %"
        return f"{max(1.0, math.ceil(100.0 * percent)) / 100.0:.2f} %"

    def _bound(self) -> str:
        return f"at most {self._distance()} from the optimum" if self.gap < math.inf else "no bound is known"

    def _undecided(self) -> str:
        if self.b_stationary is False:
            return "the objective falls along another branch"
        if self.b_stationary or self.pairs == 0:
            return "its curvature was not decided"
        return "a better branch may lie next to it"

    def _starts(self) -> str:
        if self.starts > 1:
            return f"starts={2 * self.starts} searches twice as often, for about twice the work{self._work()}"
        return f"starts=8 searches 8 times, for about 8 times the work{self._work()}"

    def _work(self) -> str:
        return f" (this solve: {self.factorizations} factorization{'' if self.factorizations == 1 else 's'})."

    def _global(self) -> str:
        if self.global_search:
            return " The proof did not come to its end: detail says why."
        if self.pairs == 0:
            return ""
        return (f" global=true searches the branches of the {self.pairs} pair{'' if self.pairs == 1 else 's'} for the "
                "best one and proves it; that may take much longer, and time_limit_s ends it with a bound.")
