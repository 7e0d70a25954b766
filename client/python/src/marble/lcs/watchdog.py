"""A limit of time on calls that cannot be left: what they wait for is cancelled."""

from __future__ import annotations

import contextlib
import threading
import time
import weakref
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
        threading.Thread(target=_look, args=(weakref.ref(self), self._is_over), daemon=True).start()

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

    def look(self) -> None:
        """Cancels the block if it takes too long."""
        end = self._end
        if end is not None and time.monotonic() > end:
            self.has_cancelled, self._end = True, None
            self._cancel()


def _look(watchdog: weakref.ref[Watchdog], is_over: threading.Event) -> None:
    while not is_over.wait(_LOOK_S) and (one := watchdog()) is not None:
        one.look()
        del one
