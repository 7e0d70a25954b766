"""The planar hopper: a body and a foot, joined by a leg force, that follow a moving point over two steps up and down.

The same problem, bit by bit, as `marble example hopper`; for demonstrations and as a pattern for problems of one's own.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marble.base.lazy import lazy
from marble.model.lcqp import LCQP, Vector

sp: Any = lazy("scipy.sparse")

NAMES = ("body_x", "body_z", "foot_x", "foot_z", "body_vx", "body_vz", "foot_vx", "foot_vz", "force_x", "force_z",
         "slip_plus", "slip_minus", "normal_force", "friction_force",
         *(f"{kind}_{i}" for kind in ("sign", "sign_plus", "sign_minus") for i in range(4)))
"""The variables of one step, in the order they have in z."""

_AT = {name: i for i, name in enumerate(NAMES)}
_Terms = Mapping[int, float]


@dataclass(frozen=True)
class Hopper:
    """Parameters, in SI units.

    steps: the horizon, ≥ 1, of step_s seconds each. friction: μ. stair_x, stair_rise: where the ground's height jumps,
    and by how much. position: x, z of body and foot before the first step; velocity: theirs. last_force: the leg's
    before the first step. reference_x: where the tracked point is then; speed: its own.
    """

    steps: int = 60
    step_s: float = 0.05
    gravity: float = 9.81
    body_mass: float = 1.0
    foot_mass: float = 0.3
    friction: float = 0.8
    stair_x: tuple[float, ...] = (0.75, 1.15, 1.85, 2.25)
    stair_rise: tuple[float, ...] = (0.15, 0.15, -0.15, -0.15)
    leg_reach_x: float = 0.30
    leg_shortest: float = 0.35
    leg_longest: float = 0.85
    position: tuple[float, ...] = (0.0, 0.6, 0.0, 0.0)
    velocity: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    last_force: tuple[float, ...] = (0.0, 9.81)
    reference_x: float = 0.0
    speed: float = 1.0
    tracking_weight: float = 20.0
    force_weight: float = 0.005
    force_rate_weight: float = 0.01

    def problem(self) -> LCQP:
        """The plan to be found: 26 variables, 13 equalities, 9 inequalities and 9 pairs a step."""
        model = _Model()
        for k in range(self.steps):
            _add_dynamics(model, self, k)
            _add_contact(model, self, k)
            _add_objective(model, self, k)
        return model.problem(len(NAMES) * self.steps)

    def advanced(self, z: Vector, ticks: int = 1) -> Hopper:
        """The parameters once the first `ticks` steps of the trajectory z have been followed."""
        reached = trajectory(z)[ticks - 1]
        return dataclasses.replace(
            self, position=tuple(reached[0:4]), velocity=tuple(reached[4:8]), last_force=tuple(reached[8:10]),
            reference_x=self.reference_x + self.speed * self.step_s * ticks)

    def ground(self, x: float) -> float:
        """Height of the ground at x."""
        return float(sum(rise for edge, rise in zip(self.stair_x, self.stair_rise, strict=True) if x > edge))


def trajectory(z: Vector) -> NDArray[np.float64]:
    """z as a table: a row a step, a column for each of NAMES."""
    return z.reshape(-1, len(NAMES))


class _Rows:
    def __init__(self) -> None:
        self.entries: list[tuple[int, int, float]] = []
        self.constants: list[float] = []

    def add(self, terms: _Terms, constant: float = 0.0) -> None:
        self.entries += [(len(self.constants), j, v) for j, v in terms.items() if v != 0.0]
        self.constants.append(constant)

    def matrix(self, n: int) -> sp.csc_matrix:
        row, column, value = zip(*self.entries, strict=True)
        return sp.csc_matrix((value, (row, column)), shape=(len(self.constants), n))


class _Model:
    def __init__(self) -> None:
        self.zero, self.positive, self.left, self.right = _Rows(), _Rows(), _Rows(), _Rows()
        self.hessian: dict[tuple[int, int], float] = {}
        self.gradient: dict[int, float] = {}
        self.constant = 0.0

    def add_square(self, weight: float, terms: _Terms, constant: float = 0.0) -> None:
        """½ weight (terms + constant)²."""
        for i, a in terms.items():
            for j, b in terms.items():
                self.hessian[i, j] = self.hessian.get((i, j), 0.0) + weight * a * b
            self.gradient[i] = self.gradient.get(i, 0.0) + weight * a * constant
        self.constant += 0.5 * weight * constant * constant

    def problem(self, n: int) -> LCQP:
        gradient = np.zeros(n)
        gradient[list(self.gradient)] = list(self.gradient.values())
        row, column = zip(*self.hessian, strict=True)
        Q = sp.csc_matrix((list(self.hessian.values()), (row, column)), shape=(n, n))
        return LCQP(Q, gradient, A=self.zero.matrix(n), b=self.zero.constants, C=self.positive.matrix(n),
                    d=self.positive.constants, L=self.left.matrix(n), l=self.left.constants, R=self.right.matrix(n),
                    r=self.right.constants, c0=self.constant, name="hopper")


def _index(step: int, name: str, which: int = 0) -> int:
    return len(NAMES) * step + _AT[name] + which


def _add_dynamics(model: _Model, p: Hopper, k: int) -> None:
    """Symplectic Euler: a value is its predecessor, at first the initial state, plus h times its rate."""
    h = p.step_s

    def integrate(name: str, initial: float, rate: Mapping[str, float], constant_rate: float = 0.0) -> None:
        terms = {_index(k, name): 1.0, **{_index(k, other): -h * factor for other, factor in rate.items()}}
        if k > 0:
            terms[_index(k - 1, name)] = -1.0
        model.zero.add(terms, -h * constant_rate - (0.0 if k > 0 else initial))

    for i, (name, speed) in enumerate(zip(NAMES[0:4], NAMES[4:8], strict=True)):
        integrate(name, p.position[i], {speed: 1.0})
    to_body, to_foot = 1.0 / p.body_mass, 1.0 / p.foot_mass
    integrate("body_vx", p.velocity[0], {"force_x": to_body})
    integrate("body_vz", p.velocity[1], {"force_z": to_body}, -p.gravity)
    integrate("foot_vx", p.velocity[2], {"force_x": -to_foot, "friction_force": to_foot})
    integrate("foot_vz", p.velocity[3], {"force_z": -to_foot, "normal_force": to_foot}, -p.gravity)


def _add_contact(model: _Model, p: Hopper, k: int) -> None:
    """The foot does not slip while it presses, nor press while it is above the ground, whose height follows signs."""
    def at(name: str, which: int = 0) -> int:
        return _index(k, name, which)

    slips = {at("slip_plus"): 1.0, at("slip_minus"): 1.0}
    model.zero.add({at("foot_vx"): 1.0, at("slip_plus"): -1.0, at("slip_minus"): 1.0})
    for i, edge in enumerate(p.stair_x):  # sign of x - edge, by the stationarity of a linear program
        model.zero.add({at("foot_x"): 1.0, at("sign_plus_0", i): -1.0, at("sign_minus_0", i): 1.0}, -edge)
    distance = {at("foot_z"): 1.0, **{at("sign_0", i): -0.5 * rise for i, rise in enumerate(p.stair_rise)}}
    lowest = -0.5 * sum(p.stair_rise, 0.0)
    for name in ("slip_plus", "slip_minus"):
        model.positive.add({at(name): 1.0})
    model.positive.add(distance, lowest)
    for sign in (-1.0, 1.0):  # the friction cone
        model.positive.add({at("normal_force"): p.friction, at("friction_force"): sign})
    for sign in (1.0, -1.0):
        model.positive.add({at("body_x"): sign, at("foot_x"): -sign}, p.leg_reach_x)
    model.positive.add({at("body_z"): 1.0, at("foot_z"): -1.0}, -p.leg_shortest)
    model.positive.add({at("body_z"): -1.0, at("foot_z"): 1.0}, p.leg_longest)
    model.left.add({**slips, **distance}, lowest)
    model.right.add({at("normal_force"): 1.0})
    for name, sign in (("sign_plus_0", -1.0), ("sign_minus_0", 1.0)):
        for i in range(4):
            model.left.add({at(name, i): 1.0})
            model.right.add({at("sign_0", i): sign}, 1.0)


def _add_objective(model: _Model, p: Hopper, k: int) -> None:
    """The body follows the point; forces are small, and change little."""
    model.add_square(p.tracking_weight, {_index(k, "body_x"): 1.0}, -(p.reference_x + p.speed * p.step_s * (k + 1)))
    for i, name in enumerate(("force_x", "force_z")):
        model.add_square(p.force_weight, {_index(k, name): 1.0})
        if k > 0:
            model.add_square(p.force_rate_weight, {_index(k, name): 1.0, _index(k - 1, name): -1.0})
        else:
            model.add_square(p.force_rate_weight, {_index(k, name): 1.0}, -p.last_force[i])
