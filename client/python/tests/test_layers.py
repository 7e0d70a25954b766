from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from support import random_problem, tiny

import marble
from marble.layers import Layer

PROBLEM = random_problem(3)


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
