"""A server of loadtest/crash_rounds, batches/run and queues, which can be stopped and started again at one address."""

import os
import signal
import socket
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/deploy"))

from fleet import BUILD, MarbleProcess  # noqa: E402


class Server(MarbleProcess):
    """flags: further ones of marble-server. stderr: as in subprocess.Popen."""

    def __init__(self, *flags, stderr=None):
        self.flags, self.stderr = flags, stderr
        with socket.create_server(("127.0.0.1", 0)) as any_port:
            self.address = f"127.0.0.1:{any_port.getsockname()[1]}"
        self.start()

    def start(self, fault=""):
        """fault: MARBLE_FAULT_POINT, where the server kills itself."""
        super().start(BUILD / "bin/marble-server", "--listen", self.address, "--http", "none", "--workers", "1",
                      "--log-level", "error", *self.flags, env={**os.environ, "MARBLE_FAULT_POINT": fault},
                      stderr=self.stderr)

    def stop(self, how):
        """By a signal: SIGTERM drains the server."""
        assert super().stop(how) == (0 if how == signal.SIGTERM else -how)
