"""Expectations by more and more samples: the C++ levels, called back."""

from __future__ import annotations

import numpy as np
import pytest

import marble

pytest.importorskip("marble._core")

START = np.full(5, 2.0)


class Bt6:
    """BT6 with F = f + ξ‖x − x0 − 1‖², ξ uniform in [−1, 1]: on the average it is BT6."""

    def __init__(self, seed):
        self.seed, self.asked = seed, []

    def mean(self, count):
        if not self.asked or self.asked[-1] != count:
            self.asked.append(count)
        return np.mean(2 * marble.nlp.uniform(self.seed, 0, count)[:, 0] - 1)

    def values(self, x, count):
        f = (x[0] - 1) ** 2 + (x[0] - x[1]) ** 2 + (x[2] - 1) ** 2 + (x[3] - 1) ** 4 + (x[4] - 1) ** 6
        rows = [x[3] * x[0] ** 2 + np.sin(x[3] - x[4]) - 2 * np.sqrt(2), x[1] + x[2] ** 4 * x[1] ** 2 - 8 - np.sqrt(2)]
        return {"objective": f + self.mean(count) * np.sum((x - 3) ** 2), "equalities": rows}

    def derivatives(self, x, count):
        gradient = np.array([4 * x[0] - 2 * x[1] - 2, 2 * (x[1] - x[0]), 2 * (x[2] - 1), 4 * (x[3] - 1) ** 3,
                             6 * (x[4] - 1) ** 5])
        slope = np.cos(x[3] - x[4])
        rows = np.array([[2 * x[0] * x[3], 0, 0, x[0] ** 2 + slope, -slope],
                         [0, 1 + 2 * x[1] * x[2] ** 4, 4 * x[2] ** 3 * x[1] ** 2, 0, 0]])
        return {"gradient": gradient + 2 * self.mean(count) * (x - 3), "equalities": rows}

    def cost(self, x, sample):
        xi = 2 * marble.nlp.uniform(self.seed, sample, 1)[0, 0] - 1
        return self.values(x, 1)["objective"] + (xi - self.mean(1)) * np.sum((x - 3) ** 2)

    def solve(self, **settings):
        return marble.nlp.retrospective(self.values, self.derivatives, START, **settings)


def test_samples_are_those_of_their_numbers():
    # The published vector of Philox4x32-10 for zeros: 6627e8d5 e169c58d bc57ac4c 9b00dbd8.
    assert marble.nlp.uniform(0, 0, 1, 2).tolist() == [[(0xe169c58d6627e8d5 >> 11) / 2**53,
                                                        (0x9b00dbd8bc57ac4c >> 11) / 2**53]]
    all_at_once = marble.nlp.uniform(2**64 - 1, 10, 6, 3)
    assert all_at_once.shape == (6, 3) and len(np.unique(all_at_once)) == 18
    for i in range(6):
        assert np.array_equal(marble.nlp.uniform(2**64 - 1, 10 + i, 1, 3)[0], all_at_once[i])
    assert marble.nlp.uniform(1, 0, 0).shape == (0, 1)
    for wrong in ((-1, 0, 1), (2**64, 0, 1), (0, -1, 1), (0, 0, -1)):
        with pytest.raises(marble.InvalidArgument):
            marble.nlp.uniform(*wrong)


def test_levels_are_nested_and_close_in_on_the_optimum():
    bt6, levels = Bt6(1), []
    answer = bt6.solve(levels=12, level=levels.append)
    assert [level.samples for level in answer.levels] == [2 ** (k + 1) for k in range(12)] == bt6.asked
    assert levels == answer.levels and [level.level for level in levels] == list(range(12))
    assert answer.solved and np.array_equal(answer.x, answer.levels[-1].x)
    assert answer.answer.ticks == sum(level.ticks for level in levels) < 60
    optimum = [1.28693, 1.48023, 1.37945, 1.32195, 0.62872]
    errors = [np.abs(level.x - optimum).max() for level in levels]
    assert errors[-1] < 0.05 < errors[0]
    assert all(level.status is marble.Status.SOLVED and level.estimate is None for level in levels)


def test_on_a_server_every_bit_is_as_in_process(client):
    here, there = Bt6(2).solve(levels=6), Bt6(2).solve(levels=6, server=client)
    assert np.array_equal(here.x, there.x) and here.answer.ticks == there.answer.ticks


def test_what_is_carried_and_when_a_level_ends_can_be_chosen():
    plain = Bt6(3).solve(levels=10)
    assert Bt6(3).solve(levels=10, carry_curvature=False).answer.ticks > plain.answer.ticks
    exact = Bt6(3).solve(levels=10, reduction=1e-12)
    assert exact.answer.kkt_residual < 1e-5 < plain.answer.kkt_residual and exact.answer.ticks > plain.answer.ticks
    by_step = Bt6(3).solve(levels=10, test="step", tolerance=0.1)
    assert by_step.solved and by_step.answer.ticks != plain.answer.ticks
    grown = Bt6(3).solve(first_samples=3, growth=1.5, largest_samples=8)
    assert [level.samples for level in grown.levels] == [3, 5, 7, 8]


def test_fresh_samples_estimate_the_cost():
    answer = Bt6(4).solve(levels=8, sample_cost=Bt6(4).cost, fresh_samples=400)
    last = answer.levels[-1]
    assert 0 < last.estimate.half_width < 1.5
    assert abs(last.estimate.mean - 0.277) < 3 * last.estimate.half_width


def test_a_hessian_is_averaged_too():
    samples = []

    def hessian(x, multipliers, count):
        samples.append(count)
        return [[2.0]]

    def values(x, count):
        return {"objective": (x[0] - np.mean(marble.nlp.uniform(5, 0, count))) ** 2}

    def derivatives(x, count):
        return {"gradient": 2 * (x - np.mean(marble.nlp.uniform(5, 0, count)))}

    answer = marble.nlp.retrospective(values, derivatives, [7.0], hessian=hessian, levels=5)
    assert sorted(set(samples)) == [2, 4, 8, 16, 32]
    assert answer.x[0] == pytest.approx(np.mean(marble.nlp.uniform(5, 0, 32)))


def test_faults_are_named_and_what_is_raised_comes_out():
    for wrong, field in (({"first_samples": 0}, "settings.first_samples"), ({"growth": 1.0}, "settings.growth"),
                         ({"reduction": 1.0}, "settings.reduction"), ({"levels": 0}, "settings.levels"),
                         ({"test": "kkt"}, "test"), ({"radius": -1.0}, "settings.radius")):
        with pytest.raises(marble.InvalidArgument) as caught:
            Bt6(6).solve(**wrong)
        assert caught.value.field == field

    def stop(level):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        Bt6(6).solve(level=stop)
