"""The numbers, flags, texts and vectors of a solution. Made by proto/generate from solution.proto; not to be edited."""

from __future__ import annotations

import math
from dataclasses import dataclass

from marble.model.lcqp import Vector


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SolutionFields:
    """The numbers, flags, texts and vectors of a solution.

    detail: One sentence with the numbers that justify the status.
    z: The point, n entries.
    y: Multipliers y of A z + b = 0, n_e entries, free sign.
    nu: Multipliers nu >= 0 of C z + d >= 0, n_i entries.
    xi: Multipliers xi of L z + l >= 0, n_c entries.
    eta: Multipliers eta of R z + r >= 0, n_c entries.
    certificate: For INFEASIBLE the stacked multipliers (y, nu, xi, eta) with nu, xi, eta >= 0, b'y - d'nu - l'xi -
    r'eta = 1 and A'y - C'nu - L'xi - R'eta = 0 to rounding; empty if each branch was refuted separately. For
    UNBOUNDED a direction v (n entries) with A v = 0, C v >= 0, min(L v, R v) = 0 to rounding, and v'Qv < 0, or Q v
    = 0 to rounding and g'v < 0. Else empty.
    b_stationary: Whether no feasible direction of descent is left; None if that was not decided.
    objective: 1/2 z'Qz + g'z + c0.
    proved: Whether the result is proved. With option global_search: the solution is within relative_gap_tolerance
    of the bound, or the tree ended infeasible. Without it: also for a certificate, and for a small problem whose
    tree ended within max_small_problem_nodes. If a solution of option global_search is not proved, detail gives the
    reason.
    bound: No feasible point has a lower objective. This holds in exact arithmetic, because the bound allows for
    rounding. -inf if no bound is known, as for solutions that neither option global_search nor
    max_small_problem_nodes has bounded; infinity for a problem that is proved infeasible.
    gap: (objective - bound) / max(1, |objective|), >= 0; inf without a feasible point or a bound.
    nodes: Nodes of the tree of option global_search or max_small_problem_nodes that were bounded; 0 without a tree.
    open_nodes: Nodes of the tree that are open at the end; 0 if the tree was searched to its end.
    reused_nodes: Nodes of a session's last tree with which this tree began instead of the root. They were bounded
    again by the multipliers with which they were closed, and not solved again. detail says how many of them remain
    closed.
    reference_objective: Objective after the last cold start or search for better branches on the way to this
    solution. Then it is the solution's own objective; in a chain of warm starts it is that of an earlier solve, or
    infinity if that one started with infinity.
    kkt_residual: max |Q z + g + A'y - C'nu - L'xi - R'eta| or max |nu (C z + d)|, whichever is larger.
    iterations: Newton iterations.
    factorizations: All numeric factorizations, including rejected ones.
    """

    detail: str
    z: Vector
    y: Vector
    nu: Vector
    xi: Vector
    eta: Vector
    certificate: Vector
    b_stationary: bool | None = None
    objective: float
    proved: bool
    bound: float = -math.inf
    gap: float = math.inf
    nodes: int
    open_nodes: int
    reused_nodes: int
    reference_objective: float
    kkt_residual: float
    iterations: int
    factorizations: int
