"""The real qpsolvers and CVXPY with Marble as their solver, in process: answers, duals and ends as their other solvers'.

Usage: adapters_test.py    tests/clients/adapters finds the packages
"""

import contextlib
import io
import pathlib
import re
import sys
import unittest
import warnings

import cvxpy
import numpy as np
import qpsolvers
import scipy.sparse as sp

import marble
import marble.cvxpy
import marble.qpsolvers

sys.dont_write_bytecode = True
warnings.filterwarnings("ignore", category=qpsolvers.warnings.QPWarning)


def random_qp(seed, n=12, rows=8, equalities=3):
    random = np.random.default_rng(seed)
    root, inside = random.normal(size=(n, n)), random.normal(size=n)
    G, A = random.normal(size=(rows, n)), random.normal(size=(equalities, n))
    return root @ root.T + np.eye(n), random.normal(size=n), G, G @ inside + 0.1 * random.random(rows), A, A @ inside


class Qpsolvers(unittest.TestCase):
    def test_it_is_one_of_the_solvers(self):
        self.assertIn("marble", qpsolvers.available_solvers)

    def test_answers_and_duals_hold_by_its_own_measure_and_are_another_solver_s(self):
        for seed in range(5):
            P, q, G, h, A, b = random_qp(seed)
            for P_, G_, A_ in ((P, G, A), (sp.csc_matrix(P), sp.csc_matrix(G), sp.csc_matrix(A))):
                problem = qpsolvers.Problem(P_, q, G_, h, A_, b, -2 * np.ones(12), 2 * np.ones(12))
                ours = qpsolvers.solve_problem(problem, "marble")
                self.assertTrue(ours.found and ours.is_optimal(1e-6))
                other = qpsolvers.solve_problem(problem, "clarabel")
                self.assertAlmostEqual(ours.obj, other.obj, 5)
                np.testing.assert_allclose(ours.z_box, other.z_box, atol=1e-4)

    def test_without_rows_with_a_start_and_with_options(self):
        x = qpsolvers.solve_qp(2 * np.eye(2), np.array([-2.0, -4.0]), solver="marble", initvals=np.ones(2), polish=False)
        np.testing.assert_allclose(x, [1, 2], atol=1e-6)
        with self.assertRaises(marble.InvalidArgument):
            qpsolvers.solve_qp(np.eye(1), np.zeros(1), solver="marble", nothing=1)

    def test_an_infeasible_problem_has_no_answer_and_says_why(self):
        problem = qpsolvers.Problem(np.eye(1), np.zeros(1), np.array([[1.0], [-1.0]]), np.array([-1.0, -1.0]))
        ours = qpsolvers.solve_problem(problem, "marble")
        self.assertTrue(ours.found is False and ours.x is None)
        self.assertIs(ours.extras["solution"].status, marble.Status.INFEASIBLE)


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

    def test_the_end_of_a_solve_is_told_in_its_words(self):
        x = cvxpy.Variable()
        self.assertEqual(self.end(cvxpy.Minimize(x), []), "unbounded")
        self.assertEqual(self.end(cvxpy.Minimize(cvxpy.square(x)), [x >= 1, x <= 0]), "infeasible")
        with self.assertRaises(marble.InvalidArgument):
            self.end(cvxpy.Minimize(cvxpy.square(x)), [x >= 1], nothing=1)

    def test_a_norm_and_options_by_name(self):
        x = cvxpy.Variable(3)
        problem = cvxpy.Problem(cvxpy.Minimize(cvxpy.norm1(x - np.arange(3)) + cvxpy.sum_squares(x)), [cvxpy.sum(x) == 1])
        value = problem.solve(solver=marble.cvxpy.MARBLE(), max_iterations=200)
        self.assertAlmostEqual(value, problem.solve(solver="CLARABEL"), 5)

    def end(self, goal, rows, **options):
        problem = cvxpy.Problem(goal, rows)
        problem.solve(solver=marble.cvxpy.MARBLE(), **options)
        return problem.status


class Page(unittest.TestCase):
    def test_the_example_prints_what_it_says(self):
        page = pathlib.Path(__file__).resolve().parents[2] / "client/python/ADAPTERS.md"
        (code, said), = re.findall(r"```python\n(.*?)```\n```text\n(.*?)```", page.read_text(), re.DOTALL)
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            exec(compile(code, str(page), "exec"), {})
        self.assertEqual(out.getvalue(), said)


if __name__ == "__main__":
    unittest.main()
