"""What a session knows, whoever moves its messages: numbers of updates, and the problem as each one left it."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from marble import errors
from marble.base import contract
from marble.base.checks import is_number
from marble.base.lazy import lazy
from marble.base.tables import VALUES, VECTORS
from marble.errors import Cancelled, FailedPrecondition, InvalidArgument, InvalidProblem
from marble.message import answers, requests, wire
from marble.message.wire import Encoder
from marble.model import lcqp
from marble.model.derivatives import SensitivityRequest
from marble.model.lcqp import LCQP, Vector
from marble.model.problem import Problem, compiled, in_terms_of
from marble.model.solution import Progress, Solution

sp: Any = lazy("scipy.sparse")

_SHIFTED: Final = ("variables", "equalities", "inequalities", "pairs")


@dataclass(frozen=True)
class ShiftBlock:
    """A stretch of a vector that moves on.

    Of `count` entries from `first`, each takes the value `by` further on, and the last `by` keep theirs.
    All are ≥ 0, and by ≤ count.
    """

    first: int
    count: int
    by: int


@dataclass(frozen=True)
class Shift:
    """A receding horizon's hint: how the last answer moves one stage on before it is started from.

    Blocks of z, of the multipliers of equalities and inequalities, and of both multipliers of the pairs. Those of a
    vector may move as many entries together as it has; one that moves none counts as one.
    """

    variables: Sequence[ShiftBlock] = ()
    equalities: Sequence[ShiftBlock] = ()
    inequalities: Sequence[ShiftBlock] = ()
    pairs: Sequence[ShiftBlock] = ()

    @staticmethod
    def by_stage(problem: LCQP | Problem, stages: int) -> Shift:
        """For a problem whose vectors all hold `stages` equal parts, one stage after the other.

        InvalidArgument of field "stages" unless it is ≥ 1 and divides the size of every vector.
        """
        if stages < 1 or stages % 1:
            raise InvalidArgument("stages", "must be a whole number >= 1", value=stages)
        blocks = []
        for name, size in zip(_SHIFTED, compiled(problem).sizes, strict=True):
            if size % stages:
                raise InvalidArgument("stages", f"must divide the number of {name}, {size}", value=stages)
            blocks.append((ShiftBlock(0, size, size // stages),) if size else ())
        return Shift(*blocks)

    def blocks(self) -> tuple[tuple[tuple[int, int, int], ...], ...]:
        """Of the four kinds of vectors: first, count and by of each block."""
        return tuple(tuple((b.first, b.count, b.by) for b in getattr(self, name)) for name in _SHIFTED)

    def message(self) -> Any:
        """The Shift of marble.v1."""
        kind, block = contract.message("Shift"), contract.message("ShiftBlock")
        return kind(**{name: [block(first=b.first, count=b.count, by=b.by) for b in getattr(self, name)]
                       for name in _SHIFTED})


@dataclass(frozen=True)
class Superseded:
    """The update was overtaken by a newer one, which took its numbers along (latest_only)."""

    by_sequence: int


@dataclass(frozen=True, eq=False)
class SessionEvent:
    """What came of one update: an answer, solved or not; or why there is none, after which the session goes on."""

    sequence: int
    outcome: Solution | Superseded | errors.Error


@dataclass
class _Update:
    """What an update changes, and the problem before and after it: as the solver has it, and as it was given."""

    changes: Mapping[str, Any]
    given: Problem | None
    before: tuple[LCQP, LCQP | Problem]
    told: bool = False
    first_part: bool = False  # of which nothing may ever be told

    @property
    def after(self) -> tuple[LCQP, LCQP | Problem]:
        current, given = self.before
        return current.replaced(**self.changes), given if self.given is None else self.given


class SessionCore:
    """The state of one session; does no input or output."""

    def __init__(self, problem: LCQP | Problem, tell: Callable[[int, Progress], object] | None) -> None:
        self.given: LCQP | Problem = problem.copy() if isinstance(problem, Problem) else problem
        self.current = compiled(problem)
        self._tell = tell
        self.sequence = 0
        self.job_id = ""
        self.memory_bytes = 0
        self.setup_s = self.idle_timeout_s = 0.0
        self.ended = False
        self._lock = threading.Lock()  # one thread sends, another one reads
        self._updates: dict[int, _Update] = {}  # in their order, from the first on that nothing was told of

    def set_up(self, call: requests.Call, latest_only: bool) -> bytes:
        """The first message."""
        requests.check_request_id(call.request_id)
        requests.check_progress(call)
        setup = Encoder("SessionSetup")
        setup.message("problem", requests.problem_encoder(self.current))
        if self.current.z0 is not None:
            setup.message("initial_point", requests.initial_point(self.current.z0))
        setup.others(contract.message("SessionSetup")(
            options=requests.options_message(call.options), request_id=call.request_id,
            priority=requests.priority_number(call.priority), latest_only=latest_only,
            progress=self._tell is not None, progress_interval_s=call.progress_interval,
            iterate_every=call.iterate_every))
        return _request("setup", setup)

    def update(self, problem: LCQP | Problem | None = None, *, options: Mapping[str, Any] | None = None,
               z0: ArrayLike | None = None, cold: bool = False, shift: Shift | int | None = None,
               deadline: float | None = None, first_part: bool = False,
               sensitivity: SensitivityRequest | None = None, **parts: Any) -> bytes:
        """The next update; self.sequence is its number then."""
        check_sensitivity_of_part(sensitivity, first_part)
        changes, shift = self.prepared(problem, parts, shift, deadline)
        message = contract.message("SessionUpdate")(
            sequence=self.sequence + 1, cold=cold, deadline_s=deadline or 0.0,
            options=requests.options_message(options), shift=None if shift is None else shift.message(),
            prepare=first_part)
        update = Encoder("SessionUpdate")
        update.others(message)
        update.message("problem", _changed(changes))
        if z0 is not None:
            update.message("initial_point", requests.initial_point(lcqp.vector(z0, "z0", self.current.n, " (n)")))
        if sensitivity is not None:
            update.message("sensitivity", requests.sensitivity_encoder(sensitivity, self.current))
        data = _request("update", update)
        # Nothing is remembered of an update that could not be made.
        self.remember(problem, changes, first_part)
        return data

    def prepared(self, problem: LCQP | Problem | None, parts: Mapping[str, Any], shift: Shift | int | None,
                 deadline: float | None) -> tuple[dict[str, Any], Shift | None]:
        """What an update changes, by the letters of the equation, and its shift; checked, and not yet remembered."""
        if self.ended:
            raise FailedPrecondition("the session has ended")
        if deadline is not None and not (is_number(deadline) and math.isfinite(deadline) and deadline > 0):
            raise InvalidArgument("deadline", "must be finite and > 0 seconds", value=deadline)
        if not isinstance(shift, int | Shift | None):
            raise InvalidArgument("shift", "must be a Shift or a number of stages", value=type(shift).__name__)
        changes = self._changes(problem, parts)
        return changes, Shift.by_stage(self.current, shift) if isinstance(shift, int) else shift

    def remember(self, problem: LCQP | Problem | None, changes: Mapping[str, Any], first_part: bool = False) -> None:
        """Takes an update that was prepared, under the next number."""
        given = problem.copy() if isinstance(problem, Problem) else None
        with self._lock:
            self.sequence += 1
            update = _Update(changes, given, (self.current, self.given), first_part=first_part)
            self._updates[self.sequence] = update
            self.current, self.given = update.after

    def settle(self, sequence: int, kept: bool) -> tuple[LCQP, LCQP | Problem]:
        """The problem that an update asked for, and in whose terms; what came of it is known now.

        kept: whether the solver has its numbers; if not, those after it stand on what was before it.
        """
        with self._lock:
            update = self._updates[sequence]
            current, given = update.after
            update.told = True
            if not kept:
                del self._updates[sequence]
                self.current, self.given = update.before
                for number, later in self._updates.items():
                    if number > sequence:
                        later.before = self.current, self.given
                        self.current, self.given = later.after
            while self._updates:
                number, first = next(iter(self._updates.items()))
                if not first.told and not (first.first_part and number < sequence):
                    break
                del self._updates[number]
        return current, given if isinstance(given, Problem) else current

    def _changes(self, problem: LCQP | Problem | None, parts: Mapping[str, Any]) -> dict[str, Any]:
        now = self.current
        if problem is not None:
            other = compiled(problem)
            if other.sizes != now.sizes:
                raise InvalidProblem("problem", f"must have the sizes {now.sizes} of the set-up", value=other.sizes)
            whole = {"c0": other.c0, **{name: getattr(other, name) for name in VECTORS},
                     **{name: _same_pattern(getattr(other, name), getattr(now, name), name) for name in VALUES}}
            return {name: value for name, value in whole.items() if not _equal(value, getattr(now, name))}
        changes: dict[str, Any] = {}
        for name, value in parts.items():
            if name not in ("c0", *VECTORS, *VALUES):
                raise TypeError(f"an update has no argument {name!r}")
            if value is None:
                continue
            if name == "c0":
                changes[name] = float(lcqp.vector(value, name, 1)[0])
            elif name in VECTORS:
                changes[name] = lcqp.vector(value, name, getattr(now, name).size, ", as at the set-up")
            else:
                changes[name] = _with_pattern(value, getattr(now, name), name)
        return changes

    def take(self, data: bytes) -> tuple[bool, SessionEvent | None]:
        """Whether a reader has what it waits for, and the outcome of an update if that is what it is.

        Progress is told, and waited beyond; with the word that all is set up there is no outcome.
        """
        message, arrays = wire.decode("SessionResponse", data)
        kind = message.WhichOneof("event")
        if kind == "ready":
            self._ready(message.ready)
            return True, None
        if kind == "progress":
            if self._tell is not None:
                for row in message.progress.progress.rows:
                    self._tell(message.progress.sequence, answers.progress(row))
            return False, None
        body = getattr(message, kind)
        with self._lock:
            update = self._updates.get(body.sequence)
            first_part = update is not None and update.first_part
        if first_part and kind != "error":
            return False, None  # an older server has solved it
        error = errors.from_status(body.status) if kind == "error" else None
        problem, given = self.settle(body.sequence, kept=not isinstance(error, InvalidArgument))
        outcome: Solution | Superseded | errors.Error
        if kind == "answer":
            outcome = answers.solution(body.solution, arrays, "answer.solution.", problem, self.job_id)
            outcome = in_terms_of(given, outcome)
        else:
            outcome = error or Superseded(body.by_sequence)
        return True, SessionEvent(body.sequence, outcome)

    def _ready(self, message: Any) -> None:
        self.job_id = message.job_id
        self.memory_bytes = message.memory_bytes
        self.setup_s = message.setup_s
        self.idle_timeout_s = message.idle_timeout_s


def check_sensitivity_of_part(sensitivity: object, first_part: bool) -> None:
    """Derivatives are of an answer, which a first part has none of."""
    requests.check_sensitivity(sensitivity)
    if first_part and sensitivity is not None:
        raise InvalidArgument("sensitivity", "must come with the second part of an update")


def first_refused(unread: dict[int, SessionEvent], first_parts: list[int], sequence: int) -> SessionEvent | None:
    """The error of a first part before this update, which is then its own. Forgets the parts before it."""
    refused = [unread.pop(number) for number in first_parts if number < sequence and number in unread]
    first_parts[:] = [number for number in first_parts if number > sequence]
    return refused[0] if refused else None


def answer_of(event: SessionEvent) -> Solution:
    """The answer of an update; raises the error if there is none."""
    if isinstance(event.outcome, Superseded):
        raise Cancelled(f"update {event.sequence} was superseded by update {event.outcome.by_sequence}")
    if isinstance(event.outcome, errors.Error):
        raise event.outcome
    return event.outcome


class SessionFacts:
    """What both kinds of session tell of themselves."""

    _core: SessionCore

    @property
    def job_id(self) -> str:
        """The server's id of the session, one job for all its solves."""
        return self._core.job_id

    @property
    def memory_bytes(self) -> int:
        """Memory of the session on the server, as it is counted against the limits."""
        return self._core.memory_bytes

    @property
    def setup_s(self) -> float:
        """Seconds that scaling, ordering, analysis and allocation took."""
        return self._core.setup_s

    @property
    def idle_timeout_s(self) -> float:
        """Seconds without an update after which the server ends the session."""
        return self._core.idle_timeout_s

    @property
    def problem(self) -> LCQP:
        """The problem as the updates so far left it."""
        return self._core.current


def _request(field: str, part: Encoder) -> bytes:
    request = Encoder("SessionRequest")
    request.message(field, part)
    return request.finish()


def _changed(changes: Mapping[str, Any]) -> Encoder:
    part = Encoder("ProblemUpdate")
    if "c0" in changes:
        part.others(contract.message("ProblemUpdate")(constant=changes["c0"]))
    for name, value in changes.items():
        if name in VECTORS:
            part.doubles(VECTORS[name], value)
        elif name in VALUES:
            part.doubles(VALUES[name], value.data)
    return part


def _equal(value: Any, old: Any) -> bool:
    if value is old:
        return True
    if isinstance(value, float):
        return value == float(old)
    return np.array_equal(getattr(value, "data", value), getattr(old, "data", old))


def _with_pattern(value: Any, old: Any, name: str) -> Any:
    """A matrix as it may be given, or its values alone in the order of the set-up, as a matrix like `old`."""
    if not sp.issparse(value) and np.ndim(value) == 1 and np.size(value) == old.nnz and old.shape[0] != 1:
        data: Vector = lcqp.vector(value, name + ".values")
        return sp.csc_matrix((data, old.indices, old.indptr), shape=old.shape)
    rows, n = old.shape
    new = lcqp.upper_triangle(value, n) if name == "Q" else lcqp.matrix(value, name, n, rows)
    return _same_pattern(new, old, name)


def _same_pattern(new: Any, old: Any, name: str) -> Any:
    if new.indptr is old.indptr and new.indices is old.indices:
        return new
    if new.nnz == old.nnz and np.array_equal(new.indptr, old.indptr) and np.array_equal(new.indices, old.indices):
        return new
    rows = np.int64(old.shape[0])
    old_keys = _columns(old) * rows + old.indices  # ascending, as entries are sorted
    new_keys = _columns(new) * rows + new.indices
    places = np.searchsorted(old_keys, new_keys)
    known = places < old_keys.size
    known[known] = old_keys[places[known]] == new_keys[known]
    outside = np.flatnonzero(~known & (new.data != 0.0))
    if outside.size:
        entry = int(outside[0])
        raise InvalidProblem(name, "must be zero, as at the set-up: a session's pattern stays",
                             index=lcqp.position(new, entry), value=new.data[entry])
    data = np.zeros(old.nnz)
    data[places[known]] = new.data[known]
    return sp.csc_matrix((data, old.indices, old.indptr), shape=old.shape)


def _columns(values: Any) -> Any:
    return np.repeat(np.arange(values.shape[1], dtype=np.int64), np.diff(values.indptr))
