from __future__ import annotations

import asyncio
import os
import threading

import pytest
from support import Server

import marble
from marble.calls import links


class _Awaited:
    """A session of marble.aio, on a loop of its own, used as a plain one."""

    def __init__(self, address, problem, client_options, **more):
        self._loop = asyncio.new_event_loop()
        threading.Thread(target=self._loop.run_forever, daemon=True).start()

        async def opened():
            self._client = marble.aio.Client(address, **client_options)
            return await self._client.session(problem, **more).__aenter__()

        self._session = self._run(opened())

    def _run(self, what):
        return asyncio.run_coroutine_threadsafe(what, self._loop).result(60)

    def __getattr__(self, name):
        found = getattr(self._session, name)
        if not asyncio.iscoroutinefunction(found):
            return found
        return lambda *arguments, **more: self._run(found(*arguments, **more))

    def end(self):
        self._run(self._session.close())
        self._run(self._client.close())
        self._loop.call_soon_threadsafe(self._loop.stop)


class _Plain:
    def __init__(self, address, problem, client_options, **more):
        self._client = marble.Client(address, **client_options)
        self._session = self._client.session(problem, **more)

    def __getattr__(self, name):
        return getattr(self._session, name)

    def end(self):
        self._session.close()
        self._client.close()


@pytest.fixture(autouse=True)
def _no_environment(monkeypatch):
    for name in list(os.environ):
        if name.startswith("MARBLE_") and not name.endswith("_BINARY"):
            monkeypatch.delenv(name)


@pytest.fixture(scope="session")
def server(tmp_path_factory):
    one = Server(tmp_path_factory.mktemp("server"), "--workers", "2")
    yield one
    assert one.stop() == 0


@pytest.fixture(params=["thread", "loop"])
def way_of_sessions(request, monkeypatch):
    """Sessions have a thread each while there are few of them, and share a loop from then on."""
    if request.param == "loop":
        monkeypatch.setattr(links, "_THREADS", threading.BoundedSemaphore(0))


@pytest.fixture
def start_server(tmp_path):
    """Starts servers of a test's own; they end with it."""
    started = []

    def start(*flags, **more):
        started.append(Server(tmp_path, *flags, **more))
        return started[-1]

    yield start
    for one in started:
        one.kill()


@pytest.fixture
def client(server):
    with marble.Client(server.address) as one:
        yield one


@pytest.fixture(params=[_Plain, _Awaited], ids=["plain", "asyncio"])
def open_session(request):
    opened = []

    def begin(address, problem, client_options=None, **more):
        opened.append(request.param(address, problem, client_options or {}, **more))
        return opened[-1]

    yield begin
    for one in opened:
        one.end()
