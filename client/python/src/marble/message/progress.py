"""Progress on a terminal: one line that is rewritten, or tqdm's bar where it is installed."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, TextIO

from marble.errors import InvalidArgument
from marble.model.solution import Progress

ProgressOption = bool | Callable[[Progress], object] | None
"""As calls take it: True shows a bar."""
_EVERY_S = 0.1


def described(row: Progress) -> str:
    """How far the solve is, in words: of a proof its gap, bound and nodes."""
    if row.nodes > 0:
        best = f"best {row.incumbent:.6g}, bound {row.bound:.6g}, gap {row.gap:.1e}" if math.isfinite(row.gap) else \
            f"best {row.incumbent:.6g}, no bound yet" if math.isfinite(row.incumbent) else \
            f"no point yet, bound {row.bound:.6g}"
        return f"{best}, {row.nodes} nodes, {row.open_nodes} open"
    worst = max(row.violations.equality, row.violations.inequality, row.violations.complementarity)
    return f"objective {row.objective:.6g}, violation {worst:.1e}, kkt {row.kkt_residual:.1e}"


class ProgressLine:
    """Shows the newest row of a solve on one line of a terminal, and what it is doing where that is known."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream if stream is not None else sys.stderr
        self._bar: Any = None
        self._mutex = threading.Lock()  # in process what it is doing comes from another thread than the rows
        self._row, self._doing, self._iterations = "", "", 0
        self._shown_at = -math.inf
        try:
            from tqdm.auto import tqdm
        except ImportError:
            return
        self._bar = tqdm(unit=" iterations", file=stream, leave=True)

    def __call__(self, row: Progress) -> None:
        """Takes a row."""
        with self._mutex:
            self._row, self._iterations = described(row), row.iteration
            # A tree goes on without iterations of its own, and only they make the bar draw itself.
            due = row.nodes > 0 and time.monotonic() - self._shown_at > _EVERY_S
            if due:
                self._shown_at = time.monotonic()
            self._write(refresh=due)

    def show(self, activity: str) -> None:
        """Takes in words what the solve is doing."""
        with self._mutex:
            if activity != self._doing:
                self._doing = activity
                self._write(refresh=True)

    def _write(self, refresh: bool) -> None:
        text = "; ".join(part for part in (self._doing, self._row) if part)
        if self._bar is not None:
            self._bar.set_postfix_str(text, refresh=refresh)
            self._bar.update(max(0, self._iterations - self._bar.n))
        else:
            self._stream.write(f"\r\033[K{self._iterations} iterations, {text}")
            self._stream.flush()

    def close(self) -> None:
        """Ends the line."""
        if self._bar is not None:
            self._bar.close()
        else:
            self._stream.write("\n")


def reporter(progress: ProgressOption) -> tuple[Callable[[Progress], object] | None, Callable[[], None]]:
    """What receives the rows, None for no one, and what is called at the end."""
    if progress is None or progress is False:
        return None, _nothing
    if progress is True:
        line = ProgressLine()
        return line, line.close
    if not callable(progress):
        raise InvalidArgument("progress", "must be True, False, None or callable", value=type(progress).__name__)
    return progress, _nothing


def _nothing() -> None:
    pass
