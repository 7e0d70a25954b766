"""A builder for problems in a planner's own terms: named variables, two-sided rows, bounds, pairs."""

from __future__ import annotations

import copy
import os
import pathlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from marble.base.html import table
from marble.base.lazy import lazy
from marble.errors import InvalidProblem
from marble.model import highs_file, problem_file
from marble.model.layout import INFINITE, Layout, stack, taken
from marble.model.lcqp import LCQP, MatrixLike, Vector, csc, matrix, mirrored, numbers, upper_triangle, vector
from marble.model.solution import Solution

sp: Any = lazy("scipy.sparse")

Variable = int | str
_MOST_NAMES = 8  # of variables that a notebook shows


def _limits(values: ArrayLike | None, otherwise: float, size: int, name: str) -> Vector:
    if values is None:
        return np.full(size, otherwise)
    array = numbers(values, name)
    if array.ndim == 0:
        array = np.full(size, float(array))
    if array.shape != (size,):
        raise InvalidProblem(name, f"must have {size} entries", value=f"of shape {array.shape}")
    wrong = array >= INFINITE if otherwise < 0 else array <= -INFINITE
    bad = np.flatnonzero(np.isnan(array) | wrong)
    if bad.size:
        rule = "must be below 1e20; -inf is no limit" if otherwise < 0 else "must be above -1e20; inf is no limit"
        raise InvalidProblem(name, rule, index=int(bad[0]), value=array[bad[0]])
    return array


def _check_order(low: Vector, high: Vector, name: str) -> None:
    crossed = np.flatnonzero(low > high)
    if crossed.size:
        i = int(crossed[0])
        raise InvalidProblem(name, f"must be at most the upper limit {high[i]:g}", index=i, value=f"{low[i]:g}")


def _identity(n: int) -> Any:
    return csc(np.ones(n), np.arange(n, dtype=np.int32), np.arange(n + 1, dtype=np.int32), (n, n))


def _unit_row(i: int, n: int) -> Any:
    return csc(np.ones(1), np.zeros(1, dtype=np.int32), (np.arange(n + 1) > i).astype(np.int32), (1, n))


def _unit_rows(variables: Any, n: int) -> Any:
    return sp.csr_matrix((np.ones(variables.size), variables, np.arange(variables.size + 1)), (variables.size, n))


def _pair_indices(pairs: ArrayLike, n: int) -> Any:
    try:
        index = np.asarray(pairs)
    except ValueError:
        raise InvalidProblem("pairs", "must be a list of pairs (i, j)") from None
    if index.size == 0:
        return np.zeros((0, 2), np.int32)
    if index.ndim != 2 or index.shape[1] != 2:
        raise InvalidProblem("pairs", "must be a list of pairs (i, j)", value=f"of shape {index.shape}")
    if index.dtype.kind not in "iu":
        raise InvalidProblem("pairs", "must be indices of variables, whole numbers", value=f"of type {index.dtype}")
    wrong = np.argwhere((index < 0) | (index >= n))
    if wrong.size:
        k, side = map(int, wrong[0])
        raise InvalidProblem("pairs", f"must be in [0, {n})", index=(k, side), value=index[k, side])
    return index.astype(np.int32)


@dataclass(eq=False)
class Problem:
    """A problem as a planner states it.

    variables: their number n ≥ 1, or their names, which may then stand for their indices everywhere.
    name: for logs and dashboards.

    Nothing is sent before it is solved: marble.solve(problem), client.solve(problem), client.session(problem).
    negated: whether the objective is the negative of a file's, which maximizes; load sets it.
    Infinite limits mean none. Equal ones make an equality. The answer's row_duals and bound_duals have one entry a row
    and a variable; its s, t, xi, eta one a pair; each in the order of adding. Every method returns the problem itself.
    Raises InvalidProblem with field, index and bound.
    """

    variables: int | Sequence[str]
    name: str = ""
    n: int = field(init=False)
    negated: bool = field(init=False, default=False)
    _names: dict[str, int] = field(init=False, default_factory=dict)
    _rows: list[Any] = field(init=False, default_factory=list)
    _lows: list[Vector] = field(init=False, default_factory=list)
    _highs: list[Vector] = field(init=False, default_factory=list)
    _pairs: list[tuple[Any, Vector, Any, Vector]] = field(init=False, default_factory=list)
    _layout: Layout | None = field(init=False, default=None)  # of the rows and limits at hand, once asked for
    _compiled: LCQP | None = field(init=False, default=None)  # likewise

    def __post_init__(self) -> None:
        if isinstance(self.variables, int):
            self.n = self.variables
        else:
            self._names = {name: i for i, name in enumerate(self.variables)}
            self.n = len(self.variables)
            if len(self._names) != self.n:
                raise InvalidProblem("variables", "must have different names")
        if self.n < 1:
            raise InvalidProblem("variables", "must be at least 1", value=self.n)
        self._Q: Any = None
        self._g: Vector = np.zeros(self.n)
        self._c0 = 0.0
        self._z0: Vector | None = None
        self._low = np.full(self.n, -np.inf)
        self._high = np.full(self.n, np.inf)

    def index(self, variable: Variable) -> int:
        """The index of a variable, from 0."""
        if isinstance(variable, str):
            if variable not in self._names:
                raise InvalidProblem("variable", "is not the name of a variable", value=repr(variable))
            return self._names[variable]
        if not 0 <= variable < self.n:
            raise InvalidProblem("variable", f"must be in [0, {self.n})", value=variable)
        return int(variable)

    def minimize(self, Q: MatrixLike | None = None, g: ArrayLike | None = None, c0: float = 0.0) -> Problem:
        """Sets the objective ½ zᵀQz + gᵀz + c0; Q n × n, symmetric, g n entries."""
        self._compiled = None
        self._Q = None if Q is None else upper_triangle(Q, self.n)
        self._g = np.zeros(self.n) if g is None else vector(g, "g", self.n, " (n)")
        self._c0 = float(vector(c0, "c0", 1)[0])
        return self

    def add_rows(self, A: MatrixLike, lb: ArrayLike | None = None, ub: ArrayLike | None = None) -> Problem:
        """Adds rows lb ≤ A z ≤ ub. A: m × n; lb, ub: m entries or one number for all. None and ±1e20 are no limit."""
        return self._append_rows(A, lb, ub, ("lb", "ub"))

    def _append_rows(self, A: MatrixLike, lb: ArrayLike | None, ub: ArrayLike | None,
                     names: tuple[str, str]) -> Problem:
        rows = matrix(A, "A", self.n)
        low = _limits(lb, -np.inf, rows.shape[0], names[0])
        high = _limits(ub, np.inf, rows.shape[0], names[1])
        _check_order(low, high, names[0])
        self._layout = self._compiled = None
        self._rows.append(rows)
        self._lows.append(low)
        self._highs.append(high)
        return self

    def bound(self, variable: Variable | Sequence[Variable] | None = None, lb: ArrayLike | None = None,
              ub: ArrayLike | None = None) -> Problem:
        """Sets lb ≤ z ≤ ub of one variable, of some, or of all (None); one number or one entry a variable."""
        if variable is None:
            indices = np.arange(self.n)
        elif isinstance(variable, str) or np.ndim(variable) == 0:
            indices = np.array([self.index(cast(Variable, variable))])
        else:
            indices = np.array([self.index(v) for v in cast(Sequence[Variable], variable)], dtype=np.intp)
        low = _limits(lb, -np.inf, indices.size, "lb")
        high = _limits(ub, np.inf, indices.size, "ub")
        _check_order(low, high, "lb")
        self._layout = self._compiled = None
        self._low[indices], self._high[indices] = low, high
        return self

    def add_pair(self, i: Variable, j: Variable, *, l: float = 0.0, r: float = 0.0) -> Problem:
        """Adds 0 ≤ z_i + l ⊥ z_j + r ≥ 0."""
        return self.add_pairs(_unit_row(self.index(i), self.n), _unit_row(self.index(j), self.n), l=[l], r=[r])

    def add_pairs(self, L: MatrixLike, R: MatrixLike, *, l: ArrayLike | None = None,
                  r: ArrayLike | None = None) -> Problem:
        """Adds 0 ≤ L z + l ⊥ R z + r ≥ 0. L, R: n_c × n; l, r: n_c entries, zero without."""
        left, right = matrix(L, "L", self.n), matrix(R, "R", self.n)
        count = left.shape[0]
        if right.shape[0] != count:
            raise InvalidProblem("R", f"must have {count} rows, as many as L", value=f"{right.shape[0]} rows")
        self._compiled = None
        self._pairs.append((left, np.zeros(count) if l is None else vector(l, "l", count),
                            right, np.zeros(count) if r is None else vector(r, "r", count)))
        return self

    def start_at(self, z0: ArrayLike | None) -> Problem:
        """Sets where a solve starts, n entries; None leaves that to the solver."""
        self._compiled = None
        self._z0 = None if z0 is None else vector(z0, "z0", self.n, " (n)")
        return self

    def copy(self) -> Problem:
        """A problem of its own with the same contents."""
        other = copy.copy(self)
        for name in ("_rows", "_lows", "_highs", "_pairs"):
            setattr(other, name, list(getattr(self, name)))
        other._low, other._high = self._low.copy(), self._high.copy()
        return other

    def _limits(self) -> tuple[Vector, Vector]:
        """Of the caller's rows, then of the variables."""
        return np.concatenate([*self._lows, self._low]), np.concatenate([*self._highs, self._high])

    def _arranged(self) -> Layout:
        if self._layout is None:
            self._layout = Layout.of(*self._limits())
        return self._layout

    def compile(self) -> LCQP:
        """The problem as the solver takes it; the same object until something is changed."""
        if self._compiled is None:
            layout = self._arranged()
            parts: dict[str, Any] = {} if self._Q is None else {"Q": self._Q}
            equal, source, sign = layout.equality_source, layout.inequality_source, layout.inequality_sign
            if equal.size or source.size:
                low, high = self._limits()
                identity = _identity(self.n)
                if equal.size:
                    parts.update(A=taken([*self._rows, identity], equal), b=-low[equal])
                if source.size:
                    parts.update(C=taken([*self._rows, identity], source, sign),
                                 d=np.where(sign > 0, -low[source], high[source]))
            if self._pairs:
                lefts, ls, rights, rs = zip(*self._pairs, strict=True)
                parts.update(L=stack(lefts), l=np.concatenate(ls), R=stack(rights), r=np.concatenate(rs))
            self._compiled = LCQP(None, self._g, c0=self._c0, z0=self._z0).replaced(**parts)
        return self._compiled.named(self.name)

    def translate(self, solution: Solution) -> Solution:
        """The answer of the compiled problem with multipliers of rows and bounds as they were added."""
        rows = sum(low.size for low in self._lows)
        duals = self._arranged().duals(solution.y, solution.nu, rows + self.n)
        return solution.replaced(row_duals=duals[:rows], bound_duals=duals[rows:], variables=self._names)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes a JSON file that `marble solve` reads: the compiled problem."""
        problem_file.save(self.compile(), path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Problem:
        """Reads a JSON file as `marble example` writes it; equalities first, then inequalities, become the rows.

        .mps, .qps and .lp are read too, where highspy is installed, with their names and rows, and .mat by marble.mat.
        Of a file that maximizes the problem minimizes the negative, and `negated` is True. Raises OSError where there
        is no file.
        """
        if pathlib.Path(path).suffix.lower() == ".mat":
            from marble import mat  # which builds on this class

            return mat.load(path)
        return cls._of_highs(path) if highs_file.is_one(path) else cls.of(problem_file.load(path))

    @classmethod
    def _of_highs(cls, path: str | os.PathLike[str]) -> Problem:
        parts = highs_file.read(path)
        n, names = parts["cost"].size, [str(name) for name in parts["names"]]
        problem = cls(names if 0 < len(set(names)) == n else n, pathlib.Path(path).stem)
        problem.negated = bool(parts["maximize"])
        sign = -1.0 if problem.negated else 1.0
        Q = None
        if parts["hessian_values"].size:
            Q = sp.csc_matrix((sign * parts["hessian_values"], parts["hessian_rows"], parts["hessian_starts"]), (n, n))
        problem.minimize(Q, sign * parts["cost"], sign * float(parts["offset"]))
        low, high, row_low, row_high = (parts[name] for name in ("low", "high", "row_low", "row_high"))
        if row_low.size:
            A = sp.csc_matrix((parts["values"], parts["rows"], parts["starts"]), (row_low.size, n))
            problem.add_rows(A, row_low, row_high)
        return problem.bound(None, low, high)

    @classmethod
    def from_qp(cls, P: MatrixLike | None, q: ArrayLike, A: MatrixLike | None = None, l: ArrayLike | None = None,
                u: ArrayLike | None = None, *, pairs: ArrayLike | None = None, c0: float = 0.0,
                z0: ArrayLike | None = None, name: str = "") -> Problem:
        """The problem min ½ xᵀPx + qᵀx + c0 s.t. l ≤ A x ≤ u of QP solvers such as OSQP, with pairs.

        P: n × n, symmetric, or its upper triangle alone; None is zero. q: n ≥ 1 entries. A: m × n; l, u: m entries or
        one number for all; None and ±1e20 are no limit, and rows with l = u become equalities. pairs: k × 2 indices
        from 0 of variables, 0 ≤ x_i ⊥ x_j ≥ 0; add_pairs adds others. z0, name: as in LCQP.

        The answer's z is x, and its row_duals are OSQP's y.
        """
        cost = vector(q, "q")
        if cost.size == 0:
            raise InvalidProblem("q", "must have at least one entry", value="0 entries")
        problem = cls(cost.size, name)
        problem._Q = None if P is None else upper_triangle(P, problem.n, "P", half=True)
        problem._g, problem._c0 = cost, float(vector(c0, "c0", 1)[0])
        if A is not None:
            problem._append_rows(A, l, u, ("l", "u"))
        elif not (l is u is None):
            raise InvalidProblem("A", "is missing: l and u are of its rows")
        if pairs is not None:
            index = _pair_indices(pairs, problem.n)
            problem.add_pairs(_unit_rows(index[:, 0], problem.n), _unit_rows(index[:, 1], problem.n))
        return problem.start_at(z0)

    @classmethod
    def of(cls, lcqp: LCQP) -> Problem:
        """The same problem, to add to."""
        problem = cls(lcqp.n, lcqp.name)
        problem.minimize(mirrored(lcqp.Q), lcqp.g, lcqp.c0)
        if lcqp.b.size:
            problem.add_rows(lcqp.A, -lcqp.b, -lcqp.b)
        if lcqp.d.size:
            problem.add_rows(lcqp.C, -lcqp.d)
        if lcqp.l.size:
            problem.add_pairs(lcqp.L, lcqp.R, l=lcqp.l, r=lcqp.r)
        return problem.start_at(lcqp.z0)

    def __repr__(self) -> str:
        rows = sum(part.shape[0] for part in self._rows)
        pairs = sum(part[0].shape[0] for part in self._pairs)
        name = f" {self.name!r}" if self.name else ""
        return f"<Problem{name}: {self.n} variables, {rows} rows, {pairs} pairs>"

    def _repr_html_(self) -> str:
        shown = ", ".join([*self._names][:_MOST_NAMES]) + (", …" if len(self._names) > _MOST_NAMES else "")
        low, high = (np.concatenate([*parts, np.zeros(0)]) for parts in (self._lows, self._highs))
        bounded = np.count_nonzero((self._low > -INFINITE) | (self._high < INFINITE))
        return table(f"Problem {self.name}".strip(), [
            ("variables", f"{self.n}{': ' if shown else ''}{shown}, {bounded} with bounds"),
            ("rows", f"{low.size}, {np.count_nonzero(low == high)} of them equalities"),
            ("pairs", str(sum(part[0].shape[0] for part in self._pairs))),
            ("start", "where the solver chooses" if self._z0 is None else "given")])


def compiled(problem: LCQP | Problem) -> LCQP:
    """The problem as the solver takes it."""
    if isinstance(problem, Problem):
        return problem.compile()
    if not isinstance(problem, LCQP):
        kind = type(problem).__name__
        raise InvalidProblem("problem", "must be a marble.LCQP or a marble.Problem", value=f"a {kind}")
    return problem


def in_terms_of(problem: LCQP | Problem, solution: Solution) -> Solution:
    """The answer in the terms in which the problem was given."""
    return problem.translate(solution) if isinstance(problem, Problem) else solution


def without_objective(problem: LCQP | Problem) -> LCQP | Problem:
    """The problem with ½ zᵀz in place of its objective, as `marble explain` has it.

    Any objective will do to find a feasible point, and a convex problem is more often proved infeasible.
    """
    if isinstance(problem, Problem):
        other = problem.copy()
        return other.minimize(sp.identity(other.n, format="csc"))
    lcqp = compiled(problem)
    return lcqp.replaced(Q=sp.identity(lcqp.n, format="csc"), g=np.zeros(lcqp.n), c0=0.0)


def problem_of(Q: MatrixLike | LCQP | Problem | None, g: ArrayLike | None, A: MatrixLike | None,
               b: ArrayLike | None, C: MatrixLike | None, d: ArrayLike | None, L: MatrixLike | None,
               l: ArrayLike | None, R: MatrixLike | None, r: ArrayLike | None, c0: float, z0: ArrayLike | None,
               name: str) -> LCQP | Problem:
    """The problem that solve() was given, in parts or as one."""
    if not isinstance(Q, LCQP | Problem):
        if g is None:
            raise InvalidProblem("g", "is missing; its size defines the number of variables")
        return LCQP(Q, g, A=A, b=b, C=C, d=d, L=L, l=l, R=R, r=r, c0=c0, z0=z0, name=name)
    parts = {"g": g, "A": A, "b": b, "C": C, "d": d, "L": L, "l": l, "R": R, "r": r, "z0": z0,
             "c0": c0 if np.any(c0) else None, "name": name or None}
    given = next((part for part, value in parts.items() if value is not None), None)
    if given is not None:
        raise InvalidProblem(given, "must not be given beside a whole problem")
    return Q
