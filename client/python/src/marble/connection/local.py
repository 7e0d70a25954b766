"""A server of this process alone, for whoever asks for it by the address "local"."""

from __future__ import annotations

import atexit
import os
import pathlib
import shutil
import subprocess
import tempfile
import threading
import time
from typing import Final

from marble.errors import Unavailable

_STARTS_WITHIN_S: Final = 30.0
_STOPS_WITHIN_S: Final = 5.0
_PROGRAM: Final = "marble-server"


class LocalServer:
    """A `marble-server` that listens on a Unix socket of its own and ends with this process, however that ends.

    program: the server's binary, a name in PATH or a path. It takes no setting of the environment but MARBLE_WORKERS.
    Raises Unavailable if it cannot be started.
    """

    def __init__(self, program: str = _PROGRAM) -> None:
        found = shutil.which(program)
        if found is None:
            raise Unavailable(
                f"there is no {program} in PATH to start: install it, or name a server in MARBLE_SERVER "
                "or by an address (this package has no solver of its own)")
        self._owner = os.getpid()
        self._folder = pathlib.Path(tempfile.mkdtemp(prefix="marble-"))
        kept = {k: v for k, v in os.environ.items() if not k.startswith("MARBLE_") or k == "MARBLE_WORKERS"}
        ready = self._folder / "address"
        # Its standard input ends with this process, even if that is killed; Ctrl-C is for this process, not for it.
        self._process = subprocess.Popen(
            [found, "--listen", f"unix:{self._folder / 'socket'}", "--http", "none", "--stop-at-eof", "--drain-grace-s",
             "0", "--log-level", "error", "--address-file", str(ready)],
            stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, env=kept, start_new_session=True)
        end = time.monotonic() + _STARTS_WITHIN_S
        while not ready.exists():
            if self._process.poll() is not None or time.monotonic() > end:
                self.stop()
                raise Unavailable(f"{found} did not start")
            time.sleep(0.002)
        self.address: Final = ready.read_text().split()[0]

    @property
    def running(self) -> bool:
        """Whether it still answers; a fork of this process asks its parent's server."""
        return self._owner != os.getpid() or self._process.poll() is None

    def stop(self) -> None:
        """Ends it; solves that still run are given up. Only the process that started it does so."""
        if self._owner != os.getpid():
            return
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(_STOPS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        shutil.rmtree(self._folder, ignore_errors=True)


_lock = threading.Lock()
_server: LocalServer | None = None


def local_address() -> str:
    """The address of this process's own server, which the first call starts. Raises Unavailable if there is none."""
    global _server
    with _lock:
        if _server is None or not _server.running:
            if _server is not None:
                atexit.unregister(_server.stop)
                _server.stop()
            _server = LocalServer()
            atexit.register(_server.stop)
        return _server.address
