"""The table of loadtest/crash_rounds."""

import collections
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import marble
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/deploy"))

from fleet import eventually  # noqa: E402
from postgresql import PostgreSQL  # noqa: E402
from servers import Server  # noqa: E402

CLIENTS = 4
PAIRS = 3
POINTS = ("before_commit", "after_commit", "before_answer", "within_answer", "any moment")
OF_THE_DATABASE = ("PostgreSQL: kill -9", "PostgreSQL: immediate")


def problem(number):
    """A point's nearest one where of each pair one side is zero, and the distance, reckoned pair by pair."""
    a = np.random.default_rng(number).normal(size=(PAIRS, 2))
    flat = a.ravel()
    first, second = np.eye(2 * PAIRS)[::2], np.eye(2 * PAIRS)[1::2]
    lost = np.minimum(a, 0.0) ** 2 + a[:, ::-1] ** 2  # by keeping this side
    lcqp = marble.LCQP(np.eye(2 * PAIRS), -flat, L=first, R=second, c0=0.5 * flat @ flat, name=str(number))
    return lcqp, 0.5 * lost.min(axis=1).sum()


class Rounds:
    def __init__(self, servers, database, seed):
        self.servers, self.database, self.random = servers, database, random.Random(seed)
        self.next, self.lock, self.answers, self.ids, self.faults = 0, threading.Lock(), {}, {}, []
        self.clients = [marble.Client([server.address for server in servers]) for _ in range(CLIENTS)]

    def again(self, call):
        """A client's patience: what is unavailable is asked for again."""
        end = time.monotonic() + 120
        while True:
            try:
                return call()
            except (marble.errors.Unavailable, marble.errors.DeadlineExceeded):
                if time.monotonic() > end:
                    raise
                time.sleep(0.02)

    def work(self, client, upto):
        while True:
            with self.lock:
                number = self.next
                if number >= upto:
                    return
                self.next += 1
            try:
                self.once(client, number)
            except (marble.Error, AssertionError) as error:
                self.faults.append(f"{number}: {error!r}")

    def once(self, client, number):
        lcqp, optimum = problem(number)
        job = self.again(lambda: client.jobs.submit(lcqp, options={"global_search": True}, request_id=f"r{number}", deadline=20).job_id)
        self.ids[number] = job
        answer = self.again(lambda: client.jobs.result(job, wait=True, deadline=20))
        self.answers[number] = answer.z
        assert abs(answer.objective - optimum) < 1e-6, f"{answer.objective} is not the optimum {optimum}"
        assert abs(lcqp.objective(answer.z) - optimum) < 1e-6

    def round(self, point, jobs):
        """Whether it died at the point that was chosen, and not only at the round's end."""
        victim = self.random.choice(self.servers)
        upto = self.next + jobs
        moment = self.next + self.random.randrange(jobs)
        if point in POINTS[:4]:
            victim.kill()
            victim.start(f"{point}:{self.random.randint(1, max(jobs // (3 * len(self.servers)), 1))}")
        threads = [threading.Thread(target=self.work, args=(client, upto)) for client in self.clients]
        for thread in threads:
            thread.start()
        died = True
        if point in POINTS[:4]:
            eventually(lambda: victim.process.poll() is not None or self.next >= upto, "the fault")
            died = victim.process.poll() is not None
        else:
            eventually(lambda: self.next >= moment, "the moment")
        if point in OF_THE_DATABASE:
            self.database.kill(signal.SIGKILL if point == OF_THE_DATABASE[0] else signal.SIGQUIT)
            self.database.start()
        else:
            victim.kill()
            victim.start()
        for thread in threads:
            thread.join()
        return died

    def judge(self):
        """Lost, answered twice, not the answer that was reported before."""
        lost = changed = 0
        for number, job in self.ids.items():
            try:
                answer = self.again(lambda: self.clients[0].jobs.result(job, wait=True, deadline=20))
                changed += not np.array_equal(answer.z, self.answers[number])
            except (marble.Error, KeyError):
                lost += 1
        twice = len(self.ids) - len(set(self.ids.values()))
        if self.database:
            twice += abs(len(self.ids) - int(self.database.ask("SELECT count(*) FROM marble_answers")))
        return lost, twice, changed


def run(name, rounds, jobs, database, folder):
    if database:
        store = ["--state", database.uri, "--state-lease-s", "1"]
        points = POINTS + OF_THE_DATABASE
    else:
        store = ["--state-dir", folder]
        points = POINTS
    servers = [Server(*store, "--result-keep-s", "86400", "--job-starts", "1000", stderr=subprocess.DEVNULL)
               for _ in range(3 if database else 1)]
    table = collections.Counter()
    all_rounds = Rounds(servers, database, 24)
    began = time.monotonic()
    try:
        for number in range(rounds):
            point = points[number % len(points)]
            table[point] += 1
            table[point, "died"] += all_rounds.round(point, jobs)
        lost, twice, changed = all_rounds.judge()
        for point in points:
            print(f"{name:<12} {point:<24} {table[point]:>6} {table[point, 'died']:>6}")
        print(f"{name:<12} {len(all_rounds.ids)} jobs accepted, {len(all_rounds.answers)} answered, {lost} lost, {twice} ids for two, "
              f"{changed} answers that changed, {len(all_rounds.faults)} faults; {time.monotonic() - began:.0f} s")
        for fault in all_rounds.faults[:10]:
            print("   ", fault)
        return not (lost or twice or changed or all_rounds.faults) and len(all_rounds.answers) == rounds * jobs
    finally:
        for server in servers:
            server.kill()


def main():
    rounds, jobs = int(sys.argv[1]), int(sys.argv[2])
    print(f"{'store':<12} {'killed at':<24} {'rounds':>6} {'there':>6}")
    with tempfile.TemporaryDirectory() as folder:
        good = run("SQLite", rounds // 2, jobs // rounds, None, f"{folder}/state")
    database = PostgreSQL()
    try:
        good = run("PostgreSQL", rounds - rounds // 2, jobs // rounds, database, None) and good
    finally:
        database.close()
    sys.exit(0 if good else 1)


main()
