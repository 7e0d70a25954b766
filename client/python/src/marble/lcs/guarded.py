"""A planner that returns a plan in time, whatever its server does."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from typing import Final

from marble.errors import Aborted, Cancelled, FailedPrecondition, Refused, ServerError, Unavailable
from marble.lcs.planner import Plan, Planner
from marble.lcs.system import LCS, Array

_WITHOUT_ANSWER: Final = (Unavailable, Refused, Aborted, Cancelled, ServerError)
"""Errors of a solve after which a loop must go on."""
_LEAST_S: Final = 1e-6
"""Deadline of a solve for which no time is left."""


class GuardedPlanner:
    """Plans over a session until that is lost or ends; then along the last plan, while it opens another one.

    open: makes a planner of a system, with a session that is not reopened. What it raises at first is raised; later it
    is called on a thread of its own, again and again, and its error is part of the plans' details.
    """

    def __init__(self, open: Callable[[LCS], Planner], lcs: LCS) -> None:
        self._open = open
        self.planner: Planner = open(lcs)
        self._prepared: Array | None = None
        """Targets of the next step, if it is prepared."""
        self._lock = threading.Lock()
        self._is_opening = self._is_closed = False
        self._opened: Planner | None = None
        self._why = ""

    def prepare(self, lcs: LCS, x_ref: Array, shift: int, bounds: Mapping[str, Array]) -> bool:
        """Planner.prepare; whether the next step is prepared."""
        if not self.planner.session.is_open:
            return False
        try:
            self.planner.prepare(lcs=lcs, x_ref=x_ref, shift=shift, **bounds)
        except _WITHOUT_ANSWER:
            return False
        self._prepared = x_ref
        return True

    def step(self, lcs: LCS, x0: Array, x_ref: Array | None, last_u: Array | None, u: Array, shift: int,
             seconds: float, bounds: Mapping[str, Array]) -> tuple[Plan, str]:
        """The plan of a step, and the error of its solve if there was no answer.

        x_ref: None of a prepared step. u: (N, nu), the last inputs, moved on, with which another session begins.
        seconds: until the deadline, inf without one. bounds: x_lb and x_ub, if they change.
        """
        prepared, self._prepared = self._prepared, None
        is_other = self._take_opened()
        planner = self.planner
        deadline = None if math.isinf(seconds) else max(seconds, _LEAST_S)
        try:
            if prepared is not None and not is_other:
                return planner.feedback(x0, last_u=last_u, deadline=deadline, **bounds), ""
            return planner.step(x0, lcs=lcs, x_ref=x_ref if prepared is None else prepared, last_u=last_u,
                                u=u if is_other else None, shift=0 if is_other else shift, deadline=deadline,
                                **bounds), ""
        except (*_WITHOUT_ANSWER, FailedPrecondition) as error:
            if isinstance(error, FailedPrecondition) and planner.session.is_open:
                raise
            text = f"{type(error).__name__}: {error}" + (f"; {self._why}" if self._why else "")
            if not planner.session.is_open:
                self._start_opening(lcs)
            return planner.fall_back(text), text

    def _take_opened(self) -> bool:
        """Whether another session has been opened; it is the planner's from here on."""
        with self._lock:
            opened, self._opened = self._opened, None
        if opened is None:
            return False
        old, self.planner = self.planner, opened
        old.__exit__(Cancelled)
        return True

    def _start_opening(self, lcs: LCS) -> None:
        with self._lock:
            if self._is_opening or self._opened is not None or self._is_closed:
                return
            self._is_opening = True
        threading.Thread(target=self._open_another, args=(lcs,), daemon=True).start()

    def _open_another(self, lcs: LCS) -> None:
        made, why = None, ""
        try:
            made = self._open(lcs)
        except Exception as error:
            why = str(error)
        with self._lock:
            self._is_opening, self._why = False, why
            if not self._is_closed:
                self._opened = made
                return
        if made is not None:
            made.__exit__(Cancelled)

    def close(self) -> None:
        """Ends the session at once: no solve is under way, and the server may hang."""
        with self._lock:
            self._is_closed, opened = True, self._opened
        if opened is not None:
            opened.__exit__(Cancelled)
        self.planner.__exit__(Cancelled)
