"""The package's own tests of MATLAB's files, with the real h5py for version 7.3."""

import pathlib
import sys

import pytest

TESTS = pathlib.Path(__file__).resolve().parents[2] / "client/python/tests"
sys.exit(pytest.main(["-q", "-p", "no:cacheprovider", str(TESTS / "test_mat.py")]))
