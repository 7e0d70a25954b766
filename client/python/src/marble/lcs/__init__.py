"""Linear complementarity systems (LCS), and plans over a horizon of them as LCQPs: contact-implicit MPC.

    x₊ = A x + B u + D λ + d,   0 ≤ λ ⊥ E x + F λ + H u + c ≥ 0
"""

from marble.lcs.along_plan import linearize_along
from marble.lcs.c3 import C3Options, c3_options
from marble.lcs.controller import Controller, ControlStep, StateLinearizer
from marble.lcs.dispatch import linearize, linearizer
from marble.lcs.linearization import ContactPair, Linearization
from marble.lcs.planner import Plan, Planner, PlanOrigin, PlanTimes, rollout
from marble.lcs.statistics import ControlStatistics
from marble.lcs.system import LCS
from marble.lcs.task import Task

__all__ = ["C3Options", "ContactPair", "ControlStatistics", "ControlStep", "Controller", "LCS", "Linearization", "Plan",
           "PlanOrigin", "PlanTimes", "Planner", "StateLinearizer", "Task", "c3_options", "linearize",
           "linearize_along", "linearizer", "rollout"]
