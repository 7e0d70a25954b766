"""Nonlinear problems as sequences of LCQPs: the loop of the C++ library marble::nonlinear.

    min f(x)   s.t.   c_E(x) = 0,   c_I(x) ≥ 0,   0 ≤ G(x) ⊥ H(x) ≥ 0,   lower ≤ x ≤ upper

    answer = marble.nlp.solve(values, derivatives, x0)
    answer = marble.nlp.solve_casadi({"x": x, "f": f, "g": g, "G": G, "H": H}, x0, lbg=0, ubg=0)

`values(x)` returns a dictionary of "objective" and any of "equalities", "inequalities", "G", "H" and "residuals", half
the sum of whose squares is added to the objective. `derivatives(x)` returns one of "gradient" and their Jacobians,
dense or scipy.sparse; of a sparse one the stored entries are its pattern, which must not change.
"""

from __future__ import annotations

import contextlib
import importlib
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

import marble
from marble import errors
from marble.base.lazy import lazy
from marble.base.tables import Status
from marble.connection import connect
from marble.errors import InvalidArgument
from marble.in_process import solver
from marble.nlp import ticks

sp: Any = lazy("scipy.sparse")

_PARTS: Final = ("equalities", "inequalities", "G", "H", "residuals")
_VECTORS: Final = ("x", "y", "nu", "xi", "eta", "bounds")
_STATUSES: Final = {status.value: status for status in Status}


@dataclass(frozen=True)
class Multipliers:
    """With ∇f + ∇c_Eᵀy − ∇c_Iᵀnu − ∇Gᵀxi − ∇Hᵀeta = bounds at a solution."""

    y: NDArray[np.float64]
    nu: NDArray[np.float64]
    xi: NDArray[np.float64]
    eta: NDArray[np.float64]


@dataclass(frozen=True)
class Iteration:
    """One row of the iteration table."""

    iteration: int
    objective: float
    violation: float
    step: float
    radius: float
    accepted: bool
    ticks: int


@dataclass(frozen=True)
class Answer:
    """The newest x that was accepted, solved or not; its fields as marble/nonlinear.h has them."""

    status: Status
    detail: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    nu: NDArray[np.float64]
    xi: NDArray[np.float64]
    eta: NDArray[np.float64]
    bounds: NDArray[np.float64]
    objective: float
    violation: float
    kkt_residual: float
    b_stationary: bool | None
    iterations: int
    ticks: int
    evaluations: int
    factorizations: int

    @property
    def solved(self) -> bool:
        """Whether the tolerances, or the reduced ones, are met."""
        return self.status in (Status.SOLVED, Status.SOLVED_REDUCED)


def _vector(values: Any) -> NDArray[np.float64]:
    return np.ascontiguousarray(values, dtype=np.float64).reshape(-1)


def _matrix(given: Any) -> Any:
    """In compressed columns; of a dense one every entry is stored, so that its pattern stays."""
    if sp.issparse(given):
        made = sp.csc_matrix(given, dtype=np.float64)
        made.sort_indices()
        return made
    dense = np.atleast_2d(np.asarray(given, dtype=np.float64))
    rows, columns = dense.shape
    indices = np.tile(np.arange(rows, dtype=np.int32), columns)
    pointers = np.arange(0, rows * columns + 1, rows, dtype=np.int32) if rows else np.zeros(columns + 1, np.int32)
    return sp.csc_matrix((dense.ravel(order="F"), indices, pointers), shape=dense.shape)


def _known(given: Mapping[str, Any], first: str, what: str) -> None:
    others = sorted(set(given) - {first, *_PARTS})
    if first not in given or others:
        raise InvalidArgument(what, f"must have {first!r}, and may have {', '.join(_PARTS)}; it has {sorted(given)}")


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
    curvature: str = "automatic",
    step_tolerance: float = 1e-8,
    feasibility_tolerance: float = 1e-6,
    radius: float = 1.0,
    iteration_limit: int = 200,
    time_limit_s: float = 1e9,
    progress: Callable[[Iteration], object] | None = None,
    server: str | Sequence[str] | marble.Client | None = None,
    **options: Any,
) -> Answer:
    """Solves a nonlinear problem on this thread.

    server: where the LCQPs are solved, each an update of a session; as in marble.solve: None is the server that
    MARBLE_SERVER names, and this process where it names none. The same bits.

    hessian: of f + yᵀc_E − nuᵀc_I − xiᵀG − etaᵀH, symmetric; its upper triangle counts. blocks: sizes of groups of
    variables that no function couples but linearly. curvature: "exact", "gauss_newton", "bfgs" or "none"; "automatic"
    takes the first of the three for which there is what it needs. progress: told of each iteration. options: of each
    LCQP. What a function raises comes out. Errors: InvalidArgument names the function, and the row as index.
    """
    core = solver.core()

    def of_values(x: Any) -> tuple[Any, ...]:
        given = values(np.asarray(x))
        _known(given, "objective", "values")
        return float(given["objective"]), *(_vector(given.get(name, ())) for name in _PARTS)

    def of_derivatives(x: Any) -> tuple[Any, ...]:
        given = derivatives(np.asarray(x))
        _known(given, "gradient", "derivatives")
        return _vector(given["gradient"]), *(_matrix(given[name]) if name in given else None for name in _PARTS)

    def of_hessian(x: Any, *multipliers: Any) -> Any:
        assert hessian is not None
        given = Multipliers(*(np.asarray(part, dtype=np.float64) for part in multipliers))
        full = _matrix(hessian(np.asarray(x), given))
        return _matrix(sp.triu(full, format="csc"))

    problem = {"values": of_values, "derivatives": of_derivatives, "hessian": None if hessian is None else of_hessian,
               "start": _vector(x0), "lower": _vector(() if lower is None else lower),
               "upper": _vector(() if upper is None else upper), "scale": _vector(() if scale is None else scale),
               "blocks": np.asarray(() if blocks is None else blocks, dtype=np.int32)}
    settings = {"curvature": curvature, "step_tolerance": step_tolerance, "radius": radius,
                "feasibility_tolerance": feasibility_tolerance, "iteration_limit": iteration_limit,
                "time_limit_s": time_limit_s}
    tell = None if progress is None else lambda *row: progress(Iteration(*row))
    main_thread = threading.get_ident() == threading.main_thread().ident
    with contextlib.ExitStack() as opened:
        there = _ticks_of(server, opened)
        try:
            told = core.solve_nonlinear(problem, settings, solver.option_values(options), tell, there, main_thread)
        except core.Fault as fault:
            raise errors.from_core(*fault.args) from None
    for name in _VECTORS:
        told[name] = np.asarray(told[name])
    told["status"] = _STATUSES[told["status"]]
    return Answer(**told)


def _ticks_of(server: str | Sequence[str] | marble.Client | None,
              opened: contextlib.ExitStack) -> Callable[..., ticks.Tick] | None:
    """None for this process."""
    if not isinstance(server, marble.Client):
        server = connect.server_of(server)
        if connect.is_local(server):
            return None
        server = opened.enter_context(marble.Client(server))
    return ticks.opener(server, opened)


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
    low, high = (np.broadcast_to(np.asarray(bound, dtype=np.float64), (g.numel(),)) for bound in (lbg, ubg))
    equal = np.flatnonzero(low == high).tolist()
    above = np.flatnonzero((low != high) & (low > -np.inf)).tolist()
    below = np.flatnonzero((low != high) & (high < np.inf)).tolist()
    c_E = ca.vec(g[equal]) - ca.DM(low[equal])
    c_I = ca.vertcat(ca.vec(g[above]) - ca.DM(low[above]), ca.DM(high[below]) - ca.vec(g[below]))
    parts = {"equalities": c_E, "inequalities": c_I, "G": G, "H": H}
    weights = [type(x).sym(name, part.numel()) for name, part in parts.items()]
    lagrangian = f + ca.dot(weights[0], c_E) - sum(ca.dot(w, c) for w, c in zip(weights[1:], (c_I, G, H), strict=True))
    inputs, given_p = [x, parameters], np.asarray(p, dtype=np.float64)
    of_values = ca.Function("values", inputs, [f, *parts.values()])
    of_slopes = ca.Function("slopes", inputs, [ca.gradient(f, x), *(ca.jacobian(part, x) for part in parts.values())])
    of_hessian = ca.Function("hessian", [*inputs, *weights], [ca.hessian(lagrangian, x)[0]])

    def values(at: Any) -> dict[str, Any]:
        objective, *rest = of_values(at, given_p)
        return {"objective": float(objective), **dict(zip(parts, map(_vector, rest), strict=True))}

    def derivatives(at: Any) -> dict[str, Any]:
        gradient, *rest = of_slopes(at, given_p)
        return {"gradient": _vector(gradient), **{name: part.sparse() for name, part in zip(parts, rest, strict=True)}}

    def hessian(at: Any, m: Multipliers) -> Any:
        return of_hessian(at, given_p, m.y, m.nu, m.xi, m.eta).sparse()

    lower, upper = (np.broadcast_to(np.asarray(bound, dtype=np.float64), (x.numel(),)) for bound in (lbx, ubx))
    return solve(values, derivatives, x0, hessian=hessian, lower=lower, upper=upper, **settings)
