from __future__ import annotations

import asyncio

import numpy as np
import pytest
from support import full, random_problem

import marble


def asked(problem: marble.LCQP, **more) -> marble.SensitivityRequest:
    random = np.random.default_rng(1)
    E = np.zeros((2, problem.n))
    E[0, 0] = E[1, -1] = 1.0
    E[1, 1] = -0.5
    directions = [{"g": random.normal(size=problem.n)}, {"b": random.normal(size=problem.b.size),
                                                        "R": random.normal(size=problem.R.nnz)}]
    return marble.SensitivityRequest(**{"rows": E, "columns": True, "directions": directions,
                                        "losses": [{"z": random.normal(size=problem.n)}], **more})


def same(a: marble.SensitivityAnswer, b: marble.SensitivityAnswer) -> None:
    for one in (a, b):
        one.raise_if_undefined()
    for name in ("weak_inequalities", "biactive_pairs", "active_set_constant", "undefined_changes",
                 "undefined_gradients"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    for name in ("values", "free", "response", "z", "columns"):
        np.testing.assert_array_equal(getattr(a.rows, name), getattr(b.rows, name), err_msg=name)
    assert set(a.changes) == set(b.changes) == {"z", "y", "nu", "xi", "eta"}
    assert set(a.gradients) == set(b.gradients) == set("gbdlrQACLR")
    for part in ("changes", "gradients"):
        for name, values in getattr(a, part).items():
            np.testing.assert_array_equal(values, getattr(b, part)[name], err_msg=f"{part} {name}")
    assert (a.factorizations, a.back_substitutions) == (b.factorizations, b.back_substitutions)


PROBLEM = random_problem(3)


def test_every_call_that_solves_gives_the_bits_of_a_solve_in_process(client):
    request = asked(PROBLEM)
    here = marble.solve(PROBLEM, server="local", sensitivity=request).sensitivity
    assert here.changes["z"].shape == (2, PROBLEM.n) and here.gradients["R"].shape == (1, PROBLEM.R.nnz)
    assert here.rows.response.shape == (2, 2) and here.rows.columns.shape == (PROBLEM.n, 2)
    with marble.Client("local") as local:
        for one in (client, local):
            same(one.solve(PROBLEM, sensitivity=request).sensitivity, here)
            same(one.solve_async(PROBLEM, sensitivity=request).result().sensitivity, here)
            item = marble.BatchItem(PROBLEM, sensitivity=request)
            same(next(iter(one.batch([item]))).result().sensitivity, here)
            with one.session(PROBLEM) as session:
                same(session.update(sensitivity=request).sensitivity, here)
                assert session.update().sensitivity is None
                with pytest.raises(marble.InvalidArgument, match="second part"):
                    session.prepare(sensitivity=request)
    job = client.jobs.submit(PROBLEM, sensitivity=request)
    same(client.jobs.result(job.job_id, wait=True).sensitivity, here)

    async def awaited():
        async with marble.aio.Client(client.address) as one:
            first = await one.solve(PROBLEM, sensitivity=request)
            async with one.session(PROBLEM) as session:
                return first, await session.update(sensitivity=request)

    for answer in asyncio.run(awaited()):
        same(answer.sensitivity, here)


def test_they_are_those_of_sensitivity_which_is_asked_later():
    request = asked(PROBLEM)
    answer = marble.solve(PROBLEM, server="local", sensitivity=request)
    later = marble.Sensitivity(answer)
    derivatives = answer.sensitivity
    assert derivatives.smooth and later.smooth
    for k, direction in enumerate(request.directions):
        change = later.jvp(**direction)
        for name, values in derivatives.changes.items():
            np.testing.assert_allclose(values[k], getattr(change, name), rtol=1e-8, atol=1e-9)
    for name, values in later.vjp(**request.losses[0]).items():
        np.testing.assert_allclose(derivatives.gradients[name][0], values, rtol=1e-8, atol=1e-9)
    response = later.rows(request.rows, columns=True)
    np.testing.assert_allclose(derivatives.rows.response, response.response, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(response.values, request.rows @ answer.z)


def test_rows_follow_a_price_as_the_response_says():
    request = asked(PROBLEM)
    answer = marble.solve(PROBLEM, server="local", sensitivity=request)
    rows, price = answer.sensitivity.rows, np.array([1e-4, -2e-4])
    priced = PROBLEM.replaced(g=PROBLEM.g + request.rows.T @ price)
    moved = marble.solve(priced, server="local", warm_start=answer, max_local_search_factorizations=0)
    np.testing.assert_allclose(request.rows @ moved.z, rows.free - rows.response @ price, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(moved.z, rows.z - rows.columns @ price, rtol=1e-8, atol=1e-9)


def test_without_a_proximal_term_the_response_is_of_the_problem_without_it():
    sigma, point = np.full(PROBLEM.n, 0.3), np.zeros(PROBLEM.n)
    Q = full(PROBLEM.Q)
    proximal = PROBLEM.replaced(Q=marble.LCQP(Q + np.diag(sigma), PROBLEM.g).Q, g=PROBLEM.g - sigma * point)
    answer = marble.solve(proximal, server="local", sensitivity=asked(PROBLEM, proximal=sigma, g=PROBLEM.g))
    rows = answer.sensitivity.rows
    branch = marble.Sensitivity(answer)
    assert branch.smooth
    active = np.vstack([PROBLEM.A.toarray(), *(part.toarray()[value <= 1e-9] for part, value in (
        (PROBLEM.C, PROBLEM.C @ answer.z + PROBLEM.d), (PROBLEM.L, answer.s), (PROBLEM.R, answer.t)))])
    kkt = np.block([[Q.toarray(), active.T], [active, np.zeros((len(active), len(active)))]])
    P = np.linalg.inv(kkt)[:PROBLEM.n, :PROBLEM.n]
    E = asked(PROBLEM).rows
    np.testing.assert_allclose(rows.response, E @ P @ E.T, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(rows.free, E @ (answer.z - P @ (Q @ answer.z + PROBLEM.g)), rtol=1e-7, atol=1e-8)


def test_what_is_only_just_active_is_named_and_each_direction_says_whether_it_holds(client):
    corner = marble.LCQP(2 * np.eye(2), [0, 0], L=[1, 0], R=[0, 1])
    request = marble.SensitivityRequest(directions=[{"g": [-1, 1]}, {"g": [1, -1]}])
    derivatives = client.solve(corner, sensitivity=request).sensitivity
    assert not derivatives.smooth and derivatives.biactive_pairs.tolist() == [0]
    assert sorted(derivatives.active_set_constant.tolist()) == [False, True]
    flat = marble.LCQP([[2.0, 0.0], [0.0, 0.0]], [0.0, 0.0])
    derivatives = client.solve(flat, sensitivity=marble.SensitivityRequest(directions=[{"g": [0, 1]}, {"g": [1, 0]}],
                                                                    rows=[0.0, 1.0])).sensitivity
    assert derivatives.undefined_changes.tolist() == [0] and np.isnan(derivatives.changes["z"][0]).all()
    assert derivatives.changes["z"][1, 0] == pytest.approx(-0.5)
    assert derivatives.rows is None and "flat" in str(derivatives.rows_error)


def test_an_answer_that_is_not_solved_says_so_and_the_call_is_none_the_worse(client):
    request = marble.SensitivityRequest(losses=[{}])
    for server in (client, "local"):
        answer = marble.solve(PROBLEM, server=server, sensitivity=request, max_iterations=0, path="paper", polish=False)
        assert str(answer.sensitivity.error).startswith("solution: must be solved: it is ")
        with pytest.raises(marble.FailedPrecondition):
            answer.sensitivity.raise_if_undefined()


@pytest.mark.parametrize(("more", "field"), [
    ({"rows": [[1.0]]}, "sensitivity.rows"),
    ({"rows": [np.nan] * PROBLEM.n}, "sensitivity.rows"),
    ({"proximal": [-1.0] * PROBLEM.n}, "sensitivity.proximal"),
    ({"g": [1.0]}, "sensitivity.g"),
    ({"directions": [{"b": [1.0] * (PROBLEM.b.size + 1)}]}, "sensitivity.directions.b"),
    ({"directions": [{"h": [1.0]}]}, "sensitivity.directions"),
    ({"losses": [{"z": [1.0]}]}, "sensitivity.losses.z"),
])
def test_what_does_not_fit_is_named_the_same_here_and_there(client, more, field):
    for server in ("local", client):
        with pytest.raises(marble.InvalidArgument) as caught:
            marble.solve(PROBLEM, server=server, sensitivity=asked(PROBLEM, **more))
        assert caught.value.field == field, server
    with pytest.raises(marble.InvalidArgument, match="must be a SensitivityRequest"):
        marble.solve(PROBLEM, sensitivity={"rows": None})
