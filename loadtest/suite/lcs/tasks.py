"""The tasks: MuJoCo models, the costs that all controllers have, and what counts as done. A seed is a scenario."""

import dataclasses
import pathlib
from collections.abc import Callable
from typing import Any

import mujoco as mj
import numpy as np
from hops import Gait, Hops

MODELS = pathlib.Path(__file__).resolve().parent / "models"


@dataclasses.dataclass(frozen=True)
class Scenario:
    """What differs between the seeds of a task: the start, a goal in m, or a pose, pushes (from, to in s, body, force
    (3,) in N), and by which factors the masses and the friction of the simulation differ from what controllers know."""

    q: np.ndarray
    v: np.ndarray
    goal: Any = 0.0
    pushes: tuple = ()
    mass: float = 1.0
    friction: float = 1.0


@dataclasses.dataclass(frozen=True)
class Task:
    """Controllers work at `rate` Hz, plan `stages` of `dt` s, and pay |x - target|²_Q + |u|²_R (P in the last stage).

    contacts: options of marble.lcs.linearizer. scenario(model, random): random is None for the nominal one.
    target(scenario, data, time): configuration and velocity wanted at that time. done(scenario, data) at the end;
    failed(scenario, data) ends a run. along_plan: how often Marble plans in a step, each time linearized at each
    stage's state of the plan before; 0: once, linearized at the present state, as the others do.
    """

    name: str
    model: str
    seconds: float
    dt: float
    stages: int
    contacts: dict[str, Any]
    Q: np.ndarray
    P: np.ndarray | None
    R: np.ndarray
    scenario: Callable[..., Scenario]
    target: Callable[..., tuple[np.ndarray, np.ndarray]]
    done: Callable[..., bool]
    failed: Callable[..., bool]
    regularization: float = 1e-6
    rate: int = 50
    along_plan: int = 0

    def load(self):
        """Its MjModel."""
        return mj.MjModel.from_xml_path(str(MODELS / f"{self.model}.xml"))

    def lasting(self, seconds):
        """The same for another time."""
        return dataclasses.replace(self, seconds=seconds)

    def of_seed(self, seed):
        """The scenario of a seed. Seed 0 is the nominal one; even seeds judge, odd seeds are to tune by."""
        return self.scenario(self.load(), np.random.default_rng(seed) if seed else None)


def spread(random, size, width):
    """Uniform in ±width, zeros in the nominal scenario."""
    return np.zeros(size) if random is None else random.uniform(-width, width, size)


def cart_pole(stages):
    def scenario(_, random):
        side = 1.0 if random is None else random.choice([-1.0, 1.0])
        angle, speed = np.array([0.2, 1.8]) + spread(random, 2, 1.0) * [0.05, 0.2]
        return Scenario(side * np.array([0, angle]), side * np.array([0, speed]))

    return Task(
        f"cart_pole_{stages}", "cart_pole", 4.0, 0.02, stages,
        {"contact": "soft", "stiffness": 150.0, "pairs": [("left", "tip"), ("right", "tip")]},
        np.diag([10.0, 50, 1, 1]), None, np.array([[0.01]]), scenario, lambda *_: (np.zeros(2), np.zeros(2)),
        lambda _, data: abs(data.qpos[1]) < 0.1 and abs(data.qpos[0]) < 0.3,
        lambda _, data: abs(data.qpos[1]) > 1.5, regularization=0.0)


def push_box(contact):
    def scenario(_, random):
        q = spread(random, 5, 1.0) * [0, 0, 0, 0.03, 0.03] - [0, 0, 0, 0.03 * (random is not None), 0]
        return Scenario(q, np.zeros(5), 0.3 + spread(random, 1, 0.05)[0])

    def target(this, data, _):
        return np.array([this.goal, 0, 0, data.qpos[0] + 0.07, 0]), np.zeros(5)  # the ball at the box's left side

    Q = np.diag([200, 1, 20, 2, 20, 1, 1, 1, 0.2, 0.2])
    return Task(
        "push_box" + ("_st" if contact == "stewart_trinkle" else ""), "push_box", 4.0, 0.04, 10,
        {"contact": contact, "num_directions": 2,
         "pairs": [("floor", "box", "corner0"), ("floor", "box", "corner4"), ("box", "ball")]},
        Q, 10 * Q, 1e-3 * np.eye(2), scenario, target,
        lambda this, data: abs(data.qpos[0] - this.goal) < 0.02 and abs(data.qpos[2]) < 0.1,
        lambda _, data: np.abs(data.qpos).max() > 2)


def push_t(contact):
    """A T is turned and moved on a table by two fingers; they belong at the ends of its bar."""
    def scenario(_, random):
        q = np.array([0, 0, 0, 0, 0.14, 0, -0.14]) + spread(random, 7, 1.0) * [0.02, 0.02, 0.2, *[0.01] * 4]
        goal = np.array([0.2, 0.1, np.pi / 2]) + spread(random, 3, 1.0) * [0.05, 0.05, 0.3]
        mass, friction = 1 + spread(random, 2, 0.2)
        return Scenario(q, np.zeros(7), goal, mass=mass, friction=friction)

    def target(this, data, time):
        here, turn = data.qpos[:2], data.qpos[2]
        wanted = this.q[:3] + np.clip(time / 2.5, 0, 1) * (this.goal - this.q[:3])
        side = 0.1 * np.array([-np.sin(turn), np.cos(turn)])
        return np.array([*wanted, *(here + side), *(here - side)]), np.zeros(7)

    Q = np.diag([200, 200, 10, 60, 60, 60, 60, 2, 2, 0.1, 0.2, 0.2, 0.2, 0.2])
    return Task(
        "push_t" + ("_st" if contact == "stewart_trinkle" else ""), "push_t", 4.0, 0.05, 10,
        {"contact": contact, "num_directions": 2,
         "pairs": [("bar", "left"), ("bar", "right"), ("stem", "left"), ("stem", "right")]},
        Q, 5 * Q, 1e-3 * np.eye(4), scenario, target,
        lambda this, data: np.abs(data.qpos[:2] - this.goal[:2]).max() < 0.02 and abs(data.qpos[2] - this.goal[2]) < 0.1,
        lambda _, data: np.abs(data.qpos[:2]).max() > 1)


def pivot(contact):
    """A cube is turned by 90 degrees about its right lower edge; a finger pushes, another one holds it back."""
    def scenario(_, random):
        q = np.array([0, 0, 0, -0.15, 0.05, 0, 0.15]) + spread(random, 7, 1.0) * [0.03, 0, 0, *[0.02] * 4]
        mass, friction = 1 + spread(random, 2, 0.2)
        return Scenario(q, np.zeros(7), q[0] + 0.2, mass=mass, friction=friction)

    def target(this, data, time):
        turn = np.pi / 2 * np.clip(time / 2, 0, 1)
        c, s = np.cos(turn), np.sin(turn)
        x, z = this.goal - 0.1 - 0.1 * c + 0.1 * s, -0.1 + 0.1 * c + 0.1 * s
        at, here = data.qpos[:2], data.qpos[2]
        right, up = np.array([np.cos(here), -np.sin(here)]), np.array([np.sin(here), np.cos(here)])
        return np.array([x, z, turn, *(at - 0.1 * right + 0.05 * up), *(at + 0.1 * up)]), np.zeros(7)

    Q = np.diag([100, 100, 50, 5, 5, 5, 5, 1, 1, 0.5, 0.1, 0.1, 0.1, 0.1])
    return Task(
        "pivot" + ("_st" if contact == "stewart_trinkle" else ""), "pivot", 4.0, 0.04, 10,
        {"contact": contact, "num_directions": 2,
         "pairs": [*(("floor", "cube", f"corner{i}") for i in (0, 4, 5)), ("cube", "left"), ("cube", "top")]},
        Q, 5 * Q, 1e-3 * np.eye(4), scenario, target,
        lambda this, data: abs(data.qpos[2] - np.pi / 2) < 0.1 and abs(data.qpos[0] - this.goal) < 0.03
        and abs(data.qpos[1]) < 0.01,
        lambda _, data: np.abs(data.qpos[:3]).max() > 2.5)


def hopper_start(random):
    """Configuration and velocity, of which the nominal ones have straight legs."""
    q = np.array([0, 1.25, 0, 0, 0, 0]) + spread(random, 6, 1.0) * [0, 0, 0.05, 0.1, 0.1, 0.1]
    q[1] += spread(random, 1, 0.02)[0]
    return q


def hopper_fell(_, data):
    return data.qpos[1] < 0.5 or abs(data.qpos[2]) > 1.2


def hopper(name, contact="anitescu", push=0.0, limits="bounds"):
    """limits: joint_limits of marble.lcs.linearizer; as bounds they are Marble's alone: C3 and C3+ plan without them."""

    def scenario(_, random):
        q = hopper_start(random)
        side = 1.0 if random is None else random.choice([-1.0, 1.0])
        force = side * push * (1 + spread(random, 1, 0.2)[0])
        return Scenario(q, spread(random, 6, 0.1), pushes=((1.0, 1.1, "torso", (force, 0, 0)),) if push else ())

    rest = np.array([0, 1.2, 0, -0.3, -0.6, 0.3]), np.zeros(6)
    Q = np.diag([1, 50, 20, 0.2, 0.2, 0.5, 5, 0.5, 0.5, 0.02, 0.02, 0.02])
    return Task(
        name, "hopper", 3.0, 0.03, 15,
        {"contact": contact, "num_directions": 2, "pairs": [("floor", "foot")], "joint_limits": limits},
        Q, 5 * Q, 0.02 * np.eye(3), scenario, lambda *_: rest,
        lambda _, data: abs(data.qpos[0]) < 0.5 and data.qpos[1] > 0.7 and abs(data.qpos[2]) < 0.5, hopper_fell)


def hops(name, gait, least, seconds=10.0):
    """The hopper goes forward: it is done if its mean speed is at least that in m/s, and it is upright."""
    hopping = Hops(mj.MjModel.from_xml_path(str(MODELS / "hopper.xml")), gait)

    def scenario(_, random):
        q, v = hopper_start(random), spread(random, 6, 0.1)
        mass, friction = 1 + spread(random, 2, 0.2)
        return Scenario(q, v, mass=mass, friction=friction)

    Q = hopping.cost([20, 200, 300, 300, 5, 20], [1, 2, 0.2, 0.2, 0.05, 0.2], 0.1)
    return Task(
        name, "hopper", seconds, 0.03, 18,
        {"num_directions": 2, "pairs": [("floor", "foot")], "joint_limits": "bounds", "stiffness": 333e3},
        Q, 3 * Q + hopping.capture_cost(200.0), 0.5 * np.eye(3), scenario,
        lambda _, data, time: hopping.target(data, time),
        lambda _, data: data.qpos[0] >= least * data.time and data.qpos[1] > 0.7 and abs(data.qpos[2]) < 0.7,
        hopper_fell, along_plan=2)


def quadruped(name, push, drop=0.0, seconds=3.0):
    rest = np.zeros(15)
    rest[[2, 3]], rest[7:] = [0.55, 1], [0, 1, 0, -1, 0, -1, 0, 1]

    def scenario(model, random):
        q, v = rest.copy(), spread(random, 14, 0.05)
        q[2] += drop
        mj.mj_integratePos(model, q, spread(random, 14, 1.0) * [0, 0, 0.02, 0.05, 0.05, 0.05, *[0.05] * 8], 1.0)
        angle = np.pi / 2 if random is None else random.uniform(0, 2 * np.pi)
        force = push * (1 + spread(random, 1, 0.2)[0]) * np.array([np.cos(angle), np.sin(angle), 0])
        return Scenario(q, v, pushes=((1.0, 1.2, "torso", tuple(force)),) if push else ())

    Q = np.diag([20, 20, 100, 50, 50, 20, *[1] * 8, 1, 1, 1, 0.5, 0.5, 0.5, *[0.05] * 8])
    return Task(
        name, "quadruped", seconds, 0.02, 10,
        {"num_directions": 4, "pairs": [("floor", f"foot{i}", "end0") for i in range(1, 5)]},
        Q, 5 * Q, 0.05 * np.eye(8), scenario, lambda *_: (rest, np.zeros(14)),
        lambda _, data: abs(data.qpos[2] - 0.55) < 0.1 and np.abs(data.qpos[:2]).max() < 0.3,
        lambda _, data: upright(data) < 0.3)


def upright(data):
    """The vertical part of the torso's own axis, of a model whose free joint is the first."""
    return 1 - 2 * (data.qpos[4] ** 2 + data.qpos[5] ** 2)


TASKS = {task.name: task for task in [
    cart_pole(10), cart_pole(30), push_box("anitescu"), push_box("stewart_trinkle"),
    push_t("anitescu"), push_t("stewart_trinkle"), pivot("anitescu"), pivot("stewart_trinkle"),
    hopper("hopper_stand"), hopper("hopper_stand_st", "stewart_trinkle"), hopper("hopper_limits", limits="pairs"),
    hopper("hopper_push", push=40.0),
    hops("hopper_walk", Gait(0.3), 0.27),
    hops("hopper_run", Gait(1.0, period=0.24, flight=0.12, clearance=0.03, posture=(-0.5, -0.3, 0.7), ramp=12), 0.9),
    quadruped("quadruped_push", 10.0, drop=0.02), quadruped("quadruped_shove", 20.0, drop=0.02)]}
