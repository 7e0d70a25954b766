"""A real PostgreSQL, to be killed and started again."""

import pwd
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from pathlib import Path

PROGRAMS = Path("/usr/lib/postgresql/15/bin")
PATIENCE_S = 120


class PostgreSQL:
    """A database of its own, on loopback; its files in a folder of their own below `where`, which others may look into."""

    def __init__(self, where=None):
        self.folder = tempfile.TemporaryDirectory(dir=where)
        self.data = Path(self.folder.name) / "data"
        nobody = pwd.getpwnam("nobody")  # PostgreSQL refuses to run as root
        shutil.chown(self.folder.name, nobody.pw_uid, nobody.pw_gid)
        self.user = {"user": nobody.pw_uid, "group": nobody.pw_gid, "extra_groups": [], "cwd": self.folder.name}
        subprocess.run([PROGRAMS / "initdb", "-D", self.data, "-A", "trust", "-U", "marble", "--no-sync", "-E", "UTF8"],
                       check=True, stdout=subprocess.DEVNULL, **self.user)
        with socket.create_server(("127.0.0.1", 0)) as any_port:
            self.port = any_port.getsockname()[1]
        self.uri = f"postgresql://marble@127.0.0.1:{self.port}/postgres"
        self.start()

    def start(self):
        """What a kill leaves of it may take a moment to end: it is tried until it has."""
        def up():
            self.process = subprocess.Popen(
                [PROGRAMS / "postgres", "-D", self.data, "-h", "127.0.0.1", "-p", str(self.port), "-k", "", "-c", "fsync=off"],
                stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL, **self.user)
            ready = [PROGRAMS / "pg_isready", "-q", "-h", "127.0.0.1", "-p", str(self.port)]
            while self.process.poll() is None and subprocess.run(ready).returncode != 0:
                assert time.monotonic() < end, "PostgreSQL does not answer"
                time.sleep(0.02)
            return self.process.poll() is None
        end = time.monotonic() + PATIENCE_S
        while not up():
            assert time.monotonic() < end, "PostgreSQL does not start"
            time.sleep(0.02)

    def kill(self, how=signal.SIGKILL):
        """SIGQUIT is pg_ctl stop -m immediate."""
        self.process.send_signal(how)
        self.process.wait()

    def ask(self, statement):
        return subprocess.run([PROGRAMS / "psql", self.uri, "-qAtc", statement], check=True, capture_output=True,
                              text=True).stdout.strip()

    def close(self):
        self.kill()
        self.folder.cleanup()
