"""Systems linearized along a plan, also of configurations with rotations, and controllers that use them."""

from __future__ import annotations

import numpy as np
import pytest
from test_lcs_controller import START, CartPole, H, closed_loop, task

from marble.errors import InvalidArgument
from marble.lcs import LCS, Controller, Linearization, Planner, Task, linearize_along, rotation
from marble.lcs.linearization import Contact
from marble.lcs.time_stepping import SmoothDynamics, matrices

pytest.importorskip("marble._core")

DT = 0.05


def linearization(q, v, u, parts, difference, integrate):
    nv, none = v.size, np.zeros((v.size, v.size))
    smooth = SmoothDynamics(np.eye(nv), none, np.zeros(nv), none, none, np.ones((nv, 1)), v, u, np.eye(nv))
    return Linearization(LCS(**parts, dt=DT), q, v, u, (), np.zeros(0), smooth, np.array([-9.0]), np.array([9.0]),
                         difference, integrate)


class Pendulum:
    """q'' = 9 sin q + u, which rests its tip on a wall at q = 1 by a spring; in steps of DT, linearized anywhere."""

    def __init__(self):
        self.count = 0

    def __call__(self, state, u=None):
        return self.at(state, *state, u)

    def measure(self, state):
        return state

    def at(self, state, q, v, u=None):
        self.count += 1
        q, v, u = np.array(q, float), np.array(v, float), np.zeros(1) if u is None else np.array(u, float)
        slope, force = 9 * np.cos(q[0]), 9 * np.sin(q[0])
        A = np.array([[1 + DT * DT * slope, DT], [DT * slope, 1]])
        B, D = np.array([[DT * DT], [DT]]), -np.array([[DT * DT], [DT]])
        d = np.array([DT * DT, DT]) * force
        return linearization(q, v, u, {"A": A, "B": B, "D": D, "d": d, "E": [[-1, 0]], "F": [[0.01]], "H": [[0]],
                                       "c": 1 - q}, lambda a, b: b - a, lambda a, b: a + b)

    @staticmethod
    def step(x, u, lam):
        v = x[1] + DT * (9 * np.sin(x[0]) + u - lam)
        return np.array([x[0] + DT * v, v])


class Body:
    """A body that spins freely; its configuration is a rotation matrix as nine numbers."""

    def at(self, state, q, v, u=None):
        h = DT * np.eye(3)
        A = np.block([[rotation.transport(DT * v), h], [np.zeros((3, 3)), np.eye(3)]])
        return linearization(q, v, np.array(u, float), {
            "A": A, "B": np.full((6, 1), DT), "D": np.ones((6, 1)), "d": np.full(6, 0.01), "E": np.ones((1, 6)),
            "F": [[1]], "H": [[1]], "c": [0.5]}, difference, integrate)


def exponential(w):
    angle = np.linalg.norm(w)
    W = rotation.cross_matrix(w / angle) if angle > 0 else np.zeros((3, 3))
    return np.eye(3) + np.sin(angle) * W + (1 - np.cos(angle)) * W @ W


def integrate(q, w):
    return (q.reshape(3, 3) @ exponential(w)).ravel()


def difference(a, b):
    R = a.reshape(3, 3).T @ b.reshape(3, 3)
    angle = np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1))
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return axis / 2 * (1 if angle < 1e-9 else angle / np.sin(angle))


def test_a_step_from_a_point_of_the_plan_is_that_of_its_own_linearization():
    model = Pendulum()
    q, v, u = (np.array([[0.1], [0.5], [0.9]]) * scale for scale in (1, 2, 3))
    now = model((q[0], v[0]))
    lcs = linearize_along(model, None, now, q, v, u)
    assert lcs.stages == 3 and model.count == 3 and lcs.dt == DT
    for k in range(3):
        at, x = lcs.stage(k), now.state(q[k], v[k])
        step = at.A @ x + at.B @ u[k] + at.d
        np.testing.assert_allclose(now.configuration(step)[0], model.step([q[k, 0], v[k, 0]], u[k, 0], 0)[:1],
                                   atol=1e-12)
        np.testing.assert_allclose(step[1], model.step([q[k, 0], v[k, 0]], u[k, 0], 0)[1], atol=1e-12)
        np.testing.assert_allclose(at.E @ x + at.c, 1 - q[k], atol=1e-12)


def test_rotations_are_converted_exactly_at_the_plan_and_to_first_order_beside_it():
    random = np.random.default_rng(1)
    model = Body()
    q = np.array([exponential(0.4 * w).ravel() for w in random.normal(size=(4, 3))])
    v, u = 2 * random.normal(size=(4, 3)), random.normal(size=(4, 1))
    now = model.at(None, q[0], v[0], u[0])
    lcs = linearize_along(model, None, now, q, v, u)
    for k in range(1, 4):
        at, own, x = lcs.stage(k), model.at(None, q[k], v[k], u[k]), now.state(q[k], v[k])

        def step(x, u, lam, own=own):
            local = own.state(*now.configuration(x))
            after = own.lcs.A @ local + own.lcs.B @ u + own.lcs.D @ lam + own.lcs.d
            return now.state(*own.configuration(after)), own.lcs.E @ local + own.lcs.c

        for size, most in ((0.0, 1e-9), (1e-4, 2e-7)):
            dx, du, lam = (size * random.normal(size=n) for n in (6, 1, 1))
            made = at.A @ (x + dx) + at.B @ (u[k] + du) + at.D @ lam + at.d
            wanted, slack = step(x + dx, u[k] + du, lam)
            np.testing.assert_allclose(made, wanted, atol=most)
            np.testing.assert_allclose(at.E @ (x + dx) + at.c, slack, atol=most)


def test_bad_plans_are_named():
    model = Pendulum()
    now = model((np.zeros(1), np.zeros(1)))
    good = {"q": np.zeros((3, 1)), "v": np.zeros((3, 1)), "u": np.zeros((3, 1))}
    for field, value, words in (("q", np.zeros(3), r"^q is of shape .*: must have the shape \(N, 1\)"),
                                ("v", np.zeros((3, 2)), r"^v is of shape .*: must have the shape \(N, 1\)"),
                                ("u", np.zeros((0, 1)), r"^u is of shape .*: must have the shape \(N, 1\)"),
                                ("u", np.zeros((2, 1)), "^u is 2 rows: must have 3 rows, as many as q"),
                                ("q", [[0], [np.nan], [0]], "^q.* is nan: must be finite"),
                                ("v", "fast", "^v.*must be an array of numbers")):
        with pytest.raises(InvalidArgument, match=words):
            linearize_along(model, None, now, **{**good, field: value})
    for wrong in ("path", None, ["plan"]):
        with pytest.raises(InvalidArgument, match=r'linearize_along.*must be "state" or "plan"'):
            task(linearize_along=wrong)
    for wrong, along, most in ((0, "plan", 100), (101, "plan", 100), (2, "state", 1), (1.5, "plan", 100)):
        with pytest.raises(InvalidArgument, match=rf"linearizations is {wrong}: must be in \[1, {most}\]"):
            task(linearize_along=along, linearizations=wrong)


@pytest.mark.parametrize("prepares", [False, True])
def test_along_the_plan_a_model_that_is_linear_has_the_same_inputs(prepares):
    inputs, counts = [], []
    for along in ("state", "plan"):
        model = CartPole()
        with Controller(model, task(linearize_along=along), state=START, server="local") as controller:
            steps, _ = closed_loop(controller, 30, prepares)
        inputs.append([step.u for step in steps])
        counts.append(len(model.seen))
        assert controller.statistics.infeasible == 0
    np.testing.assert_allclose(inputs[0], inputs[1], atol=1e-6)
    assert counts[1] - 1 == 10 * (counts[0] - 1)  # a linearization a stage, but for the first plan


def test_repeated_steps_along_the_plan_end_in_a_plan_of_the_nonlinear_model():
    worst = {}
    for along, repeated, steps in (("state", 1, 15), ("plan", 1, 15), ("plan", 14, 2)):
        made = Task(rate=1e6, dt=DT, stages=12, Q=np.diag([20.0, 1]), R=[[0.01]], target=([1.5], [0]), shift=0,
                    deadline=np.inf, linearize_along=along, linearizations=repeated)
        state = np.array([-0.5]), np.array([3.0])
        with Controller(Pendulum(), made, state=state, server="local") as controller:
            for _ in range(steps):
                plan = controller.step(state).plan
            assert controller.statistics.steps == steps
        x = np.concatenate(state)
        errors = []
        for k in range(12):
            x = Pendulum.step(x, plan.u[k, 0], plan.lam[k, 0])
            errors.append(np.abs(x - plan.x[k + 1] - [state[0][0], 0]).max())
        assert plan.lam.max() > 0  # it reaches the wall
        worst[along, repeated] = max(errors)
    assert worst["plan", 1] < 1e-4 and worst["plan", 14] < 1e-4 and worst["state", 1] > 0.1


def test_a_finite_stiffness_lets_rigid_contacts_give_way():
    smooth = Pendulum()((np.zeros(1), np.zeros(1))).smooth
    contact = Contact(0.0, np.ones(1), np.array([[1.0], [-1.0]]), 0.5, True)
    for model, rows in (("anitescu", [0, 1]), ("stewart_trinkle", [1])):
        rigid, compliant = (matrices(smooth, [contact], DT, model, k)["F"] for k in (np.inf, 1e4))
        wanted = np.zeros(len(rigid))
        wanted[rows] = 1 / (1e4 * DT)
        np.testing.assert_allclose(compliant - rigid, np.diag(wanted), atol=1e-15)


def test_rounding_errors_where_a_planner_begins_do_not_choose_the_units_of_its_session():
    random = np.random.default_rng(3)

    def system(noise):
        d = noise * random.uniform(1, 2, 4)
        return LCS(np.eye(4) + H * random_A, random_B, random_D, d, random_E, np.eye(2), np.zeros((2, 1)), [0.5, 0.4])

    random_A, random_B, random_D, random_E = (random.normal(size=shape) for shape in ((4, 4), (4, 1), (4, 2), (2, 4)))
    later = LCS(np.eye(4) + H * random_A, random_B, random_D, np.full(4, 0.1), random_E, np.eye(2), np.zeros((2, 1)),
                [0.5, 0.4])
    plans = []
    for noise in (0.0, 1e-14):
        with Planner(system(noise), 6, Q=np.eye(4), R=[[1.0]], P=np.eye(4), server="local") as planner:
            plans.append(planner.step(np.ones(4), lcs=later))
    assert plans[0].x.tobytes() == plans[1].x.tobytes()
