"""A pusher that brings a box to a place by one of its sides, slowly: it sticks to the side, or slides along it.

Under the box friction is an ellipsoid of forces and of the moment, so that its velocity in its own axes follows the
pusher's force (f_n, f_t) at (−half, c): (f_n, f_t) along them, and a turn of (−half f_t − c f_n) / reach². The point
of contact slides by c' = s⁺ − s⁻ only at the cone's edge:

    0 ≤ μ f_n − f_t ⊥ s⁺ ≥ 0    0 ≤ μ f_n + f_t ⊥ s⁻ ≥ 0
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marble.robots.plan import Formulas, Robot, Scene, Tables, casadi

_INF = float("inf")


@dataclass(frozen=True)
class Pusher:
    """Parameters, in metres, seconds and radians; forces are in the speed they cause. reach: the moment's over them.

    initial: x, y and angle of the box, and the point of contact; goal: those of the box.
    """

    steps: int = 30
    step_s: float = 0.2
    half: float = 0.5
    reach: float = 0.38
    friction: float = 0.3
    initial: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    goal: tuple[float, ...] = (2.5, 1.0, 0.0)
    fastest_slide: float = 1.0
    force_weight: float = 1.0
    slide_weight: float = 0.1

    def robot(self) -> Robot:
        """The plan to be found: 8 variables and two pairs a step, by the midpoint rule."""
        ca, made, n = casadi(), Formulas("pusher", self.step_s), self.steps
        along = np.linspace(0.0, 1.0, n + 1)[:, None]
        guess = np.zeros((n + 1, 4))
        guess[:, :3] = (1 - along) * self.initial[:3] + along * self.goal
        edge = 0.9 * self.half
        state = made.table("state", n + 1, [-_INF] * 3 + [-edge], [_INF] * 3 + [edge], guess)
        force = made.table("force", n, [0.0, -_INF], [_INF, _INF], [self.goal[0] / (n * self.step_s), 0.0])
        slide = made.table("slide", n, [0.0, 0.0], [self.fastest_slide] * 2, [0.0, 0.0])
        made.zero(state[0, :] - ca.DM(self.initial).T, state[-1, :3] - ca.DM(self.goal).T)
        for k in range(n):
            now, then, (ahead, across) = state[k, :], state[k + 1, :], (force[k, 0], force[k, 1])
            angle, contact = (now[2] + then[2]) / 2, (now[3] + then[3]) / 2
            rise = [ca.cos(angle) * ahead - ca.sin(angle) * across, ca.sin(angle) * ahead + ca.cos(angle) * across,
                    -(self.half * across + contact * ahead) / self.reach**2, slide[k, 0] - slide[k, 1]]
            made.zero(*(then[i] - now[i] - self.step_s * each for i, each in enumerate(rise)))
            made.pair(self.friction * ahead - across, slide[k, 0])
            made.pair(self.friction * ahead + across, slide[k, 1])
        made.square(self.force_weight, force)
        made.square(self.slide_weight, slide)
        return made.robot(self.scene)

    def scene(self, tables: Tables) -> Scene:
        """From above: the box, and the pusher's point on it; full dots where it slides."""
        corners = self.half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
        bodies, points = [], []
        for x, y, angle, contact in tables["state"]:
            turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
            point = np.array([-self.half, contact])
            stick = np.array([point, point - [0.3, 0.0]])
            bodies.append([corners @ turn + [x, y], stick @ turn + [x, y]])
            points.append(point @ turn + [x, y])
        sliding = tables["slide"].max(axis=1) > 1e-4
        return Scene(fixed=[], path=tables["state"][:, :2], bodies=bodies, marks=np.array(points)[:-1][sliding],
                     axes=("x (m)", "y (m)"))
