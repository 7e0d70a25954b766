from __future__ import annotations

import asyncio
import dataclasses

import numpy as np
import pytest
from support import full, random_problem, tiny

import marble
from marble.layers import Layer


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


def layer_numbers(problem: marble.LCQP, names: str) -> list[np.ndarray]:
    return [getattr(getattr(problem, name), "data", None) if name in "QACLR" else getattr(problem, name)
            for name in names]


def test_a_layers_gradients_are_the_differences_of_its_losses():
    names = "gbdlrQACLR"
    start = marble.solve(PROBLEM, server="local")
    layer = Layer(PROBLEM, names, outputs=("z", "y", "xi"), start=start, options={"max_local_search_factorizations": 0})
    numbers = [np.array(values) for values in layer_numbers(PROBLEM, names)]
    random = np.random.default_rng(5)
    weights = [random.normal(size=size) for size in (PROBLEM.n, PROBLEM.b.size, PROBLEM.l.size)]
    directions = [random.normal(size=values.size) for values in numbers]

    def loss(step):
        outputs = layer(*(values + step * by for values, by in zip(numbers, directions, strict=True)))
        return sum(w @ values for w, values in zip(weights, outputs, strict=True))

    gradients = layer.gradients(numbers, layer.answers(*numbers), weights)
    h = 1e-6
    slope = sum(g @ by for g, by in zip(gradients, directions, strict=True))
    assert slope == pytest.approx((loss(h) - loss(-h)) / (2 * h), rel=1e-4)


def test_a_layer_takes_one_problem_a_row_and_adds_up_what_rows_share(client):
    layer, remote = Layer(PROBLEM, ("g", "b")), Layer(PROBLEM, ("g", "b"), client=client)
    g = PROBLEM.g + 1e-3 * np.arange(3)[:, None]
    z = layer(g, PROBLEM.b)
    np.testing.assert_array_equal(z, [layer(one, PROBLEM.b) for one in g])
    np.testing.assert_array_equal(z, remote(g, PROBLEM.b), err_msg="the same bits there")
    weights = np.random.default_rng(2).normal(size=z.shape)
    by_g, by_b = layer.gradients((g, PROBLEM.b), layer.answers(g, PROBLEM.b), [weights])
    single = [layer.gradients((one, PROBLEM.b), layer.answers(one, PROBLEM.b), [w]) for one, w in
              zip(g, weights, strict=True)]
    np.testing.assert_allclose(by_g, [one for one, _ in single], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(by_b, sum(one for _, one in single), rtol=1e-12, atol=1e-12)


def test_a_layer_warns_of_an_answer_that_is_almost_solved(monkeypatch):
    real = marble.layers.solve
    monkeypatch.setattr(marble.layers, "solve", lambda *given, **words: dataclasses.replace(
        real(*given, **words), status=marble.Status.ALMOST_SOLVED))
    with pytest.warns(marble.AlmostSolved, match="almost solved: violation "):
        Layer(tiny(), ("g",))([-2.0, -2.0])


def test_a_layer_names_what_it_cannot_take():
    with pytest.raises(marble.InvalidArgument, match=r"parameters is 'h'"):
        Layer(tiny(), ("h",))
    layer = Layer(tiny(), ("g", "l"))
    with pytest.raises(marble.InvalidArgument, match=r"g is \(3,\).*shape \(2,\)"):
        layer([1.0, 2.0, 3.0], [0.0])
    with pytest.raises(marble.InvalidArgument, match="rows"):
        layer(np.zeros((2, 2)), np.zeros((3, 1)))
    with pytest.raises(marble.Unsolved):
        Layer(tiny(), ("g",), options={"max_iterations": 0, "path": "paper", "polish": False})([-2.0, -2.0])
