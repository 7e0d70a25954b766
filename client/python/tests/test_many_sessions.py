"""More sessions than a connection has streams for, 1024, of which gRPC holds back what is more without a word; and no
threads for them.
"""

from __future__ import annotations

import asyncio
import contextlib
import pathlib
import subprocess
import sys

import pytest
from support import clean_environment, tiny

import marble
import marble.aio

FEW, SESSIONS = 200, 2200
FLAGS = ("--sessions", "4000", "--client-sessions", "0")


def _threads() -> int:
    return len(list(pathlib.Path("/proc/self/task").iterdir()))


def test_calls_have_room_beside_many_sessions_and_threads_do_not_grow_with_them(start_server):
    with marble.Client(start_server(*FLAGS).address) as client:
        sessions = [client.session(tiny()) for _ in range(FEW)]
        few = _threads()
        sessions += [client.session(tiny()) for _ in range(SESSIONS - FEW)]
        assert _threads() <= few + 8, "gRPC has some of its own for each connection"
        assert client.info().counters["sessions"] == SESSIONS
        assert client.solve(tiny(), deadline=60).solved
        assert all(session.update(g=[-2, -3]).solved for session in sessions)
        numbers = [session.send() for session in sessions]
        assert [session.next().sequence for session in sessions] == numbers
        for session in sessions[::2]:
            session.close()
        for session in sessions[1::2]:
            session.cancel()
        assert not any(session.is_open for session in sessions)
        assert client.session(tiny()).update().solved


def test_calls_have_room_beside_many_sessions_of_asyncio(start_server):
    async def many(address: str) -> None:
        async with marble.aio.Client(address) as client, contextlib.AsyncExitStack() as stack:
            sessions = [await stack.enter_async_context(client.session(tiny())) for _ in range(SESSIONS)]
            assert (await client.info()).counters["sessions"] == SESSIONS
            assert (await client.solve(tiny(), deadline=60)).solved
            for session in sessions:
                assert (await session.update()).solved

    asyncio.run(many(start_server(*FLAGS).address))


@pytest.mark.parametrize("end", ["", "client.close()", "del client, sessions"])
def test_a_program_ends_with_sessions_open(start_server, end):
    program = f"""
import marble, numpy as np
client = marble.Client({start_server(*FLAGS).address!r})
sessions = [client.session(marble.LCQP(np.eye(2), [-1, -1])) for _ in range(200)]
assert all(session.update().solved for session in sessions)
{end}
print("ended")
"""
    ran = subprocess.run([sys.executable, "-c", program], env=clean_environment(), capture_output=True, text=True,
                         timeout=120)
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "ended\n", "")


def test_a_loop_of_the_caller_s_beside_a_few_is_left_alone(start_server):
    program = f"""
import asyncio, marble, marble.aio, numpy as np
problem = marble.LCQP(np.eye(2), [-1, -1])
async def beside():
    async with marble.aio.Client(address) as other, other.session(problem) as session:
        for _ in range(50):
            assert (await session.update()).solved
address = {start_server(*FLAGS).address!r}
with marble.Client(address) as client:
    sessions = [client.session(problem) for _ in range(10)]
    asyncio.run(beside())
    assert all(session.update().solved for session in sessions)
print("ended")
"""
    ran = subprocess.run([sys.executable, "-c", program], env=clean_environment(), capture_output=True, text=True,
                         timeout=120)
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "ended\n", "")
