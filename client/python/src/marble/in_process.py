"""marble._core, the solver in this process: how it is loaded, how its errors are raised, what it is doing, its end."""

from __future__ import annotations

import atexit
import contextlib
import functools
import importlib
import os
import threading
from collections.abc import Callable, Iterator
from typing import Any, Final

from marble import errors
from marble.errors import Cancelled, Unavailable

IN_PROCESS: Final = "in process"
_SHOWN_EVERY_S: Final = 0.5


@functools.cache
def core() -> Any:
    """marble._core; Unavailable where the package was built without it."""
    try:
        return importlib.import_module("marble._core")
    except ImportError as error:
        raise Unavailable(
            "this build of marble has no solver of its own (marble._core): install a wheel of marble-solver; in a "
            "checkout, cmake --build build/release --target marble_python, which needs pybind11; or name a server "
            f"(MARBLE_SERVER=HOST:PORT) ({error})") from None


@contextlib.contextmanager
def core_errors() -> Iterator[None]:
    """Raises marble._core's errors as this package's."""
    try:
        yield
    except core().Fault as error:
        raise errors.from_core(*error.args) from None


@contextlib.contextmanager
def showing(stop: Any, report: Any) -> Iterator[None]:
    """Meanwhile calls the method `show` of `report`, if it has one, twice a second with what the solve is doing."""
    show = getattr(report, "show", None)
    if show is None:
        yield
        return
    over = threading.Event()

    def watch(shows: Callable[[str], object]) -> None:
        while not over.wait(_SHOWN_EVERY_S):
            shows(stop.activity())

    watcher = threading.Thread(target=watch, args=(show,), name="marble-activity", daemon=True)
    watcher.start()
    try:
        yield
    finally:
        over.set()
        watcher.join()


_LONGEST_S: Final = 10.0


class _Ending:
    """Stops the solves of other threads when the interpreter exits, and waits for them.

    A thread of C++ that asks for the interpreter later is ended by Python with an exception, which aborts the process.
    """

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
