"""The contract's tables, for all clients. Made by proto/generate from contract.def; not to be edited."""

from __future__ import annotations

import enum
from typing import Final

VECTORS: Final = {
    "g": "gradient",
    "b": "equality_offset",
    "d": "inequality_offset",
    "l": "left_offset",
    "r": "right_offset",
}
"""The letters of the equation, and the fields of marble.v1.Problem."""
MATRICES: Final = {
    "Q": "hessian",
    "A": "equality_matrix",
    "C": "inequality_matrix",
    "L": "left_matrix",
    "R": "right_matrix",
}
"""The same for the matrices."""
VALUES: Final = {
    "Q": "hessian_values",
    "A": "equality_values",
    "C": "inequality_values",
    "L": "left_values",
    "R": "right_values",
}
"""The fields of marble.v1.ProblemUpdate with a matrix's values."""
SOLUTION_VECTORS: Final = {
    "z": "z",
    "y": "equality_multipliers",
    "nu": "inequality_multipliers",
    "xi": "complementarity_multipliers_l",
    "eta": "complementarity_multipliers_r",
}
"""A point and its multipliers: the letters, and the fields of marble.v1.Solution, WarmStart and AnswerVectors."""
ERRORS: Final = {
    1: "cancelled",
    3: "invalid_argument",
    4: "deadline_exceeded",
    5: "not_found",
    7: "permission_denied",
    8: "resource_exhausted",
    9: "failed_precondition",
    10: "aborted",
    12: "unavailable",
    13: "internal",
    14: "unavailable",
    16: "unauthenticated",
}
"""Names of the errors, by google.rpc.Code."""
DEFAULT_ADDRESS: Final = "127.0.0.1:50051"
LOCAL_ADDRESS: Final = "local"
NO_SERVER_HINT: Final = "; start a server there (marble-server) or name another (MARBLE_SERVER=HOST:PORT)"
LOCAL_HINT: Final = ", or solve without one (MARBLE_SERVER=local)"
LONGEST_REQUEST_ID: Final = 128
LONGEST_PROBLEM_NAME: Final = 256
LONGEST_CLIENT_NAME: Final = 64
LONGEST_UNIX_PATH: Final = 107
LARGEST_PAGE: Final = 10000
DEFAULT_PAGE: Final = 100
MOST_STAGES: Final = 128
MOST_ROWS: Final = 268435455
SYMMETRY: Final = 1e-12
_ADVICE: Final = {
    "almost_solved":
        "Use it if that is enough. Otherwise find the largest violation, and scale its rows or loosen its tolerance.",
    "iteration_limit":
        "If the convergence curves still fall, raise max_iterations. If they are flat, another start (x0, or "
        "num_starts above 1) helps more than further iterations. If nodes are open, raise node_limit.",
    "time_limit":
        "Check which part took the time. Then raise time_limit_s, lower max_local_search_factorizations, or use warm "
        "starts in a session.",
    "cancelled": "Send the request again if the cancellation was not intended.",
    "infeasible":
        "The problem contradicts itself: check the signs and offsets of A, b, C, d, l and r. Option explain=true, or "
        "the command marble explain, returns a smallest set of conflicting rows and pairs.",
    "locally_infeasible":
        "If detail names ill-conditioned rows, remove one of them. With path=paper, try path=fast. Otherwise raise "
        "max_feasibility_factorizations, or start elsewhere (x0). If it happens from every start, check the data of "
        "the largest violation.",
    "unbounded": "A bound or a cost is missing: the nonzero entries of that direction show the variables.",
    "numerical_failure":
        "The cause is usually bad scaling: bring the data nearer to 1, avoid nearly equal rows, keep scaling_passes "
        "above 0, or try path = paper.",
}
KIND_TEXTS: Final = {
    "proved_optimal": "proved optimal{within}",
    "optimal": "optimal: Q is convex, and there are no pairs",
    "local_minimum": "local minimum; {optimum}",
    "stationary_point": "stationary point only: {reason}; {bound}",
    "saddle_point": "saddle point: the objective falls along a direction of negative curvature",
    "almost_solved": "almost solved: the tolerances are met up to a factor of 100 only",
    "proved_infeasible": "proved infeasible: no point meets the constraints",
    "no_feasible_point": "no feasible point found; infeasibility is not proved",
    "proved_unbounded": "proved unbounded: the objective falls without end",
    "stopped_feasible": "stopped at a feasible point; {bound}",
    "stopped_infeasible": "stopped before a feasible point was found",
    "failed": "failed: no acceptable step was found",
}
"""The kinds of solutions in a line, with numbers and parts in braces."""
KIND_ADVICE: Final = {
    "proved_optimal": "",
    "optimal": "",
    "local_minimum": "{condition}{starts}{proof}",
    "stationary_point": "{budget}{starts}{proof}",
    "saddle_point":
        "Raise max_local_search_factorizations or time_limit_s: the descent from the saddle point was cut short.",
    "almost_solved": "{status}",
    "proved_infeasible": "{status}",
    "no_feasible_point": "{status}",
    "proved_unbounded": "{status}",
    "stopped_feasible": "{status}",
    "stopped_infeasible": "{status}",
    "failed": "{status}",
}
"""What to try after a solution of each kind."""
PHRASES: Final = {
    "within": " to within {distance}",
    "bounded": "at most {distance} from the optimum",
    "not_bounded": "no bound is known",
    "optimum_if_convex": "the optimum where Q is convex",
    "another_branch": "the objective falls along another branch",
    "next_branch": "a better branch may lie next to it",
    "curvature": "its curvature was not decided",
    "if_not_convex": "Where Q is not convex: ",
    "budget_spent":
        "The search for better branches has spent max_local_search_factorizations: a larger one lets it go on. ",
    "first_starts": "num_starts=8 searches 8 times, for about 8 times the work (this solve: {factorizations}).",
    "more_starts":
        "num_starts={more} searches twice as often, for about twice the work (this solve: {factorizations}).",
    "try_global":
        " global_search=true searches the branches of the {pairs} for the best one and proves it; that may take much "
        "longer, and time_limit_s ends it with a bound.",
    "proof_ended": " The proof did not come to its end: detail says why.",
}
"""Parts of these texts."""


class Status(enum.Enum):
    """Why a solve ended. Every status comes with the best iterate and its violations.

    SOLVED: All tolerances are met.
    ALMOST_SOLVED: Feasible to 100 times the tolerances, but no further progress was possible.
    ITERATION_LIMIT: max_iterations was reached, or with option global_search node_limit; this is the best iterate.
    TIME_LIMIT: time_limit_s was reached; this is the best iterate.
    CANCELLED: The solve was cancelled by its client, by a cancel call or by a server that shuts down; this is the
    best iterate.
    INFEASIBLE: No point meets the constraints. The certificate proves it even without complementarity; if it is
    empty, every branch of the pairs was refuted.
    LOCALLY_INFEASIBLE: The search ended at a point where the violation cannot be lowered any further; no feasible
    point is near. One may exist elsewhere.
    UNBOUNDED: The objective falls without end along a feasible direction, which is the certificate.
    NUMERICAL_FAILURE: No acceptable step was found within the bounded number of tries.
    """

    SOLVED = "solved"
    ALMOST_SOLVED = "almost_solved"
    ITERATION_LIMIT = "iteration_limit"
    TIME_LIMIT = "time_limit"
    CANCELLED = "cancelled"
    INFEASIBLE = "infeasible"
    LOCALLY_INFEASIBLE = "locally_infeasible"
    UNBOUNDED = "unbounded"
    NUMERICAL_FAILURE = "numerical_failure"

    @property
    def solved(self) -> bool:
        """Whether the point may be used as a solution: to the tolerances, or to 100 × the tolerances."""
        return self in (Status.SOLVED, Status.ALMOST_SOLVED)

    @property
    def advice(self) -> str:
        """What to try; empty for SOLVED."""
        return _ADVICE.get(self.value, "")


class SolutionKind(enum.Enum):
    """The kind of a solution.

    PROVED_OPTIMAL: No feasible point is better by more than relative_gap_tolerance.
    OPTIMAL: The optimum of a problem without pairs whose Q is known to be convex, within the tolerances.
    LOCAL_MINIMUM: No point nearby is better. A point on another branch may be better; gap, where it is known,
    bounds by how much.
    STATIONARY_POINT: The solver did not decide whether it is a local minimum: the budget of the search was spent,
    or Q is not convex.
    SADDLE_POINT: The objective falls along a direction of negative curvature, and the descent was cut short.
    ALMOST_SOLVED: The tolerances are met only up to a factor of 100.
    PROVED_INFEASIBLE: No point meets the constraints.
    NO_FEASIBLE_POINT: No feasible point was found. One may exist.
    PROVED_UNBOUNDED: The objective falls without end.
    STOPPED_FEASIBLE: A limit or a cancellation ended the solve at a point that meets the tolerances.
    STOPPED_INFEASIBLE: A limit or a cancellation ended the solve before a point that meets the tolerances was
    found.
    FAILED: No acceptable step was found.
    """

    PROVED_OPTIMAL = "proved_optimal"
    OPTIMAL = "optimal"
    LOCAL_MINIMUM = "local_minimum"
    STATIONARY_POINT = "stationary_point"
    SADDLE_POINT = "saddle_point"
    ALMOST_SOLVED = "almost_solved"
    PROVED_INFEASIBLE = "proved_infeasible"
    NO_FEASIBLE_POINT = "no_feasible_point"
    PROVED_UNBOUNDED = "proved_unbounded"
    STOPPED_FEASIBLE = "stopped_feasible"
    STOPPED_INFEASIBLE = "stopped_infeasible"
    FAILED = "failed"
