"""Runs the nonlinear loops of marble._core: their settings, their subproblems and their solution."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

import marble
from marble.base.tables import Status
from marble.in_process import core, core_errors
from marble.message import records, requests
from marble.message.request import core_options
from marble.nlp import ticks


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
    reopened: int

    @property
    def solved(self) -> bool:
        """Whether the tolerances, or the reduced ones, are met."""
        return self.status in (Status.SOLVED, Status.ALMOST_SOLVED)


@dataclass(frozen=True)
class Settings:
    """Settings of the loop, each by its name; further names are options of each LCQP.

    nonlinear_method: "sqpcc", the sequence of LCQPs; "slp", the same without curvature, for answers at a vertex; and to
    compare with, smooth methods that know no pairs: "penalty", "alag" (augmented Lagrangian) and "barrier", begun
    where every inequality and every side of a pair is positive. `method` is an option of each LCQP.

    curvature: "exact", "gauss_newton", "bfgs" or "none"; "automatic" takes the first of the three for which there is
    what it needs. step_tolerance: longest step of a solved point, in units of scale. feasibility_tolerance: its largest
    violation. radius: the first one of the trust region; it grows, up to 1000 times, where no point within it meets the
    linearized rows. progress: receives each Iteration.

    server: where the LCQPs are solved, each an update of a session; as in marble.solve: None is the server that
    MARBLE_SERVER names, and this process where it names none. The same bits. reopen: a session whose server is lost is
    set up again, on another one where the client knows several, and asked again; the answer counts it as reopened.
    """

    nonlinear_method: str = "sqpcc"
    curvature: str = "automatic"
    step_tolerance: float = 1e-8
    feasibility_tolerance: float = 1e-6
    radius: float = 1.0
    iteration_limit: int = 200
    time_limit_s: float = 1e9
    progress: Callable[[Iteration], object] | None = None
    server: str | Sequence[str] | marble.Client | None = None
    reopen: bool = False


def run(entry: str, problem: Mapping[str, Any], given: Mapping[str, Any], *more: Any) -> Answer:
    """Calls marble._core's function of that name; closes its sessions at the end.

    given: settings and options of each LCQP, by their names.
    """
    names = [field.name for field in fields(Settings)]
    settings = Settings(**{name: given[name] for name in names if name in given})
    options = core_options(requests.merged({}, {name: given[name] for name in given if name not in names}, names))
    progress = settings.progress
    report = None if progress is None else lambda *row: progress(Iteration(*row))
    main_thread = threading.get_ident() == threading.main_thread().ident
    with contextlib.ExitStack() as opened:
        sessions = ticks.ticks_of(settings.server, opened, settings.reopen)
        with core_errors():
            values = getattr(core(), entry)(problem, vars(settings), options, report, sessions, main_thread, *more)
    return records.of_core(Answer, values)
