"""The same for asyncio."""

from __future__ import annotations

import asyncio

import numpy as np
import pytest
import scipy.sparse as sp
from support import Relay, check, long_solve, random_problem, tiny, wait_until

import marble


def run(test):
    return asyncio.run(asyncio.wait_for(test, 120))


def test_solves_run_side_by_side_and_give_the_same_bits(server, client):
    async def scenario():
        async with marble.aio.Client(server.address) as aio:
            return await asyncio.gather(*(aio.solve(random_problem(seed)) for seed in range(12)))

    for seed, answer in enumerate(run(scenario())):
        check(random_problem(seed), answer)
        assert answer.z.tobytes() == client.solve(random_problem(seed)).z.tobytes()


def test_progress_errors_and_deadlines(server):
    async def scenario():
        rows = []
        answer = await marble.aio.solve(random_problem(1), server=server.address, progress=rows.append)
        assert answer.solved and rows
        async with marble.aio.Client(server.address) as aio:
            with pytest.raises(marble.InvalidArgument) as caught:
                await aio.solve(tiny(), options={"max_iterations": -1})
            assert caught.value.field == "max_iterations"
            problem, options = long_solve()
            with pytest.raises(marble.DeadlineExceeded):
                await aio.solve(problem, options=options, deadline=0.2)
            assert (await aio.info()).workers == 2

    run(scenario())


@pytest.mark.parametrize("progress", [None, lambda row: None])
def test_cancelling_the_task_frees_the_worker(server, client, progress):
    async def scenario():
        async with marble.aio.Client(server.address) as aio:
            problem, options = long_solve()
            task = asyncio.ensure_future(aio.solve(problem, options=options, progress=progress))
            while (await aio.info()).counters["running"] == 0:
                await asyncio.sleep(0.01)
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task

    run(scenario())
    assert wait_until(lambda: client.info().counters["running"] == 0)


def test_a_session_is_warm_and_ends_with_its_block(server, client):
    async def scenario():
        problem = random_problem(2)
        async with marble.aio.Client(server.address) as aio:
            async with aio.session(problem) as session:
                check(problem, await session.update())
                answer = await session.update(g=problem.g + 1)
                check(problem.replaced(g=problem.g + 1), answer)
                with pytest.raises(marble.InvalidProblem):
                    await session.update(g=[1])
                await session.prepare(c0=3.0)
                assert np.isclose((await session.update()).objective, 3.0 + answer.objective)
                numbers = [await session.send(c0=float(k)) for k in range(10)]
                events = [await session.next() for _ in numbers]
                assert [event.sequence for event in events] == numbers and session.job_id
            assert not session.is_open
            with pytest.raises(marble.FailedPrecondition):
                await session.update()

    run(scenario())
    assert wait_until(lambda: client.info().counters["sessions"] == 0)


def test_batches_from_plain_and_asynchronous_sources(server):
    async def source():
        for seed in range(30):
            await asyncio.sleep(0)
            yield random_problem(seed)

    async def broken():
        yield tiny()
        raise RuntimeError("no more")

    async def scenario():
        async with marble.aio.Client(server.address) as aio:
            found = {answer.index: answer.result() async for answer in aio.batch(source())}
            assert sorted(found) == list(range(30))
            check(random_problem(29), found[29])
            plain = [answer.index async for answer in aio.batch([tiny()] * 100)]
            assert sorted(plain) == list(range(100))
            with pytest.raises(RuntimeError, match="no more"):
                async for _ in aio.batch(broken()):
                    pass

    run(scenario())


def test_jobs(server):
    async def scenario():
        problem = random_problem(3)
        async with marble.aio.Client(server.address) as aio:
            job = await aio.jobs.submit(problem)
            states = [event.job.state async for event in aio.jobs.watch(job.job_id)]
            assert states[-1] is marble.JobState.FINISHED
            answer = await aio.jobs.result(job.job_id, wait=True, problem=problem)
            check(problem, answer)
            assert (await aio.jobs.get(job.job_id)).job.job_id == job.job_id
            assert (await aio.jobs.list(limit=1)).jobs[0].job_id == job.job_id
            await aio.jobs.delete(job.job_id)
            with pytest.raises(marble.NotFound):
                await aio.jobs.cancel(job.job_id)
            large, options = long_solve()
            job = await aio.jobs.submit(large, options=options)
            async for event in aio.watch():
                if event.job.job_id == job.job_id:
                    break
            await aio.jobs.delete(job.job_id)

    run(scenario())


def test_a_submission_whose_answer_got_lost_is_sent_again_and_is_one_job(server):
    large = marble.LCQP(sp.eye(1000, format="csc"), np.ones(1000))

    async def ids(aio):
        return {job.job_id for job in (await aio.jobs.list()).jobs}

    async def scenario():
        with Relay(server.address) as relay:
            async with marble.aio.Client(server.address) as near, marble.aio.Client(relay.address) as far:
                before = await ids(near)
                submitted = asyncio.ensure_future(far.jobs.submit(large))
                while await ids(near) == before:
                    await asyncio.sleep(0.01)
                relay.cut()
                job = await submitted
                assert await ids(near) - before == {job.job_id}

    run(scenario())
