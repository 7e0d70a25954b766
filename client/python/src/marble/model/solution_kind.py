"""The kind of a solution, in words, and what a better one costs.

The texts are those of contract.def, the rules those of marble/report/solution_kind.h; tests/answers has cases for all
languages.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from marble.base.tables import KIND_ADVICE, KIND_TEXTS, PHRASES, SolutionKind, Status

__all__ = ["SolutionFacts", "SolutionKind", "is_budget_spent"]

_NO_GAP = 1e-6  # up to this gap the text says "proved optimal" alone
_BY_STATUS = {
    Status.ALMOST_SOLVED: SolutionKind.ALMOST_SOLVED,
    Status.INFEASIBLE: SolutionKind.PROVED_INFEASIBLE,
    Status.LOCALLY_INFEASIBLE: SolutionKind.NO_FEASIBLE_POINT,
    Status.UNBOUNDED: SolutionKind.PROVED_UNBOUNDED,
    Status.NUMERICAL_FAILURE: SolutionKind.FAILED,
}


@dataclass(frozen=True)
class SolutionFacts:
    """What the kind of a solution, its text and its advice follow from; second_order as a word, "unknown" without one.

    feasible: the point is within the tolerances. budget_spent: see is_budget_spent. starts, global_search: the options
    num_starts and global_search.
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
        return _filled(KIND_TEXTS[self.kind.value], self._parts())

    @property
    def what_to_try(self) -> str:
        """What may give a better answer, and what that costs; "" if nothing does."""
        return _filled(KIND_ADVICE[self.kind.value], self._parts())

    def _parts(self) -> dict[str, str]:
        """What the texts have in braces."""
        bounded = self.gap < math.inf
        bound = PHRASES["bounded" if bounded else "not_bounded"]
        undecided = PHRASES["curvature" if self.b_stationary or self.pairs == 0 else "next_branch"]
        tree = PHRASES["try_global"] if self.pairs > 0 else ""
        return {
            "bound": bound,
            "within": PHRASES["within"] if bounded and self.gap > _NO_GAP else "",
            "optimum": PHRASES["optimum_if_convex"] if self.pairs == 0 and not bounded else bound,
            "reason": PHRASES["another_branch"] if self.b_stationary is False else undecided,
            "condition": PHRASES["if_not_convex"] if self.pairs == 0 else "",
            "budget": PHRASES["budget_spent"] if self.budget_spent else "",
            "starts": PHRASES["more_starts" if self.starts > 1 else "first_starts"],
            "proof": PHRASES["proof_ended"] if self.global_search else tree,
            "status": self.status.advice,
            "more": str(2 * self.starts),
            "factorizations": f"{self.factorizations} factorization{'' if self.factorizations == 1 else 's'}",
            "pairs": f"{self.pairs} pair{'' if self.pairs == 1 else 's'}",
            "distance": self._distance() if bounded else "",
        }

    # Rounded up, because the sentence says "at most". A gap is relative to the objective only if that is above 1.
    def _distance(self) -> str:
        if abs(self.objective) < 1.0:
            return f"{math.ceil(1e3 * self.gap) / 1e3:.3f}"
        percent = 100.0 * self.gap
        if percent >= 10.0:
            return f"{math.ceil(percent):.0f} %"
        if percent >= 1.0:
            return f"{math.ceil(10.0 * percent) / 10.0:.1f} %"
        return f"{max(1.0, math.ceil(100.0 * percent)) / 100.0:.2f} %"


def is_budget_spent(factorizations: int, detail: str, options: Mapping[str, Any]) -> bool:
    """Whether the search for better branches has spent its budget.

    Each search has its own, and option effort adds to that of the first one. In a solution by segments each of them had
    the budget, so their sum decides nothing.
    """
    searches = float(options.get("num_starts", 1)) + float(options.get("effort", 1.0))
    budget = int(options.get("max_local_search_factorizations", 1000)) * searches
    return factorizations >= budget and "segments; " not in detail


def _filled(text: str, parts: dict[str, str]) -> str:
    return re.sub(r"\{(\w+)\}", lambda part: _filled(parts[part[1]], parts), text)
