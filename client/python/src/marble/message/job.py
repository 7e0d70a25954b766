"""Jobs as the server tells of them."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from marble.base.tables import Status
from marble.model.lcqp import Vector
from marble.model.scenarios import ScenarioLevel
from marble.model.solution import Progress, Times, Violations


class Priority(enum.Enum):
    """Whose turn it is when workers are busy; a higher one goes first, none starves."""

    REALTIME = "realtime"
    INTERACTIVE = "interactive"
    BATCH = "batch"


class JobKind(enum.Enum):
    """What a job came by. A SUBMITTED one and an ARRAY outlive their calls, the others are gone with theirs."""

    SOLVE = "solve"
    BATCH = "batch"
    SUBMITTED = "submitted"
    SESSION = "session"
    SCENARIOS = "scenarios"
    COUPLED = "coupled"
    ARRAY = "array"


class JobState(enum.Enum):
    """Where a job is in its life. IDLE is a session between updates."""

    QUEUED = "queued"
    RUNNING = "running"
    IDLE = "idle"
    FINISHED = "finished"


@dataclass(frozen=True)
class ArrayProgress:
    """How far an array is. done: elements that have ended; of these some are solved, and some failed with an error."""

    elements: int
    done: int
    solved: int
    failed: int


@dataclass(frozen=True, eq=False)
class Job:
    """What is known of one job, without its problem and its solution's vectors.

    sizes: variables, equalities, inequalities, pairs. accepted_unix_s, finished_unix_s: seconds since 1970, UTC; 0
    while it has not finished. queue_position, estimated_wait_s: only while queued. status: how the solve ended, None
    while it has not, or where error (a google.rpc.Status) says why there is no answer. updates: a session's, answered.
    memory_bytes: of the solver. result_bytes: of the answer that is kept. trace_id: of the W3C traceparent that came.
    server: of servers that share a store, the one that runs it or ran it last; of submitted jobs, empty before one has.
    levels: of a scenario solve, so far. activity: what it is doing, in words, while it runs; else empty. array: how far
    an array is.
    proved, incumbent, bound, gap, nodes, open_nodes: of option global, as in Solution and Progress, so far.
    """

    job_id: str
    kind: JobKind
    state: JobState
    priority: Priority
    client: str
    request_id: str
    problem_name: str
    sizes: tuple[int, int, int, int]
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
    incumbent: float
    bound: float
    gap: float
    nodes: int
    open_nodes: int
    times: Times
    updates: int
    memory_bytes: int
    result_bytes: int
    trace_id: str
    server: str
    levels: tuple[ScenarioLevel, ...] = ()
    activity: str = ""
    array: ArrayProgress | None = None


@dataclass(frozen=True, eq=False)
class JobPage:
    """Jobs, newest first, and whether there are more: go on with `before`."""

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
    """What a job did, oldest first; of a long one every stride-th iteration and the newest."""

    rows: list[Progress]
    stride: int
    pairs: list[PairSides]


@dataclass(frozen=True, eq=False)
class JobDetails:
    """A job, its options in force, and its convergence."""

    job: Job
    options: Mapping[str, Any]
    trace: Trace


@dataclass(frozen=True, eq=False)
class JobEvent:
    """A job as it is now, and its progress since it was last told of.

    trace: in the first event of one watched job, what it did until now. skipped: what this reader was too slow for.
    """

    job: Job
    rows: list[Progress]
    trace: Trace | None
    skipped: int


@dataclass(frozen=True)
class SubmittedArray:
    """An array was taken in: its id, and how many elements it has."""

    job_id: str
    elements: int


@dataclass(frozen=True)
class Submitted:
    """A job was taken in: its id, its place in the queue, and the seconds it is likely to wait."""

    job_id: str
    queue_position: int
    estimated_wait_s: float
