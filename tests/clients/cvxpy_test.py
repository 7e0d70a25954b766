"""The real CVXPY with Marble as its solver, and with pairs: answers, duals and ends as its other solvers'."""

import dataclasses
import unittest
from unittest import mock

import cvxpy
import numpy as np
from adapter_page import example, random_qp

import marble
import marble.cvxpy


class Cvxpy(unittest.TestCase):
    def test_answers_and_duals_are_another_solver_s(self):
        for seed in range(5):
            P, q, G, h, A, b = random_qp(seed)
            x = cvxpy.Variable(12)
            rows = [G @ x <= h, A @ x == b]
            problem = cvxpy.Problem(cvxpy.Minimize(0.5 * cvxpy.quad_form(x, cvxpy.psd_wrap(P)) + q @ x + 3), rows)
            problem.solve(solver=marble.cvxpy.MARBLE())
            ours = problem.status, problem.value, x.value, [row.dual_value for row in rows]
            problem.solve(solver="CLARABEL")
            self.assertEqual(ours[0], "optimal")
            self.assertAlmostEqual(ours[1], problem.value, 5)
            np.testing.assert_allclose(ours[2], x.value, atol=1e-4)
            for mine, row in zip(ours[3], rows, strict=True):
                np.testing.assert_allclose(mine, row.dual_value, atol=1e-4)

    def test_the_end_of_a_solve_is_reported_in_its_words(self):
        x = cvxpy.Variable()
        self.assertEqual(self.end(cvxpy.Minimize(x), []), "unbounded")
        self.assertEqual(self.end(cvxpy.Minimize(cvxpy.square(x)), [x >= 1, x <= 0]), "infeasible")
        with self.assertRaises(marble.InvalidArgument):
            self.end(cvxpy.Minimize(cvxpy.square(x)), [x >= 1], nothing=1)

    def test_an_answer_that_is_almost_solved_is_optimal_inaccurate_and_cvxpy_warns_of_it(self):
        real, x = marble.client.solve, cvxpy.Variable(2)
        almost = mock.patch.object(marble.client, "solve", lambda *given, **words: dataclasses.replace(
            real(*given, **words), status=marble.Status.ALMOST_SOLVED))
        for solve in (lambda problem: problem.solve(solver=marble.cvxpy.MARBLE()),
                      lambda problem: marble.cvxpy.solve(problem, pairs=[(x[0], x[1])])):
            problem = cvxpy.Problem(cvxpy.Minimize(cvxpy.sum_squares(x - 1)), [x <= 3])
            with almost, self.assertWarnsRegex(UserWarning, "inaccurate"):
                solve(problem)
            self.assertEqual(problem.status, "optimal_inaccurate")

    def test_a_norm_and_options_by_name(self):
        x = cvxpy.Variable(3)
        cost = cvxpy.norm1(x - np.arange(3)) + cvxpy.sum_squares(x)
        problem = cvxpy.Problem(cvxpy.Minimize(cost), [cvxpy.sum(x) == 1])
        value = problem.solve(solver=marble.cvxpy.MARBLE(), max_iterations=200)
        self.assertAlmostEqual(value, problem.solve(solver="CLARABEL"), 5)

    def test_pairs_hold_and_the_answer_is_the_best_of_all_branches(self):
        wanted = cvxpy.Parameter(4, value=np.zeros(4))
        x, y = cvxpy.Variable(2), cvxpy.Variable(2)
        rows = [cvxpy.sum(x) + cvxpy.sum(y) <= 4, x[0] - y[1] == 0.25]
        cost = cvxpy.sum_squares(cvxpy.hstack([x, y]) - wanted) + cvxpy.norm1(y) + 1
        for seed, goal in enumerate(3 * [cvxpy.Minimize(cost), cvxpy.Maximize(-cost)]):
            wanted.value = np.random.default_rng(seed).normal(size=4, scale=2)
            problem = cvxpy.Problem(goal, rows)
            answer = marble.cvxpy.solve(problem, pairs=[(x[0], y[0] + 0.5), (1 - x[1], y[1])], max_iterations=500)
            self.assertEqual((answer.status, problem.status), (marble.Status.SOLVED, "optimal"))
            np.testing.assert_allclose(answer.s, [x.value[0], 1 - x.value[1]], atol=1e-9)
            np.testing.assert_allclose(answer.t, [y.value[0] + 0.5, y.value[1]], atol=1e-9)
            self.assertLess(np.abs(np.minimum(answer.s, answer.t)).max(), 1e-7)
            sign = 1 if isinstance(goal, cvxpy.Minimize) else -1
            signs = [x[0] >= 0, y[0] + 0.5 >= 0, 1 - x[1] >= 0, y[1] >= 0]
            branches = [cvxpy.Problem(goal, [*rows, *signs, first == 0, second == 0])
                        for first in (x[0], y[0] + 0.5) for second in (1 - x[1], y[1])]
            best = min(sign * branch.solve(solver="CLARABEL") for branch in branches)
            self.assertAlmostEqual(sign * problem.value, best, 5)

    def test_values_and_duals_come_back_to_the_problem_that_was_given(self):
        x = cvxpy.Variable(2)
        row = cvxpy.sum(x) <= 1
        problem = cvxpy.Problem(cvxpy.Minimize(cvxpy.sum_squares(x - np.array([1, 3]))), [row])
        answer = marble.cvxpy.solve(problem, pairs=[(x[0], x[1])])
        np.testing.assert_allclose(x.value, [0, 1], atol=1e-7)
        self.assertAlmostEqual(row.dual_value, 4, 6)
        self.assertAlmostEqual(problem.value, 5, 6)
        np.testing.assert_allclose(answer.xi + answer.eta, [2], atol=1e-6)  # 2 (0 - 1) + 4 = xi
        self.assertIs(problem.solver_stats.extra_stats["solution"].status, answer.status)
        self.assertEqual(problem.solver_stats.extra_stats["kind"], answer.kind.value)

    def test_new_values_of_parameters_and_other_pairs_are_seen(self):
        x, p = cvxpy.Variable(2), cvxpy.Parameter(2)
        problem = cvxpy.Problem(cvxpy.Minimize(cvxpy.sum_squares(x - p)), [cvxpy.sum(x) <= 2])
        pairs, other = [(x[0], x[1])], [(x[0], 1 - x[1])]
        for p.value, chosen, expected in (([1, 0.5], pairs, [1, 0]), ([0.5, 1], pairs, [0, 1]),
                                          ([0.5, 0.75], other, [0.5, 1]), ([0.5, 0.75], [], [0.5, 0.75])):
            marble.cvxpy.solve(problem, pairs=chosen)
            np.testing.assert_allclose(x.value, expected, atol=1e-6)

    def test_what_a_pair_cannot_be_in_is_refused_by_its_name(self):
        x, whole = cvxpy.Variable(2, name="force"), cvxpy.Variable(integer=True, name="count")
        linear = cvxpy.Minimize(x[0])
        for goal, rows, pairs, said in (
                (cvxpy.Minimize(cvxpy.exp(x[0])), [], [], r"objective is minimize exp\(force\[0\]\)"),
                (cvxpy.Minimize(-cvxpy.square(x[0])), [], [], "objective .*convex"),
                (linear, [x >= 0, cvxpy.norm(x) <= 1], [], r"constraints\[1\] is .*force"),
                (linear, [whole >= x[0]], [], "variables is count: .*integer"),
                (linear, [], [(x[0], whole)], "variables is count: .*integer"),
                (linear, [], [(x[0], x[1]), (x[0], cvxpy.square(x[1]))], r"pairs\[1\]\[1\] is .*force\[1\]"),
                (linear, [], [(x, x[0])], r"pairs\[0\] is of shapes"),
                (linear, [], [(x[0], 1)], r"pairs\[0\]\[1\] is 1")):
            with self.assertRaisesRegex(marble.InvalidProblem, said):
                marble.cvxpy.solve(cvxpy.Problem(goal, rows), pairs=pairs)
        problem = cvxpy.Problem(cvxpy.Minimize(cvxpy.sum_squares(x)), [x >= 1])
        self.assertIs(marble.cvxpy.solve(problem, pairs=[(x[0], x[1])]).status, marble.Status.INFEASIBLE)
        self.assertEqual((problem.status, x.value), ("infeasible", None))

    def test_the_page_s_example_prints_what_it_says(self):
        self.assertEqual(*example("CVXPY"))

    def end(self, goal, rows, **options):
        problem = cvxpy.Problem(goal, rows)
        problem.solve(solver=marble.cvxpy.MARBLE(), **options)
        return problem.status


if __name__ == "__main__":
    unittest.main()
