"""Three servers with one PostgreSQL behind HAProxy: jobs go through it, whichever of them is restarted or killed."""

import ctypes
import os
import signal
import socket
import threading

import marble
import pytest

from fleet import FRONT, HOSTS, Fleet, HAProxy, eventually, example
from postgresql import PROGRAMS, PostgreSQL


class Submitters:
    """Clients that submit through the proxy and fetch each answer, from start to stop(). What was refused for want of a
    store is counted and tried again, a submission by the same request id."""

    def __init__(self, problem, clients=4):
        self.problem, self.errors, self.refused, self.answered = problem, [], 0, {}
        self.stopping, self.lock = False, threading.Lock()
        self.threads = [threading.Thread(target=self.work, args=(name,), daemon=True) for name in range(clients)]
        for thread in self.threads:
            thread.start()

    def work(self, name):
        with marble.Client(FRONT) as client:
            number = 0
            while not self.stopping:
                number += 1
                try:
                    self.once(client, f"{name}-{number}")
                except (marble.Error, AssertionError) as error:
                    with self.lock:
                        self.errors.append(f"{name}-{number}: {error!r}")

    def patiently(self, call):
        while True:
            try:
                return call()
            except marble.errors.Unavailable:
                with self.lock:
                    self.refused += 1

    def once(self, client, request_id):
        job = self.patiently(lambda: client.jobs.submit(self.problem, request_id=request_id, deadline=100).job_id)
        solution = self.patiently(lambda: client.jobs.result(job, wait=True, deadline=100))
        with self.lock:
            assert job not in self.answered
            self.answered[job] = solution.objective
            assert solution.objective == pytest.approx(next(iter(self.answered.values())), rel=1e-9)

    def wait_for(self, more):
        goal = len(self.answered) + more
        eventually(lambda: len(self.answered) >= goal, f"{more} more answers; errors: {self.errors[:3]}")

    def stop(self):
        self.stopping = True
        for thread in self.threads:
            thread.join()
        return self


@pytest.fixture(scope="module")
def database():
    if not (PROGRAMS / "postgres").exists():
        pytest.skip("PostgreSQL is not installed")
    database = PostgreSQL()
    yield database
    database.close()


def on_a_machine_of_its_own():
    """As far as its name goes."""
    clone_newuts = 0x04000000
    assert ctypes.CDLL(None).unshare(clone_newuts) == 0
    socket.sethostname(f"host-{os.getpid()}")


@pytest.fixture(scope="module")
def fleet(database):
    fleet = Fleet(["--state", database.uri, "--state-lease-s", "2"], on_a_machine_of_its_own)
    yield fleet
    fleet.close()


@pytest.fixture(scope="module")
def proxy(fleet):
    proxy = HAProxy()
    yield proxy
    proxy.close()


@pytest.fixture(scope="module")
def problem():
    return example()


@pytest.fixture
def servers():
    clients = {name: marble.Client(f"{host}:50051") for name, host in HOSTS.items()}
    yield clients
    for client in clients.values():
        client.close()


ENDLESS = {"path": "paper", "polish": False, "max_iterations": 10**8, "kappa_initial": 1.0, "rho_initial": 1.0, "rho_factor": 1.00001,
           "rho_max": 1e12, "equality_tolerance": 1e-14, "inequality_tolerance": 1e-14, "complementarity_tolerance": 1e-14,
           "stationarity_tolerance": 1e-14}


def submit_endless(problem):
    """A job that ends when it is cancelled."""
    with marble.Client(FRONT) as front:
        job = front.jobs.submit(problem, options=ENDLESS).job_id
        eventually(lambda: front.jobs.get(job).job.state == marble.JobState.RUNNING, "its begin")
    return job


def is_refused(client, problem):
    try:
        client.jobs.submit(problem, deadline=100)
    except marble.errors.Unavailable:
        return True
    return False


def all_are_answered_once(database, load):
    assert load.errors == []
    eventually(lambda: database.ask("SELECT count(*) FROM marble_jobs WHERE state < 2") == "0", "the last answer")
    kept = database.ask("SELECT id FROM marble_jobs JOIN marble_answers USING (number) WHERE state = 2").split()
    assert len(kept) == len(set(kept))
    assert set(load.answered) <= set(kept)


def test_what_is_submitted_through_the_proxy_any_server_answers_for_watches_and_ends(fleet, proxy, servers, problem):
    with marble.Client(FRONT) as front:
        jobs = [front.jobs.submit(problem).job_id for _ in range(9)]
        for name in (*HOSTS, "front"):
            client = servers.get(name, front)
            objectives = {client.jobs.result(job, wait=True, deadline=100).objective for job in jobs}
            assert len(objectives) == 1
            assert {job.job_id for job in client.jobs.list().jobs} >= set(jobs)
    running = submit_endless(problem)
    runs_at = servers["a"].jobs.get(running).job.server
    for client in servers.values():
        seen = client.jobs.watch(running)
        assert any(event.rows for event in seen), "its progress comes, wherever it runs"
        seen.close()
        assert client.jobs.get(running).job.server == runs_at
    # One of these is not where it runs, whichever that is.
    servers["b"].jobs.cancel(running)
    assert servers["c"].jobs.result(running, wait=True, deadline=100).status == marble.Status.CANCELLED
    servers["a"].jobs.delete(running)
    with pytest.raises(marble.errors.NotFound):
        servers["c"].jobs.get(running)


def test_a_rolling_restart_under_load_is_seen_by_nobody_who_submits(fleet, proxy, database, problem):
    load = Submitters(problem)
    for server in fleet.servers:
        load.wait_for(20)
        proxy.take_out(server.name)
        server.stop()
        load.wait_for(20)
        server.start()
        proxy.take_in(server.name)
    load.wait_for(20)
    all_are_answered_once(database, load.stop())
    assert load.refused == 0


def test_what_a_killed_server_ran_is_taken_over_once_its_lease_is_over(fleet, proxy, database, servers, problem):
    running = [submit_endless(problem) for _ in fleet.servers]
    alive = servers["b"].jobs
    ran_at = {job: alive.get(job).job.server for job in running}
    assert len(set(ran_at.values())) == 3, "each runs one"
    fleet.servers[0].kill()
    lost = eventually(lambda: database.ask("SELECT id FROM marble_jobs WHERE lost = 1 AND state < 2"), "the lease's end")
    assert lost in running
    others = [job for job in running if job != lost]
    alive.cancel(others[0])  # there is room for it
    eventually(lambda: (job := alive.get(lost).job).state == marble.JobState.RUNNING and job.server == ran_at[others[0]], "a new run")
    for job in (others[1], lost):
        alive.cancel(job)
    for job in running:
        assert servers["c"].jobs.result(job, wait=True, deadline=100).status == marble.Status.CANCELLED
    fleet.servers[0].start()


def test_a_killed_database_loses_no_job_and_all_goes_on_when_it_is_back(fleet, proxy, database, problem):
    load = Submitters(problem)
    load.wait_for(20)
    with marble.Client(FRONT) as front:
        for how in (signal.SIGKILL, signal.SIGQUIT):  # SIGQUIT is pg_ctl stop -m immediate
            database.kill(how)
            assert front.solve(problem).status == marble.Status.SOLVED
            # Not by the load: its clients may all wait for answers, which come when the store is back.
            eventually(lambda: is_refused(front, problem), "a refusal while there is no store")
            database.start()
            load.wait_for(20)
    all_are_answered_once(database, load.stop())
