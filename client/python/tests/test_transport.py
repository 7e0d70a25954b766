"""One interface for calls in this process and on servers, for threads and for asyncio."""

from __future__ import annotations

import asyncio
import inspect

import pytest
from support import tiny

import marble
import marble.aio
from marble.aio.local import AioLocalTransport
from marble.aio.remote import AioRemoteTransport
from marble.transport.local import LocalTransport
from marble.transport.remote import RemoteTransport
from marble.transport.transport import Transport


def public(kind: type) -> set[str]:
    return {name for name, value in vars(kind).items() if callable(value) and not name.startswith("_")}


@pytest.mark.parametrize("kind", [LocalTransport, RemoteTransport])
def test_a_transport_for_threads_has_every_call(kind):
    assert public(Transport) - public(kind) <= {"coordinate"}, "run() is coordinate() where this process solves"


@pytest.mark.parametrize("kind", [AioLocalTransport, AioRemoteTransport])
def test_a_transport_for_asyncio_has_every_call_that_its_client_makes(kind):
    assert public(Transport) - public(kind) == {"start", "subproblems"}


@pytest.mark.parametrize(("threads", "aio"), [(marble.Client, marble.aio.Client), (marble.Jobs, marble.aio.Jobs)],
                         ids=["client", "jobs"])
def test_the_clients_have_the_same_methods_with_the_same_parameters(threads, aio):
    own = public(threads) - {"solve_async"}
    assert own == public(aio)
    for name in own - {"batch", "session"}:
        ours, theirs = (inspect.signature(getattr(kind, name)) for kind in (threads, aio))
        assert ours == theirs, name
        assert name == "close" or getattr(aio, name).__doc__ == getattr(threads, name).__doc__


@pytest.mark.parametrize("address", ["local", None])
def test_an_invalid_argument_of_an_awaited_call_is_raised_by_the_await(server, address):
    async def scenario():
        async with marble.aio.Client(address or server.address) as client:
            results = await asyncio.gather(client.solve(tiny(), num_starts=0), client.solve(3), client.solve(tiny()),
                                           return_exceptions=True)
            assert [type(result) for result in results] == [marble.InvalidArgument, marble.InvalidProblem,
                                                            marble.Solution]

    asyncio.run(scenario())


def test_asyncio_refuses_to_coordinate_blocks_on_servers(server):
    async def scenario():
        async with marble.aio.Client(server.address) as client:
            with pytest.raises(marble.InvalidArgument, match="sessions"):
                await client.coupled([tiny()], [None], [], sessions=True)

    asyncio.run(scenario())


@pytest.mark.parametrize("ask", [lambda client: client.info(), lambda client: client.jobs.list(),
                                 lambda client: list(client.watch()), lambda client: list(client.jobs.array("id")),
                                 lambda client: client.jobs.submit(tiny())])
def test_without_a_server_its_own_calls_are_unavailable(ask):
    with marble.Client("local") as client, pytest.raises(marble.Unavailable, match="no server"):
        ask(client)
