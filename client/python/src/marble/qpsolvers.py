"""Marble as a solver of qpsolvers: after `import marble.qpsolvers`, solve_qp(P, q, G, h, solver="marble")."""

from __future__ import annotations

from typing import Any

import numpy as np
import qpsolvers
from qpsolvers.solvers import available_solvers, dense_solvers, solve_function, sparse_solvers

from marble.client import solve
from marble.model.problem import Problem
from marble.model.solution import warn_if_almost

_NAME = "marble"


def _stated(problem: Any) -> Problem:
    P, q, G, h, A, b, lb, ub = problem.unpack()
    stated = Problem(int(np.size(q))).minimize(P, q)
    for rows, low, high in ((G, None, h), (A, b, b)):
        if rows is not None and high is not None and np.size(high):
            stated.add_rows(rows, lb=low, ub=high)
    if lb is not None or ub is not None:
        stated.bound(None, lb=lb, ub=ub)
    return stated


def solve_problem(problem: Any, initvals: Any = None, verbose: bool = False, **options: Any) -> Any:
    """Solves a qpsolvers.Problem, where MARBLE_SERVER says, else in this process.

    initvals: where to start. verbose: show progress. options: Marble's, by name, and `server` as in marble.solve.
    Returns a qpsolvers.Solution, whose extras hold Marble's answer, "solution", its "kind", and "what_to_try".
    Raises the exceptions of marble.errors.
    """
    stated = _stated(problem)
    if initvals is not None:
        stated.start_at(initvals)
    answer = solve(stated, progress=verbose, **options)
    warn_if_almost(answer)
    solution = qpsolvers.Solution(problem)
    solution.found = answer.solved
    solution.extras = {"solution": answer, "kind": answer.kind.value, "what_to_try": answer.what_to_try}
    if answer.solved:
        rows = 0 if problem.h is None else int(np.size(problem.h))
        solution.x, solution.obj = answer.z, answer.objective
        solution.z, solution.y = answer.row_duals[:rows], answer.row_duals[rows:]
        solution.z_box = answer.bound_duals if problem.lb is not None or problem.ub is not None else np.zeros(0)
    return solution


if _NAME not in solve_function:
    solve_function[_NAME] = solve_problem
    for names in (available_solvers, dense_solvers, sparse_solvers):
        names.append(_NAME)
