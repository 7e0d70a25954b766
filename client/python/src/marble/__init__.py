"""Client of Marble Server, a solver service for quadratic programs with linear complementarity constraints.

    min ½ zᵀQz + gᵀz + c0   s.t.   A z + b = 0,   C z + d ≥ 0,   0 ≤ L z + l ⊥ R z + r ≥ 0

`solve` takes matrices, dense or scipy.sparse; `Problem` builds a problem of two-sided rows, bounds and pairs; `Client`
keeps a connection, with sessions, batches and jobs; `marble.aio` has the same for asyncio. The server is the one that
MARBLE_SERVER names, else 127.0.0.1:50051, if nothing else is said; "local" is one of this process alone.
"""

import pathlib

from marble import aio
from marble.base.tables import Status
from marble.calls.batch import BatchAnswer, BatchItem
from marble.calls.jobs import Jobs
from marble.calls.session import Session
from marble.calls.session_core import SessionEvent, Shift, ShiftBlock, Superseded
from marble.client import Client, SolveHandle, solve
from marble.connection.connect import ConnectOptions
from marble.errors import (
    Aborted,
    Cancelled,
    DeadlineExceeded,
    Error,
    FailedPrecondition,
    InvalidArgument,
    InvalidProblem,
    NotFound,
    PermissionDenied,
    Refused,
    ServerError,
    Unauthenticated,
    Unavailable,
    Unsolved,
)
from marble.message.info import Option, ServerInfo
from marble.message.job import (
    Job,
    JobDetails,
    JobEvent,
    JobKind,
    JobPage,
    JobState,
    PairSides,
    Priority,
    Submitted,
    Trace,
)
from marble.model.lcqp import LCQP
from marble.model.problem import Problem
from marble.model.solution import Progress, SecondOrder, Solution, Stationarity, Times, Violations

__version__ = pathlib.Path(__file__).with_name("VERSION").read_text(encoding="utf-8").strip()

__all__ = [
    "LCQP",
    "Aborted",
    "BatchAnswer",
    "BatchItem",
    "Cancelled",
    "Client",
    "ConnectOptions",
    "DeadlineExceeded",
    "Error",
    "FailedPrecondition",
    "InvalidArgument",
    "InvalidProblem",
    "Job",
    "JobDetails",
    "JobEvent",
    "JobKind",
    "JobPage",
    "JobState",
    "Jobs",
    "NotFound",
    "Option",
    "PairSides",
    "PermissionDenied",
    "Priority",
    "Problem",
    "Progress",
    "Refused",
    "ServerError",
    "ServerInfo",
    "Session",
    "SessionEvent",
    "Shift",
    "ShiftBlock",
    "Solution",
    "SolveHandle",
    "SecondOrder",
    "Stationarity",
    "Status",
    "Submitted",
    "Superseded",
    "Times",
    "Trace",
    "Unauthenticated",
    "Unavailable",
    "Unsolved",
    "Violations",
    "aio",
    "solve",
]
