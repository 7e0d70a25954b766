"""Three real servers behind a real proxy, on addresses of a network namespace: what deploy/proxies says, as it says it.

Start it by tests/deploy/run, which gives it that namespace: the addresses of the shipped files are then our own."""

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import grpc
import marble
from marble.message.requests import Call, solve
from marble.model import problem_file

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/support"))

from marble_process import MarbleProcess, eventually  # noqa: E402

BUILD = Path(os.environ["MARBLE_BUILD_DIR"])
PROXIES = ROOT / "deploy/proxies"
HOSTS = {"a": "10.0.0.11", "b": "10.0.0.12", "c": "10.0.0.13"}
FRONT = "10.0.0.10:50051"


def add_addresses():
    for host in (FRONT.split(":")[0], *HOSTS.values()):
        subprocess.run(["ip", "address", "replace", f"{host}/32", "dev", "lo"], check=True)


def example_file(name="hopper", steps=10):
    """The bytes of a problem that takes some milliseconds."""
    return subprocess.run([BUILD / "bin/marble", "example", name, "--steps", str(steps)], capture_output=True, check=True).stdout


def example(name="hopper", steps=10):
    """The same, read."""
    return problem_file.parse(example_file(name, steps))


class Server(MarbleProcess):
    def __init__(self, name, flags=(), before=None):
        self.name, self.address = name, f"{HOSTS[name]}:50051"
        self.flags, self.before = flags, before
        self.start()

    def start(self):
        super().start(BUILD / "bin/marble-server", "--listen", self.address, "--http", f"{HOSTS[self.name]}:50080",
                      "--insecure", "--allow-anonymous", "--workers", "1", "--log-level", "warn", *self.flags,
                      preexec_fn=self.before)

    def answered(self):
        with marble.Client(self.address) as client:
            return int(client.info().counters["answered_total"])

    def stop(self):
        assert super().stop(signal.SIGTERM) == 0

    def close(self):
        if self.process.poll() is None:
            self.kill()


class Fleet:
    def __init__(self, flags=(), before=None):
        add_addresses()
        self.servers = [Server(name, flags, before) for name in HOSTS]

    def answered(self):
        return [server.answered() for server in self.servers]

    def close(self):
        for server in self.servers:
            server.close()


class Proxy:
    """The engine with its file of deploy/proxies."""
    target = FRONT

    def __init__(self):
        self.folder = tempfile.TemporaryDirectory()
        self.log = open(Path(self.folder.name) / "log", "w+b")
        self.process = subprocess.Popen(self.command(), stdin=subprocess.DEVNULL, stdout=self.log, stderr=self.log)
        eventually(self.serves, "the proxy's first answer from a server")

    def serves(self):
        assert self.process.poll() is None, self.messages()
        try:
            with marble.Client(FRONT) as client:
                client.info()
            return self.sees_all()
        except marble.Error:
            return False

    def messages(self):
        return Path(self.log.name).read_text(errors="replace")

    def sees_all(self):
        return True

    def take_out(self, name):
        """New calls go elsewhere; returns when none is under way."""

    def take_in(self, name):
        """It is back."""

    def close(self):
        self.process.terminate()
        try:
            self.process.wait(timeout=10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.log.close()
        self.folder.cleanup()


class HAProxy(Proxy):
    program = "haproxy"
    SOCKET = "/run/haproxy/admin.sock"

    def command(self):
        os.makedirs(os.path.dirname(self.SOCKET), exist_ok=True)
        return ["haproxy", "-db", "-f", PROXIES / "haproxy.cfg"]

    def ask(self, command):
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as admin:
            admin.connect(self.SOCKET)
            admin.sendall(command.encode() + b"\n")
            return b"".join(iter(lambda: admin.recv(4096), b"")).decode()

    def table(self):
        lines = self.ask("show stat").lstrip("# ").splitlines()
        names = lines[0].split(",")
        rows = [dict(zip(names, line.split(","))) for line in lines[1:]]
        return {row["svname"]: row for row in rows if row.get("pxname") == "marble"}

    def sees_all(self):
        table = self.table()
        return all(table[name]["status"] == "UP" for name in HOSTS)

    def take_out(self, name):
        assert self.ask(f"set server marble/{name} state drain").strip() == ""
        eventually(lambda: self.table()[name]["scur"] == "0", "the last call's end")

    def take_in(self, name):
        self.ask(f"set server marble/{name} state ready")
        eventually(self.sees_all, "HAProxy's checks")


class Nginx(Proxy):
    program = "nginx"

    def command(self):
        self.file = Path(self.folder.name) / "nginx.conf"
        shutil.copy(PROXIES / "nginx.conf", self.file)
        return ["nginx", "-c", self.file, "-g", "daemon off;"]

    def workers(self, name=""):
        return set(subprocess.run(["pgrep", "-P", str(self.process.pid), "-f", name], capture_output=True,
                                  text=True).stdout.split())

    def leaving(self):
        """The workers that have been asked to end."""
        return self.workers("worker process is shutting down")

    def has_accepted(self, connection):
        """Whether a worker has this connection of a client's, which is the kernel's until then."""
        peer = "%s:%d" % connection.getsockname()
        return self.program in subprocess.run(["ss", "-Htnp", "dst", peer], check=True, capture_output=True, text=True).stdout

    def reload(self, text):
        self.file.write_text(text)
        old = self.workers()
        self.process.send_signal(signal.SIGHUP)
        eventually(lambda: self.workers() and not self.workers() & old, "the old workers' end")

    def take_out(self, name):
        text = self.file.read_text()
        out = re.sub(rf"(server {re.escape(HOSTS[name])}:50051[^;]*);", r"\1 down;", text)
        assert out != text
        self.reload(out)

    def take_in(self, name):
        self.reload(self.file.read_text().replace(" down;", ";"))


class QuietConnection:
    """Clients of `address` reach the front; the first of them on a connection that was made before, and has been silent."""

    def __init__(self):
        self.upstream = [socket.create_connection(FRONT.split(":"))]
        self.listening = socket.create_server(("127.0.0.1", 0))
        self.address = "127.0.0.1:%d" % self.listening.getsockname()[1]
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        while True:
            try:
                client, _ = self.listening.accept()
            except OSError:
                return
            upstream = self.upstream.pop() if self.upstream else socket.create_connection(FRONT.split(":"))
            for source, sink in ((client, upstream), (upstream, client)):
                threading.Thread(target=self.pass_on, args=(source, sink), daemon=True).start()

    @staticmethod
    def pass_on(source, sink):
        try:
            while data := source.recv(65536):
                sink.sendall(data)
            sink.shutdown(socket.SHUT_WR)
        except OSError:
            pass

    def close(self):
        self.listening.close()


class Envoy(Proxy):
    """Repeats by itself what a draining server turned away: nobody has to take it out."""
    program = "envoy"

    def command(self):
        program = shutil.which("envoy") or str(BUILD / "envoy/envoy")
        return [program, "-c", PROXIES / "envoy.yaml", "--log-level", "warning", "--concurrency", "1",
                "--base-id", str(os.getpid() % 30000)]

    def sees_all(self):
        import urllib.request
        with urllib.request.urlopen("http://127.0.0.1:9901/clusters") as answer:
            return answer.read().decode().count("::health_flags::healthy") == len(HOSTS)

    def take_in(self, name):
        eventually(self.sees_all, "Envoy's checks")


class NoProxy:
    """The client's own balancing."""
    target = ",".join(f"{host}:50051" for host in HOSTS.values())

    def take_out(self, name):
        pass

    def take_in(self, name):
        time.sleep(2)  # it looks for the server again by itself, no event shows when it has found it

    def close(self):
        pass


class Load:
    """Clients in a closed loop, from start to stop(). `repeating`: as our clients do, what was turned away is tried again;
    else each call is made once."""

    def __init__(self, target, problem, clients=6, repeating=True):
        self.errors, self.solved, self.stopping = [], 0, False
        self.lock = threading.Lock()
        work = self.repeat if repeating else self.once
        self.threads = [threading.Thread(target=work, args=(target, problem), daemon=True) for _ in range(clients)]
        for thread in self.threads:
            thread.start()

    def count(self, error):
        with self.lock:
            if error is None:
                self.solved += 1
            else:
                self.errors.append(str(error))

    def repeat(self, target, problem):
        with marble.Client(target) as client:
            while not self.stopping:
                try:
                    client.solve(problem, deadline=100).raise_if_unsolved()
                    self.count(None)
                except marble.Error as error:
                    self.count(error)

    def once(self, target, problem):
        request = solve(problem, Call())
        options = [("grpc.use_local_subchannel_pool", 1), ("grpc.enable_http_proxy", 0)]
        with grpc.insecure_channel(target, options) as channel:
            call = channel.unary_unary("/marble.v1.Solver/Solve")
            while not self.stopping:
                try:
                    call(request, timeout=100)
                    self.count(None)
                except grpc.RpcError as error:
                    self.count(f"{error.code()}: {error.details()}")

    def wait_for(self, more):
        goal = self.solved + more
        eventually(lambda: self.solved >= goal, f"{more} more answers; errors: {self.errors[:3]}")

    def run_for(self, seconds):
        time.sleep(seconds)

    @staticmethod
    def clock():
        return time.monotonic()

    def stop(self):
        self.stopping = True
        for thread in self.threads:
            thread.join()
        return self
