"""A limit of time on calls that cannot be left: what they wait for is cancelled."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from typing import Final

_LOOK_S: Final = 0.05
"""Between two looks: calls are not delayed by handing them to another thread."""


class Watchdog:
    """Calls `cancel` on a thread of its own if a watched block takes longer than its seconds, and up to 50 ms more."""

    def __init__(self, cancel: Callable[[], object]) -> None:
        self._cancel = cancel
        self._end: float | None = None
        self.has_cancelled = False
        """Whether the last block was cancelled."""
        self._is_over = threading.Event()
        threading.Thread(target=self._look, daemon=True).start()

    @contextlib.contextmanager
    def watch(self, seconds: float) -> Iterator[None]:
        """Watches the block; inf: without a limit."""
        self.has_cancelled, self._end = False, time.monotonic() + seconds
        try:
            yield
        finally:
            self._end = None

    def end(self) -> None:
        """Ends the thread."""
        self._is_over.set()

    def _look(self) -> None:
        while not self._is_over.wait(_LOOK_S):
            end = self._end
            if end is not None and time.monotonic() > end:
                self.has_cancelled, self._end = True, None
                self._cancel()
