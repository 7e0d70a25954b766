"""A session without a server: core's warm solver, in the callers' threads."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

from marble import errors
from marble.calls.session import Session, Turn
from marble.calls.session_core import SessionCore, SessionEvent, check_sensitivity_of_part
from marble.connection.patience import Tries
from marble.errors import Error
from marble.in_process import solver
from marble.in_process.ending import under_way
from marble.message import requests
from marble.message.requests import Call
from marble.model import lcqp
from marble.model.lcqp import LCQP
from marble.model.problem import Problem, in_terms_of
from marble.model.solution import Progress


class SessionHere(Session):
    """As marble.Session. Every update is solved as it comes, so that none ever waits or is overtaken."""

    def __init__(self, problem: LCQP | Problem, call: Call,
                 progress: Callable[[int, Progress], object] | None) -> None:
        self._core = SessionCore(problem, progress)
        self._unread: dict[int, SessionEvent] = {}
        self._first_parts: list[int] = []
        self._writing, self._reading = Turn(), Turn()
        self._call, self._tell = call, progress
        self._running: Any = None
        requests.check_request_id(call.request_id)
        requests.priority_number(call.priority)
        requests.check_progress(call)
        with solver.faults():
            self._solver = solver.core().Warm(self._core.current, solver.option_values(call.options))
        self._core.memory_bytes = self._solver.memory_bytes
        self._core.setup_s = self._solver.setup_s

    @property
    def is_open(self) -> bool:
        """Whether updates may be sent."""
        return not self._core.ended

    def prepare(self, problem: LCQP | Problem | None = None, **changes: Any) -> int:
        """As marble.Session.prepare; it is ready when this returns, and what is wrong is raised at once."""
        with self._writing:
            self._take_first_part(problem, **changes)
            return self._core.sequence

    def send(self, problem: LCQP | Problem | None = None, **changes: Any) -> int:
        """Solves before it returns the update's number; next() has the answer."""
        with self._writing:
            outcome = self._outcome(problem, **changes)
            self._unread[self._core.sequence] = SessionEvent(self._core.sequence, outcome)
            return self._core.sequence

    def _take_first_part(self, problem: LCQP | Problem | None, *, options: Any = None, z0: Any = None,
                         cold: bool = False, shift: Any = None, sensitivity: Any = None, **parts: Any) -> None:
        check_sensitivity_of_part(sensitivity, True)
        parts, options = self._core.split(parts, options)
        changes, shift = self._core.prepared(problem, parts, shift, None)
        start = None if z0 is None else lcqp.vector(z0, "z0", self._core.current.n, " (n)")
        with solver.faults():
            self._solver.prepare(solver.option_values(options), _numbers(changes), start, cold,
                                 None if shift is None else shift.blocks())
        self._core.remember(problem, changes, first_part=True)

    def _outcome(self, problem: LCQP | Problem | None, *, options: Any = None, z0: Any = None, cold: bool = False,
                 shift: Any = None, deadline: float | None = None, sensitivity: Any = None, **parts: Any) -> Any:
        parts, options = self._core.split(parts, options)
        changes, shift = self._core.prepared(problem, parts, shift, deadline)
        start = None if z0 is None else lcqp.vector(z0, "z0", self._core.current.n, " (n)")
        values = solver.option_values(options)
        numbers = _numbers(changes)
        sequence, tell = self._core.sequence + 1, self._tell
        own = None if tell is None else lambda row: tell(sequence, row)
        stop = solver.core().Stop()
        wishes = dataclasses.replace(self._call, sensitivity=sensitivity)
        call = solver.core_call(self._core.current, wishes, own, deadline, stop)
        self._core.remember(problem, changes)
        self._running = stop
        kept = True
        try:
            with under_way(stop):
                told = self._solver.solve(values, numbers, start, cold, None if shift is None else shift.blocks(), call)
            answer = solver.unless_cancelled(solver.solution(told, self._core.current))
            return in_terms_of(self._core.given, answer)
        except solver.core().Fault as fault:
            error = errors.from_core(*fault.args)
            kept = not isinstance(error, errors.InvalidArgument)
            return error
        except Error as error:
            return error
        finally:
            self._running = None
            self._core.settle(sequence, kept)

    def _read(self, tries: Tries | None = None) -> SessionEvent | None:
        return None

    def close(self) -> None:
        """Ends the session. What was not fetched is let go."""
        self._writing.refuse_own()
        self._core.ended = True

    def cancel(self) -> None:
        """Gives the session up, with a solve that another thread has under way."""
        self._core.ended = True
        if (running := self._running) is not None:
            running.request()


def _numbers(changes: Mapping[str, Any]) -> dict[str, Any]:
    """Changes as core takes them: of a matrix its values."""
    return {name: value if name == "c0" else getattr(value, "data", value) if name in "QACLR" else value
            for name, value in changes.items()}
