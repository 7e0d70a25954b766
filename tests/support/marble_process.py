"""A marble-server that a test or a measurement starts."""

import subprocess
import tempfile
import time
from pathlib import Path


def eventually(condition, what, limit_s=120):
    """Waits for a true value of `condition()` and returns it. what: of the error, or a function that returns it."""
    end = time.monotonic() + limit_s
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > end:
            raise AssertionError(f"never happened: {what() if callable(what) else what}")
        time.sleep(0.02)


class MarbleProcess:
    """A server that listens when start() returns. addresses: of gRPC, and of HTTP where it has one."""

    def start(self, program, *flags, **popen):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "addresses"
            self.process = subprocess.Popen([program, "--address-file", file, *flags],
                                            stdin=subprocess.DEVNULL, **popen)
            eventually(lambda: file.exists() or self.process.poll() is not None, "a server's start")
            assert self.process.poll() is None, "the server ended at once"
            self.addresses = file.read_text().split()

    def stop(self, how):
        """By a signal: SIGTERM drains the server."""
        self.process.send_signal(how)
        return self.process.wait(timeout=120)

    def kill(self):
        """Also one that has ended by itself."""
        self.process.kill()
        self.process.wait()
