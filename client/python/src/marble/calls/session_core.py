"""The state of a session, independent of its transport: numbers of updates, and the problem after each one."""

from __future__ import annotations

import dataclasses
import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from numpy.typing import ArrayLike

from marble import errors
from marble.base import contract
from marble.base.checks import is_number
from marble.base.log import logger
from marble.base.tables import VALUES, VECTORS, Status
from marble.calls.changes import changes_of, update_encoder
from marble.calls.shift import Shift
from marble.errors import Cancelled, DeadlineExceeded, FailedPrecondition, InvalidArgument, Unavailable
from marble.message import answers, requests, wire
from marble.message.wire import Encoder
from marble.model import lcqp
from marble.model.derivatives import SensitivityRequest
from marble.model.lcqp import LCQP, Vector
from marble.model.problem import Problem, compiled, in_terms_of
from marble.model.solution import Progress, Solution

_PARTS: Final = ("c0", *VECTORS, *VALUES)
_FIXED: Final = "scaling_passes"  # an option that updates may not change
_MOST_MISSES: Final = 20  # updates in a row that a server may leave unanswered beyond their deadlines
_STARTS: Final = (Status.SOLVED, Status.ALMOST_SOLVED, Status.TIME_LIMIT)  # of answers that the next solve starts from


class Late(Exception):
    """What a session waits for has not come in time; it may come later."""


@dataclass(frozen=True)
class Superseded:
    """The update was replaced by a newer one, which includes its numbers (latest_only)."""

    by_sequence: int


@dataclass(frozen=True, eq=False)
class SessionEvent:
    """The result of one update: a solution, solved or not; or why there is none, after which the session continues."""

    sequence: int
    outcome: Solution | Superseded | errors.Error


@dataclass(frozen=True)
class _Controls:
    """What accompanies an update's numbers."""

    options: Mapping[str, Any] | None = None
    z0: Vector | None = None
    cold: bool = False
    shift: Shift | None = None
    deadline: float | None = None
    sensitivity: SensitivityRequest | None = None

    def moved(self, z: Vector | None) -> Vector | None:
        """Where a solve starts that would start at z without these; None is the solver's own choice."""
        if self.cold or self.z0 is not None or z is None:
            return self.z0
        return z if self.shift is None else self.shift.moved(z)


@dataclass(frozen=True)
class _State:
    """The state of a session: the problem as the solver has it, and as it was given; all options; the last z0."""

    current: LCQP
    given: LCQP | Problem
    options: Mapping[str, Any]
    z0: Vector | None


@dataclass
class _Update:
    """What an update changes, and the state before and after it."""

    changes: Mapping[str, Any]
    given: Problem | None
    controls: _Controls
    before: _State
    has_result: bool = False
    first_part: bool = False  # the preparation phase, which may never have a result
    given_up: bool = False  # no one waits for its result

    @property
    def after(self) -> _State:
        before, controls = self.before, self.controls
        return _State(before.current.replaced(**self.changes), before.given if self.given is None else self.given,
                      {**before.options, **(controls.options or {})}, before.z0 if controls.z0 is None else controls.z0)


class SessionCore:
    """The state of one session; does no input or output.

    reopen: whether it is set up again if its server is lost. Each set-up has an epoch of its own. Updates without a
    result are sent again after the next set-up, which has the numbers from before them.
    """

    def __init__(self, problem: LCQP | Problem, report: Callable[[int, Progress], object] | None,
                 reopen: bool = False) -> None:
        given: LCQP | Problem = problem.copy() if isinstance(problem, Problem) else problem
        lcqp_now = compiled(problem)
        self._state = _State(lcqp_now, given, {}, lcqp_now.z0)
        self._report = report
        self.sequence = 0
        self.job_id = ""
        self.memory_bytes = 0
        self.setup_s = self.idle_timeout_s = 0.0
        self.ended = False
        self.reopen = reopen
        self.reopened = 0
        self._epoch, self._server_epoch = -1, 0
        self._is_reopened = False  # and no solution has reported it
        self._lock = threading.Lock()  # one thread sends, another one reads
        self._updates: dict[int, _Update] = {}  # in their order, from the first one without a result
        self._newest: Vector | None = None  # z of the last solution, shifted by the updates that were given up
        self._start: Vector | None = None  # where the first solve of a reopened session starts
        self._leads = False  # whether no solve was requested since it was reopened
        self._call = requests.Call()
        self._latest_only = False
        self.misses = 0  # updates in a row that were not answered in time
        self.is_last_missed = False  # whether the last update was not, even if it waited for another one
        self.gone: Unavailable | None = None  # what ended the last stream, until the session is set up again

    @property
    def current(self) -> LCQP:
        """The problem as the solver has it."""
        return self._state.current

    @property
    def given(self) -> LCQP | Problem:
        """The same as it was given."""
        return self._state.given

    def set_up(self, call: requests.Call, latest_only: bool) -> bytes:
        """The first message of the first stream."""
        requests.check_request_id(call.request_id)
        requests.check_session(call)
        self._call, self._latest_only = call, latest_only
        return self.set_up_again()

    def set_up_again(self) -> bytes:
        """The first message of another stream: the session as it was before the updates without a result."""
        self._leave_given_up()
        with self._lock:
            waiting = next((update for update in self._updates.values() if not update.has_result), None)
            state = self._state if waiting is None else waiting.before
            self._epoch += 1
        call = self._call
        options = {**(call.options or {}),
                   **{name: value for name, value in state.options.items() if name != _FIXED}}
        setup = Encoder("SessionSetup")
        setup.message("problem", requests.problem_encoder(state.current))
        if state.z0 is not None:
            setup.message("initial_point", requests.initial_point(state.z0))
        setup.others(contract.message("SessionSetup")(
            options=requests.options_message(options), request_id=call.request_id,
            priority=requests.priority_number(call.priority), latest_only=self._latest_only,
            progress=self._report is not None, progress_interval_s=call.progress_interval,
            iterate_every=call.iterate_every, epoch=self._epoch))
        return _request("setup", setup)

    def again(self) -> list[bytes]:
        """The messages that follow once all is set up: the updates without a result, in their order."""
        with self._lock:
            self.reopened += 1
            logger.warning("the session's server was lost; it is open again (%d)", self.reopened)
            self.misses, self.is_last_missed, self.gone = 0, False, None
            self._is_reopened = True
            self._start, self._leads = self._newest, True
            # Those that were given up since the set-up become preparations: they need no solves.
            return [self._message(number, update.changes, _as_preparation(update), update.first_part or update.given_up,
                                  update.before.current)
                    for number, update in self._updates.items() if not update.has_result]

    def give_up(self, sequence: int) -> None:
        """Gives an update up: its result is discarded. Its numbers are kept, and so is its shift of the last z."""
        with self._lock:
            if (update := self._updates.get(sequence)) is not None:
                update.given_up = True

    def _leave_given_up(self) -> None:
        """Takes updates that were given up as the server would have, which is lost."""
        with self._lock:
            left = [number for number, one in self._updates.items() if one.given_up and not one.has_result]
            for number, one in self._updates.items():
                if not one.has_result and any(number == last or (one.first_part and number < last) for last in left):
                    self._newest = one.controls.moved(self._newest)
        for number in left:
            self.settle(number, kept=True)

    def answer_by(self, deadline: float | None) -> float | None:
        """Until when an update waits that is sent now, by time.monotonic(); None is for ever."""
        return None if deadline is None else time.monotonic() + deadline + self._call.answer_grace

    def open_by(self) -> float:
        """Until when a server that gets the set-up now may take to set the session up; after it, it counts as hung."""
        return time.monotonic() + 1.0 + 10.0 * self.setup_s

    def prepared_by(self) -> float:
        """Until when a preparation waits that is sent now: its update may take it along."""
        return time.monotonic() + self._call.answer_grace

    def miss(self, sequence: int, deadline: float) -> DeadlineExceeded:
        """Gives an update up whose result has not come in time; its error."""
        self.give_up(sequence)
        with self._lock:  # a server that solves an earlier update need not hang
            busy = any(number < sequence and not (one.has_result or one.given_up or one.first_part)
                       for number, one in self._updates.items())
        self.misses += not busy
        self.is_last_missed = True
        grace, after = self._call.answer_grace, deadline + self._call.answer_grace
        return DeadlineExceeded(f"the server did not answer within {after:g} s, {grace:g} s after the deadline")

    @property
    def lost(self) -> Unavailable | None:
        """Of a server that has left too many updates without an answer."""
        if self.misses < _MOST_MISSES:
            return None
        return Unavailable(f"the server left {_MOST_MISSES} updates in a row without an answer")

    def update(self, problem: LCQP | Problem | None = None, *, options: Mapping[str, Any] | None = None,
               z0: ArrayLike | None = None, cold: bool = False, shift: Shift | int | None = None,
               deadline: float | None = None, first_part: bool = False,
               sensitivity: SensitivityRequest | None = None, **parts: Any) -> bytes:
        """The next update; self.sequence is its number then."""
        check_sensitivity_of_part(sensitivity, first_part)
        parts, options = self.split(parts, options)
        changes, shift = self.prepared(problem, parts, shift, deadline)
        start = None if z0 is None else lcqp.vector(z0, "z0", self.current.n, " (n)")
        controls = _Controls(options, start, cold, shift, deadline, sensitivity)
        # An update that cannot be encoded leaves no trace.
        with self._lock:
            data = self._message(self.sequence + 1, changes, controls, first_part, self.current)
        self.record(problem, changes, first_part, controls)
        return data

    def _message(self, sequence: int, changes: Mapping[str, Any], controls: _Controls, first_part: bool,
                 current: LCQP) -> bytes:
        """The caller holds the lock."""
        message = contract.message("SessionUpdate")(
            sequence=sequence, cold=controls.cold, deadline_s=controls.deadline or 0.0, epoch=self._epoch,
            options=requests.options_message(controls.options), prepare=first_part,
            shift=None if controls.shift is None else controls.shift.message())
        update = Encoder("SessionUpdate")
        update.others(message)
        update.message("problem", update_encoder(changes))
        if controls.sensitivity is not None:
            update.message("sensitivity", requests.sensitivity_encoder(controls.sensitivity, current))
        z0 = controls.z0
        if self._leads:  # a server that has solved nothing yet has nothing to shift
            z0 = self._start = controls.moved(self._start)
            self._leads = first_part
        if z0 is not None:
            update.message("initial_point", requests.initial_point(z0))
        return _request("update", update)

    @staticmethod
    def split(given: dict[str, Any],
              options: Mapping[str, Any] | None) -> tuple[dict[str, Any], Mapping[str, Any] | None]:
        """The parts of the problem among what is given by name, and the options with the rest."""
        rest = {name: value for name, value in given.items() if name not in _PARTS}
        if not rest:
            return given, options
        return ({name: value for name, value in given.items() if name in _PARTS},
                requests.merged(options, rest, (*_PARTS, "z0", "cold", "shift")))

    def prepared(self, problem: LCQP | Problem | None, parts: Mapping[str, Any], shift: Shift | int | None,
                 deadline: float | None) -> tuple[dict[str, Any], Shift | None]:
        """The changes of an update, by the letters of the equation, and its shift; checked, and not yet recorded."""
        if self.ended:
            raise FailedPrecondition("the session has ended")
        if deadline is not None and not (is_number(deadline) and math.isfinite(deadline) and deadline > 0):
            raise InvalidArgument("deadline", "must be finite and > 0 seconds", value=deadline)
        if not isinstance(shift, int | Shift | None):
            raise InvalidArgument("shift", "must be a Shift or a number of stages", value=type(shift).__name__)
        changes = changes_of(self.current, problem, parts)
        return changes, Shift.by_stage(self.current, shift) if isinstance(shift, int) else shift

    def record(self, problem: LCQP | Problem | None, changes: Mapping[str, Any], first_part: bool = False,
                 controls: _Controls = _Controls()) -> None:
        """Records an update under the next number."""
        given = problem.copy() if isinstance(problem, Problem) else None
        with self._lock:
            self.sequence += 1
            update = _Update(changes, given, controls, self._state, first_part=first_part)
            self._updates[self.sequence] = update
            self._state = update.after

    def settle(self, sequence: int, kept: bool) -> tuple[LCQP, LCQP | Problem]:
        """Records that an update has a result; returns the problem after it, as the solver has it and as it was given.

        kept: whether the solver has its numbers; if not, later updates build on the state before it.
        """
        with self._lock:
            update = self._updates[sequence]
            after = update.after
            update.has_result = True
            if not kept:
                del self._updates[sequence]
                self._state = update.before
                for number, later in self._updates.items():
                    if number > sequence:
                        later.before = self._state
                        self._state = later.after
                self._leads = self._start is not None
            while self._updates:
                number, first = next(iter(self._updates.items()))
                may_have_none = first.first_part or first.given_up  # a reopened session prepares what was given up
                if not first.has_result and not (may_have_none and number < sequence):
                    break
                del self._updates[number]
        return after.current, after.given if isinstance(after.given, Problem) else after.current

    def take(self, data: bytes) -> tuple[bool, SessionEvent | None]:
        """Whether a reader has what it waits for, and the result of an update if it is one.

        Progress is reported, and is not waited for; the message that all is set up has no result.
        """
        message, arrays = wire.decode("SessionResponse", data)
        kind = message.WhichOneof("event")
        if kind == "ready":
            self._ready(message.ready)
            return True, None
        if kind == "progress":
            if self._report is not None:
                for row in message.progress.progress.rows:
                    self._report(message.progress.sequence, answers.progress(row))
            return False, None
        body = getattr(message, kind)
        if kind in ("answer", "error") and body.epoch != self._server_epoch:
            return False, None  # of another set-up
        with self._lock:
            update = self._updates.get(body.sequence)
        if update is None or update.has_result:
            return False, None  # given up
        if update.first_part and kind != "error":
            return False, None  # an older server has solved it
        error = errors.from_status(body.status) if kind == "error" else None
        if self.reopen and isinstance(error, Unavailable):
            raise error  # of a server that is shutting down
        problem, given = self.settle(body.sequence, kept=not isinstance(error, InvalidArgument))
        outcome: Solution | Superseded | errors.Error
        if kind == "answer":
            answer = answers.solution(body.solution, arrays, "answer.solution.", problem, self.job_id)
            outcome = in_terms_of(given, self._first_of_epoch(answer, update.given_up))
        else:
            outcome = error or Superseded(body.by_sequence)
        self.misses, self.is_last_missed = 0, False
        if update.given_up:
            return False, None
        return True, SessionEvent(body.sequence, outcome)

    def _first_of_epoch(self, answer: Solution, given_up: bool) -> Solution:
        with self._lock:
            reopened = self._is_reopened and not given_up
            self._is_reopened = self._is_reopened and given_up
            self._start = None
            if answer.status in _STARTS:
                self._newest = answer.z
        return answer.replaced(reopened=True) if reopened else answer

    def _ready(self, message: Any) -> None:
        self._server_epoch = message.epoch  # 0 of an older server
        self.job_id = message.job_id
        self.memory_bytes = message.memory_bytes
        self.setup_s = message.setup_s
        self.idle_timeout_s = message.idle_timeout_s


def _as_preparation(update: _Update) -> _Controls:
    """The controls of an update, without those that a preparation may not have if it becomes one."""
    controls = update.controls
    return dataclasses.replace(controls, deadline=None, sensitivity=None) if update.given_up else controls


def check_sensitivity_of_part(sensitivity: object, first_part: bool) -> None:
    """Derivatives are of a solution, and a preparation has none."""
    requests.check_sensitivity(sensitivity)
    if first_part and sensitivity is not None:
        raise InvalidArgument("sensitivity", "must come with the second part of an update")


def first_refused(unread: dict[int, SessionEvent], first_parts: list[int], sequence: int) -> SessionEvent | None:
    """The error of a preparation before this update, which then becomes its own. Forgets the preparations before it."""
    refused = [unread.pop(number) for number in first_parts if number < sequence and number in unread]
    first_parts[:] = [number for number in first_parts if number > sequence]
    return refused[0] if refused else None


def answer_of(event: SessionEvent) -> Solution:
    """The solution of an update; raises the error if there is none."""
    if isinstance(event.outcome, Superseded):
        raise Cancelled(f"update {event.sequence} was superseded by update {event.outcome.by_sequence}")
    if isinstance(event.outcome, errors.Error):
        raise event.outcome
    return event.outcome


class SessionInfo:
    """Properties of the sessions of marble and of marble.aio."""

    _core: SessionCore

    @property
    def job_id(self) -> str:
        """The server's id of the session, one job for all its solves; a new one after it is reopened."""
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
    def reopened(self) -> int:
        """How often the session was set up again because its server was lost; see Solution.reopened."""
        return self._core.reopened

    @property
    def problem(self) -> LCQP:
        """The problem after all updates so far."""
        return self._core.current


def _request(field: str, part: Encoder) -> bytes:
    request = Encoder("SessionRequest")
    request.message(field, part)
    return request.finish()
