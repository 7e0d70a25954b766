"""A solve under way on a thread of its own."""

from __future__ import annotations

import threading
from collections.abc import Callable

from marble.calls.handle import SolveHandle
from marble.in_process import solver
from marble.message.requests import Call
from marble.model.lcqp import LCQP
from marble.model.problem import Problem, in_terms_of
from marble.model.solution import Progress


class HandleHere(SolveHandle):
    """As marble.SolveHandle, without a job."""

    def __init__(self, problem: LCQP, given: LCQP | Problem, call: Call, tell: Callable[[Progress], object] | None,
                 deadline: float | None) -> None:
        super().__init__()
        self._stop = solver.core().Stop()
        self._given_up = False
        self._accept("")
        threading.Thread(target=self._run, args=(problem, given, call, tell, deadline), name="marble-solve",
                         daemon=True).start()

    def cancel(self) -> None:
        """Gives the solve up: it stops within one iteration, and result() raises Cancelled."""
        self._given_up = True
        self._stop.request()

    def stop(self) -> None:
        """Ends the solve with what it has: result() is its best iterate, of status CANCELLED."""
        self._stop.request()

    def _run(self, problem: LCQP, given: LCQP | Problem, call: Call, tell: Callable[[Progress], object] | None,
             deadline: float | None) -> None:
        try:
            answer = solver.stoppable(problem, call, tell, deadline, self._stop)
            self._answer.set_result(in_terms_of(given, solver.unless_cancelled(answer) if self._given_up else answer))
        except BaseException as error:
            self._answer.set_exception(error)
