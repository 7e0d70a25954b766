"""LCQPs from CasADi expressions, as planners write them, and back. Needs casadi (3.6 or newer).

    x, p = casadi.SX.sym("x", 2), casadi.SX.sym("p")
    problem = marble.casadi.from_casadi(x, (x[0] - 1)**2 + x[1]**2, pairs=[(x[0], x[1])])
    solution = marble.solve(problem)

    solver = marble.casadi.mpccsol("contact", dict(x=x, p=p, f=(x[0] - p)**2 + x[1]**2, G=x[0], H=x[1]))
    answer = solver(p=1.5)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import casadi
import numpy as np
from numpy.typing import ArrayLike

from marble.base.lazy import lazy
from marble.base.tables import Status
from marble.client import Client
from marble.errors import InvalidArgument, InvalidProblem
from marble.model.layout import INFINITE, Family
from marble.model.lcqp import LCQP, Vector, mirrored
from marble.model.lcqp import numbers as real
from marble.model.problem import Problem, compiled
from marble.model.solution import Solution, warn_if_almost
from marble.repeated import Repeated

sp: Any = lazy("scipy.sparse")

_KEYS: Final = ("x", "p", "f", "g", "G", "H")
_VARIABLE_SIDES: Final = ((True, True), (True, False), (False, True), (False, False))  # by cc_types


class _Forms:
    """Expressions as one Function of p: the numbers of Q, g, c0, and of J and c of each linear J x + c.

    parts: linear expressions by the field to be named in errors. A part or an objective of the wrong degree is refused.
    """

    def __init__(self, x: Any, p: Any, objective: Any, parts: Mapping[str, Any]) -> None:
        graphs = any(isinstance(e, casadi.MX) for e in (x, p, objective, *parts.values()))
        self._kind = casadi.MX if graphs else casadi.SX
        x, p = self._column(x, "x"), self._column(casadi.DM(0, 1) if p is None else p, "p")
        f = self._kind(objective)
        if f.numel() != 1:
            raise InvalidProblem("objective", "must be one number", value=f"of shape {f.shape}")
        self.variables, self.p_size = _names(x), p.numel()
        columns = {field: casadi.vec(self._kind(part)) for field, part in parts.items()}
        known = {s.name() for s in (*casadi.symvar(x), *casadi.symvar(p))}
        for field, expression in {"objective": f, **columns}.items():
            others = sorted({s.name() for s in casadi.symvar(expression)} - known)
            if others:
                raise InvalidProblem(field, f"must depend on x and p only; it has {', '.join(others)}")
        # In symbols of its own x may be put together of several ones.
        X, P = self._kind.sym("x", x.numel()), self._kind.sym("p", p.numel())
        whole = casadi.Function("whole", [x, p], [casadi.densify(e) for e in (f, *columns.values())])
        f_of, *parts_of = whole.call([X, P], True, False)
        out = self._quadratic(f_of, X)
        for (field, written), part in zip(columns.items(), parts_of, strict=True):
            out += self._linear(part, X, field, written)
        self._numbers = casadi.Function("numbers", [X, P], out)
        if self._kind is casadi.MX:
            try:
                self._numbers = self._numbers.expand()
            except RuntimeError:  # it calls what has no SX
                pass
        self._allocate()

    def _column(self, symbols: Any, field: str) -> Any:
        column = casadi.vec(self._kind(symbols))
        if column.numel() and not column.is_valid_input():
            raise InvalidProblem(field, "must be symbols")
        return column

    def _quadratic(self, f: Any, X: Any) -> list[Any]:
        hessian, gradient = casadi.hessian(f, X)
        curved = casadi.which_depends(casadi.vec(hessian), X, 1, False)
        names = [name for name, yes in zip(self.variables, curved, strict=True) if yes]
        if names:
            raise InvalidProblem("objective", "must be quadratic in the variables; its second derivative depends on "
                                 + ", ".join(names))
        return [casadi.triu(hessian), casadi.densify(gradient), f]

    def _linear(self, part: Any, X: Any, field: str, written: Any) -> list[Any]:
        if part.numel() == 0:
            return [casadi.DM(0, X.numel()), casadi.DM(0, 1)]
        curved = casadi.which_depends(part, X, 2, True)
        if any(curved):
            row = list(curved).index(True)
            raise InvalidProblem(field, "must be linear in the variables", index=row, value=written[row])
        return [casadi.jacobian(part, X), part]

    def _allocate(self) -> None:
        call = self._numbers
        self._buffer, self._run = call.buffer()
        self._x, self._p = np.zeros(len(self.variables)), np.zeros(self.p_size)
        self._out = [np.zeros(call.nnz_out(i)) for i in range(call.n_out())]
        for i, array in enumerate((self._x, self._p)):
            self._buffer.set_arg(i, array.data)
        for i, array in enumerate(self._out):
            self._buffer.set_res(i, array.data)
        self.patterns = [
            sp.csc_matrix((np.zeros(s.nnz()), np.array(s.row(), dtype=np.int32), np.array(s.colind(), dtype=np.int32)),
                          shape=s.shape) for s in (call.sparsity_out(i) for i in range(call.n_out()))]

    def at(self, p: ArrayLike | None) -> list[Vector]:
        """All numbers, in the order of the patterns' entries; they last until the next call."""
        self._p[:] = _filled("p", 0.0 if p is None and not self.p_size else p, self.p_size, finite=True)
        self._run()
        return self._out

    def matrix(self, i: int) -> Any:
        """An output as a matrix, with the numbers of the newest call."""
        self.patterns[i].data[:] = self._out[i]
        return self.patterns[i]


def _names(x: Any) -> list[str]:
    return [name for s in casadi.symvar(x) for name in
            ([s.name()] if s.numel() == 1 else [f"{s.name()}[{i}]" for i in range(s.numel())])]


def _filled(field: str, values: Any, size: int, finite: bool = False) -> Vector:
    """A vector of the size: of that many numbers, or of one for all."""
    if values is None:
        raise InvalidArgument(field, f"must be {size} numbers", value="nothing")
    array = real(values, field).reshape(-1)
    if array.size not in (1, size):
        raise InvalidArgument(field, f"must have {size} entries", value=f"{array.size} entries")
    bad = np.flatnonzero(~np.isfinite(array) if finite else np.isnan(array))
    if bad.size:
        raise InvalidArgument(field, "must be finite" if finite else "must be a number", index=int(bad[0]),
                              value=array[bad[0]])
    return array if array.size == size else np.full(size, array[0] if array.size else 0.0)


def from_casadi(x: Any, objective: Any, constraints: Any = None, lb: ArrayLike | None = None,
                ub: ArrayLike | None = None, *, pairs: Sequence[tuple[Any, Any]] = (), lbx: ArrayLike | None = None,
                ubx: ArrayLike | None = None, x0: ArrayLike | None = None, name: str = "", p: Any = None,
                p0: ArrayLike | None = None) -> Problem:
    """An LCQP from expressions in the symbols x (a column of SX or MX, n entries).

    objective: a scalar, quadratic in x. constraints: any shape, linear in x, with lb ≤ constraints ≤ ub, one number or
    an entry each; None is no limit. pairs: (a, b) of the same shape, linear in x, for 0 ≤ a ⊥ b ≥ 0. lbx, ubx: bounds
    of x. x0: where to start. p: symbols of parameters, which may be multiplied with x, and p0 their numbers; mpccsol is
    for those that change.

    Returns a Problem, whose row_duals are in the order of the constraints. Raises InvalidProblem with the part and the
    reason where something is not quadratic, not linear, or has other symbols than x and p.
    """
    parts = {} if constraints is None else {"constraints": constraints}
    for k, (a, b) in enumerate(pairs):
        parts.update({f"pairs[{k}][0]": a, f"pairs[{k}][1]": b})
    forms = _Forms(x, p, objective, parts)
    numbers = forms.at(p0)
    upper = forms.matrix(0)
    problem = Problem(len(forms.variables), name).minimize(mirrored(upper), numbers[1], float(numbers[2][0]))
    problem.bound(None, lbx, ubx).start_at(x0)
    linear = [(forms.matrix(i), np.array(numbers[i + 1])) for i in range(3, len(numbers), 2)]
    if constraints is not None:
        rows, constant = linear.pop(0)
        low = real(-np.inf if lb is None else lb, "lb")
        high = real(np.inf if ub is None else ub, "ub")
        problem.add_rows(rows, low - constant, high - constant)
    for (L, l), (R, r) in zip(linear[::2], linear[1::2], strict=True):
        problem.add_pairs(L, R, l=l, r=r)
    return problem


class MpccSolver:
    """What mpccsol returns: called with numbers, it solves. It keeps a session, so that a call sends only what differs
    from the last one's and starts from its answer; close() ends it. One thread at a time.
    """

    def __init__(self, name: str, mpcc: Mapping[str, Any], options: Mapping[str, Any] | None = None,
                 server: str | Sequence[str] | Client | None = None) -> None:
        unknown = sorted(set(mpcc) - set(_KEYS))
        if unknown or not {"x", "f"} <= set(mpcc):
            raise InvalidProblem("mpcc", f"must have x and f, and may have {', '.join(_KEYS)}", value=sorted(mpcc))
        given = dict(options or {})
        self.name = name
        x, g = mpcc["x"], mpcc.get("g", casadi.DM(0, 1))
        G, H, self._limits = _with_limits(casadi.vec(x), casadi.vec(g), mpcc.get("G", casadi.DM(0, 1)),
                                          mpcc.get("H", casadi.DM(0, 1)), given.pop("cc_pairs", ()),
                                          given.pop("cc_types", None))
        self._forms = _Forms(x, mpcc.get("p"), mpcc["f"], {"g": g, "G": G, "H": H})
        self._m = casadi.vec(g).numel()
        self._repeated = Repeated(server, given)
        self._family: Family | None = None
        self._answer: Solution | None = None

    def __call__(self, *, x0: ArrayLike | None = None, p: ArrayLike | None = None, lbx: ArrayLike = -np.inf,
                 ubx: ArrayLike = np.inf, lbg: ArrayLike = -np.inf, ubg: ArrayLike = np.inf) -> dict[str, Any]:
        """Solves with p, and bounds that are one number or an entry each.

        x0: start here; None is the last answer. Returns DM of x, f, g, G, H and of the multipliers lam_x, lam_g, lam_G
        and lam_H, of CasADi's sign: ∇f + lam_x + Σ lam ∇(g, G, H) = 0. What cc_pairs names comes after G and H.
        stats() has whether it is solved.
        """
        n, m, forms = len(self._forms.variables), self._m, self._forms
        low = np.concatenate([_filled("lbg", lbg, m), _filled("lbx", lbx, n)])
        high = np.concatenate([_filled("ubg", ubg, m), _filled("ubx", ubx, n)])
        Q, gradient, c0, J, constant, L, l, R, r = forms.at(p)
        for k, sides in enumerate(self._limits):
            at = l.size - len(self._limits) + k
            for offset, place in zip((l, r), sides, strict=True):
                if not -INFINITE < low[place] < INFINITE:
                    raise InvalidProblem("lbx" if place >= m else "lbg", f"must be finite, as it is of cc_pairs[{k}]",
                                         index=place - m if place >= m else place,
                                         value=forms.variables[place - m] if place >= m else low[place])
                offset[at] -= low[place]
        low[[place for sides in self._limits for place in sides]] = -np.inf  # the pairs have them
        crossed = np.flatnonzero(low > high)
        if crossed.size:
            place = int(crossed[0])
            raise InvalidProblem("lbx" if place >= m else "lbg", f"must be at most the upper bound {high[place]:g}",
                                 index=place - m if place >= m else place, value=f"{low[place]:g}")
        same = self._family is not None and self._family.fits(low, high)
        if self._family is None or not same:
            self._family = Family([forms.patterns[i] for i in (0, 3, 5, 7)], low, high, self.name)
        problem = self._family.problem(Q=Q, g=gradient, c0=float(c0[0]), rows=J, constant=constant, low=low, high=high,
                                       L=L, l=l, R=R, r=r)
        z0 = None if x0 is None else _filled("x0", x0, n, finite=True)
        self._answer = answer = self._repeated.solve(problem, same_pattern=same, z0=z0)
        warn_if_almost(answer)
        duals = self._family.layout.duals(answer.y, answer.nu, m + n)
        xi, eta = (values if values.size else np.zeros(l.size) for values in (answer.xi, answer.eta))
        values = {"x": answer.z, "f": answer.objective, "g": forms.matrix(3) @ answer.z + constant, "G": answer.s,
                  "H": answer.t, "lam_x": duals[m:], "lam_g": duals[:m], "lam_G": -xi, "lam_H": -eta}
        return {key: casadi.DM(value) for key, value in values.items()}

    def stats(self) -> dict[str, Any]:
        """Of the last call: success, return_status, iter_count, t_wall_total, kind ("local_minimum", …), what_to_try,
        and solution, Marble's own answer."""
        if self._answer is None:
            raise InvalidArgument("stats", "are there after the first call")
        answer = self._answer
        return {"success": answer.status is Status.SOLVED, "return_status": answer.status.value,
                "iter_count": answer.iterations, "t_wall_total": answer.times.total_s, "kind": answer.kind.value,
                "what_to_try": answer.what_to_try, "solution": answer}

    def close(self) -> None:
        """Ends the session."""
        self._repeated.close()

    def __enter__(self) -> MpccSolver:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def mpccsol(name: str, mpcc: Mapping[str, Any], options: Mapping[str, Any] | None = None, *,
            server: str | Sequence[str] | Client | None = None) -> MpccSolver:
    """A solver of min f(x, p) over lbx ≤ x ≤ ubx, lbg ≤ g(x, p) ≤ ubg, 0 ≤ G(x, p) ⊥ H(x, p) ≥ 0.

    mpcc: x and f, and where there are such p, g, G and H; f quadratic in x, the others linear, whatever p does. That is
    checked here, and InvalidProblem names the row, its expression, or the variable.
    options: the solver's, by name. Also as for casadi.nlpsol: cc_pairs, (i, j) for two entries of which one is at its
    lower bound, from 0; cc_types, one for each of these: 0, both are of x; 1, x and g; 2, g and x; 3, both of g.
    server: as in marble.solve.
    """
    return MpccSolver(name, mpcc, options, server)


def _with_limits(x: Any, g: Any, G: Any, H: Any, pairs: Any, types: Any) -> tuple[Any, Any, list[tuple[int, int]]]:
    """G and H with the sides of the pairs below them; of each pair the places of its bounds, among those of g and x."""
    kinds = [0] * len(pairs) if types is None else list(types)
    if len(kinds) != len(pairs):
        raise InvalidArgument("cc_types", f"must have {len(pairs)} entries, as many as cc_pairs",
                              value=f"{len(kinds)} entries")
    sides: tuple[list[Any], list[Any]] = [casadi.vec(G)], [casadi.vec(H)]
    if sides[0][0].numel() != sides[1][0].numel():
        raise InvalidProblem("H", f"must have {sides[0][0].numel()} entries, as many as G",
                             value=f"{sides[1][0].numel()} entries")
    limits = []
    for k, (pair, kind) in enumerate(zip(pairs, kinds, strict=True)):
        if kind not in range(4):
            raise InvalidArgument("cc_types", "must be 0, 1, 2 or 3", index=k, value=kind)
        places = []
        for side, i, of_x in zip(sides, pair, _VARIABLE_SIDES[kind], strict=True):
            entries = x if of_x else g
            if not 0 <= i < entries.numel():
                raise InvalidArgument("cc_pairs", f"must be in [0, {entries.numel()})", index=k, value=i)
            side.append(entries[i])
            places.append(g.numel() + i if of_x else i)
        limits.append((places[0], places[1]))
    return casadi.vertcat(*sides[0]), casadi.vertcat(*sides[1]), limits


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
