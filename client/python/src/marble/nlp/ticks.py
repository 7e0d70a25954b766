"""The subproblems of a nonlinear solve as updates of a client's sessions."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

import marble
from marble.errors import DeadlineExceeded
from marble.model.lcqp import LCQP, csc

Tick = Callable[[Mapping[str, Any], bool, float | None], tuple[Any, ...] | None]


def opener(client: marble.Client,
           sessions: contextlib.ExitStack) -> Callable[[Mapping[str, Any], Mapping[str, Any]], Tick]:
    """What marble._core asks for a session each time it has a problem of another pattern; `sessions` closes them."""

    def open_session(options: Mapping[str, Any], parts: Mapping[str, Any]) -> Tick:
        problem = _problem(parts)
        session = sessions.enter_context(client.session(problem, options=options))

        def tick(changes: Mapping[str, Any], cold: bool, seconds: float | None) -> tuple[Any, ...] | None:
            nonlocal problem
            problem = _changed(problem, changes)
            try:
                answer = session.update(problem, cold=cold, deadline=seconds)
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
