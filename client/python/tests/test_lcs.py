"""Linear complementarity systems: their checks, roll-outs, and planners in process and over a server."""

from __future__ import annotations

import collections
import dataclasses
import importlib
import os

import lcs_random
import numpy as np
import pytest
import scipy.linalg

import marble
from marble import in_process
from marble.base.tables import Status
from marble.errors import DeadlineExceeded, FailedPrecondition, InvalidArgument, InvalidProblem, Unavailable
from marble.lcs import LCS, Plan, Planner, PlanOrigin, rollout

START = np.array([0.3, 0.3, 0.9, 0.5])
COSTS = {"Q": np.diag([10.0, 2, 1, 1]), "R": [[1.0]]}


def cart_pole(**changes) -> LCS:
    """A cart-pole between two soft walls, at 0.01 s."""
    mp, mc, lp, lc, stiffness, g, h = 0.411, 0.978, 0.6, 0.4267, 100.0, 9.81, 0.01
    cart, pole = -1 / mc + lp / (mc * lc), -1 / (mc * lc) + lp * (mc + mp) / (mc * mp * lc * lc)
    parts = {
        "A": np.eye(4) + h * np.array([[0, 0, 1, 0], [0, 0, 0, 1], [0, g * mp / mc, 0, 0],
                                       [0, g * (mc + mp) / (lc * mc), 0, 0]]),
        "B": h * np.array([[0], [0], [1 / mc], [1 / (lc * mc)]]),
        "D": h * np.array([[0, 0], [0, 0], [cart, -cart], [pole, -pole]]), "d": np.zeros(4),
        "E": [[-1, lp, 0, 0], [1, -lp, 0, 0]], "F": np.eye(2) / stiffness, "H": np.zeros((2, 1)), "c": [0.35, 0.35]}
    return LCS(**{**parts, **changes})


def violation(lcs: LCS, plan: Plan) -> float:
    """Largest dynamics error or |min(λ, E x + F λ + H u + c)|, by plain products."""
    worst = 0.0
    for k in range(len(plan.u)):
        s, x, u, lam = lcs.stage(k), plan.x[k], plan.u[k], plan.lam[k]
        gap = s.E @ x + s.F @ lam + s.H @ u + s.c
        dynamics = s.A @ x + s.B @ u + s.D @ lam + s.d - plan.x[k + 1]
        worst = max(worst, np.abs(np.minimum(lam, gap)).max(initial=0.0), np.abs(dynamics).max())
    return worst


def cost(planner: Planner, plan: Plan, x_ref=0.0) -> float:
    error = plan.x - x_ref
    stages = sum(x @ COSTS["Q"] @ x for x in error[:-1]) + sum(u @ COSTS["R"] @ u for u in plan.u)
    return float(stages + error[-1] @ planner.P @ error[-1])


# ---------------------------------------------------------------- LCS


def test_a_system_has_constant_parts_or_one_per_stage():
    lcs = cart_pole()
    assert (lcs.nx, lcs.nu, lcs.nl, lcs.stages, lcs.dt) == (4, 1, 2, None, None) and lcs.stage(7) is lcs
    offsets = np.arange(12.0).reshape(3, 4)
    varying = cart_pole(d=offsets, dt=0.01, names={"inputs": ["force"]})
    assert varying.stages == 3 and varying.stage(2).stages is None
    np.testing.assert_array_equal(varying.stage(2).d, offsets[2])
    assert varying.stage(1).names["inputs"] == ("force",) and varying.stage(1).dt == 0.01
    offsets[:] = 0
    assert varying.d[1, 0] == 4.0 and not varying.d.flags.writeable
    with pytest.raises(InvalidArgument, match=r"k is 3: must be in \[0, 3\)"):
        varying.stage(3)


def with_entry(array, place, value):
    made = np.array(array, dtype=float)
    made[place] = value
    return made


@pytest.mark.parametrize(("changes", "field", "index", "words"), [
    ({"A": np.eye(3)}, "A", None, "nx"),
    ({"A": np.ones((4, 3))}, "A", None, "must have the shape (3, 3)"),
    ({"B": np.ones((4, 0))}, "B", None, "at least 1 columns"),
    ({"c": 5.0}, "c", None, "of shape ()"),
    ({"E": np.ones((3, 4))}, "E", None, "of shape (3, 4)"),
    ({"d": np.zeros((3, 4)), "c": np.zeros((2, 2))}, "c", None, "must have 3 stages"),
    ({"F": with_entry(np.zeros((3, 2, 2)), (1, 0, 1), np.nan)}, "F[1]", (0, 1), "must be finite"),
    ({"c": with_entry(np.zeros((3, 2)), (2, 1), np.inf)}, "c[2]", 1, "must be finite"),
    ({"H": with_entry(np.zeros((2, 1)), (1, 0), -np.inf)}, "H", (1, 0), "must be finite"),
    ({"D": "many"}, "D", None, "must be an array of numbers"),
    ({"d": np.zeros(4, complex)}, "d", None, "must be an array of numbers"),
    ({"dt": 0.0}, "dt", None, "> 0 seconds"), ({"dt": np.nan}, "dt", None, "> 0 seconds"),
    ({"names": {"force": ["a"]}}, "names", None, "states, inputs, pairs"),
    ({"names": {"pairs": ["a", "a"]}}, "names.pairs", 1, "differs"),
    ({"names": {"states": "abcd"}}, "names.states", None, "must have 4 texts"),
])
def test_a_bad_part_is_named(changes, field, index, words):
    with pytest.raises(InvalidArgument) as raised:
        cart_pole(**changes)
    if field != "A" or changes["A"].shape != (3, 3):  # then the next part does not fit
        assert raised.value.field == field
    assert raised.value.index == index and words in str(raised.value)


# ---------------------------------------------------------------- roll-outs


def test_a_rollout_satisfies_dynamics_and_complementarity():
    random = np.random.default_rng(3)
    u = random.normal(20, 20, size=(40, 1))
    x, lam = rollout(cart_pole(), START, u)
    assert x.shape == (41, 4) and lam.shape == (40, 2) and lam.max() > 0
    s = cart_pole()
    gap = x[:-1] @ s.E.T + lam @ s.F.T + s.c
    assert np.abs(np.minimum(gap, lam)).max() < 1e-13
    assert np.abs(x[:-1] @ s.A.T + u @ s.B.T + lam @ s.D.T - x[1:]).max() < 1e-13


def test_a_rollout_without_a_solution_names_the_stage():
    stuck = cart_pole(F=np.zeros((2, 2)), c=with_entry(np.ones((4, 2)), (2, 1), -9.0))
    with pytest.raises(FailedPrecondition, match=r"stages\[2\].*ended in a ray"):
        rollout(stuck, np.zeros(4), np.zeros((4, 1)))


def test_a_rollout_refuses_arrays_of_other_shapes():
    for u in (np.zeros(4), np.zeros((1, 4)), np.zeros((0, 1))):
        with pytest.raises(InvalidArgument, match=r"u is of shape .*must have the shape \(N, 1\)"):
            rollout(cart_pole(), START, u)
    with pytest.raises(InvalidProblem, match="x0"):
        rollout(cart_pole(), START[:3], np.zeros((4, 1)))
    with pytest.raises(InvalidArgument, match=r"u\[1\]\[0\] is nan"):
        rollout(cart_pole(), START, [[0.0], [np.nan]])


# ---------------------------------------------------------------- planners


@pytest.fixture(params=["local", "server"])
def where(request):
    return "local" if request.param == "local" else request.getfixturevalue("server").address


def closed_loop(planner: Planner, steps: int, step) -> list[Plan]:
    lcs, x, plans = cart_pole(), START, []
    for k in range(steps):
        plans.append(step(planner, k, x))
        x = rollout(lcs, x, plans[-1].u[:1])[0][1]
    return plans


def test_plans_are_feasible_and_not_above_their_start(where):
    with Planner(cart_pole(), 10, **COSTS, u_lb=-4, u_ub=4, max_u_change=2.0, server=where) as planner:
        np.testing.assert_allclose(planner.P, scipy.linalg.solve_discrete_are(
            cart_pole().A, cart_pole().B, COSTS["Q"], COSTS["R"]), rtol=1e-9)
        plans = closed_loop(planner, 60, lambda planner, k, x: planner.step(x))
    for before, plan in zip([None, *plans], plans, strict=False):
        assert plan.feasible and plan.status is Status.SOLVED and plan.origin is PlanOrigin.SOLVE
        assert violation(cart_pole(), plan) < 1e-6 and np.abs(plan.u).max() <= 4 + 1e-6
        assert plan.objective <= plan.start_objective + 1e-9 * (1 + plan.start_objective)
        assert plan.objective == pytest.approx(cost(planner, plan), rel=1e-9)
        assert plan.solution is not None and plan.objective == pytest.approx(plan.solution.objective, rel=1e-9)
        assert abs(plan.u[0, 0] - (0.0 if before is None else before.u[0, 0])) <= 2 + 1e-6
        assert plan.times.total_s >= plan.times.solve_s > 0 and plan.times.rollout_s > 0
    assert max(plan.lam[0].max() for plan in plans) > 0


def in_two_parts(planner: Planner, k: int, x) -> Plan:
    planner.prepare(lcs=cart_pole(d=[0, 0, 1e-3 * k, 0]), x_ref=[0.01 * k, 0, 0, 0])
    return planner.feedback(x)


def in_one_part(planner: Planner, k: int, x) -> Plan:
    return planner.step(x, lcs=cart_pole(d=[0, 0, 1e-3 * k, 0]), x_ref=[0.01 * k, 0, 0, 0])


def test_plans_have_the_same_bits_everywhere_and_in_two_parts(server):
    loops = []
    for address, step in (("local", in_one_part), ("local", in_two_parts), (server.address, in_one_part),
                          (server.address, in_two_parts)):
        with Planner(cart_pole(), 10, **COSTS, server=address) as planner:
            loops.append(closed_loop(planner, 15, step))
    for plans in loops[1:]:
        for plan, first in zip(plans, loops[0], strict=True):
            assert plan.u.tobytes() == first.u.tobytes() and plan.objective == first.objective
            assert plan.x.tobytes() == first.x.tobytes() and plan.lam.tobytes() == first.lam.tobytes()


def test_all_numbers_may_change_from_step_to_step(where):
    random = np.random.default_rng(5)
    with Planner(cart_pole(), 6, **COSTS, P=np.eye(4), R_change=[[0.1]], regularization=1e-6, u_ref=[0.5], server=where,
                 x_lb=[-1, -np.inf, -np.inf, -np.inf]) as planner:
        for _ in range(5):
            lcs = cart_pole(d=0.01 * random.normal(size=(6, 4)), c=0.35 + 0.01 * random.random((6, 2)))
            x_ref, u_ref, last = (random.normal(scale=0.1, size=size) for size in ((7, 4), (6, 1), 1))
            plan = planner.step(START, lcs=lcs, x_ref=x_ref, u_ref=u_ref, last_u=last)
            change = np.diff(plan.u[:, 0], prepend=last)
            expected = (cost(planner, plan, x_ref) - np.square(plan.u).sum() + np.square(plan.u - u_ref).sum()
                        + 0.1 * np.square(change).sum() + 1e-6 * np.square(plan.lam).sum())
            assert plan.objective == pytest.approx(expected, rel=1e-9)
            assert plan.feasible and violation(lcs, plan) < 1e-6 and plan.x[1:, 0].min() > -1 - 1e-6


def test_a_stopped_solve_returns_a_feasible_plan(where):
    with Planner(cart_pole(), 10, **COSTS, server=where) as planner:
        plans = closed_loop(planner, 10, lambda planner, k, x: planner.step(x, time_limit_s=1e-9))
    for plan in plans:
        assert plan.status is Status.TIME_LIMIT and plan.feasible and violation(cart_pole(), plan) < 1e-9
        assert plan.objective <= plan.start_objective * (1 + 1e-12)


def test_a_deadline_returns_the_rolled_out_start(monkeypatch):
    with Planner(cart_pole(), 5, **COSTS, server="local") as planner:
        first = planner.step(START)

        def late(**_):
            raise DeadlineExceeded("too late")

        monkeypatch.setattr(planner.session, "update", late)
        plan = planner.step(first.x[1])
        assert plan.status is Status.TIME_LIMIT and plan.origin is PlanOrigin.START_ROLLOUT and plan.solution is None
        np.testing.assert_array_equal(plan.u, np.vstack([first.u[1:], first.u[-1:]]))
        assert plan.feasible and "too late" in plan.detail
        guess = np.full((5, 1), 0.25)
        np.testing.assert_array_equal(planner.step(first.x[1], u=guess, shift=3).u, guess)


def test_numbers_of_a_refused_update_are_sent_again(monkeypatch):
    with Planner(cart_pole(), 5, **COSTS, server="local") as planner:
        update = planner.session.update

        def fails(**_):
            raise Unavailable("lost")

        monkeypatch.setattr(planner.session, "update", fails)
        with pytest.raises(Unavailable):
            planner.step(START, lcs=cart_pole(c=[0.1, 0.1]))
        monkeypatch.setattr(planner.session, "update", update)
        plan = planner.step(START)
        assert violation(cart_pole(c=[0.1, 0.1]), plan) < 1e-6


def test_a_start_that_violates_state_bounds_is_reported():
    with Planner(cart_pole(), 20, **COSTS, x_ub=[0.05, np.inf, np.inf, np.inf], server="local") as planner:
        plan = planner.step([0, 0, 0.4, 0])
        assert plan.feasible and plan.start_objective == np.inf and "x_ub[0] is violated by" in plan.detail
        none = planner.step([0.5, 0, 3.0, 0])
        assert not none.feasible and none.violations.inequality > 0.1


def test_limits_may_differ_by_stage_and_change_from_step_to_step(where):
    slow = with_entry(np.full(4, -np.inf), 2, -5.0)
    with Planner(cart_pole(), 10, **COSTS, x_lb=slow, u_lb=-50, u_ub=50, server=where) as planner:
        loose = planner.step(START)
        for step in range(3):
            x_lb = with_entry(np.tile(slow, (10, 1)), (slice(None), 2), 0.85 - 0.01 * step - 0.05 * np.arange(10))
            u_ub = 20.0 + np.arange(10.0)[:, None]
            plan = planner.step(START, x_lb=x_lb, u_lb=-20.0, u_ub=u_ub, shift=0)
            assert plan.feasible and plan.status is Status.SOLVED and plan.objective > loose.objective
            assert (plan.x[1:] - x_lb).min() > -1e-6 and (u_ub - plan.u).min() > -1e-6 and plan.u.min() > -20 - 1e-6
        planner.prepare(x_lb=slow, u_lb=-50, u_ub=50, shift=0)
        assert planner.feedback(START).objective == pytest.approx(loose.objective, rel=1e-6)
        with pytest.raises(InvalidArgument, match=r"x_ub\[0\] is 1: must be infinite, as at the beginning"):
            planner.feedback(START, x_ub=[1.0, np.inf, np.inf, np.inf])


def test_systems_of_one_row_keep_their_form(where):
    one = LCS([[1.0]], [[0.1]], [[0.0]], [0.0], [[1.0]], [[1.0]], [[0.0]], [0.5])
    with Planner(one, 1, Q=[[1]], R=[[1]], P=[[1]], server=where) as planner:
        planner.step([1.0])
        two = LCS([[2.0]], [[0.2]], [[0.0]], [0.1], [[1.0]], [[1.0]], [[0.3]], [0.5])
        plan = planner.step([1.0], lcs=two)
        assert plan.u[0, 0] == pytest.approx(-0.2 * 2.1 / (1 + 0.04)) and violation(two, plan) < 1e-9


def test_a_system_without_pairs_is_a_quadratic_program():
    free = cart_pole(D=np.zeros((4, 0)), E=np.zeros((0, 4)), F=np.zeros((0, 0)), H=np.zeros((0, 1)), c=np.zeros(0))
    with Planner(free, 20, **COSTS, server="local") as planner:
        plan = planner.step(START)
        gain = np.linalg.solve(COSTS["R"] + free.B.T @ planner.P @ free.B, free.B.T @ planner.P @ free.A)
        np.testing.assert_allclose(plan.u[0], -gain @ START, rtol=1e-6)
        assert plan.objective == pytest.approx(START @ planner.P @ START, rel=1e-8)


@pytest.mark.parametrize(("changes", "words"), [
    ({"stages": 0}, "stages is 0"), ({"stages": 2.5}, "stages is 2.5"),
    ({"Q": np.eye(3)}, r"Q is of shape \(3, 3\)"), ({"Q": np.triu(np.ones((4, 4)))}, "Q.*must be symmetric"),
    ({"Q": np.full((4, 4), np.nan)}, r"Q\[0\] is nan"), ({"R": [[0.0]]}, "R is not positive definite"),
    ({"P": np.zeros(4)}, "P is of shape"), ({"regularization": -1}, "regularization is -1"),
    ({"u_lb": 1, "u_ub": 0}, r"u_ub\[0\] is 0: must be >= u_lb, 1"), ({"x_lb": [0, 0]}, r"x_lb is of shape \(2,\)"),
    ({"u_ub": with_entry(np.ones((10, 1)), (3, 0), np.inf)}, r"u_ub\[3\]\[0\] is inf: must be finite in all stages"),
    ({"max_u_change": -1}, r"max_u_change\[0\] is -1"), ({"x_ref": np.zeros((10, 4))}, r"x_ref is of shape \(10, 4\)"),
    ({"u_ub": np.nan}, r"u_ub\[0\] is nan"), ({"lcs": cart_pole(d=np.zeros((3, 4)))}, "must be 3, as many"),
    ({"x_ub": [[1.0], [1.0, 2.0]]}, "x_ub.*must be an array of numbers"),
    ({"lcs": None}, "must be a marble.lcs.LCS"), ({"speed": 3}, "speed"),
])
def test_a_bad_planning_problem_is_named(changes, words):
    with pytest.raises((InvalidArgument, FailedPrecondition), match=words):
        Planner(**{"lcs": cart_pole(), "stages": 10, **COSTS, "server": "local", **changes})


def test_a_bad_step_is_named_and_changes_nothing():
    with Planner(cart_pole(), 5, **COSTS, server="local") as planner:
        plan = planner.step(START)
        for changes, words in [({"x0": START[:2]}, "x0 is 2 entries"), ({"x0": [0, 0, np.inf, 0]}, r"x0\[2\] is inf"),
                               ({"x_ref": np.zeros((5, 4))}, "x_ref is of shape"),
                               ({"u": np.zeros(5)}, "u is of shape"),
                               ({"x_lb": 0}, r"x_lb\[0\] is 0: must be infinite, as at the beginning"),
                               ({"x_lb": [0, 0]}, r"x_lb is of shape \(2,\): must have the shape \(4,\) or \(5, 4\)"),
                               ({"u_ub": np.full((5, 1), np.nan)}, r"u_ub\[0\]\[0\] is nan: must be a number"),
                               ({"last_u": [1, 2]}, "last_u is 2 entries"), ({"shift": 7}, "shift is 7"),
                               ({"shift": 1.5}, "whole number"), ({"lcs": cart_pole(d=np.zeros((3, 4)))}, "lcs.stages"),
                               ({"lcs": LCS([[1]], [[1]], [[1]], [1], [[1]], [[1]], [[1]], [1])}, "lcs.states is 1")]:
            with pytest.raises(InvalidArgument, match=words):
                planner.step(**{"x0": START, **changes})
        assert planner.step(START, shift=0).start_objective == pytest.approx(plan.objective)


def test_numbers_that_overflow_are_named_by_their_argument():
    with pytest.raises(InvalidArgument, match=r"x_ref: must leave the numbers of the LCQP finite \(c0"):
        Planner(cart_pole(), 5, **COSTS, x_ref=[1e200, 0, 0, 0], server="local")
    with Planner(cart_pole(), 5, **COSTS, server="local") as planner:
        with pytest.raises(InvalidArgument, match=r"x0: must leave the numbers of the LCQP finite \(c0"):
            planner.step([1e200, 0, 0, 0])
        with pytest.raises(InvalidArgument, match="lcs is dict: must be a"):
            planner.step(START, lcs={})
        assert planner.step(START).feasible


def test_without_the_native_module_the_error_says_what_to_install(monkeypatch):
    def missing(_):
        raise ImportError("no _core")

    in_process.core.cache_clear()
    monkeypatch.setattr(importlib, "import_module", missing)
    try:
        with pytest.raises(Unavailable, match=r"marble\.lcs needs marble\._core.*also where a server solves"):
            Planner(cart_pole(), 5, **COSTS)
        with pytest.raises(Unavailable, match=r"marble.lcs needs marble._core"):
            rollout(cart_pole(), START, np.zeros((2, 1)))
    finally:
        in_process.core.cache_clear()


def test_a_client_that_was_given_stays_open():
    with marble.Client("local") as client:
        with Planner(cart_pole(), 5, **COSTS, server=client) as planner:
            planner.step(START)
        client.session(planner.problem).close()


pytest.importorskip("marble._core")

RUNS, SEED = (int(os.environ.get(f"MARBLE_LCS_{name}", default)) for name, default in (("RUNS", 400), ("SEED", 1)))


def test_every_call_ends_with_a_checked_result_or_an_error_that_names_its_argument():
    counts = collections.Counter()
    for index in range(RUNS):
        target, outcome, plans = lcs_random.call(SEED, index, sorted(lcs_random.TARGETS))
        counts[target, outcome] += 1
        counts["plans"] += plans
    if RUNS >= 400:  # each target has valid and hostile calls, and most valid steps have feasible plans
        for target in lcs_random.TARGETS:
            assert counts[target, "accepted"] > 0, counts
            assert counts[target, "refused"] > 0 or target in ("step", "threads"), counts
        assert counts["plans"] > counts["step", "accepted"], counts


def test_the_check_of_plans_finds_what_is_wrong():
    random = np.random.default_rng(3)
    lcs = LCS(**lcs_random.system(random, (2, 1, 2)))
    task, last = lcs_random.problem(random, 2, 1), np.zeros(1)
    x0 = random.normal(size=2)
    with Planner(lcs, **task, server="local") as planner:
        plan = planner.step(x0, last_u=last)
    assert lcs_random.check_plan(plan, lcs, x0, task, last)
    for changes, words in (({"x": plan.x + 0.1}, "x0"), ({"lam": plan.lam + 0.1}, "dynamics"),
                           ({"u": plan.u + 1e4}, "dynamics"), ({"objective": plan.objective + 1}, "objective"),
                           ({"u": plan.u[1:]}, "shapes"),
                           ({"start_objective": plan.objective - 1}, "above that of the start")):
        with pytest.raises(lcs_random.Found, match=words):
            lcs_random.check_plan(dataclasses.replace(plan, **changes), lcs, x0, task, last)
