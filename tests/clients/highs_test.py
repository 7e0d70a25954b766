"""Problems of MPS, QPS and LP files, as the real HiGHS reads them: what they mean, and what is refused."""

import contextlib
import io
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest
from unittest import mock

import highspy
import numpy as np

import marble
from marble import __main__ as program
from marble.base import bounded_process
from marble.model import highs_file

MPS = """NAME qp
ROWS
 N  obj
 L  c1
 G  c2
 E  c3
COLUMNS
    x         obj       1.0   c1   1.0
    x         c2        1.0
    y         obj      -2.0   c1   1.0
    y         c3        1.0
    z         obj       1.0   c1   1.0
RHS
    RHS       c1        4.0   c2   0.25
    RHS       c3        1.5
    RHS       obj       -7
RANGES
    RNG       c1        3.0
BOUNDS
 UP BND       x         4.0
 FR BND       y
 LO BND       z         0.5
 UP BND       z         1e30
QUADOBJ
    x x 2
    x y 1
    y y 2
    z z 4
ENDATA
"""
LP = """maximize
 obj: 3 x + 5 y - [ x^2 ] / 2
subject to
 c1: x + y <= 4
 c2: x - y >= -2
bounds
 x free
 y <= 3.5
end
"""


class Highs(unittest.TestCase):
    def setUp(self):
        self._folder = tempfile.TemporaryDirectory()
        self.addCleanup(self._folder.cleanup)

    def file(self, name, text):
        path = pathlib.Path(self._folder.name) / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    def test_a_qp_is_read_as_it_is_and_solved_as_by_highs(self):
        for name in ("model.mps", "model.QPS", "wéird name'.mps"):
            problem = marble.Problem.load(self.file(name, MPS))
            answer = marble.solve(problem, server="local")
            highs = highspy.Highs()
            highs.setOptionValue("output_flag", False)
            highs.readModel(str(self.file("again.mps", MPS)))
            highs.run()
            self.assertAlmostEqual(answer.objective, highs.getInfo().objective_function_value, 6)
            self.assertEqual((answer["x"], answer["y"], answer["z"]), tuple(answer.z))
            np.testing.assert_allclose(answer.z, highs.getSolution().col_value, atol=1e-5)
            np.testing.assert_array_equal(problem.compile().Q.toarray(), [[2, 1, 0], [0, 2, 0], [0, 0, 4]])
            self.assertEqual((problem.n, answer.row_duals.size, problem.negated), (3, 3, False))
            self.assertEqual(problem.compile().c0, 7)

    def test_a_maximum_is_reported_as_the_file_has_it(self):
        path = self.file("model.lp", LP)
        problem = marble.Problem.load(path)
        self.assertTrue(problem.negated)
        answer = marble.solve(problem, server="local")
        np.testing.assert_allclose([answer["x"], answer["y"]], [1, 3], atol=1e-6)
        self.assertAlmostEqual(answer.objective, -17.5, 6)
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            self.assertEqual(program.main(["--server", "local", "solve", str(path)]), 0)
        self.assertRegex(out.getvalue(), r"objective +17\.5\n")

    def test_pairs_may_be_added_by_the_files_names(self):
        problem = marble.Problem.load(self.file("model.mps", MPS)).add_pair("x", "z", l=-1)
        self.assertTrue(marble.solve(problem, server="local").solved)

    def test_what_no_lcqp_has_and_what_is_broken_is_refused_with_the_reason(self):
        lp = "minimize\n x\nsubject to\n c: x + y >= 1\n"
        for name, text, said in (
                ("integer.lp", lp + "general\n y\nend\n", "variable y: must be continuous"),
                ("binary.lp", lp + "binary\n x\nend\n", "variable x: must be continuous"),
                ("semi.lp", lp + "bounds\n y <= 5\nsemi-continuous\n y\nend\n", "variable y: must be continuous"),
                ("rows.lp", "minimize\n x\nsubject to\n c: [ x^2 ] <= 1\nend\n", "cannot be read by HiGHS"),
                ("none.lp", "", "must have a variable"),
                ("words.mps", "what is this\n" * 3, "cannot be read by HiGHS"),
                ("zeros.mps", b"\0" * 10_000, "cannot be read by HiGHS"),
                ("cut.mps", MPS[:200], ""),
                ("nan.mps", MPS.replace("-2.0", "nan"), "")):
            path = self.file(name, text)
            with self.subTest(name):
                with self.assertRaisesRegex(marble.InvalidProblem, said):
                    marble.Problem.load(path)
                err = io.StringIO()
                with contextlib.redirect_stderr(err):
                    self.assertEqual(program.main(["--server", "local", "solve", str(path)]), 2)
                self.assertIn(f"{name}: ", err.getvalue())
        with self.assertRaises(OSError):
            marble.Problem.load(os.path.join(self._folder.name, "missing.mps"))

    def test_every_beginning_and_many_changed_files_are_read_or_refused_and_nothing_else(self):
        random = np.random.default_rng(1)
        texts = [MPS[:at] for at in range(0, len(MPS), 150)]
        for _ in range(6):
            changed = bytearray(MPS.encode())
            for place in random.integers(0, len(changed), 4):
                changed[place] = random.integers(0, 256)
            texts.append(bytes(changed))
        for text in texts:
            with contextlib.suppress(marble.InvalidProblem):
                marble.Problem.load(self.file("changed.mps", text))

    def test_a_file_may_not_ask_for_more_than_its_length_allows(self):
        with mock.patch.object(bounded_process, "MOST_BYTES", 100), \
                self.assertRaisesRegex(marble.InvalidProblem, "must have at most 100 bytes"):
            marble.Problem.load(self.file("long.mps", MPS))
        # A reader that dies, as by its limits, is an error and not the end of this process.
        for how, said in (("import os; os.kill(os.getpid(), 9)", "which failed"), ("print('nonsense')", "cannot be read"),
                          ("import time; time.sleep(60)", "takes more than")):
            real = subprocess.run

            def instead(command, how=how, real=real, **words):
                return real([sys.executable, "-c", how], **words)

            with mock.patch.object(bounded_process.subprocess, "run", instead), \
                    mock.patch.object(bounded_process, "_SECONDS", 0.5), \
                    self.assertRaisesRegex(marble.InvalidProblem, said):
                marble.Problem.load(self.file("model.mps", MPS))

    def test_without_the_package_the_error_says_what_to_install(self):
        with mock.patch.object(highs_file.importlib.util, "find_spec", lambda name: None), \
                self.assertRaisesRegex(marble.InvalidProblem, "pip install highspy"):
            marble.Problem.load(self.file("model.mps", MPS))


if __name__ == "__main__":
    unittest.main()
