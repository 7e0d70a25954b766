"""More sessions than a connection has streams for: 1024, of which gRPC holds back what is more without a word."""

from __future__ import annotations

import asyncio
import contextlib

from support import tiny

import marble
import marble.aio

SESSIONS = 1100
FLAGS = ("--sessions", "2000", "--client-sessions", "0")


def test_calls_have_room_beside_many_sessions(start_server):
    with marble.Client(start_server(*FLAGS).address) as client:
        sessions = [client.session(tiny()) for _ in range(SESSIONS)]
        assert client.info().counters["sessions"] == SESSIONS
        assert client.solve(tiny(), deadline=60).solved
        assert all(sessions[k].update().solved for k in (0, 99, 100, 999, 1000, SESSIONS - 1))
        for session in sessions:
            session.cancel()


def test_calls_have_room_beside_many_sessions_of_asyncio(start_server):
    async def many(address: str) -> None:
        async with marble.aio.Client(address) as client, contextlib.AsyncExitStack() as stack:
            sessions = [await stack.enter_async_context(client.session(tiny())) for _ in range(SESSIONS)]
            assert (await client.info()).counters["sessions"] == SESSIONS
            assert (await client.solve(tiny(), deadline=60)).solved
            for k in (0, 99, 100, 999, 1000, SESSIONS - 1):
                assert (await sessions[k].update()).solved

    asyncio.run(many(start_server(*FLAGS).address))
