"""Nonlinear problems as sequences of LCQPs: the loop of the C++ library marble::nonlinear.

    min f(x)   s.t.   c_E(x) = 0,   c_I(x) ≥ 0,   0 ≤ G(x) ⊥ H(x) ≥ 0,   lower ≤ x ≤ upper

    answer = marble.nlp.solve(values, derivatives, x0)
    answer = marble.nlp.solve_casadi({"x": x, "f": f, "g": g, "G": G, "H": H}, x0, lbg=0, ubg=0)
    answer = marble.nlp.solve_jax({"f": f, "g": g, "G": G, "H": H}, x0, lbg=0, ubg=0)

`values(x)` returns a dictionary of "objective" and any of "equalities", "inequalities", "G", "H" and "residuals", half
the sum of whose squares is added to the objective. `derivatives(x)` returns one of "gradient" and their Jacobians,
dense or scipy.sparse; of a sparse one the stored entries are its pattern, which must not change.

`retrospective` is for functions that are averages over samples: values(x, N) and derivatives(x, N).
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from marble.errors import InvalidArgument
from marble.nlp.from_jax import JaxFunctions
from marble.nlp.functions import Multipliers, TwoSided, broadcast, problem_of, vector
from marble.nlp.levels import Estimate, Level, RetrospectiveAnswer, retrospective, uniform
from marble.nlp.loop import Answer, Iteration, Settings, run
from marble.nlp.real_time import RealTime, RealTimeTick

__all__ = ["Answer", "Estimate", "Iteration", "JaxFunctions", "Level", "Multipliers", "RealTime", "RealTimeTick",
           "RetrospectiveAnswer", "Settings", "retrospective", "solve", "solve_casadi", "solve_jax", "uniform"]


def solve(
    values: Callable[[NDArray[np.float64]], Mapping[str, Any]],
    derivatives: Callable[[NDArray[np.float64]], Mapping[str, Any]],
    x0: ArrayLike,
    *,
    hessian: Callable[[NDArray[np.float64], Multipliers], Any] | None = None,
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
    scale: ArrayLike | None = None,
    blocks: Sequence[int] | None = None,
    **settings: Any,
) -> Answer:
    """Solves a nonlinear problem on this thread.

    hessian: of f + yᵀc_E − nuᵀc_I − xiᵀG − etaᵀH, symmetric; its upper triangle counts. lower, upper: bounds of x.
    scale: a typical change of each variable. blocks: sizes of groups of variables that no function couples but
    linearly. settings: `Settings` by their names, and options of each LCQP. What a function raises comes out. Errors:
    InvalidArgument names the function, and the row as index.
    """
    problem = problem_of(values, derivatives, hessian, x0, lower, upper, scale, blocks)
    return run("solve_nonlinear", problem, settings)


def solve_casadi(
    problem: Mapping[str, Any],
    x0: ArrayLike,
    *,
    p: ArrayLike = (),
    lbx: ArrayLike = -np.inf,
    ubx: ArrayLike = np.inf,
    lbg: ArrayLike = -np.inf,
    ubg: ArrayLike = np.inf,
    **settings: Any,
) -> Answer:
    """Solves min f(x, p) s.t. lbg ≤ g ≤ ubg, 0 ≤ G ⊥ H ≥ 0, lbx ≤ x ≤ ubx. Needs casadi.

    problem: CasADi expressions by the names x, f and, where there are any, p, g, G and H. Derivatives and patterns are
    CasADi's; the Hessian is exact. Rows of g with equal bounds are the answer's equalities; of the others those with a
    lower bound are its first inequalities, those with an upper one the rest. settings: as `solve` takes them.
    """
    ca: Any = importlib.import_module("casadi")
    others = sorted(set(problem) - {"x", "f", "p", "g", "G", "H"})
    if others or not {"x", "f"} <= set(problem):
        raise InvalidArgument("problem", f"must have x and f, and may have p, g, G and H; it has {sorted(problem)}")
    x, f = problem["x"], problem["f"]
    empty = type(x)(0, 1)
    parameters, g = problem.get("p", empty), ca.vec(problem.get("g", empty))
    G, H = ca.vec(problem.get("G", empty)), ca.vec(problem.get("H", empty))
    sides = TwoSided(lbg, ubg, g.numel())
    equal, above, below = (rows.tolist() for rows in (sides.equal, sides.above, sides.below))
    c_E = ca.vec(g[equal]) - ca.DM(sides.low[equal])
    c_I = ca.vertcat(ca.vec(g[above]) - ca.DM(sides.low[above]), ca.DM(sides.high[below]) - ca.vec(g[below]))
    parts = {"equalities": c_E, "inequalities": c_I, "G": G, "H": H}
    weights = [type(x).sym(name, part.numel()) for name, part in parts.items()]
    lagrangian = f + ca.dot(weights[0], c_E) - sum(ca.dot(w, c) for w, c in zip(weights[1:], (c_I, G, H), strict=True))
    inputs, given_p = [x, parameters], broadcast(p, np.shape(p))
    of_values = ca.Function("values", inputs, [f, *parts.values()])
    of_slopes = ca.Function("slopes", inputs, [ca.gradient(f, x), *(ca.jacobian(part, x) for part in parts.values())])
    of_hessian = ca.Function("hessian", [*inputs, *weights], [ca.hessian(lagrangian, x)[0]])

    def values(at: Any) -> dict[str, Any]:
        objective, *rest = of_values(at, given_p)
        return {"objective": float(objective), **dict(zip(parts, (part.full() for part in rest), strict=True))}

    def derivatives(at: Any) -> dict[str, Any]:
        gradient, *rest = of_slopes(at, given_p)
        return {"gradient": gradient.full(), **{name: part.sparse() for name, part in zip(parts, rest, strict=True)}}

    def hessian(at: Any, m: Multipliers) -> Any:
        return of_hessian(at, given_p, m.y, m.nu, m.xi, m.eta).sparse()

    lower, upper = (broadcast(bound, (x.numel(),)) for bound in (lbx, ubx))
    return solve(values, derivatives, x0, hessian=hessian, lower=lower, upper=upper, **settings)


def solve_jax(
    problem: Mapping[str, Callable[..., Any]],
    x0: ArrayLike,
    *,
    p: Any = None,
    lbx: ArrayLike = -np.inf,
    ubx: ArrayLike = np.inf,
    lbg: ArrayLike = -np.inf,
    ubg: ArrayLike = np.inf,
    **settings: Any,
) -> Answer:
    """Solves min f(x, p) s.t. lbg ≤ g ≤ ubg, 0 ≤ G ⊥ H ≥ 0, lbx ≤ x ≤ ubx. Needs jax.

    problem: functions for JAX by the names f and, where there are any, g, G and H, as `JaxFunctions` takes them, which
    is what to keep of a problem that is solved again and again: its functions are compiled once. The Hessian is exact.
    settings: as `solve` takes them.
    """
    start = vector(x0)
    given = JaxFunctions(problem, start.size, p=p, lbg=lbg, ubg=ubg)
    lower, upper = (broadcast(bound, start.shape) for bound in (lbx, ubx))
    return solve(given.values, given.derivatives, start, hessian=given.hessian, lower=lower, upper=upper, **settings)
