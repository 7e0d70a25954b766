"""The subproblems of a nonlinear solve as updates of a client's sessions."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np

import marble
from marble.calls.session_core import Shift, ShiftBlock
from marble.connection import connect
from marble.errors import DeadlineExceeded
from marble.model.lcqp import LCQP, csc

_PASSED: Final = 1e-9  # to a session no time left is none at all

Blocks = Sequence[Sequence[tuple[int, int, int]]]
Tick = Callable[[Mapping[str, Any], bool, float | None, Blocks, Any, bool], tuple[Any, ...] | None]


def ticks_of(server: str | Sequence[str] | marble.Client | None,
              opened: contextlib.ExitStack) -> Callable[..., Tick] | None:
    """None for this process."""
    if not isinstance(server, marble.Client):
        server = connect.server_of(server)
        if connect.is_local(server):
            return None
        server = opened.enter_context(marble.Client(server))
    return opener(server, opened)


def opener(client: marble.Client,
           sessions: contextlib.ExitStack) -> Callable[[Mapping[str, Any], Mapping[str, Any]], Tick]:
    """What marble._core asks for a session each time it has a problem of another pattern; `sessions` closes them."""

    def open_session(options: Mapping[str, Any], parts: Mapping[str, Any]) -> Tick:
        problem = _problem(parts)
        session = sessions.enter_context(client.session(problem, options=options))

        def tick(changes: Mapping[str, Any], cold: bool, seconds: float | None, blocks: Blocks, z0: Any,
                 first_part: bool) -> tuple[Any, ...] | None:
            nonlocal problem
            problem = _changed(problem, changes)
            shift = Shift(*([ShiftBlock(*block) for block in part] for part in blocks)) if any(blocks) else None
            start = None if z0 is None else np.asarray(z0)
            if first_part:
                session.prepare(problem, cold=cold, shift=shift, z0=start)
                return None
            try:
                answer = session.update(problem, cold=cold, shift=shift, z0=start,
                                        deadline=None if seconds is None else max(seconds, _PASSED))
            except DeadlineExceeded:
                return None
            stationarity, second_order = answer.stationarity, answer.second_order
            return (answer.status.value, answer.detail, answer.z, answer.y, answer.nu, answer.xi, answer.eta,
                    answer.b_stationary, "unknown" if stationarity is None else stationarity.value,
                    "unknown" if second_order is None else second_order.value, answer.factorizations)

        return tick

    return open_session


def _changed(problem: LCQP, changes: Mapping[str, Any]) -> LCQP:
    parts: dict[str, Any] = {}
    for name, value in changes.items():
        if name in "QACLR":
            old = getattr(problem, name)
            parts[name] = csc(np.asarray(value), old.indices, old.indptr, old.shape)
        else:
            parts[name] = value if name == "c0" else np.asarray(value)
    return problem.replaced(**parts)


def _problem(parts: Mapping[str, Any]) -> LCQP:
    vectors = {name: np.array(parts[name]) for name in "gbdlr"}
    n = vectors["g"].size
    matrices = {}
    for name in "QACLR":
        data, indices, indptr, rows = parts[name]
        if rows:
            matrices[name] = csc(np.array(data), np.array(indices, dtype=np.int32), np.array(indptr, dtype=np.int32),
                                 (rows, n))
    return LCQP(None, vectors["g"], c0=parts["c0"]).replaced(**vectors, **matrices)
