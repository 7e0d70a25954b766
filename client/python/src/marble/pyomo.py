"""Marble as a persistent solver of Pyomo: after `import marble.pyomo`, SolverFactory("marble_persistent").

It reads the model's parts once and solves over a session, so that a solve after new values of parameters, bounds or
fixed variables sends only what differs, and starts from the last answer. SolverFactory("marble") is another way: the
program `marble`, by files, with conditions that mean what the model says (marble.model.pyomo_conditions). Both take
disjunctions of pyomo.gdp after TransformationFactory("marble.pairs"); `choose` sets their indicators then.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from pyomo.common.collections import ComponentMap
from pyomo.core import (
    Block,
    Constraint,
    Expression,
    Objective,
    Param,
    RangeSet,
    Set,
    SortComponents,
    Suffix,
    Var,
    minimize,
    value,
)
from pyomo.core.base.block import BlockData
from pyomo.mpec import Complementarity
from pyomo.opt import SolverFactory, SolverResults, SolverStatus, TerminationCondition
from pyomo.repn import generate_standard_repn
from pyomo.repn.util import categorize_valid_components
from pyomo.solvers.plugins.solvers.ASL import ASL

import marble
from marble import programs
from marble.base.lazy import lazy
from marble.base.tables import Status
from marble.client import Client
from marble.errors import AlmostSolved, InvalidArgument, InvalidProblem, Unavailable
from marble.model.conflict import Conflict
from marble.model.layout import Family, Layout
from marble.model.lcqp import LCQP, Vector
from marble.model.problem import without_objective
from marble.model.pyomo_conditions import OwnVariables
from marble.model.pyomo_disjunctions import choose
from marble.model.solution import Solution, warn_if_almost
from marble.repeated import Repeated

sp: Any = lazy("scipy.sparse")

_ENDS: Final = {
    Status.SOLVED: (SolverStatus.ok, TerminationCondition.optimal),
    Status.ALMOST_SOLVED: (SolverStatus.warning, TerminationCondition.feasible),
    Status.INFEASIBLE: (SolverStatus.warning, TerminationCondition.infeasible),
    Status.LOCALLY_INFEASIBLE: (SolverStatus.warning, TerminationCondition.infeasible),
    Status.UNBOUNDED: (SolverStatus.warning, TerminationCondition.unbounded),
    Status.ITERATION_LIMIT: (SolverStatus.warning, TerminationCondition.maxIterations),
    Status.TIME_LIMIT: (SolverStatus.warning, TerminationCondition.maxTimeLimit),
}
_ALMOST: Final = range(100, 200)  # codes of a .sol file
_NO_POINT: Final = (Status.INFEASIBLE, Status.UNBOUNDED)


class _Numbers:
    """A list of numbers of which some are expressions of parameters and fixed variables."""

    def __init__(self) -> None:
        self._values: list[float] = []
        self._mutable: list[tuple[int, Any]] = []

    def add(self, number: Any) -> None:
        if isinstance(number, float | int):
            self._values.append(float(number))
        else:
            self._mutable.append((len(self._values), number))
            self._values.append(np.nan)

    def now(self) -> Vector:
        for place, expression in self._mutable:
            self._values[place] = value(expression)
        return np.array(self._values)


class _Matrix:
    """Entries in the order in which they are added, and as those of a csc_matrix."""

    def __init__(self) -> None:
        self._rows: list[int] = []
        self._columns: list[int] = []
        self._entries = _Numbers()
        self._places: Any = None
        self.constants = _Numbers()
        self.count = 0

    def entry(self, row: int, column: int, number: Any) -> None:
        self._rows.append(row)
        self._columns.append(column)
        self._entries.add(number)

    def add_row(self, entries: Iterable[tuple[int, Any]], constant: Any) -> None:
        for column, number in entries:
            self.entry(self.count, column, number)
        self.constants.add(constant)
        self.count += 1

    def pattern(self, columns: int, rows: int | None = None) -> Any:
        """Where its entries are; those at one place are added up."""
        rows = self.count if rows is None else rows
        keys, self._places = np.unique(np.array(self._columns, dtype=np.int64) * rows
                                       + np.array(self._rows, dtype=np.int64), return_inverse=True)
        indptr = np.searchsorted(keys, np.arange(columns + 1, dtype=np.int64) * rows)
        return sp.csc_matrix((np.zeros(keys.size), (keys % max(rows, 1)).astype(np.int32), indptr.astype(np.int32)),
                             shape=(rows, columns))

    def now(self) -> Vector:
        entries = self._entries.now()
        size = int(self._places.max()) + 1 if entries.size else 0
        return np.bincount(self._places, weights=entries, minlength=size).astype(np.float64)


def _limit_word(rows: Sequence[str], layout: Layout, inequality: int) -> str:
    return "bound" if rows[layout.inequality_source[inequality]].startswith("variable") else "limit"


class _Model:
    """A Pyomo model's parts, read once; refused with the name of what no LCQP has."""

    def __init__(self, model: Any) -> None:
        _, unknown = categorize_valid_components(
            model, active=True, sort=SortComponents.deterministic,
            valid={Block, Objective, Constraint, Var, Param, Expression, Suffix, Set, RangeSet, Complementarity},
            targets=set())
        if unknown:
            name, kind = min((part.name, kind.__name__) for kind, found in unknown.items() for part in found)
            hint = ', but for the pairs that TransformationFactory("marble.pairs") makes of it'
            raise InvalidProblem(f"{kind} {name}", "must not be there: an LCQP has none"
                                 + (hint if kind == "Disjunction" else ""))
        self.name, self.columns = str(model.name), ComponentMap()
        self.variables: list[Any] = []
        self.Q, self.g, self.rows, self.L, self.R = _Matrix(), _Matrix(), _Matrix(), _Matrix(), _Matrix()
        self.constraints: list[Any] = []
        # A condition, and the rows ("row" or "L", number, sign) whose multipliers make its dual value.
        self.conditions: list[tuple[Any, list[tuple[str, int, float]]]] = []
        self._low, self._high = _Numbers(), _Numbers()
        mixed: list[tuple[Any, ...]] = []
        objectives = list(model.component_data_objects(Objective, active=True, descend_into=Block))
        if len(objectives) > 1:
            raise InvalidProblem("objective", "must be one", value=", ".join(o.name for o in objectives))
        self.sense = 1.0 if not objectives or objectives[0].sense == minimize else -1.0
        for constraint in model.component_data_objects(Constraint, active=True, descend_into=Block):
            if getattr(constraint, "_complementarity", None) is not None:
                raise InvalidProblem(f"constraint {constraint.name}", "must not be made by the transformation mpec.nl, "
                                     "which is for files: give the model as it was before")
            low, body, high = constraint.to_bounded_expression()
            self._row(f"constraint {constraint.name}", body)
            self._low.add(-np.inf if low is None else low)
            self._high.add(np.inf if high is None else high)
            self.constraints.append(constraint)
        for condition in model.component_data_objects(Complementarity, active=True, descend_into=Block):
            mixed += self._condition(f"complementarity {condition.name}", condition)
        if objectives:
            self._objective(objectives[0])
        else:  # any point will do
            self.g.add_row([], 0.0)
        self.n = len(self.variables) + 2 * len(mixed)
        if self.n == 0:
            raise InvalidProblem("model", "must have a variable in its objective or constraints", value=model.name)
        # low ≤ e ≤ high ⊥ F, by F = p − m: 0 ≤ e − low ⊥ p ≥ 0, 0 ≤ high − e ⊥ m ≥ 0
        for p, (condition, below, above, (entries, constant)) in zip(range(len(self.variables), self.n, 2), mixed,
                                                                     strict=True):
            self.conditions.append((condition, [("L", self.L.count, 1.0), ("L", self.L.count + 1, -1.0)]))
            self.rows.add_row([*entries, (p, -1.0), (p + 1, 1.0)], constant)
            for side, part in ((below, p), (above, p + 1)):
                self.L.add_row(*side)
                self.R.add_row([(part, 1.0)], 0.0)
        self.patterns = [self.Q.pattern(self.n, self.n),
                         *(matrix.pattern(self.n) for matrix in (self.rows, self.L, self.R, self.g))]
        self._family: Family | None = None

    def _column(self, variable: Any) -> int:
        if variable not in self.columns:
            if not variable.is_continuous():
                raise InvalidProblem(f"variable {variable.name}", "must be continuous", value=variable.domain.name)
            self.columns[variable] = len(self.variables)
            self.variables.append(variable)
        return int(self.columns[variable])

    def _linear(self, name: str, expression: Any) -> tuple[list[tuple[int, Any]], Any]:
        repn = generate_standard_repn(expression, compute_values=False)
        if repn.nonlinear_expr is not None or repn.quadratic_vars:
            raise InvalidProblem(name, "must be linear in the variables", value=str(expression))
        return [(self._column(v), c) for v, c in zip(repn.linear_vars, repn.linear_coefs, strict=True)], repn.constant

    def _row(self, name: str, body: Any) -> None:
        self.rows.add_row(*self._linear(name, body))

    def _objective(self, objective: Any) -> None:
        repn = generate_standard_repn(objective.expr, compute_values=False)
        if repn.nonlinear_expr is not None:
            raise InvalidProblem(f"objective {objective.name}", "must be quadratic in the variables",
                                 value=str(repn.nonlinear_expr))
        for (v, w), number in zip(repn.quadratic_vars, repn.quadratic_coefs, strict=True):
            i, j = sorted((self._column(v), self._column(w)))
            self.Q.entry(i, j, 2 * number if i == j else number)
        self.g.add_row([(self._column(v), c) for v, c in zip(repn.linear_vars, repn.linear_coefs, strict=True)],
                       repn.constant)

    def _condition(self, name: str, condition: Any) -> list[tuple[Any, ...]]:
        """As pyomo.mpec reads it: two sides with two bounds between them, or an equality. A side that has both bounds
        is returned, with its distances from them and the other side: no pair yet.
        """
        first, second = (condition._canonical_expression(part) for part in condition._args)
        for equality in (first, second):
            if len(equality) == 2:
                self.conditions.append((condition, [("row", self.rows.count, 1.0)]))
                self._row(name, equality[1] - equality[0])
                return []
        if sum(side is not None for part in (first, second) for side in (part[0], part[2])) != 2:
            raise InvalidProblem(name, "must have two bounds, on one of its sides or one on each")
        for (low, body, high), free in ((first, second[1]), (second, first[1])):
            if low is not None and high is not None:
                return [(condition, *(self._linear(name, side) for side in (body - low, high - body, free)))]
        self.conditions.append((condition, [("L", self.L.count, -1.0 if first[0] is None else 1.0)]))
        for (low, body, high), side in ((first, self.L), (second, self.R)):
            side.add_row(*self._linear(name, high - body if low is None else body - low))
        return []

    def numbers(self) -> tuple[LCQP, bool]:
        """The problem with the numbers as they are now, and whether it is of the pattern of the last one."""
        made = self.rows.count - len(self.constraints)
        low, high = (np.concatenate([limits.now(), np.zeros(made),
                                     [otherwise if bound is None else bound for bound in bounds],
                                     np.full(self.n - len(self.variables), otherwise)])
                     for otherwise, limits, bounds in ((-np.inf, self._low, [v.lb for v in self.variables]),
                                                       (np.inf, self._high, [v.ub for v in self.variables])))
        for i in np.flatnonzero(low > high):
            what = ([f"constraint {c.name}" for c in self.constraints] + made * [""]
                    + [f"variable {v.name}" for v in self.variables])[i]
            raise InvalidProblem(what, f"must have a lower limit of at most the upper one, {high[i]:g}", value=low[i])
        same = self._family is not None and self._family.fits(low, high)
        if self._family is None or not same:
            self._family = Family(self.patterns[:4], low, high, self.name)
        g = np.zeros(self.n)
        g[np.flatnonzero(np.diff(self.patterns[4].indptr))] = self.g.now()
        return self._family.problem(
            Q=self.sense * self.Q.now(), g=self.sense * g, c0=self.sense * float(self.g.constants.now()[0]),
            rows=self.rows.now(), constant=self.rows.constants.now(), low=low, high=high, L=self.L.now(),
            l=self.L.constants.now(), R=self.R.now(), r=self.R.constants.now()), same

    def parts_of(self, conflict: Conflict) -> list[str]:
        """The constraints, bounds and conditions of a conflict, by their names in the model."""
        assert self._family is not None
        rows = [f"constraint {constraint.name}" for constraint in self.constraints]
        rows += (self.rows.count - len(rows)) * [""]
        pairs = self.L.count * [""]
        for condition, places in self.conditions:
            for kind, number, _ in places:
                (rows if kind == "row" else pairs)[number] = f"complementarity {condition.name}"
        limits = [f"variable {variable.name}" for variable in self.variables]
        rows += limits + (self.n - len(limits)) * [""]
        layout = self._family.layout
        equal = [rows[source] for source in layout.equality_source[conflict.equalities]]
        sided = [f"{rows[layout.inequality_source[i]]}, "
                 f"{'lower' if layout.inequality_sign[i] > 0 else 'upper'} {_limit_word(rows, layout, i)}"
                 for i in conflict.inequalities]
        tied = [pairs[i] for i in sorted({*conflict.left_sides.tolist(), *conflict.right_sides.tolist(),
                                          *conflict.complementarities.tolist()})]
        return list(dict.fromkeys(name for name in (*equal, *sided, *tied) if name))

    def duals(self, answer: Solution) -> Vector:
        """Changes of the objective by the right-hand sides of constraints and by bounds of variables."""
        assert self._family is not None
        return -self.sense * self._family.layout.duals(answer.y, answer.nu, self.rows.count + self.n)

    def condition_duals(self, answer: Solution, duals: Vector) -> Iterable[tuple[Any, float]]:
        """Of each condition the change of the objective by the bounds of its first side that has one."""
        of = {"row": duals, "L": self.sense * answer.xi}
        for condition, terms in self.conditions:
            yield condition, sum(sign * float(of[kind][place]) for kind, place, sign in terms)


def _key(model: Any) -> list[Any]:
    """What a model consists of: while it is the same objects, only numbers can have changed."""
    key: list[Any] = []
    for part in model.component_data_objects((Objective, Constraint, Complementarity, Expression), active=True,
                                             descend_into=Block):
        key += [part, *(part._args if part.ctype is Complementarity else (part.expr,)), getattr(part, "sense", None)]
    for variable in model.component_data_objects(Var, descend_into=Block):
        key += [variable, variable.fixed, variable.domain]
    return key


def _same(key: list[Any], other: list[Any]) -> bool:
    return len(key) == len(other) and all(a is b for a, b in zip(key, other, strict=True))


@SolverFactory.register("marble_persistent", doc="Marble, in this process or on a server, over a session")
class MarblePersistent:
    """server: as in marble.solve. options: the solver's, by name; a dictionary, as of other solvers of Pyomo's."""

    name = "marble_persistent"

    def __init__(self, server: str | Sequence[str] | Client | None = None, options: Mapping[str, Any] | None = None,
                 **_: Any) -> None:
        self.options: dict[str, Any] = dict(options or {})
        self._repeated = Repeated(server)
        self._instance: Any = None
        self._model: _Model | None = None
        self._used: dict[str, Any] = {}
        self._key: list[Any] = []
        self.answer: Solution | None = None

    def available(self, exception_flag: bool = True) -> bool:
        """It is, as this module is."""
        return True

    def version(self) -> tuple[int, ...]:
        """Of the package."""
        return tuple(int(part) for part in marble.__version__.split("."))

    def set_instance(self, model: Any) -> None:
        """Reads the model. InvalidProblem names the constraint, condition or variable that no LCQP has."""
        self._model, self._instance, self._key = _Model(model), model, _key(model)

    def solve(self, model: Any = None, *, options: Mapping[str, Any] | None = None, timelimit: float | None = None,
              tee: bool = False, load_solutions: bool = True, warmstart: bool = False) -> Any:
        """Solves the model, or the one of set_instance, as it is now, and returns Pyomo's SolverResults.

        A model that has other parts than at the last solve, or that fixes other variables, is read again. options:
        for this solve alone. timelimit: seconds. load_solutions: whether variables get their values, and the suffixes
        dual and rc theirs. warmstart: begin where the variables are, not at the last answer. Marble's answer is
        `answer` then.
        """
        model = self._instance if model is None else model
        if model is None:
            raise InvalidArgument("model", "must be given, here or to set_instance", value="nothing")
        fresh = self._model is None or model is not self._instance or not _same(self._key, _key(model))
        if fresh:
            self.set_instance(model)
        assert self._model is not None
        problem, same = self._model.numbers()
        merged = {**self.options, **(options or {}), **({} if timelimit is None else {"time_limit_s": timelimit})}
        same = same and not fresh and merged == self._used
        start = None
        if warmstart:
            start = np.zeros(self._model.n)
            start[:len(self._model.variables)] = [0.0 if v.value is None else v.value for v in self._model.variables]
        self._repeated.options, self._used = dict(merged), merged
        self.answer = self._repeated.solve(problem, same_pattern=same, z0=start)
        warn_if_almost(self.answer)
        if load_solutions and self.answer.status not in _NO_POINT:
            self.load_vars()
            self._load_suffixes()
        return self._results(self.answer, tee)

    def load_vars(self) -> None:
        """Gives the variables the values of the last answer."""
        assert self._model is not None and self.answer is not None
        for variable, number in zip(self._model.variables, self.answer.z.tolist(), strict=False):
            variable.set_value(number, skip_validation=True)
            variable.stale = False

    def _load_suffixes(self) -> None:
        assert self._model is not None and self.answer is not None
        numbers = self._model.duals(self.answer)
        duals = numbers.tolist()
        for suffix in self._instance.component_objects(Suffix, active=True, descend_into=False):
            if suffix.import_enabled() and suffix.local_name == "dual":
                suffix.update(zip(self._model.constraints, duals, strict=False))
                suffix.update(self._model.condition_duals(self.answer, numbers))
            elif suffix.import_enabled() and suffix.local_name == "rc":
                suffix.update(zip(self._model.variables, duals[self._model.rows.count:], strict=False))

    def _results(self, answer: Solution, tee: bool) -> Any:
        assert self._model is not None
        results = SolverResults()
        results.solver.name = self.name
        results.solver.status, results.solver.termination_condition = _ENDS.get(
            answer.status, (SolverStatus.error, TerminationCondition.error))
        results.solver.message = f"{answer.status.value}: {answer.facts.text}; {answer.detail}"
        results.solver.time = answer.times.total_s
        sense = self._model.sense
        results.problem.sense = "minimize" if sense > 0 else "maximize"
        reached, bound = (answer.objective if answer.solved else np.inf), answer.bound
        results.problem.upper_bound, results.problem.lower_bound = (reached, bound) if sense > 0 else (-bound, -reached)
        if tee:
            print(answer)
        return results

    def close(self) -> None:
        """Ends the session."""
        self._repeated.close()

    def __enter__(self) -> MarblePersistent:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def explain_infeasible(model: Any, *, server: str | Client | None = None, **options: Any) -> list[str]:
    """The constraints, bounds and complementarities of an infeasible model that contradict each other, by their names.

    None of them can be left out: without it the others can be met. model: a ConcreteModel, as solve takes it; its
    objective plays no role. server, options: as in marble.solve. Returns an empty list if the model is not proved
    infeasible. Raises InvalidProblem as solve does.
    """
    read = _Model(model)
    problem, _ = read.numbers()
    answer = marble.solve(without_objective(problem), server=server, explain=True, **options)
    return [] if answer.conflict is None else read.parts_of(answer.conflict)


@SolverFactory.register("marble", doc="The program marble, by files")
class MarbleByFiles(ASL):  # type: ignore[misc]
    """Pyomo's own way to programs that read .nl files, but for conditions that its writer would change."""

    def __init__(self, **words: Any) -> None:
        if "executable" not in words:
            try:
                words["executable"] = programs.find("marble")
            except Unavailable:  # available() says so
                words["executable"] = "marble"
        super().__init__(**words)
        self.set_options("solver=marble")

    def solve(self, *arguments: Any, **words: Any) -> Any:
        """As Pyomo's other solvers by files do. The model is as it was before, with its answer."""
        with OwnVariables([part for part in arguments if isinstance(part, BlockData)]):
            results = super().solve(*arguments, **words)
        if results.solver.id in _ALMOST:
            results.solver.status = SolverStatus.warning
            results.solver.termination_condition = TerminationCondition.feasible
            warnings.warn(f"almost solved: {results.solver.message}", AlmostSolved, stacklevel=2)
        return results


__all__ = ["MarbleByFiles", "MarblePersistent", "choose", "explain_infeasible"]
