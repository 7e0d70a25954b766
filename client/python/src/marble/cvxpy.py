"""Marble as a solver of CVXPY's quadratic programs: problem.solve(solver=marble.cvxpy.MARBLE())."""

from __future__ import annotations

from typing import Any, Final

import cvxpy.settings as s
import numpy as np
from cvxpy.reductions.solution import Solution, failure_solution
from cvxpy.reductions.solvers import utilities
from cvxpy.reductions.solvers.qp_solvers.qp_solver import QpSolver

from marble.base.tables import Status
from marble.client import solve

_STATUSES: Final = {
    Status.SOLVED: s.OPTIMAL,
    Status.SOLVED_REDUCED: s.OPTIMAL_INACCURATE,
    Status.INFEASIBLE: s.INFEASIBLE,
    Status.UNBOUNDED: s.UNBOUNDED,
    Status.ITERATION_LIMIT: s.USER_LIMIT,
    Status.TIME_LIMIT: s.USER_LIMIT,
}


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
        rows: dict[str, Any] = {}
        if data[s.A].shape[0]:
            rows.update(A=data[s.A], b=-data[s.B])
        if data[s.F].shape[0]:
            rows.update(C=-data[s.F], d=data[s.G])
        return solve(data[s.P], data[s.Q], **rows, progress=verbose, **solver_opts)

    def invert(self, solution: Any, inverse_data: Any) -> Any:
        """The answer in CVXPY's terms."""
        status = _STATUSES.get(solution.status, s.SOLVER_ERROR)
        facts = {s.SOLVE_TIME: solution.times.solve_s, s.SETUP_TIME: solution.times.setup_s,
                 s.NUM_ITERS: solution.iterations, s.EXTRA_STATS: {"solution": solution}}
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
