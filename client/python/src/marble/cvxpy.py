"""Marble as a solver of CVXPY's quadratic programs: problem.solve(solver=marble.cvxpy.MARBLE()). With pairs: solve."""

from __future__ import annotations

import dataclasses
import weakref
from collections.abc import Sequence
from typing import Any, Final

import cvxpy
import cvxpy.settings as s
import numpy as np
from cvxpy.reductions.solution import Solution, failure_solution
from cvxpy.reductions.solvers import utilities
from cvxpy.reductions.solvers.qp_solvers.qp_solver import QpSolver

from marble import client
from marble.base.tables import Status
from marble.errors import InvalidProblem
from marble.model.solution import Solution as Answer

_STATUSES: Final = {
    Status.SOLVED: s.OPTIMAL,
    Status.ALMOST_SOLVED: s.OPTIMAL_INACCURATE,
    Status.INFEASIBLE: s.INFEASIBLE,
    Status.UNBOUNDED: s.UNBOUNDED,
    Status.ITERATION_LIMIT: s.USER_LIMIT,
    Status.TIME_LIMIT: s.USER_LIMIT,
}


def _parts(data: Any) -> dict[str, Any]:
    return {"A": data[s.A], "b": -data[s.B], "C": -data[s.F], "d": data[s.G]}


class MARBLE(QpSolver):  # type: ignore[misc]
    """Solves where MARBLE_SERVER says, else in this process. Options of solve() are Marble's, by name, and `server`."""

    MIP_CAPABLE = False

    def name(self) -> str:
        """As CVXPY shows it."""
        return "MARBLE"

    def import_solver(self) -> None:
        """It is there, as this module is."""

    def solve_via_data(self, data: Any, warm_start: bool, verbose: bool, solver_opts: Any,
                       solver_cache: Any = None) -> Any:
        """Marble's answer to the data of a quadratic program."""
        return client.solve(data[s.P], data[s.Q], **_parts(data), progress=verbose, **solver_opts)

    def invert(self, solution: Any, inverse_data: Any) -> Any:
        """The answer in CVXPY's terms."""
        status = _STATUSES.get(solution.status, s.SOLVER_ERROR)
        facts = {s.SOLVE_TIME: solution.times.solve_s, s.SETUP_TIME: solution.times.setup_s,
                 s.NUM_ITERS: solution.iterations,
                 s.EXTRA_STATS: {"solution": solution, "kind": solution.kind.value,
                                 "what_to_try": solution.what_to_try}}
        if status not in s.SOLUTION_PRESENT:
            return failure_solution(status, facts)
        duals = {}
        for values, rows in ((solution.y, self.EQ_CONSTR), (solution.nu, self.NEQ_CONSTR)):
            duals.update(utilities.get_dual_values(np.asarray(values), utilities.extract_dual_value,
                                                   inverse_data[rows]))
        return Solution(status, solution.objective + inverse_data[s.OFFSET], {self.VAR_ID: solution.z}, duals, facts)

    def cite(self, data: Any) -> str:
        """Nothing in BibTeX; CITATION.cff says how."""
        return ""


def _side(expression: Any, field: str) -> Any:
    side = cvxpy.Expression.cast_to_const(expression)
    if not side.is_affine() or side.is_complex():
        raise InvalidProblem(field, "must be affine in real variables", value=str(side))
    if side.is_constant():
        raise InvalidProblem(field, "must depend on a variable", value=str(side))
    return side


def _check(problem: cvxpy.Problem, sides: Sequence[Sequence[Any]]) -> None:
    """Names what is no quadratic program's."""
    for variable in cvxpy.Problem(cvxpy.Minimize(0), [side >= 0 for pair in sides for side in pair]).variables() \
            + problem.variables():
        for kind in ("integer", "boolean", "PSD", "NSD", "hermitian", "complex", "imag"):
            if np.any(variable.attributes[kind]):
                raise InvalidProblem("variables", f"must be real and continuous, not {kind}", value=variable.name())
    goal = problem.objective
    if not goal.is_dcp():
        raise InvalidProblem("objective", "must be convex by CVXPY's rules", value=str(goal))
    if not goal.args[0].is_qpwa():
        raise InvalidProblem("objective", "must be quadratic or piecewise linear", value=str(goal))
    for k, constraint in enumerate(problem.constraints):
        linear = isinstance(constraint, cvxpy.constraints.Equality | cvxpy.constraints.Zero) or (
            isinstance(constraint, cvxpy.constraints.Inequality | cvxpy.constraints.NonPos | cvxpy.constraints.NonNeg)
            and constraint.expr.is_pwl())
        if not constraint.is_dcp() or not linear:
            raise InvalidProblem(f"constraints[{k}]", "must be linear, or piecewise linear and convex",
                                 value=str(constraint))


# Of each problem what it was last solved with: its pairs, what these were made to, and with that in CVXPY's memory what
# new values of parameters need.
_known: weakref.WeakKeyDictionary[Any, tuple[list[Any], list[list[Any]], Any, MARBLE]] = weakref.WeakKeyDictionary()


def _canonical(problem: cvxpy.Problem, pairs: Sequence[tuple[Any, Any]]) -> tuple[Any, Any, Any, list[list[Any]]]:
    """CVXPY's data of a problem with the sides of the pairs as constraints, which are the last thing returned."""
    given = [expression for pair in pairs for expression in pair]
    known = _known.get(problem)
    if known is None or len(known[0]) != len(given) or any(a is not b for a, b in zip(known[0], given, strict=True)):
        sides = [[_side(expression, f"pairs[{k}][{i}]") for i, expression in enumerate(pair)]
                 for k, pair in enumerate(pairs)]
        for k, (a, b) in enumerate(sides):
            if a.size != b.size:
                raise InvalidProblem(f"pairs[{k}]", "must be two expressions of one shape",
                                     value=f"of shapes {a.shape} and {b.shape}")
        _check(problem, sides)
        signs = [[side >= 0 for side in pair] for pair in sides]
        whole = cvxpy.Problem(problem.objective, problem.constraints + [sign for pair in signs for sign in pair])
        known = _known[problem] = given, signs, whole, MARBLE()
    data, chain, inverse = known[2].get_problem_data(known[3])
    return data, chain, inverse, known[1]


def solve(problem: cvxpy.Problem, pairs: Sequence[tuple[Any, Any]] = (), **options: Any) -> Answer:
    """Solves a problem with 0 ≤ a ⊥ b ≥ 0 for every pair (a, b) of affine expressions of one shape, entry by entry.

    The rest is what CVXPY takes as a quadratic program. options: Marble's, by name, and `server`, `z0`, `progress` and
    others of marble.solve.

    The problem has status, value and dual values then, and its variables their values. Returns Marble's answer, whose
    s, t, xi and eta are in the order of the pairs, of a matrix by columns. Raises InvalidProblem with the name of what
    does not fit: a side that is not affine, a constraint or an objective that is no quadratic program's, an integer
    variable.
    """
    data, chain, inverse, signs = _canonical(problem, pairs)
    ids, places, count = chain.compose_constr_id_map(), {}, 0
    for constraint in inverse[-1][MARBLE.NEQ_CONSTR]:
        places[constraint.id] = np.arange(count, count + constraint.size)
        count += constraint.size
    left, right = (np.concatenate([np.zeros(0, int), *(places[ids[pair[i].id]] for pair in signs)]) for i in (0, 1))
    rest = np.setdiff1d(np.arange(count), np.concatenate([left, right]))
    parts = _parts(data)
    C, d = parts["C"].tocsr(), parts["d"]
    parts.update(C=C[rest], d=d[rest], L=C[left], l=d[left], R=C[right], r=d[right])
    answer = client.solve(data[s.P], data[s.Q], **parts, **options)
    nu = np.zeros(count)
    for rows, values in ((rest, answer.nu), (left, answer.xi), (right, answer.eta)):
        if values.size == rows.size:
            nu[rows] = values
    problem.unpack_results(dataclasses.replace(answer, nu=nu), chain, inverse)
    return answer
