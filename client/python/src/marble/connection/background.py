"""One event loop of asyncio's on a thread of its own, for what would else take a thread each."""

from __future__ import annotations

import asyncio
import atexit
import os
import threading
from collections.abc import Callable, Coroutine
from typing import Any, Final, TypeVar

Result = TypeVar("Result")
_END_S: Final = 1.0


class Background:
    """A loop that runs until the process ends. Its methods may be called by any other thread."""

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        # gRPC's poller wakes all loops of a process for an event of one, and those with nothing to read say so loudly.
        self._loop.set_exception_handler(_unless_blocking)
        self._tasks: set[asyncio.Task[Any]] = set()  # a loop alone holds none of them
        self._thread = threading.Thread(target=self._loop.run_forever, name="marble-sessions", daemon=True)
        self._thread.start()
        atexit.register(self._end)

    def soon(self, function: Callable[..., object], *arguments: Any) -> None:
        """Calls it on the loop, and does not wait for that."""
        self._loop.call_soon_threadsafe(function, *arguments)

    def run(self, work: Coroutine[Any, Any, Result]) -> Result:
        """What the coroutine returns, which runs on the loop."""
        return asyncio.run_coroutine_threadsafe(work, self._loop).result()

    def keep(self, work: Coroutine[Any, Any, object]) -> None:
        """Runs it on the loop, of which this is the thread, to its end."""
        task = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _end(self) -> None:
        self.soon(self._loop.stop)
        self._thread.join(_END_S)


def _unless_blocking(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    if not isinstance(context.get("exception"), BlockingIOError):
        loop.default_exception_handler(context)


_access = threading.Lock()
_shared: Background | None = None


def shared() -> Background:
    """That of this process, which begins with the first who asks for it."""
    global _shared
    with _access:
        if _shared is None:
            _shared = Background()
        return _shared


def _forget() -> None:
    global _shared, _access
    _shared, _access = None, threading.Lock()


os.register_at_fork(after_in_child=_forget)
