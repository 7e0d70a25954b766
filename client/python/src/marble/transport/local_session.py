"""A session in this process: the warm-started solver of marble._core, in the callers' threads."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

from marble import errors
from marble.calls.session import Session, Turn
from marble.calls.session_core import SessionCore, SessionEvent, check_sensitivity_of_part
from marble.connection.patience import Tries
from marble.errors import Error
from marble.in_process import core, core_errors, under_way
from marble.message import requests
from marble.message.answers import core_solution, unless_cancelled
from marble.message.request import Run, core_options
from marble.message.requests import Call
from marble.model import lcqp
from marble.model.lcqp import LCQP
from marble.model.problem import Problem, in_terms_of
from marble.model.solution import Progress


class LocalSession(Session):
    """As marble.Session. Each update is solved at once, so that none waits or is superseded."""

    def __init__(self, problem: LCQP | Problem, call: Call,
                 progress: Callable[[int, Progress], object] | None) -> None:
        self._core = SessionCore(problem, progress)
        self._unread: dict[int, SessionEvent] = {}
        self._first_parts: list[int] = []
        self._writing, self._reading = Turn(), Turn()
        self._call, self._report = call, progress
        self._running: Any = None
        requests.check_request_id(call.request_id)
        requests.priority_number(call.priority)
        requests.check_session(call)
        with core_errors():
            self._solver = core().Warm(self._core.current, core_options(call.options))
        self._core.memory_bytes = self._solver.memory_bytes
        self._core.setup_s = self._solver.setup_s

    @property
    def is_open(self) -> bool:
        """Whether updates may be sent."""
        return not self._core.ended

    def prepare(self, problem: LCQP | Problem | None = None, **changes: Any) -> int:
        """As marble.Session.prepare; returns when the preparation is complete, and raises its errors."""
        with self._writing:
            check_sensitivity_of_part(changes.pop("sensitivity", None), True)
            numbers, arguments = self._arguments(problem, **changes)
            with core_errors():
                self._solver.prepare(*arguments)
            self._core.record(problem, numbers, first_part=True)
            return self._core.sequence

    def send(self, problem: LCQP | Problem | None = None, **changes: Any) -> int:
        """Solves before it returns the update's number; next() has the answer."""
        with self._writing:
            outcome = self._outcome(problem, **changes)
            self._unread[self._core.sequence] = SessionEvent(self._core.sequence, outcome)
            return self._core.sequence

    def _arguments(self, problem: LCQP | Problem | None, *, options: Any = None, z0: Any = None, cold: bool = False,
                   shift: Any = None, deadline: float | None = None, **parts: Any) -> tuple[dict[str, Any], Any]:
        """The changes of an update, and what the solver is given of it."""
        parts, options = self._core.split(parts, options)
        changes, shift = self._core.prepared(problem, parts, shift, deadline)
        start = None if z0 is None else lcqp.vector(z0, "z0", self._core.current.n, " (n)")
        return changes, (core_options(options), _numbers(changes), start, cold,
                         None if shift is None else shift.blocks())

    def _outcome(self, problem: LCQP | Problem | None, *, deadline: float | None = None, sensitivity: Any = None,
                 **given: Any) -> Any:
        changes, arguments = self._arguments(problem, deadline=deadline, **given)
        sequence, report = self._core.sequence + 1, self._report
        rows = None if report is None else lambda row: report(sequence, row)
        stop = core().Stop()
        call = Run(deadline, stop).call(self._core.current, dataclasses.replace(self._call, sensitivity=sensitivity),
                                        rows)
        self._core.record(problem, changes)
        self._running = stop
        kept = True
        try:
            with under_way(stop):
                result = self._solver.solve(*arguments, call)
            return in_terms_of(self._core.given, unless_cancelled(core_solution(result, self._core.current)))
        except core().Fault as raised:
            error = errors.from_core(*raised.args)
            kept = not isinstance(error, errors.InvalidArgument)
            return error
        except Error as error:
            return error
        finally:
            self._running = None
            self._core.settle(sequence, kept)

    def _sent(self, problem: LCQP | Problem | None, changes: dict[str, Any]) -> tuple[int, float | None]:
        return self.send(problem, **changes), None

    def _tries(self, deadline: float | None) -> Tries | None:
        return None

    def _read(self, tries: Tries | None = None, until: float | None = None) -> SessionEvent | None:
        return None

    def close(self) -> None:
        """Ends the session, and drops results that were not fetched."""
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
