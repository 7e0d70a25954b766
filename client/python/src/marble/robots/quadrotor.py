"""A quadrotor that flies through gates in their order, by its full attitude: `marble example gates`, but wider ones.

    r'' = a R(φ, θ, ψ) e_z − g e_z    φ' = p + (q sin φ + s cos φ) tan θ    θ' = q cos φ − s sin φ
                                      ψ' = (q sin φ + s cos φ) / cos θ

with thrust a and body rates p, q, s. The progress γ of a gate goes from 0 to 1 and rises only in steps whose point is
in the gate's box: 0 ≤ γ_k − γ_(k−1) ⊥ e_k ≥ 0 with e_k at least the distance to the box along each of its axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from marble.robots.plan import Formulas, Robot, Scene, Tables, casadi

_INF = float("inf")


@dataclass(frozen=True)
class Quadrotor:
    """Parameters, in SI units and radians; thrust per mass. gates: centre and yaw of each."""

    steps: int = 30
    step_s: float = 0.12
    gravity: float = 9.81
    initial: tuple[float, ...] = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    final: tuple[float, ...] = (6.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    gates: tuple[tuple[tuple[float, float, float], float], ...] = (
        ((1.5, 0.9, 1.3), 0.4), ((2.9, -0.6, 1.7), -0.8), ((4.0, 0.7, 0.9), 0.9), ((5.2, -0.5, 1.4), -0.5))
    half_extent: tuple[float, float, float] = (0.25, 0.4, 0.4)
    largest_tilt: float = 0.6
    largest_yaw: float = 0.6
    most_thrust: float = 8.0
    largest_rate: float = 4.0
    largest_yaw_rate: float = 2.0
    velocity_weight: float = 1.0
    angle_weight: float = 10.0
    thrust_weight: float = 2.0
    rate_weight: float = 4.0
    excess_weight: float = 1e-2

    def slopes(self, state: Any, inputs: Any) -> list[Any]:
        """Of position, velocity, roll, pitch and yaw."""
        ca = casadi()
        roll, pitch, yaw = state[6], state[7], state[8]
        thrust, turn = self.gravity + inputs[0], inputs[2] * ca.sin(roll) + inputs[3] * ca.cos(roll)
        forward = ca.sin(pitch) * ca.cos(roll)
        return [state[3], state[4], state[5],
                thrust * (ca.cos(yaw) * forward + ca.sin(yaw) * ca.sin(roll)),
                thrust * (ca.sin(yaw) * forward - ca.cos(yaw) * ca.sin(roll)),
                thrust * ca.cos(pitch) * ca.cos(roll) - self.gravity,
                inputs[1] + turn * ca.tan(pitch), inputs[2] * ca.cos(roll) - inputs[3] * ca.sin(roll),
                turn / ca.cos(pitch)]

    def robot(self) -> Robot:
        """The plan to be found: 13 variables a step, two more and a pair for each gate, by the trapezoidal rule."""
        ca, made, n, count = casadi(), Formulas("quadrotor", self.step_s), self.steps, len(self.gates)
        largest = [_INF] * 6 + [self.largest_tilt, self.largest_tilt, self.largest_yaw]
        along = np.linspace(0.0, 1.0, n)[:, None]
        guess = np.zeros((n, 9))
        guess[:, :3] = (1 - along) * self.initial[:3] + along * self.final[:3]
        state = made.table("state", n, [-each for each in largest], largest, guess)
        most = [self.most_thrust, self.largest_rate, self.largest_rate, self.largest_yaw_rate]
        inputs = made.table("inputs", n - 1, [-each for each in most], most, [0.0] * 4)
        progress = made.table("progress", n, [0.0] * count, [1.0] * count, np.repeat(along, count, axis=1))
        excess = made.table("excess", n, [0.0] * count, [_INF] * count, [0.0] * count)
        made.zero(state[0, :] - ca.DM(self.initial).T, state[-1, :6] - ca.DM(self.final).T, progress[-1, :] - 1)
        for k in range(n - 1):
            now, then = state[k, :], state[k + 1, :]
            rise = zip(self.slopes(now, inputs[k, :]), self.slopes(then, inputs[k, :]), strict=True)
            made.zero(*(then[i] - now[i] - self.step_s / 2 * (a + b) for i, (a, b) in enumerate(rise)))
        for k in range(n):
            made.positive(progress[k, :-1] - progress[k, 1:])
            gained = progress[k, :] - (progress[k - 1, :] if k else 0)
            for j, (centre, yaw) in enumerate(self.gates):
                x, y, z = (state[k, i] - centre[i] for i in range(3))
                sides = (np.cos(yaw) * x + np.sin(yaw) * y, np.cos(yaw) * y - np.sin(yaw) * x, z)
                for side, half in zip(sides, self.half_extent, strict=True):
                    made.positive(excess[k, j] + half - side, excess[k, j] + half + side)
                made.pair(gained[j], excess[k, j])
        made.square(self.velocity_weight, state[:, 3:6])
        made.square(self.angle_weight, state[:, 6:])
        made.square(self.thrust_weight, inputs[:, 0])
        made.square(self.rate_weight, inputs[:, 1:])
        made.square(self.excess_weight, excess)  # e is no larger than it must be
        return made.robot(self.scene)

    def scene(self, tables: Tables) -> Scene:
        """From above: its two arms, and the gates' boxes; full dots where it makes progress through one."""
        depth, width, _ = self.half_extent
        corners = np.array([[-depth, -width], [depth, -width], [depth, width], [-depth, width], [-depth, -width]])
        boxes = []
        for (x, y, _), yaw in self.gates:
            turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
            boxes.append(corners @ turn + [x, y])
        bodies = []
        for x, y, _, _, _, _, roll, pitch, yaw in tables["state"]:
            ahead = 0.25 * np.cos(pitch) * np.array([np.cos(yaw), np.sin(yaw)])
            aside = 0.25 * np.cos(roll) * np.array([-np.sin(yaw), np.cos(yaw)])
            bodies.append([np.array([x, y]) + np.array([-arm, arm]) for arm in (ahead + aside, ahead - aside)])
        gained = np.diff(tables["progress"], axis=0, prepend=0.0).max(axis=1) > 1e-4
        return Scene(fixed=boxes, path=tables["state"][:, :2], bodies=bodies, marks=tables["state"][gained, :2],
                     axes=("x (m)", "y (m)"))
