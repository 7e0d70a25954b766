"""A hopper: body and foot, a leg that turns, and a contact whose forces a time step decides.

The leg has the angle a and the length l, with the force F along it and the torque τ at the hip. A step ends with the
velocities v and places q = q_before + h v that its own contact leaves; s is the speed at which the foot slips, if any:

    0 ≤ z_foot ⊥ N ≥ 0    0 ≤ s + v_foot ⊥ T⁺ ≥ 0    0 ≤ s − v_foot ⊥ T⁻ ≥ 0    0 ≤ μ N − T⁺ − T⁻ ⊥ s ≥ 0

(D. Stewart, J. Trinkle, 1996).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marble.robots.plan import Formulas, Robot, Scene, Tables, casadi

_INF = float("inf")


@dataclass(frozen=True)
class Hopper:
    """Parameters, in SI units and radians. It begins at rest, the body `stance` above the foot, and shall end so."""

    steps: int = 40
    step_s: float = 0.05
    gravity: float = 9.81
    masses: tuple[float, float] = (1.0, 0.3)
    friction: float = 0.6
    stance: float = 0.6
    begin: float = 0.0
    end: float = 1.5
    leg: tuple[float, float] = (0.35, 0.85)
    widest: float = 0.7
    most_force: float = 60.0
    most_torque: float = 15.0
    force_weight: float = 0.01
    torque_weight: float = 0.1
    path_weight: float = 5.0
    end_weight: float = 100.0
    contact_weight: float = 1e-2

    def robot(self) -> Robot:
        """The plan to be found: 16 variables and four pairs a step."""
        ca, made, n, h = casadi(), Formulas("hopper", self.step_s), self.steps, self.step_s
        body, foot = self.masses
        ends = [[x, self.stance, x, 0.0] for x in (self.begin, self.end)]
        along = np.linspace(0.0, 1.0, n + 1)[:, None]
        between = (1 - along) * ends[0] + along * ends[1]
        place = made.table("place", n + 1, [-_INF] * 4, [_INF] * 4, between)
        speed = made.table("speed", n + 1, [-_INF] * 4, [_INF] * 4, [0.0] * 4)
        leg = made.table("leg", n + 1, [-self.widest, self.leg[0]], [self.widest, self.leg[1]], [0.0, self.stance])
        drive = made.table("drive", n, [-self.most_force, -self.most_torque], [self.most_force, self.most_torque],
                           [0.0, 0.0])
        contact = made.table("contact", n, [0.0] * 3, [_INF] * 3, [0.0] * 3)
        slip = made.table("slip", n, [0.0], [_INF], [0.0])
        made.zero(place[0, :] - ca.DM(ends[0]).T, speed[0, :])
        made.zero(place[1:, :] - place[:-1, :] - h * speed[1:, :])
        for k in range(n + 1):
            made.zero(place[k, 0] - place[k, 2] - leg[k, 1] * ca.sin(leg[k, 0]),
                      place[k, 1] - place[k, 3] - leg[k, 1] * ca.cos(leg[k, 0]))
        for k in range(n):
            angle, length, turn = leg[k, 0], leg[k, 1], drive[k, 1]
            push = (drive[k, 0] * ca.sin(angle) + turn / length * ca.cos(angle),
                    drive[k, 0] * ca.cos(angle) - turn / length * ca.sin(angle))
            normal, along_it, against = contact[k, 0], contact[k, 1], contact[k, 2]
            gained = speed[k + 1, :] - speed[k, :]
            made.zero(body * gained[0] - h * push[0], body * (gained[1] + h * self.gravity) - h * push[1],
                      foot * gained[2] - h * (along_it - against - push[0]),
                      foot * (gained[3] + h * self.gravity) - h * (normal - push[1]))
            made.pair(place[k + 1, 3], normal)
            made.pair(slip[k] + speed[k + 1, 2], along_it)
            made.pair(slip[k] - speed[k + 1, 2], against)
            made.pair(self.friction * normal - along_it - against, slip[k])
        made.square(self.force_weight, drive[:, 0])
        made.square(self.torque_weight, drive[:, 1])
        made.square(self.path_weight, place[:, 0] - ca.DM(between[:, 0]))
        made.square(self.end_weight, ca.horzcat(place[-1, :] - ca.DM(ends[1]).T, speed[-1, :]))
        made.square(self.contact_weight, contact)
        made.square(self.contact_weight, slip)
        return made.robot(self.scene)

    def scene(self, tables: Tables) -> Scene:
        """From the side: body, leg and foot; full dots where the foot presses."""
        place, pressed = tables["place"], tables["contact"][:, 0] > 1e-3
        floor = np.array([[self.begin - 0.5, 0.0], [self.end + 0.5, 0.0]])
        return Scene(fixed=[floor], path=place[:, :2], bodies=[[each.reshape(2, 2)] for each in place],
                     marks=place[1:, 2:][pressed], axes=("x (m)", "z (m)"))
