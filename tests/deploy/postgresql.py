"""A real PostgreSQL, to be killed and started again."""

import pwd
import shutil
import signal
import socket
import subprocess
import tempfile
from pathlib import Path

from fleet import eventually

PROGRAMS = Path("/usr/lib/postgresql/15/bin")


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
            eventually(lambda: self.process.poll() is not None or subprocess.run(ready).returncode == 0, "an answer of PostgreSQL")
            return self.process.poll() is None
        eventually(up, "a start of PostgreSQL")

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
