"""The suite of NOSBENCH (loadtest/suite/nosbench) on small problems of our own in its format."""

import csv
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import casadi as ca
import numpy as np

SUITE = pathlib.Path(__file__).resolve().parents[2] / "loadtest/suite/nosbench"
sys.path.insert(0, str(SUITE))

import problems  # noqa: E402
from judge import judge  # noqa: E402
from problems import BadProblem  # noqa: E402
from report import load, profile, reason, solved  # noqa: E402


def arm():
    """An arm's tip above the floor, or a force at it; its torque is p[0] of what balances."""
    w, p = ca.SX.sym("w", 3), ca.SX.sym("p", 1)
    return {"w": w, "p": p, "w0": [0, 0, 2], "p0": [2], "f": (w[1] - 1) ** 2 + 0.1 * w[2] ** 2,
            "g": w[2] - (p - w[1]) * ca.cos(w[0]), "lbg": 0, "ubg": 0, "G": 0.2 + ca.sin(w[0]), "H": w[1]}


def disc():
    """The nearest point of a disc to (1, 2), on an axis."""
    w = ca.SX.sym("w", 2)
    return {"w": w, "w0": [1, 1], "f": (w[0] - 1) ** 2 + (w[1] - 2) ** 2, "g": ca.sumsqr(w), "lbg": -math.inf,
            "ubg": 2.25, "G": w[0], "H": w[1]}


def corner():
    """B-stationary, and not strongly, at 0, where both sides are zero: ralph1 of MacMPEC."""
    w = ca.SX.sym("w", 2)
    return {"w": w, "w0": [1, 1], "lbw": [0, 0], "f": 2 * w[0] - w[1], "G": w[1], "H": w[1] - w[0]}


def wall():
    """A body with drag, pushed for N implicit Euler steps, and a wall at 1: a gap or a force at each."""
    N, h = 8, 0.1
    w = ca.SX.sym("w", 4 * N)
    q, v, u, force = (w[i::4] for i in range(4))
    before_q, before_v = ca.vertcat(0, q[:-1]), ca.vertcat(1, v[:-1])
    return {"w": w, "w0": [0.0] * (4 * N), "lbw": [-5] * (4 * N), "ubw": [50] * (4 * N),
            "f": ca.sumsqr(q - 1) + 1e-2 * ca.sumsqr(u),
            "g": ca.vertcat(q - before_q - h * v, v - before_v - h * (u - 0.2 * v * ca.fabs(v)) + force),
            "lbg": 0, "ubg": 0, "G": 1 - q, "H": force}


def friction():
    """A block on a plane: its sliding velocity has parts forwards and backwards, and a multiplier between -1 and 1."""
    N, h = 6, 0.2
    w = ca.SX.sym("w", 5 * N)
    v, forwards, backwards, push, slip = (w[i::5] for i in range(5))
    before = ca.vertcat(0, v[:-1])
    return {"w": w, "w0": [0.0] * (5 * N), "lbw": [-10, 0, 0, -4, 0] * N, "ubw": [10, 10, 10, 4, 1] * N,
            "f": (h * ca.sum1(v) - 1) ** 2 + 1e-2 * ca.sumsqr(push),
            "g": ca.vertcat(v - forwards + backwards, v - before - h * (push + ca.sin(v) - (2 * slip - 1))),
            "lbg": 0, "ubg": 0, "G": ca.vertcat(forwards, backwards), "H": ca.vertcat(1 - slip, slip)}


SMALL = {f"{make.__name__.upper()}_1": make for make in (arm, disc, corner, wall, friction)}


def serialized(parts):
    """In the format of the repository: CasADi's strings, and numbers by entry."""
    w, p = parts["w"], parts.get("p", ca.SX.sym("p", 0))
    g = parts.get("g", ca.SX(0, 1))
    made = {"w": w.serialize(), "p": p.serialize(), "p0": parts.get("p0", []), "w0": parts["w0"],
            "lbw": parts.get("lbw", [-math.inf] * w.numel()), "ubw": parts.get("ubw", [math.inf] * w.numel()),
            "lbg": [parts.get("lbg")] * g.numel(), "ubg": [parts.get("ubg")] * g.numel()}
    for field, part in (("augmented_objective_fun", parts["f"]), ("g_fun", g), ("G_fun", parts["G"]),
                        ("H_fun", parts["H"])):
        made[field] = ca.Function(field, [w, p], [part]).serialize()
    return made


def compare(*arguments, code=0):
    run = subprocess.run([sys.executable, SUITE / "compare", *map(str, arguments)], capture_output=True, text=True,
                         env={**os.environ, "MARBLE_SERVER": ""})
    assert run.returncode == code, run.stdout + run.stderr
    return run.stdout + run.stderr


class Nosbench(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        for name, make in SMALL.items():
            (cls.folder / f"{name}.json").write_text(json.dumps(serialized(make())))
        cls.csv = cls.folder / "results.csv"
        cls.asked = [cls.folder, "--sample", "all", "--seconds", 20, "--results", cls.csv, "--solvers", "marble",
                     "ipopt_scholtes"]
        cls.printed = compare(*cls.asked, "--jobs", 2, "--profile", cls.folder / "profile.csv")
        cls.rows = load(cls.csv)

    def read(self, name):
        return problems.read(self.folder / f"{name}.json")

    def test_marble_solves_all_and_the_judge_says_so(self):
        for name in SMALL:
            row = self.rows[name, "marble"]
            self.assertTrue(solved(row) and row["said"], (name, reason(row), row["detail"]))
        self.assertRegex(self.printed, r"marble +5/5 +100\.0 ")
        self.assertAlmostEqual(self.rows["DISC_1", "marble"]["objective"], 1 + 0.25, places=6)  # at (0, 1.5)

    def test_a_relaxation_ends_at_the_root_of_t_where_both_sides_are_zero(self):
        row = self.rows["CORNER_1", "ipopt_scholtes"]
        self.assertFalse(solved(row))
        self.assertGreater(row["sides"], 1e-6)
        self.assertLess(row["products"], 1e-6)
        self.assertIn("sides", reason(row))

    def test_the_profile_counts_solved_problems_by_their_times(self):
        rows = [{**self.rows["DISC_1", "marble"], "problem": f"DISC_{i}", "solver": solver, "cpu_s": seconds}
                for i, times in enumerate([(1, 3), (2, 1)]) for solver, seconds in zip("ab", times, strict=True)]
        rows[3]["rows"] = 1.0  # b's second x is not feasible
        shares = {(name, ratio): share for name, ratio, share in profile(rows, ["a", "b"])}
        self.assertEqual((shares["a", 1.0], shares["b", 1.0], shares["b", 4.0], shares["b", 1024.0]), (1, 0, 0.5, 0.5))
        with (self.folder / "profile.csv").open(newline="") as file:
            self.assertEqual(next(csv.reader(file)), ["solver", "ratio", "share"])

    def test_an_interrupted_run_continues_where_it_was_cut_off(self):
        whole = self.csv.read_text().split("\n")
        cut = self.folder / "cut.csv"
        cut.write_text("\n".join(whole[:9]) + "\n" + whole[9][: len(whole[9]) // 3])  # 8 of 10 rows, and a part of one
        said = compare(*[cut if each == self.csv else each for each in self.asked])
        self.assertEqual(said.partition("\n\n")[0].count(" s  "), 2, said)
        again = load(cut)
        self.assertEqual(set(again), set(self.rows))
        self.assertEqual({key: row["objective"] for key, row in again.items()},
                         {key: row["objective"] for key, row in self.rows.items()})
        self.assertEqual(compare(*self.asked).partition("\n\n")[0].count(" s  "), 0)

    def test_the_judge_measures_in_the_problem_s_units(self):
        disc = self.read("DISC_1")
        found = judge(disc, [0, 2])
        self.assertEqual((found.objective, found.rows, found.sides, found.negative), (1.0, 4 - 2.25, 0.0, 0.0))
        self.assertEqual(judge(disc, [-0.5, 0.25]).negative, 0.5)
        found = judge(disc, [1e-3, 1e-3])
        self.assertEqual((found.sides, found.feasible(), found.feasible(True)), (1e-3, False, True))
        self.assertEqual(judge(self.read("WALL_1"), np.full(32, 51.0)).bounds, 1.0)
        for bad in ([math.nan, 0], [0], [math.inf, 0]):
            self.assertFalse(judge(disc, bad).feasible())

    def test_the_judge_distinguishes_stationary_points_from_others(self):
        disc = self.read("DISC_1")
        self.assertLess(judge(disc, [0, 1.5]).stationarity, 1e-8)
        self.assertLess(judge(disc, [1, 0]).stationarity, 1e-8)  # of the other branch
        slope = judge(disc, [0, 1])  # feasible; dθ/dy = -2, and the axis's multiplier takes dθ/dx
        self.assertTrue(slope.feasible() and not slope.stationary())
        self.assertAlmostEqual(slope.stationarity, 1.0, places=8)
        corner = judge(self.read("CORNER_1"), [0, 0])
        self.assertEqual(corner.biactive, 1)
        self.assertLess(corner.stationarity, 1e-8)

    def test_files_that_are_no_problems_are_refused_by_field_and_index(self):
        good = serialized(arm())
        other = ca.SX.sym("w", 4)
        cases = [
            ("not JSON", "{", "not JSON"), ("object", [], "must be an object"),
            ("missing", {k: v for k, v in good.items() if k != "H_fun"}, "H_fun is missing"),
            ("string", good | {"w": 3}, "w must be a string"),
            ("text", good | {"w": "abc"}, "w is nothing that CasADi"),
            ("null", good | {"w0": [0, None, 2]}, r"w0\[1\] is 'None', must be a number"),
            ("nan", good | {"lbw": [0, 0, math.nan]}, r"lbw\[2\]"),
            ("infinite", good | {"w0": [math.inf, 0, 0]}, r"w0\[0\] is inf, must be finite"),
            ("short", good | {"ubw": [1, 1]}, "ubw has 2 entries, must have 3, as w"),
            ("rows", good | {"lbg": [0, 0]}, "lbg has 2 entries, must have 1, as g_fun"),
            ("other w", good | {"G_fun": ca.Function("G", [other, ca.SX.sym("p")], [other[3]]).serialize()},
             "G_fun does not take w and p"),
            ("one input", good | {"G_fun": ca.Function("G", [other], [other[3]]).serialize()}, "G_fun must be a func"),
            ("pairs", good | {"H_fun": serialized(wall())["H_fun"]}, "H_fun does not take"),
        ]
        for name, given, message in cases:
            with self.subTest(name):
                path = self.folder / "bad" / f"{name}.json"
                path.parent.mkdir(exist_ok=True)
                path.write_text(given if isinstance(given, str) else json.dumps(given))
                with self.assertRaisesRegex(BadProblem, f"^{name}.json: .*{message}"):
                    problems.read(path)
        said = compare(self.folder / "bad", "--sample", "all", "--only", "missing", "short", "--solvers", "marble",
                       "--results", self.folder / "bad.csv", code=2)
        self.assertRegex(said, "marble: left out, (missing|short): ")
        (self.folder / "other.csv").write_text("a,b\n1,2\n")
        for arguments in ([self.folder, "--results", self.folder / "other.csv"], [self.folder / "bad" / "none"],
                          [self.folder, "--jobs", 0], [self.folder, "--seconds", 0], [self.folder, "--choose", 4, 1]):
            compare(*arguments, code=2)

    def test_samples_are_in_proportion_and_the_same_everywhere(self):
        names = [f"{key}_{i:03}" for key, count in (("A", 60), ("B", 30), ("C", 9), ("D", 1)) for i in range(count)]
        taken = problems.stratified(names, 20, 1)
        self.assertEqual([sum(problems.class_of(name) == key for name in taken) for key in "ABCD"], [12, 6, 1, 1])
        self.assertEqual(taken, problems.stratified(names[::-1], 20, 1))
        self.assertNotEqual(taken, problems.stratified(names, 20, 2))
        self.assertEqual([name for name in taken if name[0] in "CD"], ["C_004", "D_000"])
        tuning = problems.tuning_names()
        self.assertEqual((len(tuning), len({problems.class_of(name) for name in tuning})), (60, 33))


if __name__ == "__main__":
    unittest.main()
