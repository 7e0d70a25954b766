"""The real qpsolvers with Marble as its solver: answers, duals and ends as its other solvers'."""

import unittest
import warnings

import numpy as np
import qpsolvers
import scipy.sparse as sp
from adapter_page import almost_solved, example, random_qp

import marble
import marble.qpsolvers

warnings.filterwarnings("ignore", category=qpsolvers.warnings.QPWarning)


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
        x = qpsolvers.solve_qp(2 * np.eye(2), np.array([-2.0, -4.0]), solver="marble", initvals=np.ones(2),
                               polish=False)
        np.testing.assert_allclose(x, [1, 2], atol=1e-6)
        with self.assertRaises(marble.InvalidArgument):
            qpsolvers.solve_qp(np.eye(1), np.zeros(1), solver="marble", nothing=1)

    def test_an_answer_that_is_almost_solved_comes_with_a_warning(self):
        with almost_solved(self, marble.qpsolvers, "solve"):
            x = qpsolvers.solve_qp(2 * np.eye(2), np.array([-2.0, -4.0]), solver="marble")
        np.testing.assert_allclose(x, [1, 2], atol=1e-6)

    def test_gram_matrices_are_symmetric_enough(self):
        B = np.random.default_rng(0).normal(size=(150, 150))
        P = B.T @ (np.diag(np.arange(1.0, 151)) @ B)
        self.assertFalse((P == P.T).all())
        self.assertIsNotNone(qpsolvers.solve_qp(P, np.ones(150), solver="marble"))

    def test_an_infeasible_problem_has_no_answer_and_says_why(self):
        problem = qpsolvers.Problem(np.eye(1), np.zeros(1), np.array([[1.0], [-1.0]]), np.array([-1.0, -1.0]))
        ours = qpsolvers.solve_problem(problem, "marble")
        self.assertTrue(ours.found is False and ours.x is None)
        self.assertIs(ours.extras["solution"].status, marble.Status.INFEASIBLE)
        self.assertEqual(ours.extras["kind"], "proved_infeasible")

    def test_the_page_s_example_prints_what_it_says(self):
        self.assertEqual(*example("qpsolvers"))


if __name__ == "__main__":
    unittest.main()
