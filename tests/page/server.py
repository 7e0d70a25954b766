"""A marble-server with its HTTP port, and the command line to send it jobs."""

import json
import math
import os
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))

import marble_process  # noqa: E402

PATIENCE_S = 30


def eventually(condition, what):
    """See marble_process; fails after PATIENCE_S."""
    return marble_process.eventually(condition, what, PATIENCE_S)


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Server(marble_process.MarbleProcess):
    """A running server; `flags` follow --listen and --http on loopback."""

    # Options that make the solve of a chain take a million iterations: kappa = 1 and tiny steps of rho.
    ENDLESS = [word for option in ("path=paper", "polish=false", "max_iterations=1000000", "kappa_initial=1",
                                   "rho_initial=1", "rho_factor=1.00001", "rho_max=1e12",
                                   "equality_tolerance=1e-14", "inequality_tolerance=1e-14",
                                   "complementarity_tolerance=1e-14", "stationarity_tolerance=1e-14")
               for word in ("--option", option)]

    def __init__(self, binaries, *flags, http_port=0):
        self.folder = Path(tempfile.mkdtemp(prefix="marble page "))
        self.marble = str(Path(binaries) / "marble")
        self.environment = {**os.environ, "MARBLE_SERVER": "unset"}
        self.background = []
        self.log = open(self.folder / "log", "wb")
        self.start(Path(binaries) / "marble-server", "--listen", "127.0.0.1:0", "--http", f"127.0.0.1:{http_port}",
                   *flags, stdout=self.log, stderr=self.log)
        self.address, self.http = self.addresses
        self.environment["MARBLE_SERVER"] = self.address

    def run(self, *arguments, check=True, **keywords):
        """Runs `marble` with these arguments and returns its output."""
        run = subprocess.run([self.marble, *map(str, arguments)], env=self.environment, capture_output=True, text=True,
                             timeout=120, **keywords)
        assert not check or run.returncode == 0, run.stderr
        return run.stdout

    def begin(self, *arguments):
        """The same, in the background."""
        self.background.append(subprocess.Popen([self.marble, *map(str, arguments)], env=self.environment,
                                                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))

    def example(self, name, *arguments):
        """The path of a problem of `marble example`."""
        path = self.folder / f"{name}.json"
        path.write_text(self.run("example", name, *arguments))
        return path

    def tiny(self, name="tiny"):
        path = self.folder / "tiny.json"
        path.write_text(json.dumps({"name": name, "n": 2, "g": [-2, 0],
                                    "Q": {"rows": 2, "cols": 2, "i": [0, 1], "j": [0, 1], "v": [2, 2]},
                                    "L": {"rows": 1, "cols": 2, "i": [0], "j": [1], "v": [1]}, "l": [0],
                                    "R": {"rows": 1, "cols": 2, "i": [0, 0], "j": [0, 1], "v": [-1, 1]}, "r": [0]}))
        return path

    def chain(self, steps):
        """Positions x with controls u and forces f that act only at x = -0.5: 0 <= f complements x + 0.5 >= 0."""
        def matrix(rows, entries):
            return {"rows": rows, "cols": 3 * steps, **{key: [entry[at] for entry in entries] for at, key in enumerate("ijv")}}
        x = [3 * k for k in range(steps)]
        motion = [entry for k in range(steps) for entry in
                  [(k, x[k], 1), (k, x[k] + 1, -1), (k, x[k] + 2, -0.5)] + ([(k, x[k - 1], -1)] if k else [])]
        bounds = [entry for k in range(steps) for entry in [(2 * k, x[k] + 1, 1), (2 * k + 1, x[k] + 1, -1)]]
        g = [0.0] * (3 * steps)
        for k in range(steps):
            g[x[k]] = math.sin(0.1 * k)
        path = self.folder / "chain.json"
        path.write_text(json.dumps({
            "name": "chain", "n": 3 * steps, "g": g, "Q": matrix(3 * steps, [(i, i, 1) for i in range(3 * steps)]),
            "A": matrix(steps, motion), "b": [0] * steps, "C": matrix(2 * steps, bounds), "d": [1] * (2 * steps),
            "L": matrix(steps, [(k, x[k] + 2, 1) for k in range(steps)]), "l": [0] * steps,
            "R": matrix(steps, [(k, x[k], 1) for k in range(steps)]), "r": [0.5] * steps}))
        return path

    def submit(self, path, *arguments):
        return self.run("submit", path, *arguments).split()[0]

    def jobs(self, *arguments):
        return [json.loads(line) for line in self.run("jobs", "--output", "json", *arguments).splitlines()]

    def info(self):
        return json.loads(self.run("info", "--output", "json"))

    def stop(self):
        for process in self.background:
            process.kill()
            process.wait()
        if self.process.poll() is None:
            self.process.terminate()
            self.process.send_signal(2)  # no grace
            self.process.wait(PATIENCE_S)
        self.log.close()
        return self.process.returncode
