"""Servers without room: what waits for it, and what does not."""

from __future__ import annotations

import asyncio
import concurrent.futures

import numpy as np
import pytest
import scipy.sparse as sp
from support import long_solve, tiny, wait_until

import marble


@pytest.fixture
def full(start_server):
    """A server whose worker is busy and whose queue is full; and what frees it."""
    server = start_server("--workers", "1", "--queue-jobs", "1", "--client-queued", "0")
    problem, options = long_solve()
    with marble.Client(server.address) as client:
        jobs = [client.jobs.submit(problem, options=options, priority="batch").job_id]
        assert wait_until(lambda: client.info().counters["running"] == 1)
        jobs.append(client.jobs.submit(problem, options=options, priority="batch").job_id)

        def free():
            for job_id in reversed(jobs):
                client.jobs.cancel(job_id)

        yield server, client, free


def _refusals(client):
    return client.info().counters["refused_total"]


def test_a_submission_waits_until_there_is_room(full):
    _, client, free = full
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        submitted = pool.submit(client.jobs.submit, tiny(), priority="batch")
        assert wait_until(lambda: _refusals(client) >= 2)
        free()
        assert client.jobs.result(submitted.result(60).job_id, wait=True).solved


def test_an_asynchronous_one_waits_too(full):
    server, client, free = full

    async def scenario():
        async with marble.aio.Client(server.address) as aio:
            submitted = asyncio.ensure_future(aio.jobs.submit(tiny(), priority="batch"))
            while _refusals(client) < 2:
                await asyncio.sleep(0.01)
            free()
            job = await submitted
            assert (await aio.jobs.result(job.job_id, wait=True)).solved

    asyncio.run(asyncio.wait_for(scenario(), 120))


def test_a_submission_with_a_deadline_is_refused_before_it(full):
    _, client, free = full
    with pytest.raises(marble.Refused) as caught:
        client.jobs.submit(tiny(), priority="batch", deadline=3.0)  # a busy machine answers within it
    assert caught.value.retry_after > 0
    with pytest.raises(marble.Refused):
        client.solve(tiny(), priority="batch")  # only what is queued anyway waits for the queue
    free()


def test_what_never_fits_is_refused_at_once(start_server):
    server = start_server("--queue-bytes", "4096")
    large = marble.LCQP(sp.eye(1000, format="csc"), np.ones(1000))

    async def scenario():
        async with marble.aio.Client(server.address) as aio:
            return [answer async for answer in aio.batch([tiny(), large, tiny()])]

    with marble.Client(server.address) as client:
        with pytest.raises(marble.Refused) as caught:
            client.jobs.submit(large)
        assert caught.value.retry_after is None
        for answers in (list(client.batch([tiny(), large, tiny()])), asyncio.run(scenario())):
            by_index = {answer.index: answer for answer in answers}
            assert by_index[0].result().solved and by_index[2].result().solved
            assert isinstance(by_index[1].error, marble.Refused)


def test_a_batch_is_held_by_a_full_queue(full):
    _, client, free = full
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        answers = pool.submit(lambda: list(client.batch([tiny()] * 20)))
        free()
        assert sorted(answer.index for answer in answers.result(60) if answer.result().solved) == list(range(20))
