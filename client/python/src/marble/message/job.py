"""Jobs as the server reports them."""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from marble.base.fields import named
from marble.base.tables import Status
from marble.model.conflict import Conflict, Indices
from marble.model.lcqp import Vector
from marble.model.scenarios import SampleAverageStage
from marble.model.solution import Progress, Times, Violations


class Priority(enum.Enum):
    """The order of jobs when workers are busy: a higher one goes first, none starves."""

    REALTIME = "realtime"
    INTERACTIVE = "interactive"
    BATCH = "batch"


class JobKind(enum.Enum):
    """The call that made a job. A SUBMITTED one and an ARRAY outlive their calls, the others end with theirs."""

    SOLVE = "solve"
    BATCH = "batch"
    SUBMITTED = "submitted"
    SESSION = "session"
    SCENARIOS = "scenarios"
    COUPLED = "coupled"
    ARRAY = "array"


class JobState(enum.Enum):
    """The state of a job. IDLE is a session between updates."""

    QUEUED = "queued"
    RUNNING = "running"
    IDLE = "idle"
    FINISHED = "finished"


@dataclass(frozen=True)
class ArrayProgress:
    """The progress of an array. done: elements that have ended, of which some are solved, and some failed."""

    elements: int
    done: int
    solved: int
    failed: int


@dataclass(frozen=True, eq=False, kw_only=True)
class Job:
    """One job, without its problem and its solution's vectors.

    variables, equalities, inequalities, pairs: sizes of its problem. accepted_unix_s, finished_unix_s: seconds since
    1970, UTC; 0 while it has not finished. queue_position, estimated_wait_s: only while queued. status: how the solve
    ended, None while it has not, or where error (a google.rpc.Status) says why there is no solution. updates: of a
    session, with a result. memory_bytes: of the solver. result_bytes: of the stored result. trace_id: of the W3C
    traceparent of the request. server: of servers that share a store, the one that runs it or ran it last; of submitted
    jobs, empty before one has. stages: of a scenario solve, so far. activity: what it is doing, in words, while it
    runs; else empty. array: the progress of an array.
    proved, incumbent, bound, gap, nodes, open_nodes: of option global_search, as in Solution and Progress, so far.
    """

    job_id: str
    kind: JobKind
    state: JobState
    priority: Priority
    client: str
    request_id: str
    problem_name: str
    variables: int
    equalities: int
    inequalities: int
    pairs: int
    accepted_unix_s: float
    finished_unix_s: float
    queue_position: int
    estimated_wait_s: float
    status: Status | None
    error: Any
    detail: str
    iterations: int
    factorizations: int
    objective: float
    violations: Violations
    proved: bool
    incumbent: float = math.inf
    bound: float = -math.inf
    gap: float = math.inf
    nodes: int
    open_nodes: int
    times: Times
    updates: int
    memory_bytes: int
    result_bytes: int
    trace_id: str
    server: str
    stages: tuple[SampleAverageStage, ...] = field(default=(), metadata=named("sample_average_stages"))
    activity: str = field(default="", metadata=named("activity.text"))
    array: ArrayProgress | None = None

    @property
    def sizes(self) -> tuple[int, int, int, int]:
        """Variables, equalities, inequalities, pairs."""
        return self.variables, self.equalities, self.inequalities, self.pairs


@dataclass(frozen=True, eq=False)
class JobPage:
    """Jobs, newest first, and whether there are more: continue with `before`."""

    jobs: list[Job]
    more: bool


@dataclass(frozen=True, eq=False)
class PairSides:
    """Both sides of all pairs at one iteration, n_c entries each."""

    iteration: int
    kappa: float
    s: Vector
    t: Vector


@dataclass(frozen=True, eq=False)
class Trace:
    """The iterations of a job, oldest first; of a long one every stride-th and the newest."""

    rows: list[Progress]
    stride: int
    pairs: list[PairSides]

    def __post_init__(self) -> None:
        object.__setattr__(self, "stride", max(1, self.stride))  # 0 in the message of a job that has not begun


@dataclass(frozen=True, eq=False)
class Infeasibility:
    """Why the problem of a job is infeasible, of bounded length; the job's Solution has all of it.

    conflict: of option explain, as Solution.conflict, with its first 100 parts in the order of its attributes; else
    None. more_parts: how many further ones there are. rows: the indices in Solution.certificate of its largest
    multipliers, at most 8, largest first; empty without a certificate. multipliers: of these rows. more_rows: how many
    further rows have a multiplier of more than a thousandth of the largest.
    """

    conflict: Conflict | None
    more_parts: int
    rows: Indices
    multipliers: Vector
    more_rows: int


@dataclass(frozen=True, eq=False)
class JobDetails:
    """A job, its options in force, and its convergence.

    infeasibility: why its problem is infeasible, also if the server does not keep the solution; None for any other
    status. Of a session, for its newest solve.
    """

    job: Job
    options: Mapping[str, Any]
    trace: Trace
    infeasibility: Infeasibility | None = None


@dataclass(frozen=True, eq=False)
class JobEvent:
    """A job as it is now, and its progress since its last event.

    trace: in the first event of one watched job, its progress until now. skipped: events that this reader was too slow
    for.
    """

    job: Job
    rows: list[Progress]
    trace: Trace | None
    skipped: int


@dataclass(frozen=True)
class SubmittedArray:
    """An accepted array: its id, and how many elements it has."""

    job_id: str
    elements: int


@dataclass(frozen=True)
class Submitted:
    """An accepted job: its id, its place in the queue, and the seconds it is likely to wait."""

    job_id: str
    queue_position: int
    estimated_wait_s: float
