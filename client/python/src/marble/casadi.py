"""LCQPs from CasADi expressions, as planners write them, and back. Needs casadi (3.6 or newer).

    x = casadi.SX.sym("x", 2)
    problem = marble.casadi.from_casadi(x, (x[0] - 1)**2 + x[1]**2, pairs=[(x[0], x[1])])
    solution = marble.solve(problem)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi
import numpy as np
from numpy.typing import ArrayLike

from marble.base.lazy import lazy
from marble.errors import InvalidProblem
from marble.model.lcqp import LCQP, mirrored
from marble.model.problem import Problem, compiled

sp: Any = lazy("scipy.sparse")


def _only_of(expression: Any, x: Any, what: str) -> None:
    inside = {s.name() for s in casadi.symvar(x)}
    others = sorted({s.name() for s in casadi.symvar(expression)} - inside)
    if others:
        raise InvalidProblem(what, f"must depend on the variables only; it has the parameter {', '.join(others)}")


def _linear(expression: Any, x: Any, what: str) -> tuple[Any, Any]:
    """J and c of an expression J x + c."""
    column = casadi.vec(expression)
    _only_of(column, x, what)
    if column.numel() == 0:
        return sp.csc_matrix((0, x.numel())), np.zeros(0)
    curved = casadi.which_depends(column, x, 2, True)
    if any(curved):
        entry = list(curved).index(True)
        raise InvalidProblem(what, "must be linear in the variables", index=entry, value=column[entry])
    at_zero = casadi.DM.zeros(x.numel())
    parts = casadi.Function("parts", [x], [casadi.jacobian(column, x), column])(at_zero)
    return sp.csc_matrix(parts[0].sparse()), np.asarray(parts[1]).reshape(-1)


def _quadratic(objective: Any, x: Any) -> tuple[Any, Any, float]:
    if objective.numel() != 1:
        raise InvalidProblem("objective", "must be one number", value=f"of shape {objective.shape}")
    _only_of(objective, x, "objective")
    hessian, gradient = casadi.hessian(objective, x)
    if any(casadi.which_depends(casadi.vec(hessian), x, 1, True)):
        entries = casadi.symvar(hessian)
        raise InvalidProblem("objective", "must be quadratic in the variables; its second derivative depends on "
                             + ", ".join(sorted({s.name() for s in entries})))
    at_zero = casadi.DM.zeros(x.numel())
    Q, g, c0 = casadi.Function("parts", [x], [hessian, gradient, objective])(at_zero)
    return sp.csc_matrix(Q.sparse()), np.asarray(g).reshape(-1), float(c0)


def from_casadi(x: Any, objective: Any, constraints: Any = None, lb: ArrayLike | None = None,
                ub: ArrayLike | None = None, *, pairs: Sequence[tuple[Any, Any]] = (), lbx: ArrayLike | None = None,
                ubx: ArrayLike | None = None, x0: ArrayLike | None = None, name: str = "") -> Problem:
    """An LCQP from expressions in the symbols x (a column of SX or MX, n entries).

    objective: a scalar, quadratic in x. constraints: any shape, linear in x, with lb ≤ constraints ≤ ub, one number or
    an entry each; None is no limit. pairs: (a, b) of the same shape, linear in x, for 0 ≤ a ⊥ b ≥ 0. lbx, ubx: bounds
    of x. x0: where to start.

    Returns a Problem, whose row_duals are in the order of the constraints. Raises InvalidProblem with the part and the
    reason where something is not quadratic, not linear, or has other symbols than x.
    """
    column = casadi.vec(x)
    if not column.is_valid_input():
        raise InvalidProblem("x", "must be symbols")
    Q, g, c0 = _quadratic(column.__class__(objective), column)
    problem = Problem(column.numel(), name).minimize((Q + Q.T) / 2, g, c0).bound(None, lbx, ubx).start_at(x0)
    if constraints is not None:
        rows, constant = _linear(column.__class__(constraints), column, "constraints")
        low = np.asarray(-np.inf if lb is None else lb, dtype=np.float64)
        high = np.asarray(np.inf if ub is None else ub, dtype=np.float64)
        problem.add_rows(rows, low - constant, high - constant)
    for k, (a, b) in enumerate(pairs):
        L, l = _linear(column.__class__(a), column, f"pairs[{k}][0]")
        R, r = _linear(column.__class__(b), column, f"pairs[{k}][1]")
        problem.add_pairs(L, R, l=l, r=r)
    return problem


def _constant(values: Any) -> Any:
    return casadi.DM(sp.csc_matrix(values))


def to_casadi(problem: LCQP | Problem, kind: Any = None) -> dict[str, Any]:
    """The problem in CasADi's terms: a dictionary for casadi.nlpsol, and the pairs beside it.

    kind: casadi.SX (if None) or casadi.MX. Keys: "x", the symbols; "f", the objective; "g" with "lbg" and "ubg": A z,
    which must be −b, and C z, which must be at least −d; "G" and "H", the two sides of the pairs, n_c entries each.
    """
    lcqp = compiled(problem)
    x = (kind or casadi.SX).sym("x", lcqp.n)
    quadratic = casadi.dot(x, casadi.mtimes(_constant(mirrored(lcqp.Q)), x))
    return {
        "x": x,
        "f": 0.5 * quadratic + casadi.dot(casadi.DM(lcqp.g), x) + lcqp.c0,
        "g": casadi.vertcat(casadi.mtimes(_constant(lcqp.A), x), casadi.mtimes(_constant(lcqp.C), x)),
        "lbg": np.concatenate([-lcqp.b, -lcqp.d]),
        "ubg": np.concatenate([-lcqp.b, np.full(lcqp.d.size, np.inf)]),
        "G": casadi.mtimes(_constant(lcqp.L), x) + casadi.DM(lcqp.l),
        "H": casadi.mtimes(_constant(lcqp.R), x) + casadi.DM(lcqp.r),
    }
