"""A server whose store is on a small disk, a tmpfs, that fills up: jobs are refused, all else goes on, and none is lost."""

import os
import subprocess
from pathlib import Path

import marble
import pytest

from fleet import Server, add_addresses, eventually, example
from postgresql import PROGRAMS, PostgreSQL


class Disk:
    def __init__(self, size):
        self.path = Path("/run/disk")
        self.path.mkdir(exist_ok=True)
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size},mode=755", "tmpfs", self.path], check=True)
        self.filler = self.path / "filler"

    def fill(self):
        with open(self.filler, "ab", buffering=0) as filler:
            for size in (1 << 20, 1 << 12):
                try:
                    while True:
                        filler.write(b"x" * size)
                except OSError:
                    pass
        assert os.statvfs(self.path).f_bavail == 0

    def free(self):
        self.filler.unlink()

    def close(self):
        subprocess.run(["umount", "--lazy", self.path], check=True)


@pytest.fixture
def disk(request):
    disk = Disk(request.param)
    yield disk
    disk.close()


def accepted(client, problem):
    """The job; None if it was refused for want of a store."""
    try:
        return client.jobs.submit(problem, deadline=100).job_id
    except marble.errors.Unavailable:
        return None


def fills_up(disk, flags, restored=lambda: None):
    add_addresses()
    server, problem = Server("a", flags), example()
    try:
        with marble.Client(server.address) as client:
            jobs = [accepted(client, problem) for _ in range(5)]
            assert None not in jobs
            disk.fill()
            while job := accepted(client, problem):  # what room there is within the store's files
                jobs.append(job)
            assert client.solve(problem).status == marble.Status.SOLVED
            disk.free()
            restored()
            jobs.append(eventually(lambda: accepted(client, problem), "room for a job"))
            answers = {client.jobs.result(job, wait=True, deadline=100).objective for job in jobs}
            assert len(answers) == 1
    finally:
        server.close()


@pytest.mark.parametrize("disk", ["4m"], indirect=True)
def test_a_full_disk_of_one_servers_store(disk):
    fills_up(disk, ["--state-dir", disk.path / "state"])


@pytest.mark.parametrize("disk", ["160m"], indirect=True)
@pytest.mark.skipif(not (PROGRAMS / "postgres").exists(), reason="PostgreSQL is not installed")
def test_a_full_disk_of_postgresql(disk):
    database = PostgreSQL(disk.path)
    try:
        fills_up(disk, ["--state", database.uri], lambda: database.process.poll() is None or database.start())
    finally:
        database.close()
