"""Calls whose server is lost: those that may be made twice wait for it."""

from __future__ import annotations

import asyncio
import concurrent.futures
import time

import pytest
from support import Absence, long_solve, tiny, wait_until

import marble


@pytest.fixture
def pool():
    with concurrent.futures.ThreadPoolExecutor(4) as one:
        yield one


def _lost(start_server):
    """A server that is gone, and a client that has reached it."""
    server = start_server()
    client = marble.Client(server.address)
    assert client.info().workers
    server.kill()
    return server, client


def test_calls_wait_for_a_server_that_is_started_again(start_server, pool):
    server, client = _lost(start_server)
    rows = []
    with client:
        absence = Absence(server.address)
        calls = [pool.submit(client.solve, tiny()), pool.submit(client.info),
                 pool.submit(client.solve, tiny(), progress=rows.append), pool.submit(client.jobs.submit, tiny())]
        absence.wait(3)
        absence.end()
        start_server(listen=server.address)
        solved, info, streamed, job = (call.result(60) for call in calls)
        assert solved.solved and info.workers and streamed.solved and rows
        assert client.jobs.result(job.job_id, wait=True).solved


def test_asynchronous_calls_wait_for_it_too(start_server):
    server = start_server()

    async def scenario():
        async with marble.aio.Client(server.address) as client:
            assert (await client.solve(tiny())).solved
            server.kill()
            absence = Absence(server.address)
            calls = asyncio.gather(client.solve(tiny()), client.info(), client.jobs.submit(tiny()),
                                   client.solve(tiny(), progress=lambda row: None))
            await asyncio.to_thread(absence.wait, 3)
            absence.end()
            await asyncio.to_thread(start_server, listen=server.address)
            solved, _, _, streamed = await calls
            assert solved.solved and streamed.solved

    asyncio.run(asyncio.wait_for(scenario(), 120))


def test_a_solve_under_way_begins_anew_and_may_be_stopped_there(start_server):
    server = start_server()
    problem, options = long_solve()
    with marble.Client(server.address) as client:
        handle = client.solve_async(problem, options=options)
        first = handle.job_id(60)
        assert first and wait_until(lambda: client.info().counters["running"] == 1)
        server.kill()
        start_server(listen=server.address)
        assert wait_until(lambda: client.info().counters["running"] == 1)
        assert wait_until(lambda: handle.job_id() != first)
        handle.stop()
        assert handle.result(60).status is marble.Status.CANCELLED


def test_a_solve_that_is_cancelled_does_not_wait_on(start_server):
    server = start_server()
    problem, options = long_solve()
    with marble.Client(server.address, wait=3600) as client:
        handle = client.solve_async(problem, options=options)
        assert wait_until(lambda: client.info().counters["running"] == 1)
        server.kill()
        absence = Absence(server.address)
        absence.wait()
        handle.cancel()
        with pytest.raises(marble.Cancelled):
            handle.result(60)
        absence.end()


def test_a_client_that_is_closed_does_not_wait_on(start_server, pool):
    server, client = _lost(start_server)
    with marble.Client(server.address, wait=3600) as other:
        absence = Absence(server.address)
        calls = [pool.submit(other.solve, tiny()), pool.submit(list, other.batch([tiny()]))]
        absence.wait()
        other.close()
        for call in calls:
            with pytest.raises((marble.FailedPrecondition, marble.Cancelled)):
                call.result(60)
        absence.end()
    client.close()


def test_no_call_waits_beyond_its_deadline_or_without_patience(start_server):
    _, client = _lost(start_server)
    begun = time.monotonic()
    with client, pytest.raises((marble.Unavailable, marble.DeadlineExceeded)):
        client.solve(tiny(), deadline=0.3)
    server = start_server()
    with marble.Client(server.address, wait=0) as client:
        assert client.info().workers
        server.kill()
        with pytest.raises(marble.Unavailable):
            client.info()
    assert time.monotonic() - begun < 8  # of the 10 s that calls wait else


def test_a_wrong_address_is_reported_at_once(start_server):
    server = start_server()
    server.kill()
    begun = time.monotonic()
    with marble.Client(server.address) as client, pytest.raises(marble.Unavailable):
        client.solve(tiny())
    assert time.monotonic() - begun < 5


def test_a_client_may_come_before_its_server(start_server, pool):
    server = start_server()
    server.kill()
    absence = Absence(server.address)
    with marble.Client(server.address, wait=60) as client:
        solve = pool.submit(client.solve, tiny())
        absence.wait(3)
        absence.end()
        start_server(listen=server.address)
        assert solve.result(60).solved


@pytest.mark.parametrize("wait", [-1, float("nan"), "10", True])
def test_a_time_to_wait_is_a_number_that_is_not_negative(wait):
    for kind in (marble.Client, marble.aio.Client):
        with pytest.raises(marble.InvalidArgument) as caught:
            kind("127.0.0.1:1", wait=wait)
        assert caught.value.field == "wait"
