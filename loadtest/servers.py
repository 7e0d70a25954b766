"""A server of loadtest/crash_rounds, batches/run and queues, which can be stopped and started again at one address."""

import os
import signal
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/deploy"))

from fleet import BUILD, eventually  # noqa: E402


class Server:
    """flags: further ones of marble-server. stderr: as in subprocess.Popen."""

    def __init__(self, *flags, stderr=None):
        self.flags, self.stderr = flags, stderr
        with socket.create_server(("127.0.0.1", 0)) as any_port:
            self.address = f"127.0.0.1:{any_port.getsockname()[1]}"
        self.start()

    def start(self, fault=""):
        """fault: MARBLE_FAULT_POINT, where the server kills itself."""
        with tempfile.TemporaryDirectory() as folder:
            ready = Path(folder) / "addresses"
            self.process = subprocess.Popen(
                [BUILD / "bin/marble-server", "--listen", self.address, "--http", "none", "--workers", "1",
                 "--log-level", "error", "--address-file", ready, *self.flags],
                env={**os.environ, "MARBLE_FAULT_POINT": fault}, stdin=subprocess.DEVNULL, stderr=self.stderr)
            eventually(lambda: ready.exists() or self.process.poll() is not None, "a server's start")
            assert self.process.poll() is None

    def stop(self, how):
        """By a signal: SIGTERM drains the server."""
        self.process.send_signal(how)
        assert self.process.wait(timeout=120) == (0 if how == signal.SIGTERM else -how)

    def kill(self):
        """Also one that has ended by itself."""
        self.process.kill()
        self.process.wait()
