"""All that the package offers by its name: loaded when something of it is wanted."""

from marble.base.tables import Status
from marble.calls.array import ArrayAnswer, ArrayItem
from marble.calls.batch import BatchAnswer, BatchItem
from marble.calls.batch_solver import BatchResult, BatchSolver
from marble.calls.jobs import Jobs
from marble.calls.sensitivity import Sensitivity
from marble.calls.session import Session
from marble.calls.session_core import SessionEvent, Superseded
from marble.calls.shift import Shift, ShiftBlock
from marble.client import Client, SolveHandle, solve
from marble.connection.connect import ConnectOptions
from marble.errors import (
    Aborted,
    AlmostSolved,
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
    ArrayProgress,
    Infeasibility,
    Job,
    JobDetails,
    JobEvent,
    JobKind,
    JobPage,
    JobState,
    PairSides,
    Priority,
    Submitted,
    SubmittedArray,
    Trace,
)
from marble.model.conflict import Conflict
from marble.model.coupled import Coordination, CoupledSolution, SegmentsSolution
from marble.model.derivatives import AnswerChange, RowResponse, SensitivityAnswer, SensitivityRequest
from marble.model.lcqp import LCQP
from marble.model.problem import Problem
from marble.model.scenarios import (
    OutOfSample,
    Quantity,
    SampleAverageStage,
    ScenarioEnd,
    Scenarios,
    ScenarioSolution,
)
from marble.model.solution import PointOrigin, Progress, SecondOrder, Solution, Stationarity, Times, Violations
from marble.model.solution_kind import SolutionKind

__all__ = [
    "LCQP",
    "Aborted",
    "AlmostSolved",
    "AnswerChange",
    "ArrayAnswer",
    "ArrayItem",
    "ArrayProgress",
    "BatchAnswer",
    "BatchItem",
    "BatchResult",
    "BatchSolver",
    "Cancelled",
    "Client",
    "Conflict",
    "ConnectOptions",
    "Coordination",
    "CoupledSolution",
    "DeadlineExceeded",
    "Error",
    "FailedPrecondition",
    "Infeasibility",
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
    "OutOfSample",
    "PairSides",
    "PermissionDenied",
    "SegmentsSolution",
    "PointOrigin",
    "Priority",
    "Problem",
    "Progress",
    "Quantity",
    "Refused",
    "RowResponse",
    "ScenarioSolution",
    "ScenarioEnd",
    "SampleAverageStage",
    "Scenarios",
    "Sensitivity",
    "SensitivityAnswer",
    "SensitivityRequest",
    "ServerError",
    "ServerInfo",
    "Session",
    "SessionEvent",
    "Shift",
    "ShiftBlock",
    "Solution",
    "SolutionKind",
    "SolveHandle",
    "SecondOrder",
    "Stationarity",
    "Status",
    "Submitted",
    "SubmittedArray",
    "Superseded",
    "Times",
    "Trace",
    "Unauthenticated",
    "Unavailable",
    "Unsolved",
    "Violations",
    "solve",
]
