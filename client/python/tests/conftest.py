from __future__ import annotations

import os
import threading

import pytest
from support import Server

import marble
from marble.calls import links


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
