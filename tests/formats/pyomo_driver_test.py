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
    result = solve(m, options={"global_search": "true", "relative_gap_tolerance": 1e-3})
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


def hs071(sense=pyo.minimize, product=25, squares=40):
    """Problem 71 of Hock and Schittkowski: objective 17.0140173 at (1, 4.7429994, 3.8211503, 1.3794082)."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var(range(4), bounds=(1, 5), initialize=lambda m, i: (1, 5, 5, 1)[i])
    x = m.x
    cost = x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2]
    m.cost = pyo.Objective(sense=sense, expr=cost if sense == pyo.minimize else -cost)
    m.product = pyo.Constraint(expr=x[0] * x[1] * x[2] * x[3] >= product)
    m.squares = pyo.Constraint(expr=sum(x[i] ** 2 for i in range(4)) == squares)
    m.dual = pyo.Suffix(direction=pyo.Suffix.IMPORT)
    m.rc = pyo.Suffix(direction=pyo.Suffix.IMPORT)
    return m


def a_nonlinear_model_has_its_known_optimum_and_multipliers():
    for sense, sign in ((pyo.minimize, 1), (pyo.maximize, -1)):
        m = hs071(sense)
        result = solve(m)
        assert result.solver.termination_condition == TerminationCondition.optimal, result
        near(pyo.value(m.cost), sign * 17.0140172892)
        for i, x in enumerate((1, 4.7429994, 3.8211503, 1.3794082)):
            near(m.x[i].value, x)
        near(m.dual[m.product], sign * 0.5522937)
        near(m.dual[m.squares], sign * -0.1614686)
        near(m.rc[m.x[0]], sign * 1.0878712)


def duals_of_a_nonlinear_model_are_changes_of_its_objective():
    step = 1e-3
    for sense in (pyo.minimize, pyo.maximize):
        def objective(**words):
            m = hs071(sense, **words)
            solve(m, options={"step_tolerance": 1e-10})
            return pyo.value(m.cost)
        m = hs071(sense)
        solve(m)
        for name, value in (("product", 25), ("squares", 40)):
            change = (objective(**{name: value + step}) - objective(**{name: value - step})) / (2 * step)
            assert abs(change - m.dual[m.component(name)]) < 1e-5, (name, change, m.dual[m.component(name)])


def wall(start):
    """A nonlinear MPEC: the gap of a bent wall and the force on it, of which one is zero."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=start)
    m.force = pyo.Var(initialize=0.0)
    m.cost = pyo.Objective(expr=(m.x - 2) ** 2 + (m.force - 0.1) ** 2)
    m.wall = Complementarity(expr=complements(pyo.exp(m.x) - 2 >= 0, m.force >= 0))
    m.cap = pyo.Constraint(expr=m.x * m.x + m.force <= 3)
    m.dual = pyo.Suffix(direction=pyo.Suffix.IMPORT)
    return m


def a_nonlinear_condition_keeps_its_branch_and_has_a_multiplier():
    # The gap is worth more than the force: x is where its square is the cap.
    m = wall(1.5)
    assert solve(m).solver.termination_condition == TerminationCondition.optimal
    near(m.x.value, 3 ** 0.5)
    near(m.force.value, 0)
    near(m.dual[m.cap], (3 ** 0.5 - 2) / 3 ** 0.5)  # 2 (x - 2) / 2 x
    # Where there can be no gap, the force is as wished.
    m = wall(0.5)
    m.near = pyo.Constraint(expr=m.x <= pyo.log(2))
    assert solve(m).solver.termination_condition == TerminationCondition.optimal
    near(m.x.value, 0.6931471805599453)
    near(m.force.value, 0.1)


def what_cannot_be_of_a_nonlinear_model_is_infeasible():
    m = hs071(squares=3)  # four numbers of at least 1
    assert solve(m, load_solutions=False).solver.termination_condition == TerminationCondition.infeasible


def a_start_without_a_value_is_an_error_that_names_the_constraint():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=-1.0)
    m.cost = pyo.Objective(expr=m.x ** 2)
    m.heat = pyo.Constraint(expr=pyo.log(m.x) <= 3)
    result = solve(m, load_solutions=False, symbolic_solver_labels=True)
    assert result.solver.status == SolverStatus.error, result
    assert "initial point, in constraint heat (C" in result.solver.message, result.solver.message
    m.x.value = 1.0
    assert solve(m).solver.termination_condition != TerminationCondition.error


def a_start_at_a_bound_without_a_value_is_moved_off_it():
    for cost, bounds, best in ((lambda x: x - pyo.log(x), (0, 10), 1), (lambda x: x * pyo.log(x), (0, 10), -0.3678794412),
                               (lambda x: 1 / x + x, (0, 10), 2), (lambda x: (pyo.log(x - 2) - 1) ** 2, (2, 10), 0),
                               (lambda x: x - pyo.sqrt(x), (0, 10), -0.25)):
        m = pyo.ConcreteModel()
        m.x = pyo.Var(bounds=bounds)  # no start, which is 0 in a file
        m.cost = pyo.Objective(expr=cost(m.x))
        assert solve(m).solver.termination_condition == TerminationCondition.optimal
        near(pyo.value(m.cost), best)


def limits_and_settings_reach_the_nonlinear_loop():
    limited = solve(hs071(), options={"iteration_limit": 2})
    assert limited.solver.termination_condition == TerminationCondition.maxIterations, limited
    late = solve(hs071(), options={"time_limit_s": 0}, load_solutions=False)
    assert "time_limit" in late.solver.message, late.solver.message
    m = hs071()
    assert solve(m, options={"curvature": "bfgs"}).solver.termination_condition == TerminationCondition.optimal
    near(pyo.value(m.cost), 17.0140172892)
    wrong = solve(hs071(), options={"curvature": "flat"}, load_solutions=False)
    assert wrong.solver.status == SolverStatus.error and "curvature" in wrong.solver.message, wrong


def what_jumps_is_refused_with_the_constraints_name():
    m = qpec()
    m.heat = pyo.Constraint(expr=pyo.floor(m.w[0]) <= 3)
    result = solve(m, load_solutions=False, symbolic_solver_labels=True)
    assert result.solver.status == SolverStatus.error, result
    assert "floor" in result.solver.message and "constraint heat (C" in result.solver.message, result.solver.message


def integers_are_refused_with_the_variables_name():
    m = qpec()
    m.switch = pyo.Var(domain=pyo.Binary)
    m.on = pyo.Constraint(expr=m.y[0] <= 50 * m.switch)
    result = solve(m, load_solutions=False, symbolic_solver_labels=True)
    assert result.solver.status == SolverStatus.error, result
    assert "variable switch (v" in result.solver.message, result.solver.message


def the_version_is_reported():
    solver = pyo.SolverFactory("marble")
    assert solver.available()
    assert solver.version() is not None


def main():
    promises = [an_answer_has_status_primals_duals_and_reduced_costs, options_and_limits_reach_the_solver,
                what_cannot_be_is_infeasible, what_falls_without_end_is_unbounded,
                a_nonlinear_model_has_its_known_optimum_and_multipliers,
                duals_of_a_nonlinear_model_are_changes_of_its_objective,
                a_nonlinear_condition_keeps_its_branch_and_has_a_multiplier,
                what_cannot_be_of_a_nonlinear_model_is_infeasible,
                a_start_without_a_value_is_an_error_that_names_the_constraint,
                a_start_at_a_bound_without_a_value_is_moved_off_it,
                limits_and_settings_reach_the_nonlinear_loop, what_jumps_is_refused_with_the_constraints_name,
                integers_are_refused_with_the_variables_name, the_version_is_reported]
    for promise in promises:
        promise()
        print("holds:", promise.__name__.replace("_", " "))


main()
