"""The package's own tests of nonlinear plans, with the real CasADi; and that the suite beside others judges by itself."""

import os
import pathlib
import subprocess
import sys
import unittest

import pytest

PROJECT = pathlib.Path(__file__).resolve().parents[2]


class Robots(unittest.TestCase):
    def test_the_package_s_own_tests_pass(self):
        tests = [str(PROJECT / f"client/python/tests/test_{name}.py") for name in ("robots", "nlp")]
        self.assertEqual(pytest.main(["-q", "-p", "no:cacheprovider", *tests]), 0)

    def test_the_suite_counts_what_reaches_the_best_known_objective_and_what_does_not(self):
        run = subprocess.run([sys.executable, PROJECT / "loadtest/suite/nonlinear/compare", "--solvers", "marble", "ipopt",
                              "--only", "jr1", "ralph1", "gumus"], capture_output=True, text=True, check=True,
                             env={**os.environ, "MARBLE_SERVER": ""})
        self.assertRegex(run.stdout, r"marble +reached 3 of 3 \(100.0 %\), by products 3; said solved 3, rejected of them 0")
        # gumus at another optimum; ralph1 is off by the root of what the product may be
        self.assertRegex(run.stdout, r"ipopt +reached 1 of 3 \(33.3 %\), by products 2; said solved 3, rejected of them 1")


if __name__ == "__main__":
    unittest.main()
