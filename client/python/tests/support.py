"""A server of the tests' own, a relay to it that loses answers, problems, and an independent check of answers."""

from __future__ import annotations

import os
import pathlib
import signal
import socket
import subprocess
import threading
import time
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

import marble

SERVER = os.environ.get("MARBLE_SERVER_BINARY", "marble-server")
PROGRAM = os.environ.get("MARBLE_BINARY", "marble")


def clean_environment(**more: str) -> dict[str, str]:
    """Without what would direct the server or the client elsewhere."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith("MARBLE_")}
    return {**kept, **more}


class Server:
    """A marble-server on a free port of loopback."""

    def __init__(self, folder: pathlib.Path, *flags: str, listen: str = "127.0.0.1:0") -> None:
        file = folder / f"address-{time.monotonic_ns()}"
        self.process = subprocess.Popen(
            [SERVER, "--listen", listen, "--address-file", str(file), "--http", "none", "--log-level", "warn", *flags],
            env=clean_environment())
        end = time.monotonic() + 120
        while not (file.exists() and file.read_text().endswith("\n")):
            assert self.process.poll() is None, "the server ended at once"
            assert time.monotonic() < end, "the server did not come up"
            time.sleep(0.01)
        self.address = file.read_text().split()[0]

    def stop(self) -> int:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
        try:
            return self.process.wait(60)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return self.process.wait()

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()


def wait_until(condition, seconds: float = 120.0) -> bool:
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True


def first_answer(session, deadline: float) -> marble.Solution:
    """The answer of an update that is repeated until one comes in time."""
    answers = []

    def is_there():
        try:
            answers.append(session.update(deadline=deadline))
        except (marble.DeadlineExceeded, marble.Unavailable):
            return False
        return True

    assert wait_until(is_there)
    return answers[0]


def stop_all(process) -> None:
    """Stops a process; returns when all of its threads have stopped: until then one may still answer."""
    process.send_signal(signal.SIGSTOP)
    tasks = pathlib.Path(f"/proc/{process.pid}/task")
    assert wait_until(lambda: all((task / "stat").read_text().rpartition(")")[2].split()[0] == "T"
                                  for task in tasks.iterdir()))


def tiny() -> marble.LCQP:
    """min (z0 - 1)^2 + (z1 - 1)^2 over the two half-axes: z is (1, 0) or (0, 1), the objective 1."""
    return marble.LCQP(2 * np.eye(2), [-2, -2], L=[1, 0], R=[0, 1], c0=2.0, name="tiny")


def long_solve() -> tuple[marble.LCQP, dict[str, object]]:
    """A problem and options that keep a worker busy until somebody stops it.

    A chain of pairs, x' = x + u + f/2, 0 <= f _|_ x + 1/2 >= 0, |u| <= 1, at kappa = 1, followed in tiny steps of rho:
    each is one full Newton step along a smooth path, whatever the machine.
    """
    steps = 2000
    k = np.arange(steps)

    def rows(part: int, first: int = 0) -> sp.csc_matrix:
        where = (k[first:], 3 * k[:steps - first] + part)
        return sp.csc_matrix((np.ones(steps - first), where), shape=(steps, 3 * steps))

    x, u, f = rows(0), rows(1), rows(2)
    g = np.zeros(3 * steps)
    g[::3] = np.sin(0.1 * k)
    problem = marble.LCQP(sp.identity(3 * steps), g, A=x - u - 0.5 * f - rows(0, first=1), C=sp.vstack([u, -u]),
                          d=np.ones(2 * steps), L=f, R=x, r=np.full(steps, 0.5), name="long")
    tolerances = ("equality", "inequality", "complementarity", "stationarity")
    return problem, {"path": "paper", "polish": False, "max_iterations": 10**9, "kappa_initial": 1, "rho_initial": 1,
                     "rho_factor": 1.00001, "rho_max": 1e12, **{f"{name}_tolerance": 1e-14 for name in tolerances}}


def random_problem(seed: int) -> marble.LCQP:
    """Convex, feasible by construction, dense in parts; sizes vary with the seed."""
    random = np.random.default_rng(seed)
    n, n_e, n_i, n_c = (int(random.integers(low, high)) for low, high in ((4, 30), (0, 3), (0, 8), (0, 4)))
    root = random.normal(size=(n, n))
    feasible = random.normal(size=n)
    A, C = random.normal(size=(n_e, n)), random.normal(size=(n_i, n)) * (random.random((n_i, n)) < 0.4)
    L, R = random.normal(size=(n_c, n)), random.normal(size=(n_c, n))
    left_active = random.random(n_c) < 0.5
    gap = random.random(n_c)
    l = -L @ feasible + np.where(left_active, 0.0, gap)
    r = -R @ feasible + np.where(left_active, gap, 0.0)
    return marble.LCQP(root @ root.T / n + np.eye(n), random.normal(size=n), A=A, b=-A @ feasible, C=C,
                       d=-C @ feasible + random.random(n_i), L=L, l=l, R=R, r=r, name=f"random-{seed}")


def full(Q):
    """Both triangles of the symmetric matrix whose upper one this is."""
    return sp.csc_matrix(Q + sp.triu(Q, 1).T)


def check(problem: marble.LCQP, answer: marble.Solution, tolerance: float = 1e-6) -> None:
    """Everything that an answer says of itself, computed again from the problem's data alone."""
    z = answer.z
    s, t = problem.L @ z + problem.l, problem.R @ z + problem.r
    equality = np.abs(problem.A @ z + problem.b).max(initial=0.0)
    inequality = np.maximum(0.0, -(problem.C @ z + problem.d)).max(initial=0.0)
    complementarity = np.abs(np.minimum(s, t)).max(initial=0.0)
    assert equality <= tolerance and inequality <= tolerance and complementarity <= tolerance
    assert np.isclose(answer.violations.equality, equality, atol=1e-12)
    assert np.isclose(answer.violations.inequality, inequality, atol=1e-12)
    assert np.isclose(answer.violations.complementarity, complementarity, atol=1e-12)
    np.testing.assert_array_equal(answer.s, s)
    np.testing.assert_array_equal(answer.t, t)
    Q = full(problem.Q)
    assert np.isclose(answer.objective, 0.5 * z @ (Q @ z) + problem.g @ z + problem.c0, rtol=1e-10, atol=1e-10)
    gradient = (Q @ z + problem.g + problem.A.T @ answer.y - problem.C.T @ answer.nu - problem.L.T @ answer.xi
                - problem.R.T @ answer.eta)
    assert np.abs(gradient).max() <= 1e-5
    assert answer.nu.min(initial=0.0) >= -tolerance


class Absence:
    """Who comes to the address of a server that was lost: they are let in, and shut out at once."""

    def __init__(self, address: str) -> None:
        host, _, port = address.rpartition(":")
        self._listener = socket.create_server((host, int(port)))
        self._came = threading.Semaphore(0)
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                self._listener.accept()[0].close()
            except OSError:
                return
            self._came.release()

    def wait(self, times: int = 2) -> None:
        """Until somebody has looked for the server so often."""
        for _ in range(times):
            assert self._came.acquire(timeout=60)

    def end(self) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()


_REQUEST_BYTES = 4000  # more than a connection's beginning has, less than the requests whose answers get lost


@dataclass
class _Connection:
    client: socket.socket
    server: socket.socket
    asked: int = 0

    def close(self) -> None:
        for end in (self.client, self.server):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass


class Relay:
    """Keeps back what the server says to a request, until cut() ends the connection; later ones are passed on."""

    def __init__(self, address: str) -> None:
        host, _, port = address.rpartition(":")
        self._server = host, int(port)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._connections: list[_Connection] = []
        self._loses = True
        self.address = f"127.0.0.1:{self._listener.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
                connection = _Connection(client, socket.create_connection(self._server))
            except OSError:
                return
            self._connections.append(connection)
            for pump in (self._asks, self._answers):
                threading.Thread(target=pump, args=(connection,), daemon=True).start()

    def _asks(self, connection: _Connection) -> None:
        self._pump(connection, connection.client, connection.server)

    def _answers(self, connection: _Connection) -> None:
        self._pump(connection, connection.server, connection.client)

    def _pump(self, connection: _Connection, source: socket.socket, sink: socket.socket) -> None:
        try:
            while data := source.recv(1 << 16):
                if source is connection.client:
                    connection.asked += len(data)
                elif self._loses and connection.asked > _REQUEST_BYTES:
                    continue
                sink.sendall(data)
        except OSError:
            pass
        connection.close()

    def cut(self) -> None:
        """Ends what there is; what comes then gets its answers."""
        self._loses = False
        for connection in self._connections:
            connection.close()

    def __enter__(self) -> Relay:
        return self

    def __exit__(self, *_: object) -> None:
        self._listener.close()
        self.cut()


class Shown:
    """Takes rows, and in words what the solve is doing."""

    def __init__(self) -> None:
        self.words: list[str] = []

    def __call__(self, row: marble.Progress) -> None:
        """Takes a row."""

    def show(self, activity: str) -> None:
        """Takes what the solve is doing."""
        self.words.append(activity)
