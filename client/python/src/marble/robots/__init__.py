"""Robots whose formulas bend, planned from an LCQP's answer: rocket, quadrotor, hopper, pusher. Needs casadi.

    plan = marble.robots.solve(marble.robots.Rocket().robot())
    marble.robots.save(plan, "rocket.gif")

Patterns for planners of one's own: `Formulas` collects variables, rows, pairs and squares.
"""

from marble.robots.drawing import save
from marble.robots.hopper import Hopper
from marble.robots.plan import Formulas, Plan, Robot, Scene, solve
from marble.robots.pusher import Pusher
from marble.robots.quadrotor import Quadrotor
from marble.robots.rocket import Rocket

__all__ = ["ROBOTS", "Formulas", "Hopper", "Plan", "Pusher", "Quadrotor", "Robot", "Rocket", "Scene", "save", "solve"]

ROBOTS = {"rocket": Rocket, "quadrotor": Quadrotor, "hopper": Hopper, "pusher": Pusher}
