"""The table of loadtest/batches/run."""

import collections
import contextlib
import json
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import marble
from problems import change, is_right

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parents[1] / "tests/deploy")]

from fleet import BUILD, eventually  # noqa: E402
from postgresql import PostgreSQL  # noqa: E402
from servers import Server  # noqa: E402

# After which part of the problems a server stops, and how. Arrays lose them during the upload as well.
STOPS = ((0.1, signal.SIGKILL), (0.25, signal.SIGTERM), (0.4, signal.SIGKILL), (0.55, signal.SIGTERM),
         (0.7, signal.SIGKILL), (0.85, signal.SIGTERM))
# More than the kills: one that hits the same element twice is no fault of the element.
JOB_STARTS = sum(how == signal.SIGKILL for _, how in STOPS) + 1
COLUMNS = ("client", "way", "servers", "kill -9", "drains", "problems", "once", "twice", "lost", "wrong", "errors",
           "seconds", "client MB")


class CountedServer(Server):
    """A server that counts the problems it has answered."""

    def start(self):
        self.counted = 0
        super().start()

    def newly_answered(self):
        """Problems since the last call."""
        with marble.Client(self.address, wait=60) as client:
            before, self.counted = self.counted, int(client.info().counters["answered_total"])
        return self.counted - before


def peak_mb(pid):
    """Of a process that may have ended just now."""
    with contextlib.suppress(OSError, StopIteration):
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
        return 1.024e-3 * int(next(line for line in lines if line.startswith("VmHWM")).split()[1])
    return 0.0


def index_of(answer):
    """Of a line of marble, which has a file's name or JOB[INDEX]."""
    return int(Path(answer["file"]).stem if answer.get("file") else answer["name"].rstrip("]").split("[")[1])


class Client:
    """A process with one batch or array, whose lines are read as they come."""

    def __init__(self, commands):
        self.counts, self.wrong, self.errors, self.events = collections.Counter(), 0, [], {}
        self.answers, self.over, self.peak_mb = 0, False, 0.0
        self.thread = threading.Thread(target=self.run, args=(commands,))
        self.thread.start()

    def run(self, commands):
        try:
            for command in commands:
                process = subprocess.Popen([word.format(**self.events) for word in command], stdin=subprocess.DEVNULL,
                                           stdout=subprocess.PIPE, text=True)
                for line in process.stdout:
                    self.read(line)
                    if self.answers % 100 == 1:
                        self.peak_mb = max(self.peak_mb, peak_mb(process.pid))
                if process.wait() != 0:
                    self.errors.append(f"exit code {process.returncode}")
                    break
        finally:
            self.over = True

    def read(self, line):
        if not line.startswith("{"):  # of marble submit
            self.events["job"] = line.strip()
            return
        answer = json.loads(line)
        if "event" in answer:
            self.events.update({answer.pop("event"): True, **answer})
            return
        self.answers += 1
        if "error" in answer:
            self.errors.append(answer["error"])
            return
        index = answer["index"] if "index" in answer else index_of(answer)
        self.counts[index] += 1
        self.wrong += not is_right(index, answer["objective"], answer["z"])


def commands_of(client, way, addresses, count, files):
    """One after the other; {job} is the id that one of them printed."""
    if client == "C++":
        program, server = str(BUILD / "bin/marble"), ["--server", addresses]
        if way == "batch":
            return [[program, "batch", *server, "--output", "json", *sorted(map(str, files.iterdir()))]]
        return [[program, "submit", *server, "--array", str(files)],
                [program, "result", *server, "--wait", "--output", "json", "{job}"]]
    if client == "Node":
        module = BUILD / "typescript/client/ts/dist/index.js"
        return [["node", str(HERE / "client.mjs"), str(module), way, addresses, str(count)]]
    kind = "plain" if client == "Python" else "asyncio"
    return [[sys.executable, str(HERE / "client.py"), kind, way, addresses, str(count)]]


def solved(client, servers, way):
    """How many problems: those that the client has read, or of an array those that the servers have."""
    if way == "batch" or client.over:
        return client.answers
    if "job" not in client.events:
        return 0
    with marble.Client([server.address for server in servers], wait=60) as control:
        return control.jobs.get(client.events["job"]).job.array.done


def disturb(client, servers, how, done):
    """Stops a server that works for the client, and starts it again."""
    victims = eventually(lambda: client.over or [one for one in servers if one.newly_answered() > 0], "work")
    if client.over:
        return
    victim = victims[0]
    victim.stop(how)
    victim.start()
    done[how] += 1


def stored_once(servers, job, count):
    """Whether the servers have each answer of an array once."""
    with marble.Client([server.address for server in servers], wait=60) as client:
        answers = list(client.jobs.array(job))
        progress = client.jobs.get(job).job.array
    return (sorted(answer.index for answer in answers) == list(range(count))
            and [answer.sequence for answer in answers] == list(range(1, count + 1))
            and (progress.done, progress.failed) == (count, 0))


def row(client_name, way, servers, count, files):
    addresses, done = ",".join(server.address for server in servers), collections.Counter()
    began = time.monotonic()
    client = Client(commands_of(client_name, way, addresses, count, files))
    if way == "array" and client_name != "C++":
        eventually(lambda: "uploading" in client.events or client.over, "the upload")
        for victim in servers:  # one of them is receiving it
            victim.stop(signal.SIGKILL)
            victim.start()
            done[signal.SIGKILL] += 1
    for server in servers:
        server.newly_answered()
    for part, how in STOPS:
        eventually(lambda: solved(client, servers, way) >= part * count or client.over, "answers", 600)
        if client.over:
            break
        disturb(client, servers, how, done)
    client.thread.join()
    seconds = time.monotonic() - began
    job = client.events.get("job")
    if way == "array" and not (job and stored_once(servers, job, count)):
        client.errors.append("the servers do not have each answer once")
    once = sum(1 for times in client.counts.values() if times == 1)
    twice = sum(1 for times in client.counts.values() if times > 1)
    lost = count - sum(1 for index in client.counts if 0 <= index < count)
    values = (client_name, way, len(servers), done[signal.SIGKILL], done[signal.SIGTERM], count, once, twice, lost,
              client.wrong, len(client.errors), f"{seconds:.1f}", f"{client.peak_mb:.0f}")
    print("| " + " | ".join(map(str, values)) + " |", flush=True)
    for error in client.errors[:5]:
        print("   ", error, flush=True)
    return once == count and not (twice or lost or client.wrong or client.errors)


def write_files(folder, count):
    folder.mkdir()
    for index in range(count):
        (folder / f"{index:06}.json").write_text(json.dumps({
            "n": 2, **change(index), "Q": {"rows": 2, "cols": 2, "i": [0, 1], "j": [0, 1], "v": [1, 1]},
            "L": {"rows": 1, "cols": 2, "i": [0], "j": [0], "v": [1]}, "l": [0],
            "R": {"rows": 1, "cols": 2, "i": [0], "j": [1], "v": [1]}, "r": [0]}))
    return folder


def main():
    count, chosen = int(sys.argv[1]), sys.argv[2:] or ["C++", "Python", "asyncio", "Node"]
    print("| " + " | ".join(COLUMNS) + " |\n| --- | --- |" + " ---: |" * (len(COLUMNS) - 2), flush=True)
    good, database = True, None
    with tempfile.TemporaryDirectory() as folder:
        files = write_files(Path(folder) / "files", count)
        try:
            for number in (1, 3):
                if number == 3:
                    database = PostgreSQL()
                store = ["--state-dir", f"{folder}/state"]
                if database:
                    store = ["--state", database.uri, "--state-lease-s", "1"]
                servers = [CountedServer(*store, "--job-starts", str(JOB_STARTS)) for _ in range(number)]
                try:
                    for client in chosen:
                        for way in ("batch", "array"):
                            good = row(client, way, servers, count, files) and good
                finally:
                    for server in servers:
                        server.kill()
        finally:
            if database:
                database.close()
    sys.exit(0 if good else 1)


main()
