"""Stops the solves of other threads when the interpreter exits, and waits for them.

A thread of C++ that asks for the interpreter later is ended by Python with an exception, which aborts the process.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import threading
from collections.abc import Iterator
from typing import Any, Final

from marble.errors import Cancelled

_LONGEST_S: Final = 10.0


class _Ending:
    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._stops: list[Any] = []
        self._ends = False

    @contextlib.contextmanager
    def under_way(self, stop: Any) -> Iterator[None]:
        with self._changed:
            if self._ends:
                raise Cancelled("the interpreter ends")
            self._stops.append(stop)
        try:
            yield
        finally:
            with self._changed:
                self._stops.remove(stop)
                self._changed.notify_all()

    def end(self) -> None:
        with self._changed:
            self._ends = True
            for stop in self._stops:
                stop.request()
            self._changed.wait_for(lambda: not self._stops, _LONGEST_S)


_ENDING: Final = _Ending()
atexit.register(_ENDING.end)
os.register_at_fork(after_in_child=_ENDING.__init__)  # type: ignore[misc]  # the threads stayed with the parent
under_way = _ENDING.under_way

__all__ = ["under_way"]
