"""The native loop: what it is asked, where its LCQPs are solved, and its answer."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

import marble
from marble.base.tables import Status
from marble.in_process import solver
from marble.nlp import ticks

_VECTORS: Final = frozenset(("x", "y", "nu", "xi", "eta", "bounds"))


@dataclass(frozen=True)
class Iteration:
    """One row of the iteration table."""

    iteration: int
    objective: float
    violation: float
    step: float
    radius: float
    accepted: bool
    ticks: int


@dataclass(frozen=True)
class Answer:
    """The newest x that was accepted, solved or not; its fields as marble/nonlinear.h has them."""

    status: Status
    detail: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    nu: NDArray[np.float64]
    xi: NDArray[np.float64]
    eta: NDArray[np.float64]
    bounds: NDArray[np.float64]
    objective: float
    violation: float
    kkt_residual: float
    b_stationary: bool | None
    iterations: int
    ticks: int
    evaluations: int
    factorizations: int

    @property
    def solved(self) -> bool:
        """Whether the tolerances, or the reduced ones, are met."""
        return self.status in (Status.SOLVED, Status.SOLVED_REDUCED)


def decoded(told: dict[str, Any]) -> dict[str, Any]:
    """What the native library tells, with this package's statuses and arrays."""
    for name in _VECTORS & told.keys():
        told[name] = np.asarray(told[name])
    told["status"] = Status(told["status"])
    return told


def answer_of(told: dict[str, Any]) -> Answer:
    """The native library's answer as an object."""
    return Answer(**decoded(told))


def run(
    entry: str,
    problem: Mapping[str, Any],
    settings: Mapping[str, Any],
    options: Mapping[str, Any],
    progress: Callable[[Iteration], object] | None,
    server: str | Sequence[str] | marble.Client | None,
    *more: Any,
) -> Any:
    """Calls marble._core's function of that name, with the sessions that it asks for open until it ends."""
    core = solver.core()
    tell = None if progress is None else lambda *row: progress(Iteration(*row))
    main_thread = threading.get_ident() == threading.main_thread().ident
    with contextlib.ExitStack() as opened:
        there = ticks.ticks_of(server, opened)
        with solver.faults():
            return getattr(core, entry)(problem, settings, solver.option_values(options), tell, there, main_thread,
                                        *more)
