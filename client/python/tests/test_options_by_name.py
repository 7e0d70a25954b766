"""Options by their names, in every call that takes options; and names that are none."""

from __future__ import annotations

import asyncio
import inspect

import numpy as np
import pytest
from support import tiny

import marble
import marble.aio
import marble.nlp
from marble.layers import Layer
from marble.model.scenarios import Scenarios


def _said(**names):
    with marble.Client("127.0.0.1:1", wait=0) as client, pytest.raises(marble.InvalidArgument) as found:
        client.solve(tiny(), **names)
    return str(found.value)


@pytest.fixture(params=["server", "local"])
def either(request, client):
    return client if request.param == "server" else marble.Client("local")


def test_calls_take_options_by_their_names(either):
    assert either.solve(tiny(), max_iterations=1).options["max_iterations"] == 1
    assert either.solve(tiny(), options={"max_iterations": 7}, max_iterations=1).options["max_iterations"] == 1
    assert either.solve(tiny(), global_search=True).options["global_search"]
    assert either.solve_async(tiny(), max_iterations=1).result().options["max_iterations"] == 1
    assert [a.result().options["max_iterations"] for a in either.batch([tiny()], max_iterations=9)] == [9]
    with either.session(tiny(), max_iterations=9) as session:
        assert session.update().options["max_iterations"] == 9
        assert session.update(g=[-2, -3], max_iterations=8).options["max_iterations"] == 8
        session.prepare(max_iterations=7)
        assert session.update().options["max_iterations"] == 7


def test_jobs_take_options_by_their_names(client):
    job = client.jobs.submit(tiny(), time_limit_s=5, max_iterations=9)
    answer = client.jobs.result(job.job_id, wait=True)
    assert (answer.options["time_limit_s"], answer.options["max_iterations"]) == (5, 9)
    array = client.jobs.submit_array([tiny()], max_iterations=9)
    assert [one.result().options["max_iterations"] for one in client.jobs.array(array.job_id)] == [9]
    with pytest.raises(marble.InvalidArgument, match="did you mean max_iterations"):
        client.jobs.submit_array([tiny()], max_iter=9)


def test_asyncio_takes_options_by_their_names(server):
    async def calls() -> None:
        async with marble.aio.Client(server.address) as client:
            assert (await client.solve(tiny(), max_iterations=9)).options["max_iterations"] == 9
            job = await client.jobs.submit(tiny(), max_iterations=9)
            assert (await client.jobs.result(job.job_id, wait=True)).options["max_iterations"] == 9
            async for answer in client.batch([tiny()], max_iterations=9):
                assert answer.result().options["max_iterations"] == 9
            async with client.session(tiny(), max_iterations=9) as session:
                assert (await session.update(max_iterations=8)).options["max_iterations"] == 8
            with pytest.raises(marble.InvalidArgument, match="did you mean max_iterations"):
                await client.solve(tiny(), max_iter=9)

    asyncio.run(calls())


def test_what_has_settings_of_its_own_takes_options_beside_them(either):
    blocks = [tiny(), tiny()]
    rows = [np.array([[1.0, 0.0]]), np.array([[1.0, 0.0]])]
    answer = either.coupled(blocks, rows, [1.0], max_iterations=30, max_feasibility_factorizations=3)
    assert answer.coordination.iterations <= 30
    with pytest.raises(marble.InvalidArgument, match="did you mean freeze_after"):
        either.coupled(blocks, rows, [1.0], freez_after=2)
    with pytest.raises(marble.InvalidArgument, match="did you mean first_stage"):
        either.scenarios(tiny(), first_stages=[0])


@pytest.mark.parametrize(("given", "meant"), [
    ("max_iter", "max_iterations"), ("maxIterations", "max_iterations"), ("time_limit", "time_limit_s"),
    ("timeout", "deadline or time_limit_s"), ("prioritys", "priority"), ("verbose", "progress"),
    ("tol", "equality_tolerance"), ("gap_tol", "relative_gap_tolerance")])
def test_a_name_that_is_no_option_is_reported_with_what_was_meant(given, meant):
    said = _said(**{given: 3})
    assert said.startswith(f"{given}: is no option; did you mean ")
    assert meant in said
    assert len(said) < 200


def test_a_name_like_no_other_says_where_all_are():
    assert _said(qqqq=1) == "qqqq: is no option; core/OPTIONS.md has all, and so has Client.info().options"
    assert _said(options={"qqqq": 1}).startswith("qqqq: is no option; core/OPTIONS.md")
    assert "did you mean max_iterations" in _said(options={"max_iter": 1})
    assert _said(options=3, max_iterations=1) == "options is int: must be a mapping of names to values"


def test_layers_and_nonlinear_problems_take_options_by_their_names():
    layer = Layer(tiny(), ["g"], max_iterations=9)
    solution, = layer.solve(layer.problems([[-2.0, -3.0]])[0])
    assert solution.options["max_iterations"] == 9
    with pytest.raises(marble.InvalidArgument, match="did you mean max_iterations"):
        Layer(tiny(), ["g"], max_iter=9)
    slope = {"gradient": np.array([2.0])}
    with pytest.raises(marble.InvalidArgument, match="did you mean equality_tolerance"):
        marble.nlp.solve(lambda x: {"objective": 2 * x[0]}, lambda x: slope, [0.0], equality_tolerence=1e-3)


def test_a_name_is_guessed_once(either):
    with pytest.raises(marble.InvalidArgument) as caught:
        either.segments(tiny(), [0, 1], 2, max_iter=3)
    assert str(caught.value).count("max_iterations") == 1


def test_methods_for_research_are_refused(either):
    with pytest.raises(marble.InvalidArgument, match=r"method.* must be marble; `marble compare`"):
        either.solve(tiny(), method="alag")
    with (pytest.raises(marble.InvalidArgument, match=r"method.* must be marble; `marble compare`"),
          either.session(tiny(), method="alag") as session):
        session.update()
    assert either.solve(tiny(), method="marble").solved


def test_no_option_has_the_name_of_an_argument(client):
    options = set(client.info().options)
    for call in (client.solve, client.solve_async, client.batch, client.session, client.jobs.submit, client.scenarios,
                 marble.solve, marble.Session.update):
        assert not options & set(inspect.signature(call).parameters)
    assert not options & set(Scenarios.__dataclass_fields__)
