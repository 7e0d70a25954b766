"""The subproblems of a nonlinear solve as updates of a client's sessions."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

import marble
from marble.calls.session import Session
from marble.calls.session_core import Shift, ShiftBlock
from marble.connection import connect
from marble.errors import DeadlineExceeded, Error, Unavailable
from marble.model.lcqp import LCQP
from marble.model.parts import changed, problem_of
from marble.model.solution import Solution

_PASSED: Final = 1e-9  # to a session no time left is none at all
_PAUSES: Final = (0.0, 0.1, 0.3, 0.6)  # seconds before each try to reopen; a server that is found is found by the first

Blocks = Sequence[Sequence[tuple[int, int, int]]]
Tick = Callable[[Mapping[str, Any], bool, float | None, Blocks, Any, bool], tuple[Solution, bool] | None]


def ticks_of(server: str | Sequence[str] | marble.Client | None, opened: contextlib.ExitStack,
             reopen: bool) -> Callable[..., Tick] | None:
    """What marble._core asks for a session each time it has a problem of another pattern; None for this process.

    `opened` closes them. reopen: where the server of one is lost, it is set up again.
    """
    if not isinstance(server, marble.Client):
        server = connect.server_of(server)
        if connect.is_local(server):
            return None
        server = opened.enter_context(marble.Client(server))
    client = server
    return lambda options, parts: _Ticks(client, opened, options, problem_of(parts), reopen).tick


class _Ticks:
    def __init__(self, client: marble.Client, opened: contextlib.ExitStack, options: Mapping[str, Any], problem: LCQP,
                 reopen: bool) -> None:
        self._client, self._opened, self._options, self._reopen = client, opened, options, reopen
        self._problem = problem
        self._z: Any = None  # of the last answer, as the first part of an update has moved it
        self._session: Session | None = self._open(problem)

    def _open(self, problem: LCQP) -> Session:
        session = self._client.session(problem, options=self._options)

        def end(*raised: Any) -> None:
            with contextlib.suppress(Error):  # of one whose server was lost since
                session.__exit__(*raised)

        self._opened.push(end)
        return session

    def tick(self, changes: Mapping[str, Any], cold: bool, seconds: float | None, blocks: Blocks, z0: Any,
             first_part: bool) -> tuple[Solution, bool] | None:
        """One update; None where the time was up, and of a first part."""
        self._problem = changed(self._problem, changes)
        shift = Shift(*([ShiftBlock(*block) for block in part] for part in blocks)) if any(blocks) else None
        controls: dict[str, Any] = {"cold": cold, "shift": shift, "z0": None if z0 is None else np.asarray(z0)}
        end = None if seconds is None else time.monotonic() + seconds
        if first_part:
            if self._session is not None:
                with self._loss():
                    self._session.prepare(self._problem, **controls)
            self._z = self._start(**controls)
            return None
        try:
            answer, reopened = self._answer(controls, end)
        except DeadlineExceeded:
            return None
        self._z = answer.z
        return answer, reopened

    def _answer(self, controls: Mapping[str, Any], end: float | None) -> tuple[Solution, bool]:
        if self._session is not None:
            with self._loss():
                return self._session.update(self._problem, deadline=_left(end), **controls), False
        start = self._start(**controls)
        for pause in _PAUSES:
            time.sleep(pause)
            try:
                session = self._open(self._problem if start is None else self._problem.replaced(z0=start))
            except Unavailable as error:
                lost = error
                continue
            self._session = session
            try:
                return session.update(deadline=_left(end)), True
            except Unavailable as error:
                session.cancel()
                lost = error
        raise lost

    @contextlib.contextmanager
    def _loss(self) -> Iterator[None]:
        """Where there may be another session, the loss of this one is no error yet."""
        assert self._session is not None
        try:
            yield
        except Unavailable:
            self._session.cancel()
            self._session = None
            if not self._reopen:
                raise

    def _start(self, cold: bool, shift: Shift | None, z0: Any) -> Any:
        """Where an update starts, for a session that does not know the answer before."""
        if cold or z0 is not None or self._z is None:
            return None if cold else z0
        z = np.array(self._z)
        for block in () if shift is None else shift.variables:
            end = block.first + block.count
            z[block.first:end - block.by] = z[block.first + block.by:end]
        return z


def _left(end: float | None) -> float | None:
    return None if end is None else max(end - time.monotonic(), _PASSED)
