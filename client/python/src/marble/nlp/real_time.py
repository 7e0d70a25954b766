"""Real-time iteration: a nonlinear plan in closed loop, by one LCQP a tick.

    with marble.nlp.RealTime(values, derivatives, x0, variables=[0, 1]) as loop:
        while True:
            loop.prepare()                      # while the measurement is on its way
            tick = loop.feedback(measurement)   # tick.x is the plan
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

import marble
from marble.base.tables import Status
from marble.calls.shift import Shift
from marble.in_process import core, core_errors
from marble.message import records
from marble.message.request import core_options
from marble.nlp import functions, ticks

_FOREVER: Final = 1e9  # seconds


@dataclass(frozen=True)
class RealTimeTick:
    """The plan after one tick, and where it is from; its fields as marble/real_time.h has them."""

    outcome: str
    status: Status
    deadline_met: bool
    why: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    nu: NDArray[np.float64]
    xi: NDArray[np.float64]
    eta: NDArray[np.float64]
    step: float
    violation: float
    b_stationary: bool | None
    ticks: int
    factorizations: int
    reopened: int


class RealTime:
    """One step a tick: of the C++ library, with Python functions. A context manager: leaving it ends its session."""

    def __init__(
        self,
        values: Callable[[NDArray[np.float64]], Mapping[str, Any]],
        derivatives: Callable[[NDArray[np.float64]], Mapping[str, Any]],
        x0: ArrayLike,
        *,
        variables: Sequence[int] = (),
        equalities: Sequence[int] = (),
        hessian: Callable[[NDArray[np.float64], functions.Multipliers], Any] | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        scale: ArrayLike | None = None,
        curvature: str = "automatic",
        diagonal: float = 0.0,
        radius: float = 1e6,
        fallback: str = "shifted",
        shift: Shift | None = None,
        server: str | Sequence[str] | marble.Client | None = None,
        reopen: bool = False,
        **options: Any,
    ) -> None:
        """A plan x0 of a problem as marble.nlp.solve has it.

        variables: each is fixed at its entry of the measurement. equalities: rows of c_E, each of which must be its
        entry, after those of the variables, in place of 0. shift: how the plan moves on from tick to tick: stretches of
        x, c_E, c_I and the pairs. fallback: what a tick returns whose LCQP has no answer: "keep", "shifted" or
        "elastic". radius: of steps, in units of scale. diagonal: added to the curvature, which cannot be "bfgs".
        server, reopen: as marble.nlp.Settings has them. options: of each LCQP.
        """
        problem = functions.problem_of(values, derivatives, hessian, x0, lower, upper, scale, None)
        settings = {"variables": list(variables), "equalities": list(equalities), "curvature": curvature,
                    "diagonal": diagonal, "radius": radius, "fallback": fallback,
                    "shift": None if shift is None else shift.blocks()}
        self._opened = contextlib.ExitStack()
        try:
            with core_errors():
                self._loop = core().RealTimeLoop(problem, settings, core_options(options),
                                               ticks.ticks_of(server, self._opened, reopen))
        except BaseException:
            self._opened.close()
            raise

    def prepare(self) -> None:
        """Moves the plan on, calls the functions there and sends all that does not depend on the measurement."""
        with core_errors():
            self._loop.prepare()

    def feedback(self, measurement: ArrayLike, deadline: float | None = None) -> RealTimeTick:
        """One LCQP: the plan's answer to a measurement, within `deadline` seconds. Prepares if that was not done."""
        with core_errors():
            values = self._loop.feedback(functions.vector(measurement), _FOREVER if deadline is None else deadline)
        return records.of_core(RealTimeTick, values)

    def restart(self, x: ArrayLike) -> None:
        """Another plan to go on from; it is not moved on first."""
        with core_errors():
            self._loop.restart(functions.vector(x))

    def close(self) -> None:
        """Ends its session."""
        self._opened.close()

    def __enter__(self) -> RealTime:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
