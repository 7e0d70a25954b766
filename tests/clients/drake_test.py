"""The real Drake with Marble as a solver of its programs: answers and duals as SNOPT's, refusals by name."""

import gc
import itertools
import unittest
import weakref

import numpy as np
from adapter_page import almost_solved, example
from pydrake.solvers import ClarabelSolver, MathematicalProgram, SolutionResult

import marble
import marble.drake


def program(seed, branch=None):
    """Two pairs, as Drake says it and, with `branch`, as what it means where these sides are zero."""
    random = np.random.default_rng(seed)
    prog = MathematicalProgram()
    x, y = prog.NewContinuousVariables(2, "x"), prog.NewContinuousVariables(2, "y")
    both, root = np.concatenate([x, y]), random.normal(size=(4, 4))
    prog.AddQuadraticCost(root @ root.T + np.eye(4), random.normal(size=4), 3.0, both)
    prog.AddLinearCost(random.normal(size=2), 1.5, y)
    rows = [prog.AddLinearConstraint(random.normal(size=(2, 4)), np.full(2, -1.0), np.full(2, 2.0), both),
            prog.AddBoundingBoxConstraint(-3, 3, both)]
    M, q = random.normal(size=(2, 2)) + 2 * np.eye(2), random.normal(size=2)
    if branch is None:
        prog.AddLinearComplementarityConstraint(M, q, x)
    else:
        sides = np.vstack([np.eye(2), M])
        offset = np.concatenate([np.zeros(2), q])
        upper = [0 if k else np.inf for k in (*branch, *(not k for k in branch))]
        prog.AddLinearConstraint(sides, -offset, np.array(upper) - offset, x)
    return prog, x, y, rows


class Drake(unittest.TestCase):
    def test_an_answer_that_is_almost_solved_comes_with_a_warning(self):
        with almost_solved(self, marble.client, "solve"):
            result = marble.drake.solve(program(0)[0])
        self.assertIs(result.solution.status, marble.Status.ALMOST_SOLVED)

    def test_answers_and_duals_are_those_of_the_best_branch(self):
        solved = 0
        for seed in range(8):
            prog, x, y, rows = program(seed)
            branches = []
            for branch in itertools.product((False, True), repeat=2):
                other, _, _, other_rows = program(seed, branch)
                result = ClarabelSolver().Solve(other)
                if result.is_success():
                    branches.append((result.get_optimal_cost(), result, other_rows))
            ours = marble.drake.solve(prog)
            self.assertEqual(ours.is_success(), bool(branches))
            if not branches:
                self.assertEqual(ours.get_solution_result(), SolutionResult.kInfeasibleConstraints)
                continue
            solved += 1
            cost, best, other_rows = min(branches, key=lambda entry: entry[0])
            self.assertAlmostEqual(ours.get_optimal_cost(), cost, 4)
            np.testing.assert_allclose(ours.GetSolution(), best.get_x_val(), atol=1e-4)
            self.assertEqual(ours.GetSolution(x[1]), ours.get_x_val()[1])
            together = ours.GetSolution(x)[0] + 2 * ours.GetSolution(y)[1]
            self.assertAlmostEqual(ours.GetSolution(x[0] + 2 * y[1]), together)
            for row, other in zip(rows, other_rows):
                np.testing.assert_allclose(ours.GetDualSolution(row), best.GetDualSolution(other), atol=1e-3)
        self.assertGreaterEqual(solved, 4)

    def test_a_pair_that_is_said_from_both_sides_is_one(self):
        prog = MathematicalProgram()
        x = prog.NewContinuousVariables(4, "x")
        prog.AddQuadraticErrorCost(np.eye(4), np.array([1.0, 2, 3, 4]), x)
        swap = np.kron(np.array([[0, 1], [1, 0]]), np.eye(2))
        prog.AddLinearComplementarityConstraint(swap, np.zeros(4), x)
        result = marble.drake.solve(prog, max_iterations=300)
        self.assertEqual(result.solution.problem.sizes[3], 2)
        np.testing.assert_allclose(result.GetSolution(x), [0, 0, 3, 4], atol=1e-6)
        self.assertEqual(result.solution.options["max_iterations"], 300)

    def test_the_program_s_guess_is_where_it_begins(self):
        prog = MathematicalProgram()
        x = prog.NewContinuousVariables(2, "x")
        prog.AddQuadraticErrorCost(np.eye(2), np.ones(2), x)
        prog.AddLinearComplementarityConstraint(np.array([[0, 1], [1, 0]]), np.zeros(2), x)
        prog.SetInitialGuess(x, [0.9, 0.1])
        np.testing.assert_allclose(marble.drake.solve(prog).GetSolution(x), [1, 0], atol=1e-6)
        np.testing.assert_allclose(marble.drake.solve(prog, [0.1, 0.9]).GetSolution(x), [0, 1], atol=1e-6)

    def test_what_no_lcqp_has_is_refused_by_its_name(self):
        wrong = {
            r"constraint cone of x\(0\), x\(1\): must be linear":
                lambda p, x: p.AddLorentzConeConstraint(np.array([2, x[0], x[1]])).evaluator().set_description("cone"),
            r"constraint QuadraticConstraint of x\(0\)": lambda p, x: p.AddConstraint(x[0] ** 2 + x[1] ** 2 <= 1),
            r"constraint cube of x\(0\)":
                lambda p, x: p.AddConstraint(x[0] ** 3 >= 1).evaluator().set_description("cube"),
            r"cost .* of x\(0\): must be linear or quadratic": lambda p, x: p.AddCost(x[0] ** 4),
            r"cost L2NormCost of x\(0\), x\(1\)": lambda p, x: p.AddL2NormCost(np.eye(2), np.ones(2), x),
            r"variable switch\(0\) is binary: must be continuous": lambda p, x: p.NewBinaryVariables(1, "switch"),
        }
        for said, change in wrong.items():
            prog = MathematicalProgram()
            change(prog, prog.NewContinuousVariables(2, "x"))
            with self.assertRaisesRegex(marble.InvalidProblem, said):
                marble.drake.solve(prog)
        prog, x, _, _ = program(0)
        with self.assertRaisesRegex(marble.InvalidArgument, "LinearComplementarityConstraint"):
            marble.drake.solve(prog).GetDualSolution(prog.linear_complementarity_constraints()[0])
        prog = MathematicalProgram()
        prog.AddLinearCost(prog.NewContinuousVariables(1)[0])
        self.assertEqual(marble.drake.solve(prog).get_solution_result(), SolutionResult.kUnbounded)

    def test_a_program_is_translated_again_when_anything_of_it_has_changed(self):
        prog = MathematicalProgram()
        x = prog.NewContinuousVariables(3, "x")
        cost = prog.AddQuadraticErrorCost(np.eye(3), np.array([1.0, 2, 3]), x).evaluator()
        slope = prog.AddLinearCost(np.zeros(3), 0.0, x).evaluator()
        rows = prog.AddLinearConstraint(np.ones((1, 3)), [-50.0], [50.0], x)
        bounds = prog.AddBoundingBoxConstraint(-9, 9, x).evaluator()
        seen = [marble.drake._stated(prog)]
        np.testing.assert_allclose(marble.drake.solve(prog).GetSolution(x), [1, 2, 3], atol=1e-6)
        extra = []
        changes = [
            (lambda: cost.UpdateCoefficients(2 * np.eye(3), -2 * np.array([3.0, 2, 1])), [3, 2, 1]),
            (lambda: slope.UpdateCoefficients(np.array([2.0, 0, 0])), [2, 2, 1]),
            (lambda: rows.evaluator().UpdateCoefficients(np.array([[1.0, 0, 0]]), [-50.0], [1.0]), [1, 2, 1]),
            (lambda: bounds.UpdateUpperBound(np.array([9.0, 1.5, 9.0])), [1, 1.5, 1]),
            (lambda: extra.append(prog.AddBoundingBoxConstraint(0.5, 0.5, x[2])), [1, 1.5, 0.5]),
            (lambda: prog.RemoveConstraint(extra.pop()), [1, 1.5, 1]),
            (lambda: extra.append(prog.AddLinearCost(2 * x[1])), [1, 1, 1]),
            (lambda: prog.AddLinearComplementarityConstraint(np.array([[0.0, 1], [1, 0]]), np.zeros(2), x[:2]), None),
            (lambda: prog.NewContinuousVariables(1, "y"), None)]
        for change, expected in changes:
            change()
            seen.append(marble.drake._stated(prog))
            self.assertIsNot(seen[-1], seen[-2])
            self.assertIs(marble.drake._stated(prog), seen[-1])
            if expected is not None:
                np.testing.assert_allclose(marble.drake.solve(prog).GetSolution(x), expected, atol=1e-6)
        result = marble.drake.solve(prog)
        self.assertAlmostEqual(min(result.GetSolution(x[:2])), 0.0)
        self.assertIs(marble.drake._stated(prog), seen[-1])
        prog.SetInitialGuess(x, [1.0, 0.0, 0.0])  # which is no part of the translation
        self.assertIs(marble.drake._stated(prog), seen[-1])
        kept = result.solution.z.copy()
        prog.NewBinaryVariables(1)
        with self.assertRaises(marble.InvalidProblem):
            marble.drake.solve(prog)
        np.testing.assert_array_equal(result.GetSolution(x), kept[:3])

    def test_programs_that_are_gone_are_forgotten(self):
        prog = program(1)[0]
        marble.drake.solve(prog)
        self.assertIn(prog, marble.drake._STATED)
        gone = weakref.ref(prog)
        del prog
        gc.collect()
        self.assertIsNone(gone())

    def test_large_programs_are_those_of_small_ones_beside_each_other(self):
        copies, prog = 60, MathematicalProgram()
        parts = [prog.NewContinuousVariables(4) for _ in range(copies)]
        for x in parts:
            prog.AddQuadraticErrorCost(np.eye(4), np.array([1.0, 2, 3, 4]), x)
            prog.AddLinearComplementarityConstraint(np.array([[0.0, 1], [1, 0]]), np.zeros(2), x[:2])
        everything = np.concatenate(parts)
        prog.AddLinearConstraint(np.eye(4 * copies), np.full(4 * copies, -5.0), np.full(4 * copies, 3.5), everything)
        again = np.concatenate([parts[0][3:], parts[0][3:]])
        prog.AddLinearConstraint(np.array([[1.0, 1.0]]), [-1.0], [6.0], again)  # a variable twice: 2 x <= 6
        result = marble.drake.solve(prog)
        self.assertEqual(result.solution.problem.sizes, (4 * copies, 0, 2 * (4 * copies + 1), copies))
        np.testing.assert_allclose(result.GetSolution(parts[1]), [0, 2, 3, 3.5], atol=1e-6)
        np.testing.assert_allclose(result.GetSolution(parts[0]), [0, 2, 3, 3], atol=1e-6)

    def test_the_page_s_example_prints_what_it_says(self):
        self.assertEqual(*example("Drake"))


if __name__ == "__main__":
    unittest.main()
