"""Batches whose server is lost: every problem is answered once all the same."""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import queue
import signal

import pytest
from support import Absence, check, long_solve, random_problem, tiny, wait_until

import marble

COUNT = 300


def _plain(address, problems, received, **more):
    with marble.Client(address, **more) as client:
        for answer in client.batch(problems):
            received(answer)


async def _on_a_thread(problems):
    each = iter(problems)
    while (problem := await asyncio.to_thread(next, each, None)) is not None:
        yield problem


def _asynchronous(address, problems, received, **more):
    async def scenario():
        async with marble.aio.Client(address, **more) as client:
            async for answer in client.batch(_on_a_thread(problems)):
                received(answer)
                await asyncio.sleep(0)

    asyncio.run(scenario())


@pytest.fixture(params=[_plain, _asynchronous], ids=["plain", "asyncio"])
def batch(request):
    """Runs a batch on a thread: the future of its end, and the queue of its answers."""
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        def begin(address, problems, **more):
            answers = queue.Queue()
            return pool.submit(request.param, address, problems, answers.put, **more), answers

        yield begin


def _some(answers, count):
    return [answers.get(timeout=60) for _ in range(count)]


def _rest(end, answers):
    end.result(120)
    found = []
    with contextlib.suppress(queue.Empty):
        while True:
            found.append(answers.get_nowait())
    return found


def _check_all(found, count=COUNT):
    assert sorted(answer.index for answer in found) == list(range(count))
    for answer in found:
        check(random_problem(answer.index % 7), answer.result())


def _problems(count=COUNT):
    return (random_problem(index % 7) for index in range(count))


def _answered(address):
    with marble.Client(address) as client:
        return client.info().counters["answered_total"]


def test_a_batch_goes_on_once_its_server_is_there_again(batch, start_server):
    server = start_server("--batch-window", "8")
    end, answers = batch(server.address, _problems())
    found = _some(answers, 20)
    server.kill()
    absence = Absence(server.address)
    absence.wait()
    found += _some(answers, answers.qsize())
    absence.end()
    again = start_server(listen=server.address)
    answered_before = len(found)
    found += _rest(end, answers)
    _check_all(found)
    assert _answered(again.address) <= COUNT - answered_before


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_a_batch_goes_on_at_the_next_server(batch, start_server, how):
    servers = [start_server("--batch-window", "8", "--drain-grace-s", "60") for _ in range(2)]
    end, answers = batch([server.address for server in servers], _problems())
    found = _some(answers, 20)
    serving = next(server for server in servers if _answered(server.address) > 0)
    serving.process.send_signal(how)
    found += _rest(end, answers)
    _check_all(found)


def test_a_batch_goes_on_after_a_restart_by_the_book(batch, start_server):
    server = start_server("--batch-window", "8")
    end, answers = batch(server.address, _problems())
    found = _some(answers, 20)
    server.stop()
    start_server(listen=server.address)
    found += _rest(end, answers)
    _check_all(found)


def test_a_source_may_wait_for_the_answers_that_were_lost(batch, start_server):
    """The source is within its own next() when the server is lost: what is open goes first, and past it."""
    long, options = long_solve()
    server, may_go_on = start_server("--workers", "1"), queue.Queue()

    def problems():
        yield marble.BatchItem(long, options=options)
        may_go_on.get(timeout=60)
        yield tiny()

    end, answers = batch(server.address, problems())
    with marble.Client(server.address) as client:
        assert wait_until(lambda: client.info().counters["running"] == 1)
        server.kill()
        start_server("--workers", "1", listen=server.address)
        assert wait_until(lambda: client.info().counters["running"] == 1)
        job = next(job for job in client.jobs.list(states=["running"]).jobs)
        client.jobs.cancel(job.job_id)
    first, = _some(answers, 1)
    assert first.index == 0 and first.result().status is marble.Status.CANCELLED
    may_go_on.put(None)
    last, = _rest(end, answers)
    assert last.index == 1 and last.result().solved


def test_a_batch_gives_up_when_its_time_to_wait_is_over(batch, start_server):
    long, options = long_solve()
    server = start_server()
    end, _ = batch(server.address, [marble.BatchItem(long, options=options)], wait=0.3)
    with marble.Client(server.address) as client:
        assert wait_until(lambda: client.info().counters["running"] == 1)
    server.kill()
    with pytest.raises(marble.Unavailable):
        end.result(60)


def test_what_the_source_raises_is_raised_while_the_server_is_lost_too(batch, start_server):
    server, may_fail = start_server(), queue.Queue()

    def problems():
        yield tiny()
        may_fail.get(timeout=60)
        raise RuntimeError("no more")

    end, answers = batch(server.address, problems())
    _some(answers, 1)
    server.kill()
    absence = Absence(server.address)
    absence.wait()
    may_fail.put(None)
    with pytest.raises(RuntimeError, match="no more"):
        end.result(60)
    absence.end()
