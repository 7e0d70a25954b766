"""The real CasADi: expressions with parameters become numbers once, and are solved again and again over a session."""

import itertools
import pathlib
import tempfile
import unittest
import warnings

import casadi
import numpy as np
from adapter_page import almost_solved, example, local_and_remote

import marble
from marble.casadi import from_casadi, mpccsol
from marble.repeated import Repeated

KINDS = (casadi.SX, casadi.MX)


def contact(kind):
    """Two pairs, a row and an objective that p is in everywhere."""
    x, p = kind.sym("x", 4), kind.sym("p", 3)
    f = (x[0] - p[0]) ** 2 + (1 + p[1] ** 2) * (x[1] - 2) ** 2 + x[2] ** 2 + p[0] * x[2] * x[3] + 3 * x[3] ** 2 - x[3]
    g = casadi.vertcat(x[0] + p[1] * x[1] + casadi.sin(p[2]), x[2] - x[3])
    return {"x": x, "p": p, "f": f, "g": g, "G": casadi.vertcat(x[0], x[2] + p[2]), "H": casadi.vertcat(x[1], 2 - x[3])}


def best(terms, p, lbx, ubx, lbg, ubg):
    """The least objective of all branches, by CasADi's own solver of QPs."""
    sides = casadi.vertcat(terms["G"], terms["H"])
    solver = casadi.qpsol("best", "qrqp", {"x": terms["x"], "p": terms["p"], "f": terms["f"],
                                           "g": casadi.vertcat(terms["g"], sides)},
                          {"print_time": False, "print_header": False, "print_iter": False, "error_on_fail": False})
    found = []
    for branch in itertools.product((0, np.inf), repeat=2):
        upper = [*branch, *(0 if limit else np.inf for limit in branch)]
        answer = solver(p=p, lbx=lbx, ubx=ubx, lbg=[*lbg, 0, 0, 0, 0], ubg=[*ubg, *upper])
        found += [float(answer["f"])] if solver.stats()["success"] else []
    return min(found)


def near(column, values):
    np.testing.assert_allclose(column.full(), np.reshape(values, (-1, 1)), atol=1e-7)


class Casadi(unittest.TestCase):
    def test_every_p_has_the_answer_of_the_best_branch_and_its_multipliers(self):
        bounds = {"lbx": [-5, -5, -5, -3], "ubx": [5, 5, 5, 3], "lbg": [-4, -1], "ubg": [2, -1]}
        for kind in KINDS:
            terms = contact(kind)
            with mpccsol("contact", terms, server="local") as repeated:
                for p in np.abs(np.random.default_rng(3).normal(size=(6, 3))):
                    cold = mpccsol("contact", terms, server="local")
                    self.assertAlmostEqual(float(cold(p=p, **bounds)["f"]), best(terms, p, **bounds), 5)
                    for solver in (cold, repeated):
                        answer = solver(p=p, **bounds)
                        self.assertTrue(solver.stats()["success"], solver.stats())
                        self.assertLess(np.abs(np.minimum(answer["G"].full(), answer["H"].full())).max(), 1e-7)
                        self.stationary(terms, p, answer)

    def stationary(self, terms, p, answer):
        parts = [terms["f"], terms["g"], terms["G"], terms["H"]]
        slopes = casadi.Function("slopes", [terms["x"], terms["p"]],
                                 [*parts, *(casadi.jacobian(part, terms["x"]) for part in parts)])
        *values, f, g, G, H = slopes(answer["x"], p)
        for name, value in zip("fgGH", values):
            near(answer[name], value.full())
        rest = f.T + answer["lam_x"] + g.T @ answer["lam_g"] + G.T @ answer["lam_G"] + H.T @ answer["lam_H"]
        self.assertLess(np.abs(rest.full()).max(), 1e-5)

    def test_a_call_sends_what_changed_and_starts_from_the_last_answer_here_and_on_a_server(self):
        with tempfile.TemporaryDirectory() as folder, local_and_remote(pathlib.Path(folder)) as clients:
            for client in clients:
                terms = contact(casadi.SX)
                solver = mpccsol("contact", terms, {"max_iterations": 300, "max_small_problem_nodes": 0}, server=client)
                first = solver(p=[1, 0, 0], lbx=-5, ubx=5)
                before = solver.stats()["solution"].problem
                again = solver(p=[1.001, 0, 0], lbx=-5, ubx=5)
                warm = solver.stats()["solution"]
                self.assertLess(warm.factorizations, 5)
                self.assertIs(warm.problem.A, before.A)  # not looked at, and not sent
                self.assertIs(warm.problem.C, before.C)
                self.assertFalse(np.array_equal(warm.problem.g, before.g))
                self.assertEqual(warm.options["max_iterations"], 300)
                self.assertAlmostEqual(float(first["f"]), float(again["f"]), 1)
                solver(p=[1, 0, 0], lbx=-5)  # no upper bounds: another pattern
                self.assertEqual(solver.stats()["solution"].problem.sizes, (4, 0, 4, 2))
                at = solver(p=[1, 0, 0], x0=first["x"], lbx=-5)
                self.assertAlmostEqual(float(at["f"]), float(first["f"]), 6)
                solver.close()
                self.assertTrue(solver(p=[1, 0, 0]))  # which opens it again

    def test_a_sweep_has_the_best_branch_of_a_small_problem_each_time_here_and_on_a_server(self):
        x, p = casadi.SX.sym("x", 2), casadi.SX.sym("p")
        terms = {"x": x, "p": p, "f": (x[0] - p) ** 2 + (x[1] - 2) ** 2, "G": x[0], "H": x[1]}
        sweep = (1, 3, 30, -2, 1.5, 2.5, 0)
        with tempfile.TemporaryDirectory() as folder, local_and_remote(pathlib.Path(folder)) as clients:
            for client in clients:
                with mpccsol("sweep", terms, server=client) as best, \
                        mpccsol("sweep", terms, {"max_small_problem_nodes": 0, "effort": 0}, server=client) as near:
                    for at in sweep:
                        least = at ** 2 if at < 2 else 4
                        self.assertAlmostEqual(float(best(p=at)["f"]), least, 6, at)
                        self.assertTrue(best.stats()["success"])
                    costs = [float(near(p=at)["f"]) for at in sweep[:3]]
                    np.testing.assert_allclose(costs, [1, 9, 900], atol=1e-6)

    def test_many_pairs_that_change_at_will_are_the_cold_answers(self):
        n, random = 6, np.random.default_rng(5)
        root = random.normal(size=(2 * n, 2 * n))
        x, p = casadi.SX.sym("x", 2 * n), casadi.SX.sym("p", 2 * n)
        terms = {"x": x, "p": p, "f": casadi.bilin(casadi.DM(root @ root.T / n + 0.1 * np.eye(2 * n)), x - p),
                 "G": x[:n], "H": x[n:]}
        with mpccsol("many", terms, server="local") as sweep:
            for at in 1 + random.normal(size=(8, 2 * n)):
                cold = mpccsol("many", terms, server="local")(p=at)
                self.assertAlmostEqual(float(sweep(p=at)["f"]), float(cold["f"]), 6)
                self.assertTrue(sweep.stats()["solution"].proved)
                self.assertEqual(sweep.stats()["kind"], "proved_optimal")

    def test_an_answer_that_is_almost_solved_comes_with_a_warning_and_is_no_success(self):
        with mpccsol("contact", contact(casadi.SX), server="local") as solver, almost_solved(self, Repeated, "solve"):
            solver(p=[1, 0, 0])
        self.assertFalse(solver.stats()["success"])

    def test_complex_numbers_are_refused_not_halved(self):
        x, p = casadi.SX.sym("x", 2), casadi.SX.sym("p")
        solver = mpccsol("real", {"x": x, "p": p, "f": casadi.sumsqr(x - p)}, server="local")
        for words in ({"p": 1j}, {"p": 1, "x0": np.array([1, 1j])}, {"p": 1, "lbx": [0, 1j]}):
            with self.assertRaisesRegex(marble.InvalidArgument, "complex"):
                solver(**words)
        for words in ({"lb": 1j}, {"ub": np.array([1j])}):
            with self.assertRaisesRegex(marble.InvalidArgument, "complex"):
                from_casadi(x, x[0], x[1], **words)
        for words in ({"lbx": 1j}, {"lbg": [1j]}, {"p": [1j]}):
            with self.assertRaisesRegex(marble.InvalidArgument, "complex"):
                marble.nlp.solve_casadi({"x": x, "p": p, "f": casadi.sumsqr(x) + p, "g": x[0]}, [0, 0],
                                        **{"p": [1], **words})

    def test_nonlinear_functions_are_called_without_a_warning(self):
        x, p = casadi.SX.sym("x"), casadi.SX.sym("p")
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            answer = marble.nlp.solve_casadi({"x": x, "p": p, "f": (x - p) ** 4, "g": x ** 2}, [3], p=[1], lbx=0, ubg=9)
        self.assertAlmostEqual(answer.x[0], 1, 2)

    def test_cc_pairs_name_bounds_of_x_and_g_that_complement_each_other(self):
        for kind in KINDS:
            x = kind.sym("x", 3)
            f, g = casadi.sumsqr(x - casadi.DM([1, 2, 3])), casadi.vertcat(x[2] + 1, 2 * x[1], x[0])
            sides = ((x[0], x[1]), (x[0], g[1]), (g[2], x[1]), (g[2], g[1]))
            limits = {"lbx": [0.5, -1, -10], "lbg": [-10, -2, 0.5], "ubg": 10}
            for cc_type, (a, b) in enumerate(sides):
                by_index = mpccsol("by_index", {"x": x, "f": f, "g": g},
                                   {"cc_pairs": [(0 if cc_type < 2 else 2, 1)], "cc_types": [cc_type]}, server="local")
                low = 1 if cc_type in (0, 2) else 2
                written = mpccsol("written", {"x": x, "f": f, "g": g, "G": a - 0.5, "H": b + low}, server="local")
                answer, same = by_index(**limits), written(**limits)
                near(answer["x"], same["x"].full())
                near(answer["x"], [0.5, 2, 3])
            default = mpccsol("default", {"x": x, "f": f}, {"cc_pairs": [(0, 1)]}, server="local")
            near(default(lbx=0)["x"], [0, 2, 3])
            with self.assertRaisesRegex(marble.InvalidProblem, r"lbx\[0\] is x.*0.*cc_pairs\[0\]"):
                default()

    def test_what_is_no_lcqp_is_refused_by_its_row_or_its_variable(self):
        for kind in KINDS:
            x, p, other = kind.sym("x", 2), kind.sym("p"), kind.sym("other")
            good = {"x": x, "p": p, "f": x[0] ** 2}
            for wrong, said in (
                    ({"f": x[0] ** 2 + p * x[1] ** 3}, "objective: .*depends on x.?1"),
                    ({"f": x}, "objective is of shape"),
                    ({"g": casadi.vertcat(x[0], p * x[0] * x[1])}, r"g\[1\] is .*x.?0.*must be linear"),
                    ({"G": x[0], "H": casadi.exp(x[1])}, r"H\[0\] is exp"),
                    ({"G": x, "H": x[0]}, "H is 1 entries"),
                    ({"f": other * x[0]}, "objective: .*other"),
                    ({"h": x}, "mpcc is ")):
                with self.assertRaisesRegex(marble.InvalidProblem, said):
                    mpccsol("wrong", good | wrong)
            solver = mpccsol("good", good, server="local")
            for numbers, said in (({}, "^p "), ({"p": [1, 2]}, "^p "), ({"p": np.nan}, r"^p\[0\]"),
                                  ({"p": 1, "lbx": [1, 2], "ubx": [2, 1]}, r"^lbx\[1\]"), ({"p": 1, "lbg": [1]}, None)):
                if said is None:
                    self.assertTrue(solver(**numbers))
                else:
                    with self.assertRaisesRegex(marble.InvalidArgument, said):
                        solver(**numbers)

    def test_x_of_several_symbols_and_a_program_without_p_or_pairs(self):
        a, b = casadi.MX.sym("a", 2), casadi.MX.sym("b")
        x = casadi.vertcat(a, b)
        solver = mpccsol("several", {"x": x, "f": casadi.sumsqr(x - 1), "g": a[0] + b}, server="local")
        near(solver(ubg=1)["x"], [0.5, 1, 0.5])
        with self.assertRaisesRegex(marble.InvalidProblem, "depends on b"):
            mpccsol("several", {"x": x, "f": casadi.sumsqr(a) + b ** 3})

    def test_from_casadi_takes_parameters_with_their_numbers(self):
        for kind in KINDS:
            x, p = kind.sym("x", 2), kind.sym("p", 2)
            problem = from_casadi(x, (x[0] - p[0]) ** 2 + x[1] ** 2 - 4 * x[1], p[1] * x[0], ub=1, pairs=[(x[0], x[1])],
                                  p=p, p0=[5, 2])
            answer = marble.solve(problem, server="local")
            np.testing.assert_allclose(answer.z, [0.5, 0], atol=1e-7)
            self.assertAlmostEqual(answer.row_duals[0], 4.5, 6)
            with self.assertRaisesRegex(marble.InvalidArgument, "^p "):
                from_casadi(x, p[0] * x[0], p=p)

    def test_the_page_s_example_prints_what_it_says(self):
        self.assertEqual(*example("CasADi"))


if __name__ == "__main__":
    unittest.main()
