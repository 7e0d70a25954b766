"""Servers that are gone without a word."""

from __future__ import annotations

import asyncio
import concurrent.futures
import signal
import time

import pytest
from support import long_solve, stop_all, tiny, wait_until

import marble
from marble.connection import connect


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
