"""marble._core, the solver in this process: how it is loaded, how its errors are raised, and what it is doing."""

from __future__ import annotations

import contextlib
import functools
import importlib
import threading
from collections.abc import Callable, Iterator
from typing import Any, Final

from marble import errors
from marble.errors import Unavailable

IN_PROCESS: Final = "in process"
_SHOWN_EVERY_S: Final = 0.5


@functools.cache
def core() -> Any:
    """marble._core; Unavailable where the package was built without it."""
    try:
        return importlib.import_module("marble._core")
    except ImportError as error:
        raise Unavailable(
            "this build of marble has no solver of its own (marble._core): install a wheel of marble-solver, or build "
            f"with pybind11; or name a server (MARBLE_SERVER=HOST:PORT) ({error})") from None


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
