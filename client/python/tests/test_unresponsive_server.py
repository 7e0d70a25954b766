"""Servers that hang, that are full, and that are gone without a word."""

from __future__ import annotations

import asyncio
import concurrent.futures
import signal
import threading
import time

import numpy as np
import pytest
import scipy.sparse as sp
from support import first_answer, long_solve, stop_all, tiny, wait_until

import marble
from marble.calls import links
from marble.connection import connect

pytestmark = pytest.mark.usefixtures("way_of_sessions")

SOON, LONG = 0.02, 60.0


def _goes_on(server):
    server.process.send_signal(signal.SIGCONT)


@pytest.mark.parametrize("reopen", [False, True])
def test_an_update_returns_in_time_and_the_next_one_works_once_the_server_goes_on(open_session, start_server, reopen):
    server = start_server()
    session = open_session(server.address, tiny(), reopen=reopen)
    assert session.update(deadline=LONG).solved
    stop_all(server.process)
    for k in range(3):
        session.prepare(g=[-2.0, -2.0])
        with pytest.raises(marble.DeadlineExceeded) as caught:
            session.update(c0=float(k), deadline=SOON)
        assert str(caught.value) == "the server did not answer within 0.12 s, 0.1 s after the deadline"
        assert session.is_open
    _goes_on(server)
    answer = session.update(deadline=LONG)  # late answers are discarded, their numbers kept
    assert answer.solved and not answer.reopened and answer.objective == pytest.approx(1.0)  # of c0 = 2
    number = session.send(c0=5.0)
    event = session.next()
    assert event.sequence == number and event.outcome.objective == pytest.approx(4.0)
    session.close()


def test_updates_that_the_server_has_no_room_for_are_kept(open_session, start_server):
    n = 30_000  # numbers of 240 kB, and a window of 64 kB
    server = start_server()
    session = open_session(server.address, marble.LCQP(sp.identity(n), np.ones(n)))
    session.update(deadline=LONG)
    stop_all(server.process)
    for k in range(4):
        session.prepare(c0=float(k))
        with pytest.raises(marble.DeadlineExceeded):
            session.update(g=np.full(n, 2.0 + k), deadline=SOON)
    _goes_on(server)
    answer = session.update(deadline=LONG)
    assert answer.objective == pytest.approx(3.0 - 12.5 * n)


def test_a_server_without_answers_is_left_after_20_updates(open_session, start_server):
    servers = [start_server() for _ in range(2)]
    session = open_session([server.address for server in servers], tiny(), answer_grace=0.02)
    assert session.update(deadline=LONG).solved
    busy = next(server for server in servers if _sessions(server))
    stop_all(busy.process)
    for k in range(20):
        with pytest.raises(marble.DeadlineExceeded):
            session.update(c0=float(k), deadline=SOON)
    answer = first_answer(session, 0.2)
    assert session.reopened == 1
    assert answer.reopened and answer.objective == pytest.approx(18.0)  # of c0 = 19
    _goes_on(busy)


def test_one_that_is_not_reopened_ends_then(open_session, start_server):
    server = start_server()
    session = open_session(server.address, tiny(), reopen=False, answer_grace=0.001)
    stop_all(server.process)
    for _ in range(20):
        with pytest.raises(marble.DeadlineExceeded):
            session.update(deadline=0.001)
    with pytest.raises(marble.Unavailable, match="left 20 updates in a row without an answer"):
        session.update(deadline=0.001)
    assert not session.is_open
    _goes_on(server)


def test_closing_does_not_wait_for_it(open_session, start_server):
    server = start_server()
    session = open_session(server.address, tiny())
    stop_all(server.process)
    with pytest.raises(marble.DeadlineExceeded):
        session.update(deadline=SOON)
    session.close()
    assert not session.is_open
    _goes_on(server)
    assert wait_until(lambda: _sessions(server) == 0)


def test_closing_does_not_wait_for_it_with_an_earlier_update_under_way(open_session, start_server):
    server = start_server()
    session = open_session(server.address, tiny())
    stop_all(server.process)
    session.send(c0=1.0)
    with pytest.raises(marble.DeadlineExceeded):
        session.update(deadline=SOON)
    session.close()
    assert not session.is_open
    _goes_on(server)


def test_a_cancelled_stream_ends_after_messages_that_no_one_read():
    cancelled = threading.Event()

    class Stream:
        def __init__(self):
            self.left = links.AHEAD + 1

        def __iter__(self):
            return self

        def __next__(self):
            self.left -= 1
            if self.left < 0:
                raise StopIteration
            if self.left == 0:
                cancelled.wait()
            return b"data"

        def add_done_callback(self, _):
            pass

        def cancel(self):
            cancelled.set()

    class Rpc:
        def duplex(self, *_):
            return Stream()

    link = links._OfThread(Rpc(), b"", lambda: None)
    assert link.receive(LONG) == b"data"
    assert wait_until(lambda: link._inbox.qsize() == links.AHEAD - 1)
    link._inbox.put(b"data")  # full
    link.cancel()
    assert wait_until(lambda: None in link._inbox.queue)
    while link.receive(LONG) is not None:
        pass


@pytest.mark.parametrize("grace", [-1, float("nan"), float("inf"), 3601, "long", None, True])
def test_a_grace_is_a_number_in_its_range(open_session, start_server, grace):
    with pytest.raises(marble.InvalidArgument) as caught:
        open_session("127.0.0.1:1", tiny(), answer_grace=grace)
    assert caught.value.field == "answer_grace"


def _sessions(server):
    with marble.Client(server.address) as client:
        return client.info().counters["sessions"]


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


@pytest.fixture
def pool():
    with concurrent.futures.ThreadPoolExecutor(1) as one:
        yield one


def test_a_server_that_is_silent_is_lost_once_it_answers_no_ping(start_server, pool):
    server = start_server("--keepalive-s", "1")
    problem, options = long_solve()
    with marble.Client(server.address, keepalive=0.5, wait=0) as client:
        solve = pool.submit(client.solve, problem, options=options)
        assert wait_until(lambda: client.info().counters["running"] == 1)
        begun = time.monotonic()
        stop_all(server.process)
        with pytest.raises(marble.Unavailable):
            solve.result(60)
        assert time.monotonic() - begun < 20  # of the 45 s that it takes else
        server.process.send_signal(signal.SIGCONT)


def test_a_session_leaves_a_server_that_is_silent(start_server):
    servers = [start_server("--keepalive-s", "1") for _ in range(2)]

    async def scenario():
        async with marble.aio.Client([server.address for server in servers], keepalive=0.5) as client, \
                client.session(tiny()) as session:
            assert (await session.update()).solved
            busy = await _busy()
            stop_all(busy.process)
            assert (await session.update()).reopened
            busy.process.send_signal(signal.SIGCONT)

    async def _busy():
        for server in servers:
            async with marble.aio.Client(server.address) as one:
                if (await one.info()).counters["sessions"]:
                    return server
        raise AssertionError

    asyncio.run(asyncio.wait_for(scenario(), 60))


def test_pings_that_are_permitted_end_nothing(start_server):
    server = start_server("--keepalive-s", "1")
    problem, options = long_solve()
    with marble.Client(server.address, keepalive=0.5, wait=0) as client:
        answer = client.solve(problem, options={**options, "time_limit_s": 3.0})  # six pings, where three are too many
        assert answer.status is marble.Status.TIME_LIMIT


@pytest.mark.parametrize(("keepalive", "silence", "answer"), [
    (None, 30_000, 15_000), ("control", 10_000, 1_000), (0.5, 500, 250)])
def test_a_channel_pings_as_it_is_configured(keepalive, silence, answer):
    options = dict(connect.target("127.0.0.1:1", connect.ConnectOptions.from_environment(keepalive=keepalive)).options)
    assert (options["grpc.keepalive_time_ms"], options["grpc.keepalive_timeout_ms"]) == (silence, answer)


@pytest.mark.parametrize("keepalive", [0, 0.1, -1, 1e9, "often", True, float("nan")])
def test_a_keepalive_is_a_number_in_its_range_or_a_preset(keepalive):
    for kind in (marble.Client, marble.aio.Client):
        with pytest.raises(marble.InvalidArgument) as caught:
            kind("127.0.0.1:1", keepalive=keepalive)
        assert caught.value.field == "keepalive"
