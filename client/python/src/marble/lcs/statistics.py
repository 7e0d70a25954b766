"""What a controller counts of its steps."""

from __future__ import annotations

import collections
import dataclasses
from typing import Final

import numpy as np

_WINDOW: Final = 10_000
"""Steps whose times are kept."""


@dataclasses.dataclass
class ControlStatistics:
    """Counts of a controller's steps since it was made or `clear` was called; str() has them in one line.

    The first step of a controller that was made without a state, and that after `reset`, opens the session: it has no
    deadline, and counts as late if it takes longer than others may.
    """

    rate: float
    """Hz, of the task."""
    steps: int = 0
    """Control steps."""
    late: int = 0
    """Steps that took longer than the deadline or the period."""
    fallbacks: int = 0
    """Steps whose inputs are not those of the solver's solution: those of a roll-out of it, of the last plan, moved on
    and rolled out, or, where that is not feasible, of the last plan, moved on."""
    unsolved: int = 0
    """Steps whose solve has not ended solved: stopped by the deadline, failed, or without an answer."""
    infeasible: int = 0
    """Steps without a feasible plan; they go on along the last one."""
    errors: int = 0
    """Steps whose solve raised an error, as that of a server that is lost or full."""
    last_detail: str = ""
    """Of the last step that was unsolved or infeasible: its status, and why."""
    _step_s: collections.deque[float] = dataclasses.field(default_factory=lambda: collections.deque(maxlen=_WINDOW))
    _solve_s: collections.deque[float] = dataclasses.field(default_factory=lambda: collections.deque(maxlen=_WINDOW))
    _begins: collections.deque[float] = dataclasses.field(default_factory=lambda: collections.deque(maxlen=_WINDOW))

    def add_times(self, begin: float, step_s: float, solve_s: float) -> None:
        """Records one step: when it began by a clock, in seconds, how long it took, and its solve."""
        self._begins.append(begin)
        self._step_s.append(step_s)
        self._solve_s.append(solve_s)

    @property
    def loop_rate(self) -> float:
        """Steps a second of wall time, Hz, over the last steps; nan before the second one.

        In a simulation that waits for the controller it is the speed of both.
        """
        if len(self._begins) < 2:
            return float("nan")
        return (len(self._begins) - 1) / max(self._begins[-1] - self._begins[0], 1e-9)

    def step_s(self, quantile: float = 0.5) -> float:
        """Seconds from a measurement to its inputs: the quantile in [0, 1] of the last steps; nan without any."""
        return float(np.quantile(np.array(self._step_s), quantile)) if self._step_s else float("nan")

    def solve_s(self, quantile: float = 0.5) -> float:
        """Seconds of the solves alone: the quantile in [0, 1] of the last steps; nan without any."""
        return float(np.quantile(np.array(self._solve_s), quantile)) if self._solve_s else float("nan")

    def clear(self) -> None:
        """Begins to count anew."""
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(value, collections.deque):
                value.clear()
            elif field.name != "rate":
                setattr(self, field.name, type(value)())

    def __str__(self) -> str:
        counts = ", ".join(f"{getattr(self, name)} {name}" for name in ("late", "fallbacks", "unsolved", "infeasible",
                                                                        "errors"))
        times = "; ".join(f"{name} {1e3 * of(0.5):.2f} / {1e3 * of(0.99):.2f} / {1e3 * of(1.0):.2f} ms"
                          for name, of in (("step", self.step_s), ("solve", self.solve_s)))
        return (f"{self.steps} steps for {self.rate:g} Hz at {self.loop_rate:.1f} Hz: {counts}; median / p99 / worst: "
                f"{times}")
