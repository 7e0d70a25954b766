"""The subproblems of a nonlinear solve as updates of a client's sessions."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np

import marble
from marble.calls.session import Session
from marble.calls.shift import Shift, ShiftBlock
from marble.connection import connect
from marble.errors import DeadlineExceeded, Error
from marble.model.lcqp import LCQP, changed, problem_of
from marble.model.solution import Solution

_PASSED: Final = 1e-9  # to a session no time left is none at all

Blocks = Sequence[Sequence[tuple[int, int, int]]]
Tick = Callable[[Mapping[str, Any], bool, float | None, Blocks, Any, bool], tuple[Solution, bool] | None]


def ticks_of(server: str | Sequence[str] | marble.Client | None, opened: contextlib.ExitStack,
             reopen: bool) -> Callable[..., Tick] | None:
    """Opens a session for each pattern of marble._core's subproblems; None where marble._core solves them itself.

    `opened` closes them. reopen: as in marble.Client.session.
    """
    client = server if isinstance(server, marble.Client) else opened.enter_context(
        marble.Client(connect.server_of(server)))
    return client._transport.subproblems(
        lambda options, parts: _Ticks(client, opened, options, problem_of(parts), reopen).tick)


class _Ticks:
    def __init__(self, client: marble.Client, opened: contextlib.ExitStack, options: Mapping[str, Any], problem: LCQP,
                 reopen: bool) -> None:
        self._problem = problem
        self._session: Session = client.session(problem, options=options, reopen=reopen)
        opened.push(self._end)

    def _end(self, *raised: Any) -> None:
        with contextlib.suppress(Error):  # of one whose server was lost since
            self._session.__exit__(*raised)

    def tick(self, changes: Mapping[str, Any], cold: bool, seconds: float | None, blocks: Blocks, z0: Any,
             first_part: bool) -> tuple[Solution, bool] | None:
        """One update; None where the time was up, and of a first part."""
        self._problem = changed(self._problem, changes)
        shift = Shift(*([ShiftBlock(*block) for block in part] for part in blocks)) if any(blocks) else None
        controls: dict[str, Any] = {"cold": cold, "shift": shift, "z0": None if z0 is None else np.asarray(z0)}
        if first_part:
            self._session.prepare(self._problem, **controls)
            return None
        try:
            answer = self._session.update(self._problem, **controls,
                                          deadline=None if seconds is None else max(seconds, _PASSED))
        except DeadlineExceeded:
            return None
        return answer, answer.reopened
