"""The real Pyomo with Marble as its persistent solver: what is solved, what is sent, what is refused by its name."""

import itertools
import logging
import os
import pathlib
import tempfile
import unittest
from unittest import mock

import numpy as np
import pyomo.environ as pyo
from adapter_page import almost_solved, example, local_and_remote, one_warning_of_almost
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity, complements
from pyomo.opt import SolverStatus, TerminationCondition

import marble
import marble.pyomo
from marble.repeated import Repeated

logging.getLogger("pyomo").setLevel(logging.ERROR)
INF = np.inf
FREE = (-INF, INF)
# What is written, and the pieces of its meaning: boxes of y and of w.
CONDITIONS = {
    "w >= 0, y >= 0": (lambda m: complements(m.w >= 0, m.y >= 0), [((0, 0), (0, INF)), ((0, INF), (0, 0))]),
    "w >= 0, y <= 50": (lambda m: complements(m.w >= 0, m.y <= 50), [((50, 50), (0, INF)), ((-INF, 50), (0, 0))]),
    "w <= 0, y <= 50": (lambda m: complements(m.w <= 0, m.y <= 50), [((50, 50), (-INF, 0)), ((-INF, 50), (0, 0))]),
    "w <= m.p, y >= 0": (lambda m: complements(m.w <= m.p, m.y >= 0), [((0, 0), (-INF, 2)), ((0, INF), (2, 2))]),
    "w + 1 >= 0, 50 - y >= 0": (lambda m: complements(m.w + 1 >= 0, 50 - m.y >= 0),
                                [((50, 50), (-1, INF)), ((-INF, 50), (-1, -1))]),
    "w == 3, y": (lambda m: complements(m.w == 3, m.y), [(FREE, (3, 3))]),
    "0 <= y <= 50, w": (lambda m: complements(pyo.inequality(0, m.y, 50), m.w),
                        [((0, 0), (0, INF)), ((0, 50), (0, 0)), ((50, 50), (-INF, 0))]),
    "y, 0 <= w <= 5": (lambda m: complements(m.y, pyo.inequality(0, m.w, 5)),
                       [((0, INF), (0, 0)), ((0, 0), (0, 5)), ((-INF, 0), (5, 5))]),
}


def qpec(sense=pyo.minimize):
    """Three pairs, and a sum that holds both first variables back."""
    sign = 1 if sense == pyo.minimize else -1
    m = pyo.ConcreteModel("qpec")
    m.p = pyo.Param(initialize=0, mutable=True)
    m.y = pyo.Var(range(3), bounds=(0, 50))
    m.w = pyo.Var(range(3))
    m.cost = pyo.Objective(sense=sense, expr=sign * sum(
        (m.y[i] - 60) ** 2 + (m.w[i] + i - 4 + m.p) ** 2 + m.y[i] * m.w[(i + 1) % 3] for i in range(3)))
    m.pairs = Complementarity(range(3), rule=lambda m, i: complements(m.w[i] >= 0, m.y[i] >= 0))
    m.total = pyo.Constraint(expr=m.y[0] + m.y[1] + m.p * m.y[2] <= 70 + m.p)
    m.dual = pyo.Suffix(direction=pyo.Suffix.IMPORT)
    m.rc = pyo.Suffix(direction=pyo.Suffix.IMPORT)
    return m


def solver(**words):
    return pyo.SolverFactory("marble_persistent", server="local", **words)


class Pyomo(unittest.TestCase):
    def test_conditions_mean_what_they_say(self):
        wanted = list(itertools.product((60.0, 20.0, -60.0), (-5.0, 5.0)))
        for words, (condition, pieces) in CONDITIONS.items():
            m = pyo.ConcreteModel()
            m.p, m.far, m.up = (pyo.Param(initialize=2, mutable=True) for _ in range(3))
            m.w, m.y = pyo.Var(), pyo.Var()
            m.cost = pyo.Objective(expr=(m.y - m.far) ** 2 + (m.w - m.up) ** 2)
            m.condition = Complementarity(expr=condition(m))
            for m.far.value, m.up.value in wanted:
                one = solver()
                one.solve(m)
                best = min(sum((np.clip(at, *box) - at) ** 2 for at, box in zip((m.far.value, m.up.value), piece))
                           for piece in pieces)
                self.assertAlmostEqual(pyo.value(m.cost), best, 5, f"{words}, {m.far.value}, {m.up.value}")

    def test_sides_with_bounds_of_their_own_mean_the_same_by_files(self):
        boxes = {"above": (1, 9), "below": (-3, 4), "both": (-2, 60), "none": (None, None), "at": (0, 50)}
        wanted = [(60.0, -5.0), (20.0, 5.0), (0.5, 5.0), (-60.0, -5.0)]
        for (words, (condition, _)), (name, (low, high)) in itertools.product(CONDITIONS.items(), boxes.items()):
            m = pyo.ConcreteModel()
            m.p = pyo.Param(initialize=2, mutable=True)
            m.far, m.up = pyo.Param(initialize=0, mutable=True), pyo.Param(initialize=0, mutable=True)
            m.w, m.y, m.v = pyo.Var(), pyo.Var(bounds=(low, high)), pyo.Var(bounds=(-1, None))
            m.cost = pyo.Objective(expr=(m.y - m.far) ** 2 + (m.w - m.up) ** 2 + (m.v - 1) ** 2)
            conditions = [None, condition(m), complements(m.v >= 0, m.v >= -2)]
            m.pair = Complementarity([1, 2], rule=lambda _, i: conditions[i])  # noqa: B023
            args = m.pair[1]._args
            for m.far.value, m.up.value in wanted[:: 1 if name == "above" else 2]:
                with self.subTest(words, own=name, wanted=(m.far.value, m.up.value)):
                    right = solver().solve(m).solver.termination_condition
                    cost = pyo.value(m.cost) if right == TerminationCondition.optimal else None
                    m.y.value = m.w.value = m.v.value = None
                    found = pyo.SolverFactory("marble").solve(m)
                    self.assertEqual(found.solver.termination_condition, right)
                    if right == TerminationCondition.optimal:
                        self.assertAlmostEqual(pyo.value(m.cost), cost, 5)
                    self.assertEqual(m.y.bounds, (low, high))
                    self.assertIs(m.pair[1]._args, args)
                    self.assertTrue(m.pair[1].active)
                    self.assertEqual([part.name for part in m.component_objects((pyo.Block, pyo.Var))], ["w", "y", "v"])

    def test_a_side_in_no_row_or_that_is_fixed_is_written_too(self):
        for fixed, best in ((None, 0), (2.0, 1)):
            m = pyo.ConcreteModel()
            m.x, m.y = pyo.Var(bounds=(0, 5)), pyo.Var(bounds=(0, 5))
            m.cost = pyo.Objective(expr=(m.x - 1) ** 2)
            m.pair = Complementarity(expr=complements(m.x >= 0, m.y >= 0))
            if fixed is not None:
                m.y.fix(fixed)
            pyo.assert_optimal_termination(pyo.SolverFactory("marble").solve(m))
            self.assertAlmostEqual(pyo.value(m.cost), best, 6)
            self.assertAlmostEqual(m.y.value, fixed or 0, 6)

    def test_a_failed_solve_by_files_leaves_the_model_as_it_was(self):
        m = pyo.ConcreteModel()
        m.x, m.y = pyo.Var(bounds=(0, 10)), pyo.Var(bounds=(1, 9))
        m.cost = pyo.Objective(expr=(m.x - 2) ** 2 + (m.y - 3) ** 2)
        m.pair = Complementarity(expr=complements(m.x >= 0, m.y >= 0))
        m.jump = pyo.Constraint(expr=pyo.floor(m.x) <= 3)
        with self.assertRaises(ValueError):  # Pyomo's, as there is nothing to load
            pyo.SolverFactory("marble").solve(m)
        self.assertEqual(m.y.bounds, (1, 9))
        self.assertEqual(len(list(m.component_data_objects(pyo.Var))), 2)
        m.jump.deactivate()
        solver().solve(m)
        self.assertAlmostEqual(m.y.value, 3, 6)

    def test_the_transformation_for_files_writes_what_the_model_says(self):
        m = pyo.ConcreteModel()
        m.x, m.y = pyo.Var(bounds=(0, 10)), pyo.Var(bounds=(1, 9))
        m.cost = pyo.Objective(expr=(m.x - 2) ** 2 + (m.y - 3) ** 2)
        m.pair = Complementarity(expr=complements(m.x >= 0, m.y >= 0))
        with self.assertRaisesRegex(marble.InvalidProblem, "marble.nl is speed: has no options"):
            pyo.TransformationFactory("marble.nl").apply_to(m, speed=3)
        pyo.TransformationFactory("marble.nl").apply_to(m)
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "model.nl")
            m.write(path)
            rows = [row for row in pathlib.Path(path).read_text().splitlines() if row.startswith("5 1 ")]
        self.assertEqual(len(rows), 1)
        self.assertEqual(m.y.bounds, (1, 9))

    def test_a_model_without_an_objective_has_any_point_of_it(self):
        m = qpec()
        del m.cost
        with solver() as one:
            for low in (5, 20):
                m.y[0].setlb(low)
                pyo.assert_optimal_termination(one.solve(m))
                self.assertGreaterEqual(m.y[0].value, low - 1e-6)
                self.assertEqual(one.answer.objective, 0)
                self.assertLess(max(min(m.y[i].value, m.w[i].value) for i in range(3)), 1e-6)

    def test_a_sweep_has_the_best_branch_of_a_small_model_each_time(self):
        m = pyo.ConcreteModel()
        m.far, m.x, m.y = pyo.Param(initialize=1, mutable=True), pyo.Var(), pyo.Var()
        m.cost = pyo.Objective(expr=(m.x - m.far) ** 2 + (m.y - 2) ** 2)
        m.pair = Complementarity(expr=complements(m.x >= 0, m.y >= 0))
        with solver() as one:
            for m.far.value, best in ((1, 1), (3, 4), (30, 4), (0.5, 0.25)):
                one.solve(m)
                self.assertAlmostEqual(pyo.value(m.cost), best, 6)

    def test_an_answer_that_is_almost_solved_comes_with_a_warning_and_is_not_optimal(self):
        with almost_solved(self, Repeated, "solve"):
            results = solver().solve(qpec())
        self.assertEqual((results.solver.status, results.solver.termination_condition),
                         (SolverStatus.warning, TerminationCondition.feasible))
        real = marble.pyomo.ASL.solve

        def almost(*arguments, **words):
            results = real(*arguments, **words)
            results.solver.id = 100
            return results

        with mock.patch.object(marble.pyomo.ASL, "solve", almost), one_warning_of_almost(self):
            results = pyo.SolverFactory("marble").solve(qpec())
        self.assertEqual((results.solver.status, results.solver.termination_condition),
                         (SolverStatus.warning, TerminationCondition.feasible))

    def test_status_values_duals_and_reduced_costs(self):
        for sense, sign in ((pyo.minimize, 1), (pyo.maximize, -1)):
            m = qpec(sense)
            results = solver().solve(m)
            pyo.assert_optimal_termination(results)
            self.assertEqual(results.solver.status, SolverStatus.ok)
            np.testing.assert_allclose([v.value for v in m.y.values()], [35, 35, 50], atol=1e-6)
            self.assertAlmostEqual(pyo.value(m.cost), sign * 1379, 5)
            self.assertAlmostEqual(m.dual[m.total], sign * -50, 5)  # 2 (35 - 60)
            self.assertAlmostEqual(m.rc[m.y[2]], sign * -20, 5)  # 2 (50 - 60), at its upper bound
            self.assertAlmostEqual(results.problem.upper_bound, sign * 1379, 5)

    def test_a_solve_after_new_numbers_is_an_update_of_the_session_here_and_on_a_server(self):
        with tempfile.TemporaryDirectory() as folder, local_and_remote(pathlib.Path(folder)) as clients:
            for client in clients:
                m = qpec()
                with pyo.SolverFactory("marble_persistent", server=client, options={"max_small_problem_nodes": 0}) as one:
                    one.set_instance(m)
                    one.solve()
                    before = one.answer.problem
                    m.p.value = 0.2  # in a row, in its limit and in the objective
                    one.solve()
                    self.assertIs(one.answer.problem.Q, before.Q)
                    self.assertLess(one.answer.factorizations, 5)
                    other = qpec()
                    other.p.value = 0.2
                    solver().solve(other)
                    self.assertAlmostEqual(pyo.value(m.cost), pyo.value(other.cost), 5)
                    m.y[1].setub(20)
                    one.solve()
                    self.assertAlmostEqual(m.y[1].value, 20, 6)
                    self.assertEqual(one.answer.problem.sizes, before.sizes)
                    m.y[0].fix(3)  # what follows changes what the model consists of
                    one.solve()
                    self.assertEqual(one.answer.problem.n, before.n - 1)
                    m.y[0].fix(4)
                    one.solve()
                    self.assertEqual(m.y[0].value, 4)
                    m.more = pyo.Constraint(expr=m.y[1] == 7)
                    one.solve(m)
                    self.assertAlmostEqual(m.y[1].value, 7, 6)
                    m.more.deactivate()
                    m.pairs[1].deactivate()
                    one.solve()
                    self.assertEqual(one.answer.problem.sizes[3], 2)

    def test_the_dual_value_of_a_condition_is_the_change_by_its_bound(self):
        for words, condition, bend in (
                ("lower, lower", lambda m: complements(m.w >= m.p, m.y >= 0), (-5, 60)),
                ("upper, lower", lambda m: complements(m.w <= m.p, m.y >= 0), (5, 60)),
                ("equality", lambda m: complements(m.w == 3 + m.p, m.y), (9, 60)),
                ("both bounds", lambda m: complements(pyo.inequality(m.p, m.w, 5 + m.p), m.y), (-4, 20)),
                ("both bounds, above", lambda m: complements(pyo.inequality(m.p, m.w, 5 + m.p), m.y), (9, -20))):
            for sense, sign in ((pyo.minimize, 1), (pyo.maximize, -1)):
                m = pyo.ConcreteModel()
                m.p, m.y, m.w = pyo.Param(initialize=0, mutable=True), pyo.Var(), pyo.Var()
                m.cost = pyo.Objective(sense=sense, expr=sign * ((m.w - bend[0]) ** 2 + (m.y - bend[1]) ** 2))
                m.pair = Complementarity(rule=condition)
                m.dual = pyo.Suffix(direction=pyo.Suffix.IMPORT)
                values = []
                with solver() as one:
                    for step in (1e-4, -1e-4, 0):
                        m.p.value = step
                        one.solve(m)
                        values.append(pyo.value(m.cost))
                with self.subTest(words, sense=sense):
                    self.assertGreater(abs(m.dual[m.pair]), 1)
                    self.assertAlmostEqual(m.dual[m.pair], (values[0] - values[1]) / 2e-4, 4)

    def test_disjunctions_become_pairs_and_their_indicators_are_chosen(self):
        for target, best, chosen in (((-3, 0.5), 0, "left"), ((2.7, 0.5), 0, "right"), ((0.5, 3.5), 0.25, "up"),
                                   ((0.1, -4), 0.01, "nested")):
            for solve, proof in ((solver().solve, True), (pyo.SolverFactory("marble").solve, "true")):
                m = pyo.ConcreteModel()
                m.x, m.y = pyo.Var(bounds=(-9, 9)), pyo.Var(bounds=(-9, 9))
                m.left = Disjunct()
                m.left.far = pyo.Constraint(expr=m.x <= -1)
                m.right = Disjunct()
                m.right.far = pyo.Constraint(expr=(2, m.x, 3))
                m.up = Disjunct()
                m.up.exact = pyo.Constraint(expr=m.y == 3)
                m.nested = Disjunct()
                m.nested.deep = pyo.Constraint(expr=m.y <= -3)
                m.nested.inner = Disjunction(expr=[m.x >= 1.1, m.x <= 0])
                m.away = Disjunct()  # is none of them
                m.away.where = pyo.Constraint(expr=m.x == 0.2)
                m.away.indicator_var.fix(False)
                m.one = Disjunction(expr=[m.left, m.right, m.up, m.nested, m.away])
                m.two = Disjunction(expr=[m.y >= -5, m.x >= 5])
                m.cost = pyo.Objective(expr=(m.x - target[0]) ** 2 + (m.y - target[1]) ** 2)
                pyo.TransformationFactory("marble.pairs").apply_to(m)
                solve(m, options={"global_search": proof})
                with self.subTest(chosen):
                    self.assertLess(pyo.value(m.cost), best + 0.02)
                    marble.pyomo.choose(m)
                    indicators = {d.local_name: d.indicator_var.value for d in m.one.disjuncts}
                    self.assertEqual([name for name, holds in indicators.items() if holds], [chosen])
                    self.assertEqual([d.indicator_var.value for d in m.two.disjuncts], [True, False])

    def test_a_disjunct_without_constraints_always_holds(self):
        def model(units, forced=None):
            m = pyo.ConcreteModel()
            m.v = pyo.Var(bounds=(1, 3))
            m.unit = Disjunct(range(units))
            for i in range(1, units):
                m.unit[i].on = pyo.Constraint(expr=m.v <= 2)
            if forced is not None:
                m.unit[forced].indicator_var.fix(True)
            m.either = Disjunction(expr=[m.unit[i] for i in range(units)])
            m.cost = pyo.Objective(expr=m.v, sense=pyo.maximize)
            pyo.TransformationFactory("marble.pairs").apply_to(m)
            return m

        for solve in (solver().solve, pyo.SolverFactory("marble").solve):
            for units, forced, best in ((2, None, 3), (3, None, 3), (2, 1, 2), (3, 0, 3)):
                m = model(units, forced)
                solve(m)
                self.assertAlmostEqual(m.v.value, best, 6)
                marble.pyomo.choose(m)
                self.assertEqual(m.unit[0].indicator_var.value, best == 3)

    def test_of_disjunctions_what_no_pair_has_is_refused_by_its_name(self):
        def model():
            m = pyo.ConcreteModel()
            m.x = pyo.Var(bounds=(0, 9))
            m.low, m.high = Disjunct(), Disjunct()
            m.low.at = pyo.Constraint(expr=m.x <= 1)
            m.high.at = pyo.Constraint(expr=m.x >= 5)
            m.either = Disjunction(expr=[m.low, m.high])
            m.cost = pyo.Objective(expr=(m.x - 4) ** 2)
            return m

        m = model()
        with self.assertRaisesRegex(marble.InvalidProblem, "marble.pairs"):
            solver().solve(m)
        m.logic = pyo.LogicalConstraint(expr=m.low.indicator_var.implies(m.high.indicator_var))
        with self.assertRaisesRegex(marble.InvalidProblem, "logical constraint logic"):
            pyo.TransformationFactory("marble.pairs").apply_to(m)
        m = model()
        m.price = pyo.Constraint(expr=m.low.binary_indicator_var + m.x <= 9)
        with self.assertRaisesRegex(marble.InvalidProblem, "constraint price"):
            pyo.TransformationFactory("marble.pairs").apply_to(m)
        m = model()
        m.low.deactivate()
        m.high.indicator_var.fix(False)
        with self.assertRaisesRegex(marble.InvalidProblem, "disjunction either"):
            pyo.TransformationFactory("marble.pairs").apply_to(m)
        m = model()
        m.high.indicator_var.fix(True)
        pyo.TransformationFactory("marble.pairs").apply_to(m)
        solver().solve(m)
        self.assertAlmostEqual(m.x.value, 5, 6)

    def test_options_limits_and_ends_are_reported_in_its_words(self):
        m = qpec()
        one = solver(options={"global_search": True, "relative_gap_tolerance": 1e-3})
        one.solve(m)
        self.assertTrue(one.answer.proved)
        limited = solver().solve(m, options={"path": "paper", "polish": False, "max_iterations": 2})
        self.assertEqual(limited.solver.termination_condition, TerminationCondition.maxIterations)
        with self.assertRaisesRegex(marble.InvalidArgument, "speed"):
            solver().solve(m, options={"speed": 3})
        one.options["max_iterations"] = 77
        one.solve(m, timelimit=5)
        self.assertEqual((one.answer.options["max_iterations"], one.answer.options["time_limit_s"]), (77, 5))
        m.y[0].value = None
        m.more = pyo.Constraint(expr=m.y[0] >= 50.5)
        results = solver().solve(m)
        self.assertEqual(results.solver.termination_condition, TerminationCondition.infeasible)
        self.assertIsNone(m.y[0].value)
        m = pyo.ConcreteModel()
        m.x = pyo.Var(bounds=(0, None))
        m.cost = pyo.Objective(expr=-m.x)
        self.assertEqual(solver().solve(m).solver.termination_condition, TerminationCondition.unbounded)

    def test_a_warm_start_begins_where_the_variables_are(self):
        m = pyo.ConcreteModel()
        m.x, m.y = pyo.Var(), pyo.Var()
        m.cost = pyo.Objective(expr=(m.x - 1) ** 2 + (m.y - 1) ** 2)
        m.pair = Complementarity(expr=complements(m.x >= 0, m.y >= 0))
        one = solver()
        for start in ((0.9, 0.1), (0.1, 0.9)):
            m.x.value, m.y.value = start
            one.solve(m, warmstart=True)
            np.testing.assert_allclose([m.x.value, m.y.value], np.round(start), atol=1e-6)

    def test_what_no_lcqp_has_is_refused_by_its_name(self):
        def binary(m):
            m.switch = pyo.Var(domain=pyo.Binary)
            m.on = pyo.Constraint(expr=m.y[0] <= 50 * m.switch)

        def cubic(m):
            m.cost.set_value(m.y[0] ** 3)

        wrong = {
            r"constraint heat is exp\(w\[0\]\).* must be linear":
                lambda m: m.add_component("heat", pyo.Constraint(expr=pyo.exp(m.w[0]) <= 3)),
            r"constraint ball is .*must be linear":
                lambda m: m.add_component("ball", pyo.Constraint(expr=m.w[0] ** 2 <= 3)),
            r"complementarity curved is .*must be linear": lambda m: m.add_component(
                "curved", Complementarity(expr=complements(m.w[0] >= 0, m.y[0] * m.y[1] >= 0))),
            r"complementarity three: must have two bounds": lambda m: m.add_component(
                "three", Complementarity(expr=complements(m.w[0] >= 0, pyo.inequality(0, m.y[0], 5)))),
            "variable switch is Binary: must be continuous": binary,
            "objective is cost, other: must be one": lambda m: m.add_component("other", pyo.Objective(expr=m.y[0])),
            "objective cost is .*must be quadratic": cubic,
            "SOSConstraint sets: must not": lambda m: m.add_component("sets", pyo.SOSConstraint(var=m.y, sos=1)),
            "Disjunction either: must not": lambda m: m.add_component(
                "either", Disjunction(expr=[m.y[0] <= 1, m.y[1] <= 1])),
            r"variable y\[0\] is 60": lambda m: m.y[0].setlb(60),
            "constraint pairs.*mpec.nl": lambda m: pyo.TransformationFactory("mpec.nl").apply_to(m),
        }
        for said, change in wrong.items():
            m = qpec()
            change(m)
            with self.assertRaisesRegex(marble.InvalidProblem, said):
                solver().solve(m)

    def test_an_infeasible_model_is_explained_by_its_own_names(self):
        m = qpec()
        m.least = pyo.Constraint(expr=m.y[0] + m.y[1] >= 3)
        m.push = pyo.Constraint(expr=m.w[0] >= 1)
        m.other = pyo.Constraint(expr=m.w[1] == 2)
        m.idle = pyo.Constraint(expr=m.y[2] + m.w[2] >= -9)
        with tempfile.TemporaryDirectory() as folder, local_and_remote(pathlib.Path(folder)) as clients:
            for client in clients:
                self.assertEqual(
                    sorted(marble.pyomo.explain_infeasible(m, server=client)),
                    ["complementarity pairs[0]", "complementarity pairs[1]", "constraint least, lower limit",
                     "constraint other", "constraint push, lower limit"])
        self.assertEqual(marble.pyomo.explain_infeasible(qpec(), server="local"), [])
        m.y[0].setlb(2)
        m.most = pyo.Constraint(expr=m.y[0] <= 1)
        del m.push, m.other
        self.assertEqual(sorted(marble.pyomo.explain_infeasible(m, server="local")),
                         ["constraint most, upper limit", "variable y[0], lower bound"])

    def test_the_page_s_example_prints_what_it_says(self):
        self.assertEqual(*example("Pyomo"))


if __name__ == "__main__":
    unittest.main()
