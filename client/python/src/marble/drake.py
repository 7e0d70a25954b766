"""Marble for Drake's programs: marble.drake.solve(prog). Needs drake (1.51 was tried).

Costs that are linear or quadratic, of any curvature; linear, bounding-box and linear complementarity constraints.
"""

from __future__ import annotations

import functools
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
from marble.model.lcqp import Vector, numbers
from marble.model.problem import Problem
from marble.model.solution import Solution, warn_if_almost

sp: Any = lazy("scipy.sparse")

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

    def __init__(self, program: Any, answer: Solution, rows: dict[Any, slice]) -> None:
        self.solution, self._rows = answer, rows
        self._values = dict(zip((v.get_id() for v in program.decision_variables()), answer.z.tolist(), strict=True))

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

    Raises InvalidProblem with the name of a cost, a constraint or a variable that no LCQP has: its description in
    Drake, and its variables.
    """
    problem, rows = _stated(prog)
    guess = numbers(prog.initial_guess() if initial_guess is None else initial_guess, "initial_guess")
    if np.isfinite(guess).any():
        problem.start_at(np.where(np.isnan(guess), 0.0, guess))
    answer = client.solve(problem, **options)
    warn_if_almost(answer)
    return Result(prog, answer, rows)


def _name(binding: Any) -> str:
    what = binding.evaluator()
    names = ", ".join(v.get_name() for v in binding.variables())
    return f"{what.get_description() or type(what).__name__} of {names}"


def _stated(prog: MathematicalProgram) -> tuple[Problem, dict[Any, slice]]:
    n = prog.num_vars()
    if n == 0:
        raise InvalidProblem("prog", "must have a variable")
    for variable in prog.decision_variables():
        if variable.get_type() != Variable.Type.CONTINUOUS:
            raise InvalidProblem(f"variable {variable.get_name()}", "must be continuous",
                                 value=variable.get_type().name.lower())
    columns = functools.partial(_columns, prog)
    problem = Problem(n)
    Q, g, c0 = sp.csc_matrix((n, n)), np.zeros(n), 0.0
    for binding in prog.GetAllCosts():
        cost, places = binding.evaluator(), columns(binding)
        if isinstance(cost, QuadraticCost):
            Q = Q + places.T @ sp.csc_matrix(cost.Q()) @ places
            g, c0 = g + places.T @ cost.b(), c0 + float(cost.c())
        elif isinstance(cost, LinearCost):
            g, c0 = g + places.T @ cost.a(), c0 + float(cost.b())
        else:
            raise InvalidProblem(f"cost {_name(binding)}", "must be linear or quadratic")
    problem.minimize((Q + Q.T) / 2, g, c0)
    rows: dict[Any, slice] = {}
    count = 0
    for binding in prog.GetAllConstraints():
        constraint, places = binding.evaluator(), columns(binding)
        if isinstance(constraint, LinearComplementarityConstraint):
            _add_pairs(problem, constraint, places)
        elif isinstance(constraint, LinearConstraint):
            part = places if isinstance(constraint, BoundingBoxConstraint) else constraint.get_sparse_A() @ places
            problem.add_rows(part, constraint.lower_bound(), constraint.upper_bound())
            rows[binding] = slice(count, count + part.shape[0])
            count += part.shape[0]
        else:
            raise InvalidProblem(f"constraint {_name(binding)}", "must be linear, or a linear complementarity")
    return problem, rows


def _columns(prog: MathematicalProgram, binding: Any) -> Any:
    """Which of the program's variables are the binding's: a row each."""
    places = [prog.FindDecisionVariableIndex(v) for v in binding.variables()]
    return sp.csr_matrix((np.ones(len(places)), (np.arange(len(places)), places)), shape=(len(places), prog.num_vars()))


def _add_pairs(problem: Problem, constraint: Any, places: Any) -> None:
    """0 ≤ x ⊥ M x + q ≥ 0. Where M says of x_i ⊥ x_j also x_j ⊥ x_i, that is one pair."""
    M, q = constraint.M(), constraint.q()
    units = (M != 0).sum(axis=1) == 1
    units &= (M.max(axis=1) == 1) & (q == 0)
    partner = np.where(units, np.argmax(M != 0, axis=1), -1)
    index = np.arange(q.size)
    known = (partner >= 0) & (partner < index) & (partner[partner] == index)
    problem.add_pairs(places[index[~known]], sp.csr_matrix(M[~known]) @ places, r=q[~known])
