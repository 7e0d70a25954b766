"""A rocket that is caught by a tower: `marble example rocket` with its sines and cosines.

    x'' = −T/m sin(θ + α)    y'' = T/m cos(θ + α) − g    θ'' = −T ℓ/I sin α    α' = u

with thrust T and gimbal angle α. Below the trigger's altitude both ends are to the right of the tower, and the thrust
does not point at it: 0 ≤ p ⊥ q ≥ 0 with p ≥ y_trigger − y and q at least what each of these lacks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from marble.robots.plan import Formulas, Robot, Scene, Tables, casadi

_INF = float("inf")


@dataclass(frozen=True)
class Rocket:
    """Parameters, in SI units and radians; thrusts as parts of the weight."""

    steps: int = 40
    step_s: float = 0.25
    gravity: float = 9.81
    mass: float = 1.0
    half_length: float = 2.0
    trigger_altitude: float = 18.0
    initial: tuple[float, ...] = (13.0, 25.5, 0.0, -4.0, -4.0, 0.0, 0.0)
    catch: tuple[float, float] = (0.5, 6.0)
    largest_angle: float = 0.35
    largest_gimbal: float = 0.25
    largest_rate: float = 0.5
    fastest_descent: float = 6.0
    thrust: tuple[float, float] = (0.4, 1.6)
    weights: tuple[float, ...] = (0.5, 0.0, 400.0, 1.0, 0.0, 400.0, 400.0)
    thrust_weight: float = 4.0
    gimbal_rate_weight: float = 400.0
    final_weight: float = 2000.0
    hold_weight: float = 1e-2

    def slopes(self, state: Any, thrust: Any) -> list[Any]:
        """Of x, y, θ, vx, vy and ω."""
        ca = casadi()
        lean, inertia = state[2] + state[6], self.mass * self.half_length**2 / 3
        return [state[3], state[4], state[5], -thrust / self.mass * ca.sin(lean),
                thrust / self.mass * ca.cos(lean) - self.gravity,
                -thrust * self.half_length / inertia * ca.sin(state[6])]

    def robot(self) -> Robot:
        """The plan to be found: 11 variables and a pair a step, by the trapezoidal rule."""
        ca, made, n = casadi(), Formulas("rocket", self.step_s), self.steps
        weight = self.mass * self.gravity
        lower = [-_INF, self.half_length, -self.largest_angle, -_INF, -self.fastest_descent, -self.largest_rate,
                 -self.largest_gimbal]
        upper = [_INF, _INF, self.largest_angle, _INF, 0.0, self.largest_rate, self.largest_gimbal]
        along = np.linspace(0.0, 1.0, n)[:, None]
        guess = np.zeros((n, 7))
        guess[:, :2] = (1 - along) * self.initial[:2] + along * self.catch
        state = made.table("state", n, lower, upper, guess)
        inputs = made.table("inputs", n - 1, [self.thrust[0] * weight, -_INF], [self.thrust[1] * weight, _INF],
                            [weight, 0.0])
        hold = made.table("hold", n, [0.0, 0.0], [_INF, _INF], [0.0, 0.0])
        made.zero(state[0, :] - ca.DM(self.initial).T, state[-1, :2] - ca.DM(self.catch).T, state[-1, 3:5])
        for k in range(n - 1):
            now, then, thrust = state[k, :], state[k + 1, :], inputs[k, 0]
            rise = zip(self.slopes(now, thrust), self.slopes(then, thrust), strict=True)
            made.zero(*(then[i] - now[i] - self.step_s / 2 * (a + b) for i, (a, b) in enumerate(rise)))
            made.zero(then[6] - now[6] - self.step_s * inputs[k, 1])
        for k in range(n):
            x, y, angle, gimbal = state[k, 0], state[k, 1], state[k, 2], state[k, 6]
            made.positive(hold[k, 0] - (self.trigger_altitude - y), hold[k, 1] + x - self.half_length * ca.sin(angle),
                          hold[k, 1] + x + self.half_length * ca.sin(angle), hold[k, 1] + ca.sin(angle + gimbal))
            made.pair(hold[k, 0], hold[k, 1])
        for i, factor in enumerate(self.weights):
            made.square(factor, state[:, i] - (self.catch[0] if i == 0 else 0.0))
        made.square(self.thrust_weight, inputs[:, 0] - weight)
        made.square(self.gimbal_rate_weight, inputs[:, 1])
        made.square(self.final_weight, state[-1, [2, 5]])
        made.square(self.hold_weight, hold)  # p and q are no larger than they must be
        return made.robot(self.scene)

    def scene(self, tables: Tables) -> Scene:
        """The rocket, its flame against the gimbal, and the tower; a dot where it is caught."""
        bodies = []
        for k, (x, y, angle, _, _, _, gimbal) in enumerate(tables["state"]):
            along = self.half_length * np.array([-np.sin(angle), np.cos(angle)])
            tail = np.array([x, y]) - along
            thrust = tables["inputs"][min(k, self.steps - 2), 0] / (self.mass * self.gravity)
            flame = 1.5 * thrust * np.array([np.sin(angle + gimbal), -np.cos(angle + gimbal)])
            bodies.append([np.array([tail, tail + 2 * along]), np.array([tail, tail + flame])])
        tower = np.array([[0.0, 0.0], [0.0, self.trigger_altitude]])
        return Scene(fixed=[tower], path=tables["state"][:, :2], bodies=bodies, marks=np.array([self.catch]),
                     axes=("x (m)", "y (m)"))
