"""Client.coupled and Client.segments: problems that rows tie together, and a long one in segments."""

from __future__ import annotations

import asyncio

import numpy as np
import pytest
from scipy import sparse

import marble


def arm(wanted: float, name: str = "") -> marble.LCQP:
    """½(force − wanted)², force ≥ 0 ⊥ gap ≥ 0, of (force, gap), where the gap costs."""
    return marble.LCQP(np.diag([1.0, 1.0]), [-wanted, 0.1], L=[[1, 0]], l=[0.0], R=[[0, 1]], r=[0.0], name=name)


def chain(steps: int) -> tuple[marble.LCQP, list[int]]:
    """x moves by u, which is pushed for at a price, towards 1; either the push or its brake is zero."""
    n = 3 * steps  # x, push, brake of each step
    A = sparse.lil_matrix((steps, n))
    g, Q = np.zeros(n), np.zeros(n)
    for k in range(steps):
        A[k, 3 * k] = -1.0
        if k:
            A[k, 3 * k - 3] = 1.0
        A[k, 3 * k + 1], A[k, 3 * k + 2] = 0.5, -0.5
        g[3 * k], Q[3 * k], Q[3 * k + 1], Q[3 * k + 2] = -1.0, 1.0, 0.1, 0.1
    push = sparse.csc_matrix((np.ones(steps), (range(steps), range(1, n, 3))), (steps, n))
    brake = sparse.csc_matrix((np.ones(steps), (range(steps), range(2, n, 3))), (steps, n))
    problem = marble.LCQP(sparse.diags(Q), g, A=A, b=np.zeros(steps), L=push, l=np.zeros(steps), R=brake,
                          r=np.zeros(steps))
    return problem, [j // 3 for j in range(n)]


FORCE = [[1.0, 0.0]]


def test_blocks_share_what_there_is_at_one_price(client):
    rows: list[marble.Progress] = []
    answer = client.coupled([arm(3.0), arm(2.0)], [FORCE, FORCE], [4.0], progress=rows.append)
    assert answer.status is marble.Status.SOLVED and answer.coordination.status is marble.Status.SOLVED
    np.testing.assert_allclose([z[0] for z in answer.z], [2.5, 1.5], atol=1e-7)
    np.testing.assert_allclose(answer.coupling_multipliers, [0.5], atol=1e-7)
    np.testing.assert_allclose(answer.solution.y[-1:], [0.5], atol=1e-7)
    assert np.isclose(answer.objective, 2.5**2 / 2 - 3 * 2.5 + 1.5**2 / 2 - 2 * 1.5)
    assert rows and rows[-1].violations.equality <= 1e-6 and rows[-1].rho > 0
    assert client.jobs.get(answer.job_id).job.kind is marble.JobKind.COUPLED


def test_a_block_that_no_row_sees_and_a_start_at_the_coupling_multipliers_are_taken(client):
    answer = client.coupled([arm(3.0), arm(2.0)], [FORCE, None], [1.0], coupling_multipliers=[2.0],
                            options={"max_iterations": 50})
    np.testing.assert_allclose([z[0] for z in answer.z], [1.0, 2.0], atol=1e-7)
    np.testing.assert_allclose(answer.coupling_multipliers, [2.0], atol=1e-7)


def test_the_block_that_has_no_answer_is_named(client):
    never = marble.LCQP(np.eye(2), [0.0, 0.0], C=[[1, 0], [-1, 0]], d=[-1.0, 0.0], name="elbow")
    answer = client.coupled([arm(3.0), never], [FORCE, FORCE], [1.0])
    assert answer.status is marble.Status.INFEASIBLE
    assert answer.coordination.failed == 1 and "block 1 (elbow)" in answer.detail


def test_a_long_problem_in_segments_is_solved_as_the_whole(client):
    problem, stages = chain(30)
    whole = client.solve(problem)
    answer = client.segments(problem, stages, 3)
    assert answer.solution.status is marble.Status.SOLVED and answer.solution.z.shape == whole.z.shape
    assert np.isclose(answer.solution.objective, whole.objective, atol=1e-7)
    assert answer.coordination.sweep_objective is not None
    assert answer.coordination.sweep_objective >= answer.solution.objective - 1e-9


def test_faults_are_named(client):
    for field, call in (
        ("blocks", lambda: client.coupled([], [], [0.0])),
        ("coupling", lambda: client.coupled([arm(1.0)], [], [0.0])),
        ("coupling[0]", lambda: client.coupled([arm(1.0)], [[[1.0]]], [0.0])),
        ("coupling_multipliers", lambda: client.coupled([arm(1.0)], [FORCE], [0.0], coupling_multipliers=[1.0, 2.0])),
        ("speed", lambda: client.coupled([arm(1.0)], [FORCE], [0.0], speed=3)),
        ("coupled", lambda: client.coupled([arm(1.0)], [FORCE], [0.0], proximal="much")),
        ("stages", lambda: client.segments(arm(1.0), [0], 1)),
    ):
        with pytest.raises(marble.InvalidArgument) as caught:
            call()
        assert caught.value.field == field
    with pytest.raises(marble.InvalidArgument, match="proximal"):
        client.coupled([arm(1.0)], [FORCE], [0.0], proximal=-1.0)
    with pytest.raises(marble.InvalidArgument, match="segments"):
        client.segments(arm(1.0), [0, 0], 2)


def test_submitted_they_answer_later_with_the_bits_of_the_call(client):
    blocks = [arm(3.0), arm(2.0)]
    there = client.jobs.submit_coupled(blocks, [FORCE, FORCE], [4.0], coupling_multipliers=[0.4], problem_name="cell")
    later = client.jobs.coupled(there.job_id, blocks, wait=True)
    now = client.coupled(blocks, [FORCE, FORCE], [4.0], coupling_multipliers=[0.4])
    assert later.coordination == now.coordination and later.job_id == there.job_id
    np.testing.assert_array_equal(later.solution.z, now.solution.z)
    np.testing.assert_array_equal(later.coupling_multipliers, now.coupling_multipliers)
    assert client.jobs.get(there.job_id).job.problem_name == "cell"
    with pytest.raises(marble.InvalidArgument) as caught:
        client.jobs.coupled(there.job_id, blocks[1:])
    assert caught.value.field == "blocks"
    problem, stages = chain(9)
    cut = client.jobs.submit_segments(problem, stages, 2, overlap=2)
    whole = client.segments(problem, stages, 2, overlap=2).solution
    np.testing.assert_array_equal(client.jobs.segments(cut.job_id, wait=True).solution.z, whole.z)
    np.testing.assert_array_equal(client.jobs.segments(cut.job_id, problem=problem).solution.s, whole.s)
    plain = client.jobs.submit(arm(1.0))
    with pytest.raises(marble.FailedPrecondition, match="solved alone"):
        client.jobs.segments(plain.job_id, wait=True)


def test_they_are_there_for_asyncio_too(server):
    async def both() -> None:
        async with marble.aio.Client(server.address) as client:
            answer = await client.coupled([arm(3.0), arm(2.0)], [FORCE, FORCE], [4.0])
            np.testing.assert_allclose(answer.coupling_multipliers, [0.5], atol=1e-7)
            problem, stages = chain(9)
            segments = await client.segments(problem, stages, 2)
            assert segments.solution.status is marble.Status.SOLVED
            there = await client.jobs.submit_coupled([arm(3.0), arm(2.0)], [FORCE, FORCE], [4.0])
            later = await client.jobs.coupled(there.job_id, [arm(3.0), arm(2.0)], wait=True)
            np.testing.assert_array_equal(later.solution.z, answer.solution.z)
            cut = await client.jobs.submit_segments(problem, stages, 2)
            later_segments = await client.jobs.segments(cut.job_id, wait=True, problem=problem)
            np.testing.assert_array_equal(later_segments.solution.z, segments.solution.z)

    asyncio.run(both())


def test_without_a_server_they_have_the_same_bits(client):
    local = marble.Client("local")
    rows: list[marble.Progress] = []
    blocks = [arm(3.0), arm(2.0, "elbow")]
    here = local.coupled(blocks, [FORCE, None], [1.0], coupling_multipliers=[1.9], max_searches=1, progress=rows.append)
    there = client.coupled(blocks, [FORCE, None], [1.0], coupling_multipliers=[1.9], max_searches=1)
    assert here.coordination == there.coordination and here.job_id == ""
    np.testing.assert_array_equal(here.solution.z, there.solution.z)
    np.testing.assert_array_equal(here.coupling_multipliers, there.coupling_multipliers)
    assert len(rows) == here.coordination.iterations and rows[-1].rho == here.coordination.proximal
    problem, stages = chain(30)
    cut = local.segments(problem, stages, 3, overlap=4)
    assert cut.coordination == client.segments(problem, stages, 3, overlap=4).coordination
    np.testing.assert_array_equal(cut.solution.z, client.segments(problem, stages, 3, overlap=4).solution.z)
    np.testing.assert_array_equal(cut.solution.s, client.segments(problem, stages, 3, overlap=4).solution.s)


def test_blocks_in_sessions_of_several_servers_agree_as_on_one(start_server):
    servers = [start_server() for _ in range(3)]
    blocks = [arm(wanted, f"arm{k}") for k, wanted in enumerate((3.0, 2.0, 1.5, 1.0))]
    with marble.Client([server.address for server in servers]) as client:
        rows: list[marble.Progress] = []
        answer = client.coupled(blocks, [FORCE] * 4, [4.0], sessions=True, problem_name="cell", progress=rows.append)
        one = marble.Client("local").coupled(blocks, [FORCE] * 4, [4.0])
        assert answer.coordination.status is marble.Status.SOLVED and answer.repeated == 0
        np.testing.assert_allclose(answer.solution.z, one.solution.z, atol=1e-7)
        np.testing.assert_allclose(answer.coupling_multipliers, one.coupling_multipliers, atol=1e-7)
        assert len(rows) == answer.coordination.iterations
        seen = []
        for server in servers:
            with marble.Client(server.address) as single:
                seen.append({job.problem_name for job in single.jobs.list().jobs})
        assert sorted(set().union(*seen)) == [f"cell arm{k}" for k in range(4)]
        assert all(not a & b for k, a in enumerate(seen) for b in seen[:k]), "each block is on one server"
        problem, stages = chain(30)
        segments = client.segments(problem, stages, 3, sessions=True)
        assert np.isclose(segments.solution.objective, client.solve(problem).objective, atol=1e-7)


def test_a_server_that_is_killed_meanwhile_costs_repeated_blocks_and_no_error(start_server):
    servers = [start_server() for _ in range(3)]

    def kill(row: marble.Progress) -> None:
        if row.iteration == 1:
            servers[1].process.kill()
            servers[1].process.wait()

    blocks = [arm(wanted) for wanted in (3.0, 2.0, 1.5, 1.0)]
    with marble.Client([server.address for server in servers]) as client:
        answer = client.coupled(blocks, [FORCE] * 4, [4.0], sessions=True, progress=kill)
    assert answer.coordination.status is marble.Status.SOLVED and answer.repeated >= 1
    one = marble.Client("local").coupled(blocks, [FORCE] * 4, [4.0])
    np.testing.assert_allclose(answer.solution.z, one.solution.z, atol=1e-7)


def test_blocks_in_sessions_end_by_what_a_callback_raises_and_by_the_time_limit(start_server):
    def stop(_: marble.Progress) -> None:
        raise ZeroDivisionError

    with marble.Client(start_server().address) as client:
        with pytest.raises(ZeroDivisionError):
            client.coupled([arm(3.0), arm(2.0)], [FORCE, FORCE], [4.0], sessions=True, progress=stop)
        late = client.coupled([arm(3.0), arm(2.0)], [FORCE, FORCE], [4.0], sessions=True, options={"time_limit_s": 0.0})
        assert late.status is marble.Status.TIME_LIMIT
    with marble.Client("127.0.0.1:1") as nobody, pytest.raises(marble.Unavailable):
        nobody.coupled([arm(3.0), arm(2.0)], [FORCE, FORCE], [4.0], sessions=True)


def test_faults_are_named_without_a_server_as_with_one(client):
    for call in (
        lambda client: client.coupled([arm(1.0)], [FORCE], [0.0], proximal=-1.0),
        lambda client: client.coupled([arm(1.0)], [FORCE], [0.0], freeze_after=0),
        lambda client: client.segments(arm(1.0), [0, 0], 2),
        lambda client: client.segments(arm(1.0), [0, 1], 2, monolithic=False),
        lambda client: client.segments(arm(1.0), [0, 1], 2, overlap=-2),
        lambda client: client.segments(arm(1.0).replaced(z0=np.zeros(2)), [0, 1], 2),
        lambda client: client.coupled([arm(1.0)], [FORCE], [0.0], options={"max_iterations": -1}),
    ):
        faults = []
        for one in (client, marble.Client("local")):
            with pytest.raises(marble.InvalidArgument) as caught:
                call(one)
            faults.append((type(caught.value), caught.value.field))
        assert faults[0] == faults[1]


def test_what_a_callback_raises_ends_them_without_a_server_too():
    def stop(_: marble.Progress) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        marble.Client("local").coupled([arm(3.0), arm(2.0)], [FORCE, FORCE], [4.0], progress=stop)

    async def both() -> None:
        async with marble.aio.Client("local") as client:
            answer = await client.coupled([arm(3.0), arm(2.0)], [FORCE, FORCE], [4.0])
            np.testing.assert_allclose(answer.coupling_multipliers, [0.5], atol=1e-7)
            problem, stages = chain(9)
            assert (await client.segments(problem, stages, 2)).solution.solved
            with pytest.raises(ZeroDivisionError):
                await client.coupled([arm(3.0), arm(2.0)], [FORCE, FORCE], [4.0], progress=stop)

    asyncio.run(both())
