"""Controllers: the loop, its deadlines and fallbacks, and their counts, in process and over a server."""

from __future__ import annotations

import functools
import signal
import sys

import numpy as np
import pytest
from support import stop_all, wait_until

import marble
from marble.base.tables import Status
from marble.errors import FailedPrecondition, InvalidArgument, Unavailable
from marble.lcs import LCS, Controller, ControlStatistics, Linearization, PlanOrigin, Task, drawing, rollout, simulation
from marble.lcs.time_stepping import SmoothDynamics
from marble.model.optional import optional

pytest.importorskip("marble._core")

START = (np.array([0.3, 0.3]), np.array([0.9, 0.5]))
H, MAX_FORCE = 0.01, 6.0


def cart_pole(offset=(0.0, 0.0)) -> LCS:
    """A cart-pole between two soft walls, of the state (δq, v) at a configuration `offset`."""
    mp, mc, lp, lc, stiffness, g = 0.411, 0.978, 0.6, 0.4267, 100.0, 9.81
    cart, pole = -1 / mc + lp / (mc * lc), -1 / (mc * lc) + lp * (mc + mp) / (mc * mp * lc * lc)
    A = np.eye(4) + H * np.array([[0, 0, 1, 0], [0, 0, 0, 1], [0, g * mp / mc, 0, 0],
                                  [0, g * (mc + mp) / (lc * mc), 0, 0]])
    E = np.array([[-1, lp, 0, 0], [1, -lp, 0, 0]])
    at = np.array([*offset, 0, 0])
    return LCS(A=A, B=H * np.array([[0], [0], [1 / mc], [1 / (lc * mc)]]),
               D=H * np.array([[0, 0], [0, 0], [cart, -cart], [pole, -pole]]), d=A @ at - at, E=E,
               F=np.eye(2) / stiffness, H=np.zeros((2, 1)), c=0.35 + E @ at, dt=H,
               names={"pairs": ["left|tip|nearest normal", "right|tip|nearest normal"]})


class CartPole:
    """A model that is linear in each branch, so that its linearizations are exact everywhere."""

    def __init__(self, seen=None, limits=None):
        self.seen = seen if seen is not None else []
        self.limits = limits  # lower and upper ones of q

    def __call__(self, state, u=None):
        return self.at(state, *state, u)

    def at(self, state, q, v, u=None):
        q, v = np.array(q, dtype=float), np.array(v, dtype=float)
        if not np.isfinite(np.concatenate([q, v])).all():
            raise InvalidArgument("state", "must be finite")
        self.seen.append((q, v))
        none = np.zeros((2, 2))
        smooth = SmoothDynamics(np.eye(2), none, np.zeros(2), none, none, np.array([[2.0], [0]]), v, np.zeros(1),
                                np.eye(2))
        return Linearization(cart_pole(q), q, v, np.zeros(1) if u is None else u, (), np.zeros(0), smooth,
                             np.array([-MAX_FORCE]), np.array([MAX_FORCE]), lambda a, b: b - a, lambda a, b: a + b,
                             None if self.limits is None else tuple(limit - q for limit in self.limits))

    def measure(self, state):
        return state


def task(**changes):
    return Task(**{"rate": 100, "dt": H, "stages": 10, "Q": np.diag([10.0, 2, 1, 1]), "R": [[1.0]],
                   "target": ([0, 0], [0, 0]), "deadline": np.inf, **changes})


@pytest.fixture(params=["local", "server"])
def where(request):
    return "local" if request.param == "local" else request.getfixturevalue("server").address


def moved(state, u):
    x = rollout(cart_pole(), np.concatenate(state), [u])[0][1]
    return x[:2], x[2:]


def closed_loop(controller, steps, prepares=False, state=START):
    made = []
    for _ in range(steps):
        made.append(controller.step(state))
        if prepares:
            controller.prepare(state)
        state = moved(state, made[-1].u)
    return made, state


# ---------------------------------------------------------------- the loop


def test_the_loop_reaches_its_target_and_counts_its_steps(where):
    with Controller(CartPole(), task(), state=START, server=where) as controller:
        steps, (q, v) = closed_loop(controller, 500)
        counts = controller.statistics
    assert np.abs([q, v]).max() < 0.05
    assert all(step.plan.feasible and step.plan.origin is PlanOrigin.SOLVE for step in steps)
    assert max(step.plan.lam[0].max() for step in steps) > 0  # a wall helps
    assert max(abs(step.u[0]) for step in steps) <= MAX_FORCE
    assert (counts.steps, counts.fallbacks, counts.unsolved, counts.infeasible, counts.errors) == (500, 0, 0, 0, 0)
    assert counts.late == sum(step.is_late for step in steps) == sum(step.total_s > H for step in steps)
    assert 0 < counts.solve_s(0.5) <= counts.solve_s(1.0) <= counts.step_s(1.0) and counts.loop_rate > 0
    for step in steps:
        assert step.total_s >= step.linearize_s > 0
        np.testing.assert_allclose(step.u, np.clip(step.plan.u[0], -MAX_FORCE, MAX_FORCE))


def test_a_prepared_step_only_measures_and_has_the_same_inputs(where):
    inputs, seen = [], []
    for prepares in (False, True):
        model = CartPole()
        with Controller(model, task(), state=START, server=where) as controller:
            steps, _ = closed_loop(controller, 40, prepares)
            inputs.append(np.array([step.u for step in steps]))
            seen.append(model.seen[1:])  # without the one of the first plan
    np.testing.assert_allclose(inputs[0], inputs[1], atol=1e-6)
    assert len(seen[0]) == 40 and len(seen[1]) == 41  # the last one is of a step that does not come
    for measured, predicted in zip(seen[0], seen[1][:-1], strict=True):
        np.testing.assert_allclose(measured, predicted, atol=1e-6)


def test_a_second_preparation_of_a_step_has_no_effect():
    model = CartPole()
    with Controller(model, task(), state=START, server="local") as controller:
        controller.step(START)
        controller.prepare(START)
        controller.prepare(START)
        assert len(model.seen) == 3
        assert controller.step(moved(START, [0.0])).plan.feasible


def test_without_a_state_the_first_step_opens_the_session():
    with Controller(CartPole(), task(), server="local") as controller:
        for early in (lambda: controller.prepare(START), lambda: controller.input(START, 0.0),
                      lambda: controller.planner, lambda: controller.pairs):
            with pytest.raises(FailedPrecondition, match="a step must come first"):
                early()
        first = controller.step(START)
        assert first.plan.status is Status.SOLVED and controller.statistics.steps == 1
        assert controller.planner.session.is_open and controller.pairs == ()


def test_targets_may_depend_on_state_and_time_and_differ_by_stage():
    times = []

    def target(now, time):
        times.append(time)
        q = np.zeros((11, 2))
        q[:, 0] = now.q[0] + 0.01 * np.arange(11)
        return q, [0.0, 0]

    with Controller(CartPole(), task(target=target), state=START, server="local") as controller:
        closed_loop(controller, 3)
        assert times == pytest.approx([0, 0, 0.01, 0.02])  # of the first plan, and the steps
        now = controller.step(START)
        ahead = rollout(now.linearization.lcs, now.linearization.x0, now.plan.u)[0]
        np.testing.assert_allclose(ahead, now.plan.x, atol=1e-6)


def test_a_stage_may_last_several_control_steps():
    shifts = []
    with Controller(CartPole(), task(rate=400), state=START, server="local") as controller:
        step = controller.planner.step

        def recorded(*arguments, **named):
            shifts.append(named["shift"])
            return step(*arguments, **named)

        controller.planner.step = recorded
        for _ in range(9):
            controller.step(START)
    assert shifts == [0, 0, 0, 0, 1, 0, 0, 0, 1]
    with Controller(CartPole(), task(rate=400, shift=2), state=START, server="local") as controller:
        before = controller.step(START).plan
        after = controller.step(START)
        assert after.plan.start_objective < np.inf and before.feasible


def test_a_reset_forgets_the_last_plan():
    with Controller(CartPole(), task(), state=START, server="local") as controller:
        first, _ = closed_loop(controller, 5)
        controller.reset(START)
        again, _ = closed_loop(controller, 5)
        assert controller.statistics.steps == 10 and controller.time_s == pytest.approx(0.05)
    for one, other in zip(first, again, strict=True):
        assert one.u.tobytes() == other.u.tobytes()


def test_velocities_keep_their_bounds():
    with Controller(CartPole(), task(v_ub=[1.0, np.inf]), state=START, server="local") as controller:
        steps, _ = closed_loop(controller, 60)
    assert all(step.plan.feasible for step in steps)
    assert max(step.plan.x[1:, 2].max() for step in steps) <= 1.0 + 1e-6


LIMITS = np.array([-np.inf, -np.inf]), np.array([0.35, np.inf])


@pytest.mark.parametrize("prepares", [False, True])
def test_joints_keep_their_limits_and_come_back_from_beyond(where, prepares):
    wide = {"Q": np.diag([0.1, 2, 1, 1]), "v_ub": [50.0, np.inf], "u_lb": -40, "u_ub": 40}
    with Controller(CartPole(), task(**wide), state=START, server=where) as controller:
        free, _ = closed_loop(controller, 30)
    assert max(step.linearization.configuration(step.plan.x[-1])[0][0] for step in free) > 0.35 + 1e-3
    within, beyond = ([0.3, 0.3], [0.5, 0.5]), ([0.355, 0.3], [0.2, 0.5])
    for state in (within, beyond):
        with Controller(CartPole(limits=LIMITS), task(**wide), state=state, server=where) as controller:
            steps, last = closed_loop(controller, 30, prepares, state)
        assert all(step.plan.feasible for step in steps), controller.statistics.last_detail
        for step in steps:
            q = np.array([step.linearization.configuration(x)[0] for x in step.plan.x])
            upper = step.linearization.joint_bounds(step.plan.x[0], 10)[1][:, 0] + step.linearization.q[0]
            assert (q[1:, 0] <= upper + 1e-6).all()
        assert last[0][0] <= 0.35 + 1e-3


def test_bounds_of_joints_are_the_limits_or_the_way_of_a_joint_that_brakes():
    def bounds(q, v, stages=10):
        now = CartPole(limits=LIMITS).at(None, q, [v, 0.0])
        lower, upper = now.joint_bounds(now.x0, stages)
        assert np.isneginf(lower).all() and np.isposinf(upper[:, 1]).all()
        return upper[:, 0] + q[0]

    np.testing.assert_allclose(bounds([0.3, 0], 1.0), 0.35)
    np.testing.assert_allclose(bounds([0.36, 0], 0.0), 0.35 + 0.01 * np.array([1] * 5 + [0.98, 0.92, 0.82, 0.68, 0.5]))
    way = 0.345 + H * np.cumsum([1, 0.8, 0.6, 0.4, 0.2])
    np.testing.assert_allclose(bounds([0.345, 0], 1.0)[:5], np.maximum(way, 0.35))
    assert bounds([0.345, 0], 1.0)[9] == pytest.approx((0.35 + way[-1]) / 2)
    np.testing.assert_allclose(bounds([0.36, 0], 1.0, 1), 0.37)
    now = CartPole().at(None, [0, 0], [0, 0])
    assert now.joint_bounds(now.x0, 3) is None
    with pytest.raises(InvalidArgument, match="x is 3 entries"):
        CartPole(limits=LIMITS).at(None, [0, 0], [0, 0]).joint_bounds([0, 0, 0], 3)


# ---------------------------------------------------------------- between two steps


def test_between_two_steps_the_inputs_follow_the_plan():
    with Controller(CartPole(), task(), state=START, server="local") as controller:
        plan = controller.step(START).plan
        for elapsed, stage in ((0, 0), (0.009, 0), (0.01, 1), (0.055, 5), (0.09, 9), (5.0, 9)):
            np.testing.assert_array_equal(controller.input(START, elapsed), plan.u[stage])
        for bad in (-1e-3, np.nan, np.inf, "now"):
            with pytest.raises(InvalidArgument, match=r"elapsed is .*must be finite and ≥ 0 seconds"):
                controller.input(START, bad)


def test_gains_pull_back_to_the_plan_within_the_bounds():
    with Controller(CartPole(), task(kp=[8.0, 3.0], kd=0.5), state=START, server="local") as controller:
        plan = controller.step(START).plan
        x = (plan.x[1] + plan.x[2]) / 2  # of the linearization at START
        on_the_plan = START[0] + x[:2], x[2:]
        np.testing.assert_allclose(controller.input(on_the_plan, 0.015), plan.u[1], atol=1e-9)
        behind = START[0] + x[:2] - [0.02, 0.04], x[2:] - [0.1, 0.3]
        # Only the cart is driven, by 2 N for each unit of input.
        expected = plan.u[1] + (8 * 0.02 + 0.5 * 0.1) / 2
        np.testing.assert_allclose(controller.input(behind, 0.015), expected, atol=1e-9)
        far = START[0] - 50, START[1]
        np.testing.assert_array_equal(controller.input(far, 0.015), [MAX_FORCE])


# ---------------------------------------------------------------- fallbacks


def test_a_deadline_that_cannot_be_met_leaves_the_last_plan_rolled_out(where):
    with Controller(CartPole(), task(deadline=1e-9), state=START, server=where) as controller:
        last, state = controller.planner.step(np.array([0, 0, *START[1]]), shift=0), START
        steps, _ = closed_loop(controller, 8, state=state)
        counts = controller.statistics
    assert counts.late == counts.unsolved == counts.steps == 8 and counts.infeasible == 0
    assert "time_limit" in counts.last_detail
    for step in steps:
        assert step.is_late and step.plan.feasible and step.plan.status is Status.TIME_LIMIT
        assert step.plan.objective <= step.plan.start_objective * (1 + 1e-9)
        if step.is_fallback:
            assert step.plan.origin is not PlanOrigin.SOLVE
    assert counts.fallbacks == sum(step.is_fallback for step in steps) > 0
    assert last.feasible


def test_a_solve_that_stays_unsolved_is_counted_and_its_plan_is_usable(where):
    options = {"max_iterations": 1, "polish": False, "path": "paper"}
    with Controller(CartPole(), task(), state=START, server=where, **options) as controller:
        steps, _ = closed_loop(controller, 20)
        counts = controller.statistics
    assert counts.unsolved == 20 and counts.infeasible == counts.errors == 0
    assert "iteration_limit" in counts.last_detail
    for step in steps:
        assert step.plan.feasible and step.is_fallback == (step.plan.origin is not PlanOrigin.SOLVE)
        assert step.plan.objective <= step.plan.start_objective * (1 + 1e-9)


def test_a_lost_server_leaves_the_last_plan_and_another_one_goes_on(start_server):
    server = start_server()
    with Controller(CartPole(), task(deadline=0.2), state=START, server=server.address) as controller:
        before, state = closed_loop(controller, 3)
        server.kill()
        lost, state = closed_loop(controller, 3, prepares=True, state=state)
        assert controller.statistics.errors == 3
        for step in lost:
            assert step.is_fallback and step.plan.status is Status.CANCELLED and step.plan.feasible
            assert step.plan.origin is PlanOrigin.START_ROLLOUT and step.plan.solution is None
        assert "Unavailable" in lost[0].plan.detail
        expected = before[-1].plan.u[1:]
        np.testing.assert_allclose(lost[0].plan.u[:-1], expected, atol=1e-9)
        start_server(listen=server.address)

        def is_back():
            return controller.step(state).plan.status is Status.SOLVED

        assert wait_until(is_back)
        assert controller.statistics.fallbacks >= controller.statistics.errors


def test_a_session_that_has_ended_is_opened_again():
    with Controller(CartPole(), task(), state=START, server="local") as controller:
        controller.step(START)
        ended = controller.planner.session
        ended.close()
        state, last = START, None
        made = controller.step(state)
        assert made.is_fallback and "the session has ended" in made.plan.detail

        def is_back():
            nonlocal made, last
            last, made = made, controller.step(state)
            return controller.planner.session is not ended

        assert wait_until(is_back)
        assert made.plan.status is Status.SOLVED and not made.is_fallback
        # It has started from the inputs of the last plan: the same objective as theirs.
        start = np.vstack([last.plan.u[1:], last.plan.u[-1:]])
        x, _ = rollout(made.linearization.lcs, made.linearization.x0, start)
        x += [*made.linearization.q, 0, 0]
        P = controller.planner.P
        expected = sum(one @ np.diag([10.0, 2, 1, 1]) @ one for one in x[:-1]) + (start**2).sum() + x[-1] @ P @ x[-1]
        assert made.plan.start_objective == pytest.approx(expected, rel=1e-9)
        assert made.plan.objective <= made.plan.start_objective * (1 + 1e-9)
        assert controller.statistics.errors == controller.statistics.steps - 2


def test_a_server_that_hangs_does_not_stop_the_loop(start_server):
    server = start_server()
    with Controller(CartPole(), task(deadline=0.02), state=START, server=server.address) as controller:
        before, state = closed_loop(controller, 3)
        stop_all(server.process)
        try:
            steps, state = closed_loop(controller, 15, prepares=True, state=state)
        finally:
            server.process.send_signal(signal.SIGCONT)
        assert steps[0].plan.detail.endswith("0.1 s after the deadline")
        assert all(step.is_fallback and step.plan.feasible and step.plan.solution is None for step in steps)
        assert controller.statistics.unsolved >= 15
        assert controller.statistics.errors == 0 and controller.statistics.infeasible == 0
        assert before[-1].plan.feasible and wait_until(lambda: controller.step(state).plan.status is Status.SOLVED)


def test_without_a_feasible_plan_the_inputs_go_on_along_the_last_one():
    with Controller(CartPole(), task(v_ub=[1.2, np.inf]), state=START, server="local") as controller:
        last = controller.step(START).plan
        too_fast = START[0], np.array([9.0, 0.5])
        step = controller.step(too_fast)
        assert not step.plan.feasible and step.is_fallback
        np.testing.assert_array_equal(step.u, last.u[1])
        np.testing.assert_array_equal(controller.step(too_fast).u, last.u[2])
        assert controller.statistics.infeasible == 2 and "v" not in controller.statistics.last_detail[:1]
        assert "x_ub[0" in controller.statistics.last_detail or "x_ub[2]" in controller.statistics.last_detail


# ---------------------------------------------------------------- errors


@pytest.mark.parametrize(("changes", "words"), [
    ({"rate": 0}, "rate is 0: must be finite and > 0 Hz"), ({"rate": np.inf}, "rate is inf"),
    ({"rate": "fast"}, "rate is fast"), ({"dt": -1}, "dt is -1: must be finite and > 0 s"),
    ({"stages": 0}, "stages is 0"), ({"stages": 2.5}, "stages is 2.5"), ({"stages": True}, "stages is True"),
    ({"deadline": 0}, "deadline is 0: must be > 0 seconds"), ({"deadline": np.nan}, "deadline is nan"),
    ({"shift": 11}, r"shift is 11: must be None or in \[0, 10\]"), ({"shift": 1.0}, r"shift is 1.0"),
    ({"contacts": ["floor"]}, "contacts is list: must be a mapping"), ({"contacts": {"dt": 1}}, "contacts is 'dt'"),
    ({"target": [1.0, 2, 3]}, r"target is \[1.0, 2, 3\]: must be \(q, v\)"), ({"target": "up"}, "target is 'up'"),
    ({"target": ([0], [0, 0])}, r"target.q is of shape \(1,\): must have the shape \(2,\) or \(11, 2\)"),
    ({"target": ([0, 0], np.zeros((10, 2)))}, r"target.v is of shape \(10, 2\)"),
    ({"target": ([0, np.nan], [0, 0])}, r"target.q\[1\] is nan: must be finite"),
    ({"target": lambda now, time: None}, "target is None"),
    ({"Q": np.eye(3)}, r"Q is of shape \(3, 3\)"), ({"R": [[0.0]]}, "R is not positive definite"),
    ({"v_lb": [0, 0, 0]}, r"v_lb is of shape \(3,\)"), ({"v_lb": 1, "v_ub": 0}, r"x_ub\[2\] is 0: must be >= x_lb"),
    ({"u_lb": [1, 2]}, r"u_lb is of shape \(2,\)"), ({"kp": -1}, r"kp\[0\] is -1.0: must be finite and ≥ 0"),
    ({"kd": [1, np.inf]}, r"kd\[1\] is inf"), ({"kp": "stiff"}, "kp"),
])
def test_a_bad_task_is_named(changes, words):
    with pytest.raises((InvalidArgument, FailedPrecondition), match=words):
        Controller(CartPole(), task(**changes), state=START, server="local")


def test_a_bad_controller_is_named():
    for model, words in (({}, r"model is builtins\.dict: must be a mujoco\.MjModel"), (None, "model is builtins")):
        with pytest.raises(InvalidArgument, match=words):
            Controller(model, task(), state=START, server="local")
    with pytest.raises(InvalidArgument, match=r"task is dict: must be a marble\.lcs\.Task"):
        Controller(CartPole(), {"rate": 50})
    with pytest.raises(InvalidArgument, match="speed"):
        Controller(CartPole(), task(), state=START, server="local", speed=3)
    with pytest.raises(Unavailable):
        Controller(CartPole(), task(), state=START, server="127.0.0.1:1")


def test_a_state_that_cannot_be_measured_is_an_error_and_changes_nothing():
    with Controller(CartPole(), task(), state=START, server="local") as controller:
        controller.step(START)
        with pytest.raises(InvalidArgument, match="state: must be finite"):
            controller.step((np.array([0, np.nan]), START[1]))
        assert controller.statistics.steps == 1
        assert controller.step(START).plan.feasible


def test_a_closed_controller_says_so():
    controller = Controller(CartPole(), task(), state=START, server="local")
    controller.close()
    controller.close()
    for call in (controller.step, controller.prepare, controller.reset):
        with pytest.raises(FailedPrecondition, match="the controller is closed"):
            call(START)


def test_a_client_that_was_given_stays_open(client):
    with Controller(CartPole(), task(), state=START, server=client) as controller:
        controller.step(START)
    assert client.info().version


# ---------------------------------------------------------------- statistics


def test_statistics_have_one_line_and_can_begin_anew():
    counts = ControlStatistics(50.0)
    assert np.isnan(counts.loop_rate) and np.isnan(counts.step_s()) and np.isnan(counts.solve_s(0.99))
    for k in range(101):
        counts.steps += 1
        counts.add_times(0.02 * k, 1e-3 * (k + 1), 1e-4 * (k + 1))
    counts.late, counts.last_detail = 2, "time_limit: late"
    assert counts.loop_rate == pytest.approx(50) and counts.step_s() == pytest.approx(0.051)
    assert str(counts) == ("101 steps for 50 Hz at 50.0 Hz: 2 late, 0 fallbacks, 0 unsolved, 0 infeasible, 0 errors; "
                           "median / p99 / worst: step 51.00 / 100.00 / 101.00 ms; solve 5.10 / 10.00 / 10.10 ms")
    counts.clear()
    assert (counts.rate, counts.steps, counts.late, counts.last_detail) == (50.0, 0, 0, "")
    assert np.isnan(counts.step_s())


# ---------------------------------------------------------------- pictures


def test_gaps_and_forces_of_a_plan_are_those_of_its_pairs():
    with Controller(CartPole(), task(), state=START, server="local") as controller:
        steps, _ = closed_loop(controller, 20)
    touching = max(steps, key=lambda step: step.plan.lam.max())
    made = drawing.contact_histories(touching.plan, touching.linearization.lcs)
    assert list(made) == ["left|tip|nearest", "right|tip|nearest"]
    plan, lcs = touching.plan, touching.linearization.lcs
    sides = plan.x[:-1] @ lcs.E.T + plan.lam @ lcs.F.T + lcs.c
    for i, one in enumerate(made.values()):
        np.testing.assert_allclose(one.gap, H * sides[:, i], atol=1e-12)
        np.testing.assert_array_equal(one.force, plan.lam[:, i])
        assert np.abs(np.minimum(one.gap, one.force)).max() < 1e-6
    assert max(one.force.max() for one in made.values()) > 0


def test_contacts_with_friction_are_one_row_each():
    def system(kinds):
        nl = len(kinds)
        names = {"pairs": [f"foot {kind}" for kind in kinds]}
        return LCS(np.eye(2), np.ones((2, 1)), np.zeros((2, nl)), np.zeros(2), np.zeros((nl, 2)), np.zeros((nl, nl)),
                   np.zeros((nl, 1)), np.arange(1.0, nl + 1), dt=0.5, names=names)

    def plan(lcs):
        with marble.lcs.Planner(lcs, 2, Q=np.eye(2), R=[[1]], P=np.eye(2), server="local") as planner:
            made = planner.step([0, 0])
        forces = np.arange(1.0, lcs.nl + 1)
        return made.__class__(**{**vars(made), "lam": np.stack([forces, 2 * forces])})

    anitescu = system(["edge0", "edge1", "edge2", "edge3"])
    one, = drawing.contact_histories(plan(anitescu), anitescu).values()
    np.testing.assert_allclose(one.gap, 0.5 * 2.5)
    np.testing.assert_allclose(one.force, [10, 20])
    pyramid = system(["slip", "normal", "friction0", "friction1"])
    histories = drawing.contact_histories(plan(pyramid), pyramid)
    np.testing.assert_allclose(histories["foot"].gap, 0.5 * 2)
    np.testing.assert_allclose(histories["foot"].force, [2, 4])
    assert list(histories) == ["foot"]
    with pytest.raises(InvalidArgument, match=r"lcs is <LCS: 4 states.*must have 2 states, 1 inputs and 4 pairs"):
        drawing.contact_histories(plan(pyramid), cart_pole())


def test_a_picture_of_a_plan_is_written(tmp_path):
    pytest.importorskip("matplotlib")
    with Controller(CartPole(), task(), state=START, server="local") as controller:
        step = controller.step(START)
    for name in ("plan.png", "plan.svg"):
        drawing.save(step.plan, step.linearization.lcs, tmp_path / name)
        assert (tmp_path / name).stat().st_size > 5000
    free = LCS([[1]], [[1]], np.zeros((1, 0)), [0], np.zeros((0, 1)), np.zeros((0, 0)), np.zeros((0, 1)), [])
    with marble.lcs.Planner(free, 2, Q=[[1]], R=[[1]], server="local") as planner, pytest.raises(
            InvalidArgument, match="must have pairs"):
        drawing.save(planner.step([1.0]), free, tmp_path / "none.png")


def test_a_package_that_is_missing_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    monkeypatch.setitem(sys.modules, "pydrake.systems.framework", None)
    monkeypatch.delitem(sys.modules, "marble.lcs.drake_system", raising=False)
    with pytest.raises(Unavailable, match="simulate needs mujoco: pip install mujoco"):
        simulation.simulate(None, None, None, 1.0)
    with pytest.raises(Unavailable, match="a Recorder needs mujoco: pip install mujoco"):
        simulation.Recorder(None)
    with pytest.raises(Unavailable, match="ControllerSystem needs pydrake: pip install drake"):
        functools.partial(__import__, "marble.lcs.drake_system")()
    assert optional("json", "json", "a test").loads("1") == 1
