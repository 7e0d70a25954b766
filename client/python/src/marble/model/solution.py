"""The result of a solve, solved or not."""

from __future__ import annotations

import enum
import functools
import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from marble.base.html import table
from marble.base.plain import plain
from marble.base.tables import Status
from marble.errors import AlmostSolved, Unsolved
from marble.model.conflict import Conflict
from marble.model.derivatives import SensitivityAnswer
from marble.model.lcqp import LCQP, Vector, twin
from marble.model.solution_fields import SolutionFields
from marble.model.solution_kind import SolutionFacts, SolutionKind, is_budget_spent


class Stationarity(enum.Enum):
    """Kind of stationary point, by the multipliers of pairs with s = t = 0; each includes those before it."""

    WEAK = "weak"
    CLARKE = "clarke"
    MORDUKHOVICH = "mordukhovich"
    STRONG = "strong"


class PointOrigin(enum.Enum):
    """Where the point of a solution comes from: SOLVE: this solve. PREVIOUS: the session's solution before it."""

    SOLVE = "solve"
    PREVIOUS = "previous"


class SecondOrder(enum.Enum):
    """What the curvature of Q says of a stationary point, on its critical cone: A v = 0, rows with a multiplier stay at
    zero, other active rows may grow, of pairs with s = t = 0 one side at a time.

    SADDLE: vᵀQv < 0 for one v of it: a saddle point or a maximum, no local minimum. NECESSARY: vᵀQv ≥ 0 for all v that
    keep every active row at zero; the rest, or whether z is B-stationary, was not decided. MINIMUM: vᵀQv ≥ 0 on the
    whole cone of a B-stationary point: a local minimum. CONVEX: the same, and Q is known to be convex: the optimum of
    each branch that the point belongs to, without pairs the optimum. Known of a diagonally dominant Q, and where a
    solve had to factor Q.
    """

    SADDLE = "saddle"
    NECESSARY = "necessary"
    MINIMUM = "minimum"
    CONVEX = "convex"


@dataclass(frozen=True)
class Violations:
    """Largest violations in the problem's own units; 0 where there is no such constraint.

    equality: max |A z + b|. inequality: max(0, -(C z + d)). complementarity: max |min(s, t)| over the pairs.
    """

    equality: float = 0.0
    inequality: float = 0.0
    complementarity: float = 0.0


@dataclass(frozen=True)
class Times:
    """Seconds spent on the job, by part: total_s runs from acceptance to the answer, solve_s is without set-up."""

    queue_s: float = 0.0
    setup_s: float = 0.0
    factorization_s: float = 0.0
    line_search_s: float = 0.0
    polish_s: float = 0.0
    solve_s: float = 0.0
    total_s: float = 0.0
    tree_s: float = 0.0


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Solution(SolutionFields):
    """The result of a solve, in the problem's units. At a solution Q z + g + Aᵀy − Cᵀν − Lᵀξ − Rᵀη = 0, ν ≥ 0.

    status: why the solve ended.
    origin: where z comes from: PREVIOUS where a session's solve was cut off and only the shifted solution before it is
    feasible.
    s, t: the sides L z + l and R z + r, n_c.
    violations: of z, in the problem's units.
    stationarity: None where the point is not solved. second_order: whether the point is a local minimum; None where it
    is not solved.
    times: seconds. options: every option as it was used. job_id: the server's. problem: what was solved.
    sensitivity: the derivatives that were requested with the solve; None without.
    conflict: with option explain, the parts that make the problem infeasible; None where it is not proved to be.
    reopened: whether the session was set up again since its last solution because its server was lost: it has started
    at the last z, without the rest of the session's state.

    Of a marble.Problem also, in its own terms, both empty otherwise:
    row_duals: one multiplier a two-sided row lb ≤ a z ≤ ub, in the order of adding. bound_duals: one a variable, n.
    With them Q z + g + Aᵀ row_duals + bound_duals − Lᵀξ − Rᵀη = 0 over all rows: ≥ 0 where the upper limit holds the
    point back, ≤ 0 where the lower one does, of any sign where both are equal.
    """

    status: Status
    origin: PointOrigin = PointOrigin.SOLVE
    violations: Violations
    stationarity: Stationarity | None
    second_order: SecondOrder | None
    times: Times
    options: Mapping[str, float | int | bool | str]
    job_id: str
    problem: LCQP
    row_duals: Vector = field(default_factory=lambda: np.zeros(0))
    bound_duals: Vector = field(default_factory=lambda: np.zeros(0))
    variables: Mapping[str, int] = field(default_factory=dict)
    sensitivity: SensitivityAnswer | None = None
    conflict: Conflict | None = None
    reopened: bool = False

    def replaced(self, **parts: Any) -> Solution:
        """The same answer with some attributes replaced."""
        other: Solution = twin(self)
        other.__dict__.update(parts)
        return other

    @property
    def solved(self) -> bool:
        """Whether z may be used as a solution."""
        return self.status.solved

    @functools.cached_property
    def facts(self) -> SolutionFacts:
        """What its kind follows from: facts.text says in a line what kind of answer it is."""
        v, limits = self.violations, self.options
        met = ((v.equality, "equality_tolerance"), (v.inequality, "inequality_tolerance"),
               (v.complementarity, "complementarity_tolerance"))
        return SolutionFacts(
            status=self.status, proved=self.proved, b_stationary=self.b_stationary,
            second_order="unknown" if self.second_order is None else self.second_order.value,
            objective=self.objective, gap=self.gap,
            feasible=all(violation <= float(limits.get(name, 1e-6)) for violation, name in met),
            pairs=self.xi.size, factorizations=self.factorizations,
            starts=int(limits.get("num_starts", 1)),
            budget_spent=is_budget_spent(self.factorizations, self.detail, limits),
            global_search=bool(limits.get("global_search", False)))

    @property
    def kind(self) -> SolutionKind:
        """Proved optimal, a local minimum, only a stationary point, and so on."""
        return self.facts.kind

    @property
    def what_to_try(self) -> str:
        """What may give a better answer, and what that costs; empty where nothing does."""
        return self.facts.what_to_try

    @functools.cached_property
    def s(self) -> Vector:
        """L z + l, n_c."""
        return np.asarray(self.problem.L @ self.z + self.problem.l)

    @functools.cached_property
    def t(self) -> Vector:
        """R z + r, n_c."""
        return np.asarray(self.problem.R @ self.z + self.problem.r)

    def raise_if_unsolved(self) -> Solution:
        """Itself; raises Unsolved if the status is neither SOLVED nor ALMOST_SOLVED."""
        if not self.solved:
            raise Unsolved(self)
        return self

    def __getitem__(self, variable: str | int) -> float:
        """The value of a variable, by its name in the marble.Problem or by its index."""
        return float(self.z[self.variables[variable] if isinstance(variable, str) else variable])

    def _facts(self) -> list[tuple[str, str]]:
        n, n_e, n_i, n_c = self.problem.sizes
        v = self.violations
        facts = [
            ("size", f"{n} variables, {n_e} equalities, {n_i} inequalities, {n_c} pairs"),
            ("objective", f"{self.objective:.10g}"),
            ("answer", self.facts.text),
            *([("proof", self._proof())] if self.nodes > 0 and self.facts.global_search else []),
            ("violations", f"equality {v.equality:.1e}, inequality {v.inequality:.1e}, "
                           f"complementarity {v.complementarity:.1e}"),
            ("kkt residual", f"{self.kkt_residual:.1e}"),
            ("work", self._work()),
            ("time", f"{1e3 * self.times.solve_s:.3f} ms solve, {1e3 * self.times.setup_s:.3f} ms set-up, "
                     f"{1e3 * self.times.queue_s:.3f} ms in the queue"),
        ]
        if self.stationarity is not None:
            b = ", no descent on any branch" if self.b_stationary else ""
            facts.append(("stationarity", self.stationarity.value + b))
            if self.second_order is not None:
                facts.append(("second order", self.second_order.value))
        else:
            facts.append(("why", self.detail))
        if self.conflict is not None:
            facts.append(("conflict", f"{len(self.conflict)} parts, {'' if self.conflict.minimal else 'not '}minimal"))
            facts += [("", line) for line in self.conflict.lines(self.problem, self.variables)]
        if self.what_to_try:
            facts.append(("what to try", self.what_to_try))
        facts.append(("z", np.array2string(self.z, precision=6, threshold=8, edgeitems=3, separator=", ")))
        return facts

    def _work(self) -> str:
        nodes = f", {self.nodes:,} node{'' if self.nodes == 1 else 's'}"
        shown = "" if self.nodes == 0 or self.facts.global_search else nodes
        return f"{self.iterations} iterations, {self.factorizations} factorizations{shown}"

    def _proof(self) -> str:
        word = "proved optimal" if self.proved and self.solved else "proved" if self.proved else "not proved"
        left = f", {self.open_nodes:,} open" if self.open_nodes else ""
        return f"{word}: bound {self.bound:.10g}, gap {self.gap:.1e}, {self.nodes:,} nodes{left}"

    def _title(self) -> str:
        return f"{self.problem.name or 'LCQP'}: {self.status.value}"

    def __repr__(self) -> str:
        lines = [f"  {name:<14}{text}" for name, text in self._facts()]
        return "\n".join([self._title(), *lines])

    def _repr_html_(self) -> str:
        return table(self._title(), self._facts(), "#2a7" if self.solved else "#c43")

    def to_dict(self) -> dict[str, Any]:
        """Everything as lists, dicts, numbers, texts and None: json.dumps(solution.to_dict()).

        The names are those of the attributes, with s, t, kind and what_to_try; `problem` is its name alone, and what is
        not finite, such as the bound where none is known, is None.
        """
        parts = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "problem"}
        return {"problem": self.problem.name, **{name: plain(value) for name, value in parts.items()},
                "s": self.s.tolist(), "t": self.t.tolist(), "kind": self.kind.value, "what_to_try": self.what_to_try}

    def plot(self) -> Any:
        """Draws z, and of each pair its sides s and t, into a new figure of matplotlib.pyplot, which is returned.

        The axes of the sides are logarithmic beyond complementarity_tolerance, up to which a side counts as zero.
        Raises Unavailable without matplotlib (pip install 'marble-solver[plot]').
        """
        from marble.model import solution_plot

        names = sorted(self.variables, key=self.variables.__getitem__)
        return solution_plot.draw(self._title(), self.z, names, self.s, self.t,
                                  float(self.options.get("complementarity_tolerance", 1e-6)))


if SolutionFields.__doc__:  # help(Solution) would not show them; python -OO has no docstrings
    Solution.__doc__ = f"{Solution.__doc__}\n    {SolutionFields.__doc__}"


@dataclass(frozen=True, eq=False)
class Progress:
    """The state of a solve after one iteration.

    iteration, outer_iteration: Newton steps, and changes of κ, ρ or the multiplier estimates so far. objective,
    violations: at the iterate. kkt_residual: of the scaled problem. kappa, rho: relaxation and penalty; κ is 0 in a
    local search. step_length: in (0, 1]. regularization, factorizations, elapsed_s: of the solve so far.
    z: the iterate, n, where it was asked for and is there; else empty.
    incumbent, bound, gap, nodes, open_nodes: of option global_search once its tree has begun, as in Solution, so far;
    the incumbent is the objective of the best point, inf while there is none. nodes is 0 before a tree.
    """

    iteration: int
    outer_iteration: int
    objective: float
    violations: Violations
    kkt_residual: float
    kappa: float
    rho: float
    step_length: float
    regularization: float
    factorizations: int
    elapsed_s: float
    z: Vector = field(default_factory=lambda: np.zeros(0))
    incumbent: float = math.inf
    bound: float = -math.inf
    gap: float = math.inf
    nodes: int = 0
    open_nodes: int = 0


Options = Mapping[str, Any]
"""Solver options by name; Client.info().options has each one's default, range and meaning."""


def warn_if_almost(answer: Solution, stacklevel: int = 3) -> None:
    """Warns AlmostSolved of a solution whose status the modelling tool cannot express."""
    if answer.status is Status.ALMOST_SOLVED:
        worst = max(answer.violations.equality, answer.violations.inequality, answer.violations.complementarity)
        warnings.warn(f"almost solved: violation {worst:.1e}, KKT residual {answer.kkt_residual:.1e}; {answer.detail}",
                      AlmostSolved, stacklevel=stacklevel)
