"""Marble, a solver of quadratic programs with linear complementarity constraints: here, or on a Marble server.

    min ½ zᵀQz + gᵀz + c0   s.t.   A z + b = 0,   C z + d ≥ 0,   0 ≤ L z + l ⊥ R z + r ≥ 0

`solve` takes matrices, dense or scipy.sparse; `Problem` builds a problem of two-sided rows, bounds and pairs; `Client`
keeps a connection, with sessions, batches and jobs; `marble.aio` has the same for asyncio. MARBLE_SERVER names the
server if nothing else is said. Where it names none, `solve` stays in this process and a `Client` asks 127.0.0.1:50051;
the address "local" is no server for both.
"""

import importlib
import pathlib
from typing import TYPE_CHECKING, Any

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

if TYPE_CHECKING:
    from marble import aio


def _version() -> str:
    file = pathlib.Path(__file__).with_name("VERSION")
    try:
        return file.read_text(encoding="utf-8").strip()
    except FileNotFoundError:
        raise ImportError(f"{file} is missing: build or install marble-solver, do not import its sources") from None


def __getattr__(name: str) -> Any:
    if name == "aio":  # asyncio takes long to load
        return importlib.import_module("marble.aio")
    raise AttributeError(f"module 'marble' has no attribute {name!r}")


__version__ = _version()

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
