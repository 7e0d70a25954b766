"""What an x is worth, from the problem's functions alone: nothing that a solver says is used.

Feasible: bounds, rows, G, H >= 0 and |min(G, H)| of each pair at most 1e-6 in the problem's own units; by products, the
last is |G H|. Stationary: there are multipliers with a residual of at most 1e-4 max(1, largest slope of f), of what is
active to 1e-5 at x: the pair's smaller side, and the other one too if it is as small. On the branch their signs are
free (weakly stationary); strongly stationary are those with nonnegative multipliers where both sides are zero.
"""

import dataclasses
import math

import numpy as np

FEASIBLE, ACTIVE, STATIONARY = 1e-6, 1e-5, 1e-4


@dataclasses.dataclass
class Verdict:
    """Numbers of x; violations in the problem's units, residuals over max(1, largest slope of f)."""

    objective: float = math.inf
    bounds: float = math.inf
    rows: float = math.inf
    negative: float = math.inf   # of -G, -H
    sides: float = math.inf      # |min(G, H)|
    products: float = math.inf   # |G H|
    stationarity: float = math.inf
    strong: float = math.inf
    biactive: int = 0

    @property
    def largest(self):
        """The name and the amount of the largest violation."""
        return max((("bounds", self.bounds), ("rows", self.rows), ("negative", self.negative), ("sides", self.sides)),
                   key=lambda each: each[1])

    def feasible(self, by_products=False):
        return max(self.bounds, self.rows, self.negative, self.products if by_products else self.sides) <= FEASIBLE

    def stationary(self):
        return self.stationarity <= STATIONARY


def judge(problem, x):
    """The verdict on x. Values that are not finite count as infinite violations."""
    import casadi as ca
    import scipy.sparse as sp

    made = ca.Function("judged", [problem.w, problem.p], [
        problem.f, problem.g, problem.G, problem.H, ca.gradient(problem.f, problem.w),
        *(ca.jacobian(part, problem.w) for part in (problem.g, problem.G, problem.H))])
    x = np.asarray(x, dtype=float).ravel()
    if x.size != problem.w0.size or not np.isfinite(x).all():
        return Verdict()
    found = made(x, problem.p0)
    f = float(found[0])
    g, G, H, slope = (part.full().ravel() for part in found[1:5])
    jacobians = [sp.csr_matrix(part.sparse()) for part in found[5:]]
    if not all(np.isfinite(part).all() for part in (f, g, G, H)):
        return Verdict()
    verdict = Verdict(
        f, _most(problem.lbw - x, x - problem.ubw), _most(problem.lbg - g, g - problem.ubg), _most(-G, -H),
        _most(np.abs(np.minimum(G, H))), _most(np.minimum(np.abs(G * H), np.abs(np.minimum(G, H)))))
    small_G, small_H = (G <= ACTIVE) | (G <= H), (H <= ACTIVE) | (H < G)
    both = small_G & small_H
    verdict.biactive = int(both.sum())
    if all(np.isfinite(part.data).all() for part in jacobians) and np.isfinite(slope).all():
        for name, signs in (("stationarity", -np.inf), ("strong", 0.0)):
            columns = [*_active(sp.identity(x.size, format="csr"), x, problem.lbw, problem.ubw),
                       *_active(jacobians[0], g, problem.lbg, problem.ubg)]
            for jacobian, small in ((jacobians[1], small_G), (jacobians[2], small_H)):
                columns.append((jacobian[small & ~both], -np.inf, np.inf))
                columns.append((jacobian[small & both], signs, np.inf))
            setattr(verdict, name, _residual(slope, columns))
    return verdict


def _most(*parts):
    amounts = np.concatenate([np.asarray(part, dtype=float).ravel() for part in (0.0, *parts)])
    return float(np.where(np.isnan(amounts), np.inf, amounts).max())


def _active(jacobian, value, low, high):
    """Rows by the signs that their multipliers may have in slope = sum of rows times multipliers."""
    at_low, at_high = value - low <= ACTIVE, high - value <= ACTIVE
    return [(jacobian[at_low & at_high], -np.inf, np.inf), (jacobian[at_low & ~at_high], 0.0, np.inf),
            (jacobian[at_high & ~at_low], -np.inf, 0.0)]


def _residual(slope, columns):
    """The least largest entry of slope - sum of rows times multipliers, relative; a linear program for HiGHS."""
    import scipy.sparse as sp
    from scipy.optimize import linprog

    rows = sp.vstack([rows for rows, _, _ in columns], format="csr")
    bounds = [(low, high) for part, low, high in columns for _ in range(part.shape[0])]
    scale = max(1.0, float(np.abs(slope).max(initial=0.0)))
    n = slope.size
    size = np.sqrt(np.asarray(rows.multiply(rows).sum(axis=1)).ravel())
    unit = sp.diags(1.0 / np.where(size > 0, size, 1.0)) @ rows  # multipliers of rows of length 1
    ones = sp.csr_matrix(np.ones((n, 1)))
    A = sp.bmat([[unit.T, -ones], [-unit.T, -ones]], format="csc")
    cost = np.zeros(rows.shape[0] + 1)
    cost[-1] = 1.0
    answer = linprog(cost, A_ub=A, b_ub=np.concatenate([slope, -slope]) / scale, bounds=[*bounds, (0, None)],
                     method="highs", options={"time_limit": 60})
    if answer.x is None:
        return math.inf
    left = slope / scale - unit.T @ answer.x[:-1]  # by our own sum, not the solver's
    return float(np.abs(left).max(initial=0.0))
