"""Marble for Drake's programs: marble.drake.solve(prog). Needs drake (1.51 was tried).

Costs that are linear or quadratic, of any curvature; linear, bounding-box and linear complementarity constraints.
"""

from __future__ import annotations

import functools
import weakref
from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike
from pydrake.solvers import (
    BoundingBoxConstraint,
    LinearComplementarityConstraint,
    LinearConstraint,
    LinearCost,
    MathematicalProgram,
    QuadraticCost,
    SolutionResult,
)
from pydrake.symbolic import Expression, Variable

from marble import client
from marble.base.lazy import lazy
from marble.base.tables import Status
from marble.errors import InvalidArgument, InvalidProblem
from marble.model.lcqp import Vector, numbers, vector
from marble.model.problem import Problem
from marble.model.solution import Solution, warn_if_almost

sp: Any = lazy("scipy.sparse")

_FEW_ENTRIES: Final = 10_000  # up to which matrices are made dense
_Numbers = tuple[Any, Any, Any]

_RESULTS: Final = {
    Status.SOLVED: SolutionResult.kSolutionFound,
    Status.ALMOST_SOLVED: SolutionResult.kSolutionFound,
    Status.INFEASIBLE: SolutionResult.kInfeasibleConstraints,
    Status.LOCALLY_INFEASIBLE: SolutionResult.kInfeasibleConstraints,
    Status.UNBOUNDED: SolutionResult.kUnbounded,
    Status.ITERATION_LIMIT: SolutionResult.kIterationLimit,
    Status.TIME_LIMIT: SolutionResult.kIterationLimit,
}


class Result:
    """As Drake's MathematicalProgramResult, by the same names. solution: Marble's answer."""

    def __init__(self, variables: tuple[int, ...], answer: Solution, rows: dict[Any, slice]) -> None:
        self.solution, self._variables, self._rows = answer, variables, rows

    @functools.cached_property
    def _values(self) -> dict[int, float]:
        return dict(zip(self._variables, self.solution.z.tolist(), strict=True))

    def is_success(self) -> bool:
        """Whether it is solved."""
        return self.solution.solved

    def get_solution_result(self) -> Any:
        """Why the solve ended, as a SolutionResult."""
        return _RESULTS.get(self.solution.status, SolutionResult.kSolverSpecificError)

    def get_optimal_cost(self) -> float:
        """All costs together, at the point."""
        return self.solution.objective

    def get_x_val(self) -> Vector:
        """The point, in the order of the program's variables."""
        return self.solution.z

    def GetSolution(self, what: Any = None) -> Any:
        """The value of a variable or an expression, or of each in an array; of all variables without."""
        if what is None:
            return self.get_x_val()
        if isinstance(what, Variable):
            return self._values[what.get_id()]
        if isinstance(what, Expression):
            return what.Evaluate({v: self._values[v.get_id()] for v in what.GetVariables()})
        return np.vectorize(self.GetSolution, otypes=[float])(what)

    def GetDualSolution(self, binding: Any) -> Vector:
        """∂cost/∂bound of a linear or bounding-box constraint, an entry a row, as Drake has it."""
        if binding not in self._rows:
            raise InvalidArgument("binding", "must be a linear or a bounding-box constraint of the program",
                                  value=_name(binding))
        return -self.solution.row_duals[self._rows[binding]]


def solve(prog: Any, initial_guess: ArrayLike | None = None, **options: Any) -> Result:
    """Solves a MathematicalProgram, where MARBLE_SERVER says, else in this process.

    initial_guess: one number a variable; without it, that of the program, where it has one. options: Marble's, by
    name, and `server`, `progress` and others of marble.solve.

    A program is translated once, and again when its variables, costs, constraints or their numbers have changed.

    Raises InvalidProblem with the name of a cost, a constraint or a variable that no LCQP has: its description in
    Drake, and its variables.
    """
    stated = _stated(prog)
    guess = numbers(prog.initial_guess() if initial_guess is None else initial_guess, "initial_guess")
    start = np.where(np.isnan(guess), 0.0, guess) if np.isfinite(guess).any() else None
    if start is not None:
        start = vector(start, "initial_guess", stated.problem.n, " (n)")
    answer = stated.problem.translate(client.solve(stated.problem.compile().replaced(z0=start), **options))
    warn_if_almost(answer)
    return Result(stated.variables, answer, stated.rows)


def _name(binding: Any) -> str:
    what = binding.evaluator()
    names = ", ".join(v.get_name() for v in binding.variables())
    return f"{what.get_description() or type(what).__name__} of {names}"


class _Stated:
    """A program as a Problem, and what it was made from. rows: of each binding of linear constraints."""

    def __init__(self, prog: MathematicalProgram) -> None:
        self.variables = _ids(prog)
        self._costs, self._constraints = prog.GetAllCosts(), prog.GetAllConstraints()
        self._parts = [binding.evaluator() for binding in (*self._costs, *self._constraints)]
        self._numbers = [_numbers(part) for part in self._parts]
        self.problem = Problem(len(self.variables))
        self.rows: dict[Any, slice] = {}
        places = [prog.FindDecisionVariableIndices(binding.variables())
                  for binding in (*self._costs, *self._constraints)]
        count = len(self._costs)
        self._add_costs(zip(self._numbers[:count], places[:count], strict=True))
        self._add_constraints(places[count:])

    def is_of(self, prog: MathematicalProgram) -> bool:
        """Whether the program still has the same variables, bindings and numbers."""
        return (self.variables == _ids(prog) and self._costs == prog.GetAllCosts()
                and self._constraints == prog.GetAllConstraints()
                and all(_are_same(_numbers(part), old)
                        for part, old in zip(self._parts, self._numbers, strict=True)))

    def _add_costs(self, costs: Iterable[tuple[_Numbers, Any]]) -> None:
        n = self.problem.n
        Q, g, c0 = _zeros(n, n), np.zeros(n), 0.0
        for (quadratic, linear, constant), places in costs:
            if quadratic is not None:
                Q = Q + _spread(_spread((quadratic + quadratic.T) / 2, places, n).T, places, n)
            np.add.at(g, places, linear)
            c0 += float(constant)
        self.problem.minimize(Q, g, c0)

    def _add_constraints(self, places: Sequence[Any]) -> None:
        n, count = self.problem.n, 0
        blocks: list[Any] = []
        limits: list[tuple[Vector, Vector]] = []
        first = len(self._costs)
        for binding, evaluator, values, columns in zip(self._constraints, self._parts[first:], self._numbers[first:],
                                                       places, strict=True):
            if isinstance(evaluator, LinearComplementarityConstraint):
                self._add_pairs(*values[:2], np.asarray(columns))
                continue
            A, low, high = values
            blocks.append(_spread(np.eye(len(columns)) if A is None else A, columns, n))
            limits.append((low, high))
            self.rows[binding] = slice(count, count + low.size)
            count += low.size
        if count:
            self.problem.add_rows(_stacked(blocks), *(np.concatenate(part) for part in zip(*limits, strict=True)))

    def _add_pairs(self, M: Any, q: Vector, places: Any) -> None:
        """0 ≤ x ⊥ M x + q ≥ 0. Where M says of x_i ⊥ x_j also x_j ⊥ x_i, that is one pair."""
        units = (M != 0).sum(axis=1) == 1
        units &= (M.max(axis=1) == 1) & (q == 0)
        partner = np.where(units, np.argmax(M != 0, axis=1), -1)
        index = np.arange(q.size)
        known = (partner >= 0) & (partner < index) & (partner[partner] == index)
        n = self.problem.n
        self.problem.add_pairs(_spread(np.eye(q.size)[~known], places, n), _spread(M[~known], places, n), r=q[~known])


_STATED: Final[weakref.WeakKeyDictionary[Any, _Stated]] = weakref.WeakKeyDictionary()


def _stated(prog: MathematicalProgram) -> _Stated:
    """The program as a Problem; that of the last call, if nothing has changed since."""
    stated = _STATED.get(prog)
    if stated is None or not stated.is_of(prog):
        _check(prog)
        _STATED[prog] = stated = _Stated(prog)
    return stated


def _check(prog: MathematicalProgram) -> None:
    if prog.num_vars() == 0:
        raise InvalidProblem("prog", "must have a variable")
    for variable in prog.decision_variables():
        if variable.get_type() != Variable.Type.CONTINUOUS:
            raise InvalidProblem(f"variable {variable.get_name()}", "must be continuous",
                                 value=variable.get_type().name.lower())
    for binding in prog.GetAllCosts():
        if not isinstance(binding.evaluator(), QuadraticCost | LinearCost):
            raise InvalidProblem(f"cost {_name(binding)}", "must be linear or quadratic")
    for binding in prog.GetAllConstraints():
        if not isinstance(binding.evaluator(), LinearComplementarityConstraint | LinearConstraint):
            raise InvalidProblem(f"constraint {_name(binding)}", "must be linear, or a linear complementarity")


def _ids(prog: MathematicalProgram) -> tuple[int, ...]:
    return tuple(variable.get_id() for variable in prog.decision_variables())


def _numbers(part: Any) -> _Numbers:
    """Of a cost its Q or None, b and c; of linear rows A, None of bounds, and limits; of complementarities M and q."""
    if isinstance(part, QuadraticCost):
        return part.Q(), part.b(), part.c()
    if isinstance(part, LinearCost):
        return None, part.a(), part.b()
    if isinstance(part, LinearComplementarityConstraint):
        return part.M(), part.q(), 0.0
    if isinstance(part, BoundingBoxConstraint):
        return None, part.lower_bound(), part.upper_bound()
    small = part.num_constraints() * part.num_vars() <= _FEW_ENTRIES  # of which a sparse matrix takes 60 times as long
    return (part.GetDenseA() if small else part.get_sparse_A()), part.lower_bound(), part.upper_bound()


def _are_same(now: _Numbers, old: _Numbers) -> bool:
    return all(ours.shape == theirs.shape and (ours != theirs).nnz == 0 if sp.issparse(ours) else
               np.array_equal(ours, theirs) for ours, theirs in zip(now, old, strict=True))


def _zeros(rows: int, columns: int) -> Any:
    return np.zeros((rows, columns)) if rows * columns <= _FEW_ENTRIES else sp.csr_matrix((rows, columns))


def _spread(values: Any, places: Any, n: int) -> Any:
    """The columns of a matrix at these places of n, added up where a place occurs again."""
    rows = values.shape[0]
    if sp.issparse(values) or rows * n > _FEW_ENTRIES:
        units = sp.csr_matrix((np.ones(len(places)), (np.arange(len(places)), places)), shape=(len(places), n))
        return sp.csr_matrix(values) @ units
    wide = np.zeros((rows, n))
    everywhere: Any = (slice(None), np.asarray(places))
    np.add.at(wide, everywhere, values)
    return wide


def _stacked(blocks: list[Any]) -> Any:
    return sp.vstack(blocks) if any(sp.issparse(block) for block in blocks) else np.vstack(blocks)
