"""Progress for people: a line that is written anew, or tqdm's bar where that is installed."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, TextIO

from marble.errors import InvalidArgument
from marble.model.solution import Progress


class ProgressLine:
    """Shows the newest row of a solve on one line of a terminal."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream if stream is not None else sys.stderr
        self._bar: Any = None
        try:
            from tqdm.auto import tqdm
        except ImportError:
            return
        self._bar = tqdm(unit=" iterations", file=stream, leave=True)

    def __call__(self, row: Progress) -> None:
        """Takes a row."""
        worst = max(row.violations.equality, row.violations.inequality, row.violations.complementarity)
        text = f"objective {row.objective:.6g}, violation {worst:.1e}, kkt {row.kkt_residual:.1e}"
        if self._bar is not None:
            self._bar.set_postfix_str(text, refresh=False)
            self._bar.update(max(0, row.iteration - self._bar.n))
        else:
            self._stream.write(f"\r\033[K{row.iteration} iterations, {text}")
            self._stream.flush()

    def close(self) -> None:
        """Ends the line."""
        if self._bar is not None:
            self._bar.close()
        else:
            self._stream.write("\n")


def teller(wish: bool | Callable[[Progress], object] | None) -> tuple[Callable[[Progress], object] | None,
                                                                       Callable[[], None]]:
    """What takes the rows, None for nobody, and what is called at the end."""
    if wish is None or wish is False:
        return None, lambda: None
    if wish is True:
        line = ProgressLine()
        return line, line.close
    if not callable(wish):
        raise InvalidArgument("progress", "must be True, False, None or callable", value=type(wish).__name__)
    return wish, lambda: None
