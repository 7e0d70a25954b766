"""Blocks of coupled problems in sessions of several servers, coordinated by marble._core in this process."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from marble.calls.session import Session
from marble.errors import Error, Refused, Unavailable
from marble.message.answers import core_solution
from marble.message.job import Priority
from marble.message.requests import Call
from marble.message.solve import SolveRequest
from marble.model.lcqp import LCQP, changed, problem_of
from marble.model.solution import Solution
from marble.transport.transport import Transport

Result = TypeVar("Result")


class BlockSessions:
    """What all blocks of one solve share.

    everywhere: a transport to all servers, used where none of them alone has a solution. each: one to each server,
    assigned to the blocks in turns. call: its priority, None is interactive, and options are of every block's solves;
    their time limit, and `limit` seconds where it is not None, count from here on.
    """

    def __init__(self, everywhere: Transport, each: Sequence[Transport], call: Call, name: str,
                 limit: float | None) -> None:
        self.everywhere, self.each, self.name = everywhere, each, name
        self.repeated = 0
        self._priority, self._options = call.priority or Priority.INTERACTIVE, dict(call.options or {})
        limits = (float(self._options.get("time_limit_s", math.inf)), math.inf if limit is None else limit)
        self._end = time.monotonic() + min(limits)
        self._turns = itertools.count()
        self._open: list[Session] = []

    def open(self, parts: Mapping[str, Any], name: str) -> Callable[[Mapping[str, Any], Any], Solution]:
        """The solver of a block, as marble._core calls it."""
        return _Block(self, problem_of(parts).named(" ".join(filter(None, (self.name, name))))).solve

    def close(self) -> None:
        """Ends the open sessions."""
        for session in self._open:
            session.cancel()

    def call(self) -> Call:
        """With the time that is left as the limit."""
        left = self._end - time.monotonic()
        options = self._options if math.isinf(left) else {**self._options, "time_limit_s": max(0.0, left)}
        return Call(options, self._priority)

    def turn(self) -> int:
        """The server of the next block."""
        return next(self._turns) % len(self.each)

    def session(self, transport: Transport, problem: LCQP) -> Session:
        """A session that close() ends."""
        session = transport.session(problem, self.call(), reopen=False)
        self._open.append(session)
        return session


class _Block:
    """A block's session is on one server. A set-up has z but no multipliers: a block that must begin on the branch of a
    solution that no session has makes solves of their own.
    """

    def __init__(self, servers: BlockSessions, problem: LCQP) -> None:
        self._servers, self._problem, self._at = servers, problem, servers.turn()
        self._session: Session | None = None
        self._newest: Any = None  # z of the session's last solution
        self._begun = False

    def solve(self, changes: Mapping[str, Any], previous: dict[str, Any] | None) -> Solution:
        """Solves the block with its changes from a solution of it as it was before; cold without one."""
        self._problem = changed(self._problem, changes)
        start = None if previous is None else core_solution(previous, self._problem)
        search, self._begun = self._begun and start is None, True
        if search:
            return self._alone(None)
        if self._session is not None and start is not None and not np.array_equal(start.z, self._newest):
            self._leave()
        if (answer := self._update()) is not None:
            return answer
        if start is None or not self._problem.l.size:
            problem = self._problem if start is None else self._problem.replaced(z0=start.z)
            with contextlib.suppress(Error):
                self._session = self._anywhere(lambda transport: self._servers.session(transport, problem))
            if (answer := self._update()) is not None:
                return answer
        return self._alone(start)

    def _update(self) -> Solution | None:
        if self._session is None:
            return None
        try:
            answer = self._session.update(self._problem, options=self._servers.call().options)
        except Error:
            self._servers.repeated += 1
            self._leave()
            return None
        if answer.solved:
            self._newest = answer.z
        return answer

    def _leave(self) -> None:
        assert self._session is not None
        self._session.cancel()
        self._session = None

    def _alone(self, start: Solution | None) -> Solution:
        servers = self._servers

        def solve(transport: Transport) -> Solution:
            return transport.run(SolveRequest(self._problem, dataclasses.replace(servers.call(), warm_start=start)))

        try:
            return self._anywhere(solve)
        except (Unavailable, Refused):
            return solve(servers.everywhere)

    def _anywhere(self, work: Callable[[Transport], Result]) -> Result:
        """On one of the servers, beginning with the one of this block."""
        each = self._servers.each
        for _ in range(len(each) - 1):
            try:
                return work(each[self._at])
            except (Unavailable, Refused):
                self._at = (self._at + 1) % len(each)
        return work(each[self._at])
