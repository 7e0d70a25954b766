#!/usr/bin/env python3
"""Pyomo calls the program as a solver, with nothing of Marble's between them.

usage: pyomo_driver_test.py MARBLE
"""

import logging
import os
import sys
from pathlib import Path

import pyomo.environ as pyo
from pyomo.mpec import Complementarity, complements
from pyomo.opt import SolverStatus, TerminationCondition

MARBLE = Path(sys.argv[1])
os.environ["PATH"] = f"{MARBLE.parent}{os.pathsep}{os.environ['PATH']}"
for name in ("MARBLE_SERVER", "marble_options"):
    os.environ.pop(name, None)
logging.getLogger("pyomo").setLevel(logging.ERROR)  # of mpec.nl, which is applied twice


def qpec(sense=pyo.minimize):
    """Three pairs, and a sum that holds both first variables back."""
    sign = 1 if sense == pyo.minimize else -1
    m = pyo.ConcreteModel()
    m.y = pyo.Var(range(3), bounds=(0, 50))
    m.w = pyo.Var(range(3))
    m.cost = pyo.Objective(sense=sense, expr=sign * sum(
        (m.y[i] - 60) ** 2 + (m.w[i] + i - 4) ** 2 + m.y[i] * m.w[(i + 1) % 3] for i in range(3)))
    m.pairs = Complementarity(range(3), rule=lambda m, i: complements(m.w[i] >= 0, m.y[i] >= 0))
    m.total = pyo.Constraint(expr=m.y[0] + m.y[1] <= 70)
    m.dual = pyo.Suffix(direction=pyo.Suffix.IMPORT_EXPORT)
    m.rc = pyo.Suffix(direction=pyo.Suffix.IMPORT)
    return m


def solve(m, **words):
    return pyo.SolverFactory("marble").solve(m, **words)


def near(a, b):
    assert abs(a - b) <= 1e-6 * (1 + abs(b)), (a, b)


def an_answer_has_status_primals_duals_and_reduced_costs():
    for sense, sign in ((pyo.minimize, 1), (pyo.maximize, -1)):
        m = qpec(sense)
        result = solve(m)
        assert result.solver.status == SolverStatus.ok, result
        assert result.solver.termination_condition == TerminationCondition.optimal, result
        near(pyo.value(m.cost), sign * 1379)
        for i, y in enumerate((35, 35, 50)):
            near(m.y[i].value, y)
            near(m.w[i].value, 0)
        near(m.dual[m.total], sign * -50)  # 2 (35 - 60)
        near(m.rc[m.y[2]], sign * -20)  # 2 (50 - 60), at its upper bound
        again = solve(m)  # Pyomo gives point and duals back
        assert "0 iterations, 1 factorizations" in again.solver.message, again.solver.message
        near(pyo.value(m.cost), sign * 1379)


def options_and_limits_reach_the_solver():
    m = qpec()
    result = solve(m, options={"global": "true", "gap_tolerance": 1e-3})
    assert "proved optimal" in result.solver.message, result.solver.message
    limited = solve(qpec(), options={"path": "paper", "polish": "false", "max_iterations": 2})
    assert limited.solver.termination_condition == TerminationCondition.maxIterations, limited
    wrong = solve(qpec(), options={"speed": 3}, load_solutions=False)
    assert wrong.solver.status == SolverStatus.error and "speed" in wrong.solver.message, wrong


def what_cannot_be_is_infeasible():
    m = qpec()
    m.more = pyo.Constraint(expr=m.y[0] >= 51)
    result = solve(m, load_solutions=False)
    assert result.solver.termination_condition == TerminationCondition.infeasible, result


def what_falls_without_end_is_unbounded():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(bounds=(0, None))
    m.cost = pyo.Objective(expr=-m.x)
    result = solve(m, load_solutions=False)
    assert result.solver.termination_condition == TerminationCondition.unbounded, result


def a_nonlinear_model_is_refused_with_the_constraints_name():
    m = qpec()
    m.heat = pyo.Constraint(expr=pyo.exp(m.w[0]) <= 3)
    result = solve(m, load_solutions=False, symbolic_solver_labels=True)
    assert result.solver.status == SolverStatus.error, result
    assert "exp" in result.solver.message and "constraint heat (C" in result.solver.message, result.solver.message


def integers_are_refused_with_the_variables_name():
    m = qpec()
    m.switch = pyo.Var(domain=pyo.Binary)
    m.on = pyo.Constraint(expr=m.y[0] <= 50 * m.switch)
    result = solve(m, load_solutions=False, symbolic_solver_labels=True)
    assert result.solver.status == SolverStatus.error, result
    assert "variable switch (v" in result.solver.message, result.solver.message


def the_version_is_told():
    solver = pyo.SolverFactory("marble")
    assert solver.available()
    assert solver.version() is not None


def main():
    promises = [an_answer_has_status_primals_duals_and_reduced_costs, options_and_limits_reach_the_solver,
                what_cannot_be_is_infeasible, what_falls_without_end_is_unbounded,
                a_nonlinear_model_is_refused_with_the_constraints_name,
                integers_are_refused_with_the_variables_name, the_version_is_told]
    for promise in promises:
        promise()
        print("holds:", promise.__name__.replace("_", " "))


main()
