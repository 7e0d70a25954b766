"""Calls of a client take a problem's data as marble.solve does."""

from __future__ import annotations

import asyncio
import inspect

import numpy as np
import pytest
from support import tiny

import marble
import marble.aio

_DATA = {"Q": 2 * np.eye(2), "g": [-2, -4], "L": [1, 0], "R": [0, 1], "c0": 5.0, "z0": [0.0, 1.0], "name": "data"}


@pytest.fixture(params=["server", "local"])
def either(request, client):
    return client if request.param == "server" else marble.Client("local")


def test_a_client_takes_what_solve_takes(either):
    whole = either.solve(marble.LCQP(**_DATA))
    for answer in (either.solve(**_DATA), either.solve_async(**_DATA).result(), marble.solve(**_DATA, server=either)):
        assert answer.z.tobytes() == whole.z.tobytes() and answer.objective == whole.objective
        assert answer.problem.name == "data" and answer.options == whole.options
    limited = either.solve(2 * np.eye(2), [-2, -4], None, None, [[1, 1]], [9], [1, 0], None, [0, 1], max_iterations=7)
    assert limited.options["max_iterations"] == 7 and limited.problem.sizes == (2, 0, 1, 1)
    rows = []
    marble.solve(**_DATA, server=either, progress=rows.append, iterate_every=1)
    assert rows and any(row.z.size == 2 for row in rows)


def test_asyncio_takes_what_solve_takes(server):
    async def answers():
        async with marble.aio.Client(server.address) as client:
            return [await client.solve(**_DATA), await marble.aio.solve(**_DATA, server=client)]

    one, other = asyncio.run(answers())
    assert one.solved and one.z.tobytes() == other.z.tobytes()


def test_the_signatures_are_alike():
    ours = inspect.signature(marble.solve).parameters
    for call in (marble.Client.solve, marble.Client.solve_async, marble.aio.Client.solve, marble.aio.solve):
        theirs = inspect.signature(call).parameters
        assert {*theirs} - {"self"} == {*ours} - ({"server"} if "self" in theirs else set())
        for name in set(theirs) & set(ours) - {"server", "progress"}:
            assert (theirs[name].kind, theirs[name].default) == (ours[name].kind, ours[name].default), name


@pytest.mark.parametrize(("more", "field"), [
    ({"g": [1, 1]}, "g"), ({"A": [[1, 1]]}, "A"), ({"r": [1]}, "r"), ({"z0": [0, 0]}, "z0"), ({"c0": 1.0}, "c0"),
    ({"name": "other"}, "name")])
def test_data_beside_a_whole_problem_is_an_error(either, more, field):
    for solve in (either.solve, either.solve_async, marble.solve):
        with pytest.raises(marble.InvalidProblem, match="whole problem") as caught:
            solve(tiny(), **more)
        assert caught.value.field == field
    with pytest.raises(marble.InvalidProblem) as caught:
        either.solve(np.eye(2))
    assert caught.value.field == "g"
