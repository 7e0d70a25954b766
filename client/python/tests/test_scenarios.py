"""Client.scenarios: two-stage problems with scenarios."""

from __future__ import annotations

import asyncio
import math

import numpy as np
import pytest
from support import tiny

import marble

EVEN = [[float(demand)] for demand in (1, 9, 3, 7, 2, 8, 4, 6)]


def shop() -> marble.LCQP:
    """Bought for 1 each, x, and sold for 3, y: no more than demand or than was bought. Storing costs x² / 20.

    Of demand uniform in [0, 10) the best is to buy 5, at a cost of -5.
    """
    return marble.LCQP([[0.1, 0], [0, 0]], [1.0, -3.0], L=[0, -1], l=[5.0], R=[1, -1], name="shop")


def best(demands) -> float:
    """Cost of the best purchase, by trying many."""
    x = np.linspace(0, 10, 100_001)
    sold = np.minimum(x[:, None], np.ravel(demands)[None, :])
    return float((x + 0.05 * x**2 - 3 * sold.mean(axis=1)).min())


def test_arrays_of_scenarios_give_the_plan_that_is_best_in_the_mean(client):
    stages = []
    answer = client.scenarios(shop(), first_stage=[0], sampler={"l": EVEN}, max_sample_size=8, stage=stages.append)
    assert answer.end is marble.ScenarioEnd.SAMPLES and answer.status is marble.Status.SOLVED
    assert [stage.scenarios for stage in stages] == [1, 2, 4, 8] and stages == list(answer.stages)
    assert answer.scenarios == 8 and answer.x.shape == (1,) and answer.recourse.shape == (8, 1)
    assert np.isclose(answer.objective, best(EVEN), atol=1e-6)
    assert np.all(answer.recourse[:, 0] <= np.minimum(answer.x[0], np.ravel(EVEN)) + 1e-9)
    assert answer.solution.z.size == 9 and answer.violations.complementarity <= 1e-6
    assert stages[1].out_of_sample is not None and stages[1].out_of_sample.scenarios == 6
    assert stages[3].out_of_sample is None
    assert answer.job_id and client.jobs.get(answer.job_id).job.stages == answer.stages


def test_a_callable_is_asked_for_nested_scenarios_by_their_numbers(client):
    def demand(random: np.random.Generator) -> dict[str, list[float]]:
        return {"l": [random.uniform(0, 10)]}

    few = client.scenarios(shop(), first_stage=[0], sampler=demand, seed=3, max_sample_size=4)
    more = client.scenarios(shop(), first_stage=[0], sampler=demand, seed=3, max_sample_size=16)
    assert few.objective == more.stages[2].objective and few.stages[2].scenarios == 4
    again = client.scenarios(shop(), first_stage=[0], sampler=demand, seed=3, max_sample_size=16)
    np.testing.assert_array_equal(again.solution.z, more.solution.z)
    other = client.scenarios(shop(), first_stage=[0], sampler=demand, seed=4, max_sample_size=4)
    assert other.objective != few.objective


def test_the_server_draws_quantities_and_ends_when_the_interval_is_small(client):
    demand = marble.Quantity({"l": [1.0]}, "uniform", location=-5, scale=10)
    answer = client.scenarios(shop(), first_stage=[0], sampler=[demand], seed=7, initial_sample_size=16,
                              max_sample_size=1024, tolerance=0.1)
    assert answer.end is marble.ScenarioEnd.INTERVAL
    out_of_sample = answer.stages[-1].out_of_sample
    assert out_of_sample is not None and out_of_sample.half_width <= 0.1 * abs(out_of_sample.mean)
    assert abs(answer.x[0] - 5) < 2 and abs(out_of_sample.mean + 5) < 1.5
    normal = marble.Quantity({"l": [1.0]}, "normal", least=-5, most=5)
    narrow = client.scenarios(shop(), first_stage=[0], sampler=[normal], max_sample_size=32)
    assert narrow.objective < answer.objective, "who knows demand better earns more"


def test_scenarios_may_be_whole_problems_in_a_planner_s_own_terms(client):
    def whole(demand: float) -> marble.Problem:
        problem = marble.Problem(["buy", "sell"])
        problem.minimize([[0.1, 0], [0, 0]], [1.0, -3.0])
        return problem.add_pairs([0, -1], [1, -1], l=[demand])

    answer = client.scenarios(whole(5.0), first_stage=["buy"], max_sample_size=4, out_of_sample_scenarios=0,
                              sampler=lambda random: whole(random.uniform(0, 10)))
    assert answer.status is marble.Status.SOLVED and answer.scenarios == 4


def test_rows_of_the_plan_alone_that_differ_are_every_scenario_s_own(client):
    bounded = marble.LCQP([[0.1, 0], [0, 0]], [1.0, -3.0], L=[0, -1], l=[5.0], R=[1, -1], C=[-1, 0], d=[9.0])
    answer = client.scenarios(bounded, first_stage=[0], sampler={"d": [[3.0], [2.0]]}, max_sample_size=2)
    assert answer.x[0] <= 2 + 1e-9


def test_a_scenario_without_a_plan_is_named(client):
    """x >= 0, y = x + b <= d."""
    base = marble.LCQP(np.eye(2), [-1.0, 0.0], A=[1, -1], C=[[0, -1], [1, 0]], d=[1.0, 0.0])
    answer = client.scenarios(base, first_stage=[0], sampler={"b": [[0.0], [0.5], [5.0], [0.0]]})
    assert answer.end is marble.ScenarioEnd.NOT_SOLVED and not answer.solution.solved
    assert answer.infeasible == (2,) and "scenario 2" in answer.detail
    assert answer.scenarios == 2 and answer.x.size == 1, "the plan of the stage before stays"


def test_scenarios_may_be_submitted_and_asked_for_later(client):
    asked = marble.Scenarios(first_stage=[0], sampler={"l": EVEN}, max_sample_size=8)
    there = client.jobs.submit(shop(), scenarios=asked)
    answer = client.jobs.scenarios(there.job_id, wait=True)
    assert answer.scenarios == 8 and np.isclose(answer.objective, best(EVEN), atol=1e-6)
    plain = client.jobs.submit(tiny())
    with pytest.raises(marble.FailedPrecondition, match="solved alone"):
        client.jobs.scenarios(plain.job_id, wait=True)


def test_the_client_for_asyncio_has_the_same(server):
    async def ask():
        stages = []
        async with marble.aio.Client(server.address) as client:
            answer = await client.scenarios(shop(), first_stage=[0], sampler={"l": EVEN}, stage=stages.append)
            there = await client.jobs.submit(
                shop(), scenarios=marble.Scenarios(first_stage=[0], sampler={"l": EVEN}))
            return answer, stages, await client.jobs.scenarios(there.job_id, wait=True)

    answer, stages, later = asyncio.run(ask())
    assert stages == list(answer.stages) and answer.scenarios == 8
    np.testing.assert_array_equal(later.solution.z, answer.solution.z)


@pytest.mark.parametrize(("field", "asked"), [
    ("first_stage", {"first_stage": []}),
    ("first_stage", {"first_stage": [1, 0]}),
    ("sampler", {"sampler": {}}),
    ("sampler", {"sampler": {"l": EVEN, "c0": [1.0]}}),
    ("scenario[1]['l']", {"sampler": {"l": [[1.0], [math.nan]]}}),
    ("weights", {"weights": [1.0]}),
    ("sampler[0].moves['l']", {"sampler": [marble.Quantity({"l": [1.0, 2.0]})]}),
    ("distribution", {"sampler": [marble.Quantity({"l": [1.0]}, "cauchy")]}),
    ("seed", {"sampler": [marble.Quantity({"l": [1.0]})], "seed": -1}),
    ("stages", {"stages": 7}),
    ("scenarios.growth", {"growth": 1.0}),
    ("scenarios.max_sample_size", {"max_sample_size": 0}),
    ("scenarios.sampler.quantities[0].scale", {"sampler": [marble.Quantity({"l": [1.0]}, scale=-1.0)]}),
])
def test_requests_that_break_a_rule_are_named(client, field, asked):
    for one in (client, marble.Client("local")):
        with pytest.raises(marble.InvalidArgument) as caught:
            one.scenarios(shop(), **{"first_stage": [0], "sampler": {"l": EVEN}, **asked})
        assert caught.value.field == field


def test_more_scenarios_than_the_server_allows_are_refused(start_server):
    with marble.Client(start_server("--scenarios", "20").address) as client:
        with pytest.raises(marble.Refused, match="at most 20"):
            client.scenarios(shop(), first_stage=[0], sampler={"l": EVEN})
        assert client.scenarios(shop(), first_stage=[0], sampler={"l": EVEN}, max_sample_size=4).scenarios == 4


@pytest.mark.parametrize("asked", [
    {"sampler": {"l": EVEN}, "weights": np.arange(1.0, 9.0)},
    {"sampler": lambda random: {"l": [random.uniform(0, 10)]}, "seed": 3, "max_sample_size": 8},
    {"sampler": [marble.Quantity({"l": [1.0], "g": [0.0, 0.1]}, "lognormal", location=1.0, most=9.0)], "seed": 2**63,
     "max_sample_size": 8},
    {"sampler": {"d": [[3.0], [2.0]]}},
])
def test_without_a_server_they_have_the_same_bits(client, asked):
    base = marble.LCQP([[0.1, 0], [0, 0]], [1.0, -3.0], L=[0, -1], l=[5.0], R=[1, -1], C=[-1, 0], d=[9.0])
    there = client.scenarios(base, first_stage=[0], **asked)
    stages: list[marble.SampleAverageStage] = []
    rows: list[marble.Progress] = []
    here = marble.Client("local").scenarios(base, first_stage=[0], stage=stages.append, progress=rows.append, **asked)
    np.testing.assert_array_equal(here.solution.z, there.solution.z)
    np.testing.assert_array_equal(here.recourse, there.recourse)
    np.testing.assert_array_equal(here.solution.nu, there.solution.nu)
    assert (here.end, here.status, here.objective) == (there.end, there.status, there.objective)
    assert stages == list(here.stages) and rows
    def means(of):
        return [one.out_of_sample and one.out_of_sample.mean for one in of]

    assert means(stages) == means(there.stages)


def test_without_a_server_a_scenario_without_a_plan_is_named_and_what_is_wrong_too():
    local = marble.Client("local")
    base = marble.LCQP(np.eye(2), [-1.0, 0.0], A=[1, -1], C=[[0, -1], [1, 0]], d=[1.0, 0.0])
    answer = local.scenarios(base, first_stage=[0], sampler={"b": [[0.0], [0.5], [5.0], [0.0]]})
    assert answer.end is marble.ScenarioEnd.NOT_SOLVED and answer.infeasible == (2,) and answer.scenarios == 2

    def stop(_: object) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        local.scenarios(shop(), first_stage=[0], sampler={"l": EVEN}, stage=stop)
    with pytest.raises(marble.DeadlineExceeded):
        local.scenarios(shop(), first_stage=[0], sampler={"l": EVEN}, deadline=1e-9)
    late = local.scenarios(shop(), first_stage=[0], sampler={"l": EVEN}, options={"time_limit_s": 0.0})
    assert late.end is marble.ScenarioEnd.TIME_LIMIT and late.scenarios == 0 and late.x.size == 0

    async def ask() -> marble.ScenarioSolution:
        stages: list[marble.SampleAverageStage] = []
        async with marble.aio.Client("local") as client:
            answer = await client.scenarios(shop(), first_stage=[0], sampler={"l": EVEN}, stage=stages.append)
            assert stages == list(answer.stages)
            with pytest.raises(ZeroDivisionError):
                await client.scenarios(shop(), first_stage=[0], sampler={"l": EVEN}, progress=stop)
            return answer

    assert asyncio.run(ask()).scenarios == 8
