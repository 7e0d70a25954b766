"""Blocks of coupled problems in sessions of several servers, for the coordinator in marble._core."""

from __future__ import annotations

import contextlib
import itertools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from marble.calls.session import Session
from marble.errors import Error, Refused, Unavailable
from marble.in_process import solver
from marble.message.job import Priority
from marble.model.lcqp import LCQP
from marble.model.parts import changed, problem_of
from marble.model.solution import Solution

Client = Any  # marble.Client, which is above
Answer = TypeVar("Answer")


class BlockSessions:
    """What all blocks of one solve share.

    everywhere: a client of all servers, asked where none of them alone has an answer. each: one of each, dealt to the
    blocks in turns. priority: None is interactive. options: of every block's solves; their time limit, and `limit`
    seconds where it is not None, count from here on.
    """

    def __init__(self, everywhere: Client, each: Sequence[Client], options: Mapping[str, Any] | None,
                 priority: Priority | str | None, name: str, limit: float | None) -> None:
        self.everywhere, self.each, self.name = everywhere, each, name
        self.priority = priority or Priority.INTERACTIVE
        self.repeated = 0
        self._options = dict(options or {})
        limits = (float(self._options.get("time_limit_s", math.inf)), math.inf if limit is None else limit)
        self._end = time.monotonic() + min(limits)
        self._turns = itertools.count()
        self._open: list[Session] = []

    def open(self, parts: Mapping[str, Any], name: str) -> Callable[[Mapping[str, Any], Any], Solution]:
        """A block's solver, as marble._core asks for it."""
        return _Block(self, problem_of(parts).named(" ".join(filter(None, (self.name, name))))).solve

    def close(self) -> None:
        """Ends what is still open."""
        for session in self._open:
            session.cancel()

    def options(self) -> dict[str, Any]:
        """With the time that is left."""
        left = self._end - time.monotonic()
        return self._options if math.isinf(left) else {**self._options, "time_limit_s": max(0.0, left)}

    def turn(self) -> int:
        """The server of the next block."""
        return next(self._turns) % len(self.each)

    def session(self, client: Client, problem: LCQP) -> Session:
        """A session that close() ends."""
        session: Session = client.session(problem, options=self.options(), priority=self.priority, reopen=False)
        self._open.append(session)
        return session


class _Block:
    """A session where its memory is where the block is. A set-up has z, and no multipliers: where a block has to begin
    on the branch of an answer that no session knows, its steps are solves of their own.
    """

    def __init__(self, servers: BlockSessions, problem: LCQP) -> None:
        self._servers, self._problem, self._at = servers, problem, servers.turn()
        self._session: Session | None = None
        self._newest: Any = None  # z of what the session has solved last
        self._begun = False

    def solve(self, changes: Mapping[str, Any], told: dict[str, Any] | None) -> Solution:
        """What has changed, from an answer to what it was; cold where there is none."""
        self._problem = changed(self._problem, changes)
        start = None if told is None else solver.solution(told, self._problem)
        search, self._begun = self._begun and start is None, True
        if search:
            return self._alone(None)
        if self._session is not None and start is not None and not np.array_equal(start.z, self._newest):
            self._leave()
        if (answer := self._tick()) is not None:
            return answer
        if start is None or not self._problem.l.size:
            problem = self._problem if start is None else self._problem.replaced(z0=start.z)
            with contextlib.suppress(Error):
                self._session = self._anywhere(lambda client: self._servers.session(client, problem))
            if (answer := self._tick()) is not None:
                return answer
        return self._alone(start)

    def _tick(self) -> Solution | None:
        if self._session is None:
            return None
        try:
            answer = self._session.update(self._problem, options=self._servers.options())
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

        def ask(client: Client) -> Solution:
            answer: Solution = client.solve(self._problem, options=servers.options(), priority=servers.priority,
                                            warm_start=start)
            return answer

        try:
            return self._anywhere(ask)
        except (Unavailable, Refused):
            return ask(servers.everywhere)

    def _anywhere(self, ask: Callable[[Client], Answer]) -> Answer:
        """The servers one after the other, from the one where the block is."""
        each = self._servers.each
        for _ in range(len(each) - 1):
            try:
                return ask(each[self._at])
            except (Unavailable, Refused):
                self._at = (self._at + 1) % len(each)
        return ask(each[self._at])
