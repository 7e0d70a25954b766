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
MOST_LEVELS: Final = 128
MOST_ROWS: Final = 268435455
SYMMETRY: Final = 1e-12
_ADVICE: Final = {
    "solved_reduced":
        "Use it if that is enough. Otherwise find the largest violation, and scale its rows or loosen its tolerance.",
    "iteration_limit":
        "If the convergence curves still fall, raise max_iterations. If they are flat, another start (x0, or starts "
        "above 1) helps more than further iterations. If nodes are open, raise node_limit.",
    "time_limit":
        "Check which part took the time. Then raise time_limit_s, lower local_search_budget, or use warm starts in a "
        "session.",
    "cancelled":
        "Send the request again if the cancellation was not intended.",
    "infeasible":
        "The problem contradicts itself: check the signs and offsets of A, b, C, d, l and r. Option explain=true, or "
        "the command marble explain, returns a smallest set of conflicting rows and pairs.",
    "locally_infeasible":
        "If detail names ill-conditioned rows, remove one of them. Otherwise raise feasibility_budget, or start "
        "elsewhere (x0). If it happens from every start, check the data of the largest violation.",
    "unbounded":
        "A bound or a cost is missing: the nonzero entries of that direction show the variables.",
    "numerical_failure":
        "The cause is usually bad scaling: bring the data nearer to 1, avoid nearly equal rows, keep scaling_passes "
        "above 0, or try path = paper.",
}


class Status(enum.Enum):
    """Why a solve ended. Every status comes with the best iterate and its violations.

    SOLVED: All tolerances are met.
    SOLVED_REDUCED: Feasible to 100 times the tolerances, but no further progress was possible.
    ITERATION_LIMIT: max_iterations was reached, or with option global node_limit; this is the best iterate.
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
    SOLVED_REDUCED = "solved_reduced"
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
        return self in (Status.SOLVED, Status.SOLVED_REDUCED)

    @property
    def advice(self) -> str:
        """What to try; empty for SOLVED."""
        return _ADVICE.get(self.value, "")
