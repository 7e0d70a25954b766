#!/usr/bin/env python3
"""Proofs of small problems, written by `marble solve --proof` and checked in exact rational numbers; proofs that were
tampered with; files that are no proofs.

Usage: proof_files_test.py MARBLE CHECK_PROOF
"""

import copy
import importlib.util
import io
import json
import pathlib
import random
import subprocess
import sys
import tempfile
import unittest

MARBLE, CHECKER = sys.argv[1], sys.argv[2]
HOLDS, FAILS, BAD_FILE, ASSUMES = 0, 1, 2, 4


def matrix(rows):
    """Dense rows as triplets."""
    entries = [(i, j, v) for i, row in enumerate(rows) for j, v in enumerate(row) if v]
    return {"rows": len(rows), "cols": len(rows[0]) if rows else 0,
            "i": [i for i, _, _ in entries], "j": [j for _, j, _ in entries], "v": [v for _, _, v in entries]}


def problem(n, Q=None, g=None, A=(), b=(), C=(), d=(), L=(), l=(), R=(), r=(), c0=0.0):
    """A problem file's object."""
    blocks = {"Q": Q, "A": A, "C": C, "L": L, "R": R}
    found = {"n": n, "c0": c0, "g": g or [0.0] * n, "b": list(b), "d": list(d), "l": list(l), "r": list(r)}
    found.update({name: matrix(list(rows)) for name, rows in blocks.items() if rows})
    return found


def unit(n, i, value=1.0):
    """A row with one entry."""
    return [value if j == i else 0.0 for j in range(n)]


def random_bounded(seed):
    """Convex, feasible at a random complementary point, with free variables that only Q holds."""
    draw = random.Random(seed)
    n, pairs = draw.randint(3, 6), draw.randint(2, 4)
    B = [[draw.randint(-3, 3) for _ in range(n)] for _ in range(n)]
    Q = [[sum(B[k][i] * B[k][j] for k in range(n)) + (i == j) for j in range(n)] for i in range(n)]
    z = [draw.randint(-2, 2) for _ in range(n)]
    L = [[draw.randint(-3, 3) for _ in range(n)] for _ in range(pairs)]
    R = [[draw.randint(-3, 3) for _ in range(n)] for _ in range(pairs)]
    side = [draw.random() < 0.5 for _ in range(pairs)]

    def offset(row, zero):
        return -sum(a * x for a, x in zip(row, z)) + (0 if zero else draw.randint(0, 3))

    return problem(n, Q=Q, g=[draw.randint(-5, 5) for _ in range(n)], L=L, R=R,
                   l=[offset(row, s) for row, s in zip(L, side)], r=[offset(row, not s) for row, s in zip(R, side)])


def random_game(seed, n=6):
    """Equilibria of a game of two, each with n strategies, with the least sum of payments as objective; a linear one."""
    draw = random.Random(seed)
    A, B = ([[draw.random() for _ in range(n)] for _ in range(n)] for _ in range(2))
    size = 2 * n + 2  # mixed strategies x, y and payments u, v
    worse_x = [[0.0] * n + [-a for a in row] + [1.0, 0.0] for row in A]
    worse_y = [[-row[j] for row in B] + [0.0] * n + [0.0, 1.0] for j in range(n)]
    sums = [[1.0] * n + [0.0] * (n + 2), [0.0] * n + [1.0] * n + [0.0, 0.0]]
    return problem(size, g=[0.0] * (2 * n) + [1.0, 1.0], A=sums, b=[-1.0, -1.0],
                   L=[unit(size, i) for i in range(2 * n)], l=[0.0] * (2 * n), R=worse_x + worse_y, r=[0.0] * (2 * n))


# One pair to branch on: min (z0 − 1)² + (z1 − 2)² over 0 ≤ z0 ⊥ z1 ≥ 0.
CORNER = problem(2, Q=[[2.0, 0.0], [0.0, 2.0]], g=[-2.0, -4.0], c0=5.0, L=[unit(2, 0)], l=[0.0], R=[unit(2, 1)], r=[0.0])
# No branch is feasible, but without complementarity z = (1, 1) is: 0 ≤ z0 ⊥ z1 ≥ 0, z0 ≥ 1, z1 ≥ 1.
CROSSED = problem(2, C=[unit(2, 0), unit(2, 1)], d=[-1.0, -1.0], L=[unit(2, 0)], l=[0.0], R=[unit(2, 1)], r=[0.0])
# Rows contradict each other without any pair: z0 + z1 ≥ 3, z0 ≤ 1, z1 ≤ 1.
CLASH = problem(2, g=[1.0, 1.0], C=[[1.0, 1.0], unit(2, 0, -1.0), unit(2, 1, -1.0)], d=[-3.0, 1.0, 1.0],
                L=[unit(2, 0)], l=[0.0], R=[unit(2, 1)], r=[0.0])
# Falls along z1 without bound.
RUNAWAY = problem(2, g=[0.0, -1.0], L=[unit(2, 0)], l=[0.0], R=[unit(2, 1)], r=[0.0])


class Files(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.problem_file = pathlib.Path(self.folder.name, "problem.json")
        self.proof_file = pathlib.Path(self.folder.name, "proof.jsonl")

    def solve(self, data, *options, files=None):
        self.problem_file.write_text(json.dumps(data))
        return subprocess.run([MARBLE, "solve", "--local", "--quiet", "--output", "json", "--option", "global_search=true",
                               "--proof", str(self.proof_file), *options, *(files or [str(self.problem_file)])],
                              capture_output=True, text=True, check=False)

    def check(self):
        result = subprocess.run([sys.executable, CHECKER, str(self.problem_file), str(self.proof_file)],
                                capture_output=True, text=True, check=False)
        self.assertNotIn("Traceback", result.stderr)
        return result.returncode, json.loads(result.stdout)

    def lines(self):
        return [json.loads(line) for line in self.proof_file.read_text().splitlines()]

    def write(self, lines):
        self.proof_file.write_text("".join(json.dumps(line) + "\n" for line in lines))


class WhatIsProved(Files):
    def test_a_bound_of_a_tree_holds_and_meets_the_point(self):
        solved = self.solve(CORNER)
        self.assertEqual(solved.returncode, 0, solved.stderr)
        code, found = self.check()
        self.assertEqual(code, HOLDS, found)
        self.assertTrue(found["optimal"] and found["feasible"], found)
        self.assertAlmostEqual(found["bound"], 1.0, places=6)
        self.assertAlmostEqual(found["objective"], 1.0, places=6)

    def test_random_convex_problems_hold_without_a_radius(self):
        for seed in range(12):
            with self.subTest(seed=seed):
                solved = self.solve(random_bounded(seed))
                self.assertEqual(solved.returncode, 0, solved.stderr)
                code, found = self.check()
                self.assertEqual(code, HOLDS, found)
                self.assertTrue(found["optimal"], found)

    def test_trees_of_games_hold_though_relaxations_lose_their_best_multipliers(self):
        for seed in range(8):
            with self.subTest(seed=seed):
                solved = self.solve(random_game(seed))
                self.assertEqual(solved.returncode, 0, solved.stderr)
                code, found = self.check()
                self.assertEqual(code, HOLDS, found)
                self.assertTrue(found["optimal"], found)

    def test_every_branch_that_contradicts_itself_is_a_leaf(self):
        solved = self.solve(CROSSED)
        self.assertEqual(json.loads(solved.stdout)["status"], "infeasible")
        code, found = self.check()
        self.assertEqual((code, found["claim"]), (HOLDS, "infeasible"), found)
        self.assertGreaterEqual(found["leaves"], 2)

    def test_rows_that_contradict_each_other_are_one_leaf(self):
        self.solve(CLASH)
        code, found = self.check()
        self.assertEqual((code, found["claim"], found["leaves"]), (HOLDS, "infeasible", 1), found)

    def test_a_proof_of_a_binary_problem_is_checked_with_its_json(self):
        for data in (CORNER, CLASH):
            self.solve(data)
            binary = self.problem_file.with_suffix(".pb")
            subprocess.run([MARBLE, "convert", str(self.problem_file), str(binary)], check=True)
            self.proof_file.unlink()
            self.solve(data, files=[str(binary)])
            json_file, self.problem_file = self.problem_file, binary
            code, found = self.check()
            self.assertEqual(code, BAD_FILE, found)
            self.assertIn(f"marble convert {binary} {json_file}", found["error"])
            json_file.unlink()
            subprocess.run([MARBLE, "convert", str(binary), str(json_file)], check=True)
            self.problem_file = json_file
            self.assertEqual(self.check()[0], HOLDS)

    def test_a_tree_that_a_limit_ends_proves_its_own_bound(self):
        solved = self.solve(random_bounded(3), "--option", "node_limit=1", "--option", "max_small_problem_nodes=0")
        bound = json.loads(solved.stdout)["bound"]
        if bound is None:
            self.assertFalse(self.proof_file.exists())
        else:
            self.assertEqual(self.check()[0], HOLDS)

    def test_an_unbounded_problem_leaves_no_file_and_says_why(self):
        solved = self.solve(RUNAWAY)
        self.assertIn("no proof was written", solved.stderr)
        self.assertFalse(self.proof_file.exists())
        self.assertEqual(solved.returncode, 1)

    def test_a_server_or_several_files_are_refused_before_anything_is_solved(self):
        for arguments in (["--proof", str(self.proof_file), "--server", "127.0.0.1:1", "x.json"],
                          ["--proof", str(self.proof_file), "--local", "x.json", "y.json"]):
            result = subprocess.run([MARBLE, "solve", *arguments], capture_output=True, text=True, check=False)
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertIn("--proof", result.stderr)
            self.assertFalse(self.proof_file.exists())


class Tampered(Files):
    """None of these may hold; each is made from a proof that does."""

    def setUp(self):
        super().setUp()
        self.solve(CORNER)
        self.assertEqual(self.check()[0], HOLDS)
        self.good = self.lines()

    def rejects(self, lines, code=FAILS):
        self.write(lines)
        result, found = self.check()
        self.assertEqual(result, code, found)

    def changed(self):
        return copy.deepcopy(self.good)

    def test_a_bound_that_is_higher(self):
        lines = self.changed()
        lines[0]["bound"] += 1e-3
        self.rejects(lines)

    def test_a_leaf_that_is_missing(self):
        self.assertGreater(len(self.good), 3, "more than one leaf")
        for at in range(1, len(self.good) - 1):
            lines = self.changed()
            del lines[at]
            lines[0]["leaves"] -= 1
            lines[-1]["end"] -= 1
            self.rejects(lines)

    def test_a_side_that_is_switched(self):
        for at in range(1, len(self.good) - 1):
            lines = self.changed()
            lines[at]["s"], lines[at]["t"] = lines[at]["t"], lines[at]["s"]
            self.rejects(lines)

    def test_a_bound_that_is_called_a_contradiction(self):
        lines = self.changed()
        lines[1]["proves"] = "contradiction"
        self.rejects(lines)
        lines = self.changed()
        lines[0]["claim"] = "infeasible"
        self.rejects(lines)

    def test_a_negative_multiplier_of_a_free_side(self):
        lines = self.changed()
        lines[1]["s"], lines[1]["t"], lines[1]["xi"] = [], [], {"i": [0], "v": [-1.0]}
        self.rejects(lines)

    def test_another_problem(self):
        other = copy.deepcopy(CORNER)
        other["g"][0] = -1.0
        self.problem_file.write_text(json.dumps(other))
        lower = dict(other, c0=4.0)
        for data in (lower, dict(other, c0=0.0)):
            self.problem_file.write_text(json.dumps(data))
            self.assertEqual(self.check()[0], FAILS)
        self.problem_file.write_text(json.dumps(RUNAWAY))
        self.assertEqual(self.check()[0], FAILS)
        self.problem_file.write_text(json.dumps(random_bounded(1)))
        self.assertEqual(self.check()[0], BAD_FILE)

    def test_multipliers_at_random_prove_no_more_than_is_true(self):
        # The optimum is 1: whatever is done to multipliers, no bound above it may ever be called proved.
        draw = random.Random(1)
        for _ in range(60):
            lines = self.changed()
            for leaf in lines[1:-1]:
                for part in ("z", "xi", "eta"):
                    if part in leaf:
                        leaf[part]["v"] = [v * draw.uniform(-2.0, 3.0) + draw.gauss(0.0, 1.0) for v in leaf[part]["v"]]
            lines[0]["bound"] = 1.0 + 1e-6
            self.write(lines)
            self.assertNotIn(self.check()[0], (HOLDS, ASSUMES))

    def test_a_contradiction_of_what_is_feasible(self):
        self.solve(CROSSED)
        self.problem_file.write_text(json.dumps(dict(CROSSED, d=[0.0, -1.0])))
        self.assertEqual(self.check()[0], FAILS)


class Hostile(Files):
    """A clear error and exit code 2, never a traceback."""

    def setUp(self):
        super().setUp()
        self.solve(CORNER)
        self.good = self.proof_file.read_bytes()

    def refuses(self, proof=None, problem_text=None):
        self.proof_file.write_bytes(self.good if proof is None else proof)
        if problem_text is not None:
            self.problem_file.write_bytes(problem_text)
        code, found = self.check()
        self.assertEqual(code, BAD_FILE, found)
        self.assertTrue(found["error"])

    def test_garbage_in_place_of_a_proof(self):
        for proof in (b"", b"\n", b"\0\xff\xfe", b"[]\n", b"nul", b"{}\n", b'{"format":"marble-proof","version":2}\n',
                      b"[" * 100000, b'{"a":' * 100000, self.good[: len(self.good) // 2], self.good + b"{}\n",
                      self.good.replace(b'"leaves":', b'"leaves":1e9,"x":'), self.good.replace(b'"n":2', b'"n":2,"n":2'),
                      self.good.replace(b'"bound":', b'"bound":NaN,"x":', 1),
                      self.good.replace(b'"bound":', b'"bound":1e999,"x":', 1),
                      self.good.replace(b'"leaves":', b'"leaves":' + b"9" * 5000 + b',"x":')):
            with self.subTest(proof=proof[:60]):
                self.refuses(proof)

    def test_leaves_with_parts_that_cannot_be(self):
        leaf = self.good.splitlines()[1]
        for part in (b'{"s":[0],"t":[0],"proves":"bound"}', b'{"s":[5],"t":[],"proves":"bound"}',
                     b'{"s":[],"t":[],"proves":"luck"}', b'{"s":null,"t":[],"proves":"bound"}',
                     b'{"s":[true],"t":[],"proves":"bound"}', b'{"s":[],"t":[],"proves":"bound","z":[1]}',
                     b'{"s":[],"t":[],"proves":"bound","z":{"i":[0,0],"v":[1,1]}}',
                     b'{"s":[],"t":[],"proves":"bound","y":{"i":[0],"v":[1]}}',
                     b'{"s":[],"t":[],"proves":"bound","z":{"i":[0],"v":["1"]}}',
                     b'{"s":[],"t":[],"proves":"bound","z":{"i":[0],"v":[]}}'):
            with self.subTest(part=part):
                self.refuses(self.good.replace(leaf, part, 1))

    def test_garbage_in_place_of_a_problem(self):
        text = json.dumps(CORNER).encode()
        for data in (b"", b"[]", b"{}", b'{"n":-1}', b'{"n":1e400}', b'{"n":2,"g":[1]}', b"\xff", b"[" * 100000,
                     text.replace(b'"n": 2', b'"n": 3'), text.replace(b"-4.0", b"Infinity"),
                     text.replace(b'"i": [0, 1]', b'"i": [0, 7]'), text.replace(b'"i": [0, 1]', b'"i": [0]')):
            with self.subTest(data=data[:60]):
                self.refuses(problem_text=data)

    def test_bytes_changed_at_random_end_in_a_verdict_that_is_true(self):
        spec = importlib.util.spec_from_file_location("check_proof", CHECKER)
        checker = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(checker)
        data = checker.Problem(self.problem_file)
        draw = random.Random(7)
        verdicts = set()
        for _ in range(1500):
            changed = bytearray(self.good)
            for _ in range(draw.randint(1, 3)):
                at = draw.randrange(len(changed))
                if draw.random() < 0.5:
                    changed[at] = draw.choice(b'0123456789-.e[]{}",:stxn')
                else:
                    del changed[at:at + draw.randint(1, 20)]
            try:
                code, found = checker.check(data, io.StringIO(changed.decode()), pathlib.Path("changed"))
            except (checker.NoProof, checker.BadFile) as error:
                verdicts.add(type(error).__name__)
                continue
            verdicts.add(code)
            if found["bound"] is not None:  # the optimum is 1; beyond |z| <= radius nothing is said
                self.assertTrue(found["bound"] <= 1.0 or code == ASSUMES, changed)
        self.assertLessEqual({HOLDS, "BadFile"}, verdicts)

    def test_files_that_are_not_there(self):
        self.proof_file.unlink()
        self.assertEqual(self.check()[0], BAD_FILE)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
