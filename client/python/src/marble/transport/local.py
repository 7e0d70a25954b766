"""Calls in this process, by marble._core in the callers' own threads."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from marble.calls.batch import BatchAnswer, BatchItem, item_call
from marble.calls.session import Session
from marble.connection.rpc import CLOSED
from marble.errors import Error, FailedPrecondition
from marble.in_process import IN_PROCESS, core, core_errors, showing, under_way
from marble.message.answers import unless_cancelled
from marble.message.request import Request, Run, Stream, no_server
from marble.message.requests import Call
from marble.message.solve import SolveRequest
from marble.model.lcqp import LCQP
from marble.model.problem import Problem
from marble.model.solution import Progress, Solution
from marble.transport.local_session import LocalSession
from marble.transport.transport import SolveHandle, Transport

Result = TypeVar("Result")
Item = TypeVar("Item")


class LocalTransport(Transport):
    """timeout: seconds, of calls without a deadline of their own; None is none."""

    def __init__(self, timeout: float | None = None) -> None:
        core()
        self.address, self._timeout, self._is_closed = IN_PROCESS, timeout, False

    def check_open(self) -> None:
        """FailedPrecondition once it is closed."""
        if self._is_closed:
            raise FailedPrecondition(CLOSED)

    def execute(self, request: Request[Result], deadline: float | None, stop: Any, open_block: Any = None) -> Result:
        """The result, also of a solve that `stop` has ended. open_block: as in Run."""
        try:
            self.check_open()
            with core_errors(), under_way(stop), showing(stop, request.report):
                limit = self._timeout if deadline is None else deadline
                return request.compute(Run(limit, stop, open_block))
        finally:
            request.close()

    def run(self, request: Request[Result], deadline: float | None = None, stop: Any = None,
            open_block: Any = None) -> Result:
        """See Transport. On the main thread Ctrl-C gives the solve up, on others `stop`."""
        result: Any = self.execute(request, deadline, stop or core().Stop(), open_block)
        unless_cancelled(getattr(result, "solution", result))
        answer: Result = result
        return answer

    def start(self, request: SolveRequest, deadline: float | None) -> SolveHandle:
        """See Transport."""
        self.check_open()
        stop, given_up = core().Stop(), threading.Event()

        def solve() -> Solution:
            solution = self.execute(request, deadline, stop)
            return unless_cancelled(solution) if given_up.is_set() else solution

        def cancel() -> None:
            given_up.set()
            stop.request()

        handle = SolveHandle(cancel, stop.request)
        handle.accept("")
        handle.begin(solve)
        return handle

    def stream(self, stream: Stream[Item]) -> Iterator[Item]:
        """See Transport."""
        raise no_server()

    def batch(self, problems: Iterable[LCQP | Problem | BatchItem], call: Call) -> Iterator[BatchAnswer]:
        """One after the other, in their order."""
        self.check_open()
        for index, item in enumerate(problems):
            one = item if isinstance(item, BatchItem) else BatchItem(item)
            request = SolveRequest(one.problem, item_call(call, one))
            try:
                yield BatchAnswer(index, one.tag, self.run(request, math.inf), None)
            except Error as error:
                yield BatchAnswer(index, one.tag, None, error)

    def session(self, problem: LCQP | Problem, call: Call, latest_only: bool = False,
                progress: Callable[[int, Progress], object] | None = None, reopen: bool = True) -> Session:
        """See Transport."""
        self.check_open()
        return LocalSession(problem, call, progress)

    def subproblems(self, open_session: Callable[..., Any]) -> Callable[..., Any] | None:
        """See Transport."""
        self.check_open()
        return None

    def close(self) -> None:
        """See Transport."""
        self._is_closed = True
