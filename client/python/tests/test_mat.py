"""MATLAB's files: what is read of each version, what is refused and with which variable's name."""

from __future__ import annotations

import faulthandler
import json
import os
import struct
import subprocess
import sys

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from support import clean_environment, full

import marble
from marble import Problem, mat
from marble import __main__ as program
from marble.base import bounded_process

try:
    import h5py
except ImportError:
    h5py = None
needs_h5py = pytest.mark.skipif(h5py is None, reason="h5py is not installed")

PARTS = {
    "Q": np.array([[2.0, 0.5], [0.5, 2.0]]), "g": np.array([[-2.0], [1.0 / 3.0]]),
    "L": np.array([[1.0, 0.0]]), "R": np.array([[0.0, 1.0]]), "lbL": np.array([[0.25]]),
    "A": np.array([[1.0, 1.0], [1.0, -1.0]]), "lbA": np.array([[-1.0], [0.5]]), "ubA": np.array([[np.inf], [0.5]]),
    "lb": np.array([[-4.0], [-np.inf]]), "ub": np.array([[np.inf], [5.0]]), "x0": np.array([[1.0], [1.0]]),
}
LESS = {name: PARTS[name] for name in "Qg"}
WANTED = {
    "Q": PARTS["Q"], "g": [-2.0, 1.0 / 3.0], "A": [[1.0, -1.0]], "b": [-0.5],
    "C": [[1.0, 1.0], [1.0, 0.0], [0.0, -1.0]], "d": [1.0, 4.0, 5.0],
    "L": [[1.0, 0.0]], "l": [-0.25], "R": [[0.0, 1.0]], "r": [0.0], "z0": [1.0, 1.0],
}


def expect(problem, wanted=WANTED):
    compiled = problem.compile()
    for name, values in wanted.items():
        found = getattr(compiled, name)
        found = (full(found) if name == "Q" else found).toarray() if sp.issparse(found) else found
        np.testing.assert_array_equal(found, values, err_msg=name)


def sparse(parts):
    return {name: sp.csc_matrix(part) if name in "QALR" else part for name, part in parts.items()}


def refusal(path):
    with pytest.raises(marble.InvalidProblem) as caught:
        mat.load(path)
    return str(caught.value)


class Mat5:
    """A file of MATLAB 5, element by element, of a machine of either byte order."""

    def __init__(self, order="<"):
        self._order = order
        self.content = b" " * 124 + (b"\0\1IM" if order == "<" else b"\1\0MI")

    def _element(self, kind, code, values):
        data = struct.pack(f"{self._order}{len(values)}{code}", *values)
        return struct.pack(f"{self._order}2I", kind, len(data)) + data + b"\0" * (-len(data) % 8)

    def _matrix(self, kind, name, shape, data):
        content = (self._element(6, "I", (kind, 0)) + self._element(5, "i", shape)
                   + self._element(1, "B", name.encode()) + data)
        self.content += self._element(14, "B", content)
        return self

    def dense(self, name, shape, values):
        return self._matrix(6, name, shape, self._element(9, "d", values))

    def sparse(self, name, shape, ir, jc, values):
        return self._matrix(5, name, shape, self._element(5, "i", ir) + self._element(5, "i", jc)
                            + self._element(9, "d", values))

    def into(self, path):
        path.write_bytes(self.content)
        return path


def write_73(path, parts):
    """As MATLAB writes version 7.3: transposed datasets, and groups of sparse matrices."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, part in parts.items():
            if sp.issparse(part):
                group = file.create_group(name)
                group.attrs["MATLAB_sparse"] = np.uint64(part.shape[0])
                if part.nnz:
                    group["data"], group["ir"] = part.data, part.indices.astype(np.uint64)
                group["jc"] = part.indptr.astype(np.uint64)
                group.attrs["MATLAB_class"] = np.bytes_("double")
            elif part.size == 0:
                file[name] = np.array(part.shape, dtype=np.uint64)
                file[name].attrs["MATLAB_empty"] = np.uint8(1)
                file[name].attrs["MATLAB_class"] = np.bytes_("double")
            else:
                file[name] = part.T
                file[name].attrs["MATLAB_class"] = np.bytes_("double")
    content = bytearray(path.read_bytes())
    content[:128] = b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM"
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("words", [{"format": "5"}, {"format": "4"}, {"format": "5", "do_compression": True}])
@pytest.mark.parametrize("form", [dict, sparse])
def test_a_file_of_scipy_is_read_as_the_problem_that_it_holds(tmp_path, words, form):
    scipy.io.savemat(tmp_path / "p.mat", form(PARTS), **words)
    problem = mat.load(tmp_path / "p.mat")
    expect(problem)
    assert problem.name == "p"
    expect(Problem.load(tmp_path / "p.mat"))


@needs_h5py
@pytest.mark.parametrize("form", [dict, sparse])
def test_a_file_of_version_7_3_is_read_as_the_problem_that_it_holds(tmp_path, form):
    expect(mat.load(write_73(tmp_path / "p.mat", form(PARTS))))
    none = {"A": sp.csc_matrix((0, 2)), "L": np.zeros((0, 2)), "R": np.zeros((0, 0)), "lbA": np.zeros((0, 0))}
    expect(mat.load(write_73(tmp_path / "none.mat", {**form(LESS), **none})), {"g": [-2.0, 1.0 / 3.0]})


@pytest.mark.parametrize("order", ["<", ">"])
def test_both_byte_orders_are_read(tmp_path, order):
    file = Mat5(order).sparse("Q", (2, 2), (0, 1), (0, 1, 2), (2.0, 4.0)).dense("g", (2, 1), (-1.0, 0.5))
    expect(mat.load(file.into(tmp_path / "p.mat")), {"Q": [[2.0, 0.0], [0.0, 4.0]], "g": [-1.0, 0.5]})


def test_upper_limits_of_the_sides_are_rows_and_vectors_may_lie_or_stand(tmp_path):
    parts = {**LESS, "g": PARTS["g"].T, "L": PARTS["L"], "R": PARTS["R"], "ubL": [[2.0]], "ubR": [[np.inf]]}
    scipy.io.savemat(tmp_path / "p.mat", parts)
    expect(mat.load(tmp_path / "p.mat"), {"g": [-2.0, 1.0 / 3.0], "C": [[-1.0, 0.0]], "d": [2.0], "l": [0.0]})


def test_empty_variables_are_none_and_others_are_ignored(tmp_path):
    parts = {**LESS, "lb": np.zeros((0, 0)), "A": np.zeros((0, 2)), "x0": np.zeros((0, 1)), "note": "a text",
             "more": {"Q": 1}, "g2": np.array([1j])}
    scipy.io.savemat(tmp_path / "p.mat", parts)
    problem = mat.load(tmp_path / "p.mat").compile()
    assert problem.sizes == (2, 0, 0, 0) and problem.z0 is None


@pytest.mark.parametrize(("change", "said"), [
    ({"Q": None}, "Q: is missing"),
    ({"g": None}, "g: is missing"),
    ({"Q": np.ones((2, 3))}, "Q is 2 x 3: must be square"),
    ({"Q": np.zeros((0, 0))}, "Q is 0 x 0: must be square, with at least one row"),
    ({"Q": np.array([[1.0, 2.0], [0.0, 1.0]])}, "Q[0, 1]"),
    ({"Q": PARTS["Q"] * 1j}, "Q is complex: must be real"),
    ({"Q": sp.csc_matrix(PARTS["Q"] * 1j)}, "Q is complex: must be real"),
    ({"Q": np.array([[np.nan, 0.0], [0.0, 1.0]])}, "Q[0, 0] is nan: must be finite"),
    ({"g": np.ones((3, 1))}, "g is 3 x 1: must have 2 entries"),
    ({"g": np.ones((2, 1), dtype=np.int32)}, "g is of class int32: must be of class double, full or sparse"),
    ({"g": np.ones((2, 1), dtype=bool)}, "g is of class logical: must be of class double"),
    ({"g": "text"}, "g is of class char: must be of class double"),
    ({"g": {"a": 1.0}}, "g is of class struct: must be of class double"),
    ({"g": np.ones((2, 1, 1)) * np.ones((1, 1, 2))}, "g is 2 x 1 x 2: must be a matrix or a vector"),
    ({"A": np.ones((2, 3))}, "A is 2 x 3: must have 2 columns, as many as Q"),
    ({"lbA": np.array([[1.0]])}, "lbA is 1 x 1: must have 2 entries"),
    ({"lbA": np.array([[0.0], [1.0]])}, "lbA[1] is 1: must be at most the upper limit 0.5"),
    ({"lbA": np.array([[np.nan], [0.0]])}, "lbA[0] is nan"),
    ({"ubA": np.array([[-np.inf], [0.5]])}, "ubA[0] is -inf"),
    ({"lb": np.array([[0.0], [6.0]])}, "lb[1] is 6: must be at most the upper limit 5"),
    ({"R": np.ones((2, 2))}, "R is 2 rows: must have 1 rows, as many as L"),
    ({"lbL": np.array([[np.inf]])}, "lbL[0] is -inf: must be finite"),
    ({"ubR": np.array([[1.0, 2.0]])}, "ubR is 1 x 2: must have 1 entries"),
    ({"x0": np.array([[1.0], [np.inf]])}, "x0[1] is inf: must be finite"),
])
def test_a_wrong_variable_is_named(tmp_path, change, said):
    parts = {name: part for name, part in {**PARTS, **change}.items() if part is not None}
    scipy.io.savemat(tmp_path / "p.mat", parts)
    assert said in refusal(tmp_path / "p.mat")


@pytest.mark.parametrize(("ir", "jc", "said"), [
    ((0, 2), (0, 1, 2), "Q.ir[1] is 2: must be in [0, 2)"),
    ((0, -1), (0, 1, 2), "Q.ir[1] is -1: must be in [0, 2)"),
    ((0, 1), (0, 1, 3), "Q"),
    ((0, 1), (0, 1, 0x7fffffff), "Q"),
    ((0, 1), (0, -1, 2), "Q.jc[0]: must ascend from 0 to 2 at most"),
    ((0, 1), (1, 1, 2), "Q"),
    ((0, 1), (0, 2, 1), "Q"),
    ((0, 1), (0, 1), "Q"),
    ((0,), (0, 1, 2), "Q"),
])
def test_indices_outside_a_sparse_matrix_are_refused(tmp_path, ir, jc, said):
    file = Mat5().sparse("Q", (2, 2), ir, jc, (2.0, 4.0)).dense("g", (2, 1), (-1.0, 0.5))
    assert refusal(file.into(tmp_path / "p.mat")).startswith(said)


def test_sizes_are_bounded_by_the_file_s_length(tmp_path):
    g = ("g", (1, 1), (1.0,))
    for file in (Mat5().sparse("Q", (1, 0x7fffffff), (), (0,), ()), Mat5().dense("Q", (-1, 1), (1.0,)),
                 Mat5().sparse("Q", (0x7fffffff, 1), (), (0, 0), ())):
        assert "Q is" in (said := refusal(file.dense(*g).into(tmp_path / "p.mat")))
        assert "must be a matrix or a vector with at most 10" in said
    dense = Mat5().dense("Q", (40_000, 40_000), (1.0,)).dense(*g).into(tmp_path / "p.mat")
    assert "Q is 40000 x 40000: must have at most" in refusal(dense)
    scipy.io.savemat(tmp_path / "packed.mat", {"Q": np.zeros((4000, 4000)), "g": 1.0}, do_compression=True)
    assert "Q is 4000 x 4000: must have at most" in refusal(tmp_path / "packed.mat")


def test_a_variable_twice_is_refused(tmp_path):
    file = Mat5().dense("Q", (1, 1), (1.0,)).dense("g", (1, 1), (1.0,)).dense("g", (1, 1), (2.0,))
    assert refusal(file.into(tmp_path / "p.mat")) == "g: is there twice"


def test_a_sparse_matrix_of_version_4_is_checked(tmp_path):
    def variable(name, *columns):
        rows = len(columns[0])
        return (struct.pack("<5i", 2, rows, len(columns), 0, len(name) + 1) + name.encode() + b"\0"
                + struct.pack(f"<{rows * len(columns)}d", *(number for column in columns for number in column)))

    for columns, said in ((((1, 1), (1, 1), (2, 0), (1, 0)), "Q is complex: must be real"),
                          (((2, 1), (1, 1), (2, 0)), "Q: cannot be read: "),
                          (((0, 1), (1, 1), (2, 0)), "Q: cannot be read: "),
                          (((1, 1e9), (1, 1e9), (2, 0)), "Q is 1000000000 x 1000000000: must be a matrix")):
        (tmp_path / "p.mat").write_bytes(variable("Q", *columns))
        assert refusal(tmp_path / "p.mat").startswith(said)


@needs_h5py
def test_version_7_3_is_checked_too(tmp_path):
    path = tmp_path / "p.mat"
    wrong = sp.csc_matrix(PARTS["Q"])
    for part, values, said in (("indices", [0, 2, 0, 1], "Q.ir[1] is 2: must be in [0, 2)"),
                               ("indptr", [0, 2, 10**6], "Q.jc[1]: must ascend from 0 to 4 at most")):
        bad = wrong.copy()
        setattr(bad, part, np.array(values))
        assert refusal(write_73(path, {**LESS, "Q": bad})) == said
    assert "Q is complex: must be real" in refusal(write_73(path, {**LESS, "Q": PARTS["Q"] * 1j}))
    assert "g is of type int64: must be of class double" in refusal(write_73(path, {**LESS, "g": np.ones((2, 1), int)}))
    assert "g is 3 x 1: must have 2" in refusal(write_73(path, {**LESS, "g": np.ones((3, 1))}))
    with h5py.File(path, "w") as file:
        file["Q"], file["g"] = PARTS["Q"], h5py.ExternalLink("other.mat", "g")
    assert refusal(path) == "g: must be in the file, not a link"
    with h5py.File(path, "w") as file:
        file["Q"] = PARTS["Q"]
        file.create_dataset("g", (2, 1), "f8", external=[("/dev/zero", 0, 16)])
    assert refusal(path) == "g: must be in the file, not in another"
    with h5py.File(path, "w") as file:
        file["g"] = PARTS["g"].T
        file.create_dataset("Q", (10**5, 10**5), "f8", chunks=(100, 100), compression="gzip")
    assert "Q is 10000000000 entries: is too large for the file's length" in refusal(path)


@pytest.mark.parametrize("content", [b"", b"MATLAB nonsense", b"MATLAB 5.0 MAT-file".ljust(128, b"\0"), b"\0" * 99,
                                     b"\1\0\0\0" * 100, b"\xff" * 1000, struct.pack("<5i", 0, -5, 1, 0, 2) + b"Q\0"])
def test_what_is_no_file_of_matlab_is_reported(tmp_path, content):
    (tmp_path / "p.mat").write_bytes(content)
    assert "cannot be read as a MATLAB file" in refusal(tmp_path / "p.mat")


@pytest.mark.parametrize("begin", [b"# Created by Octave 7.3.0, Wed Nov 25 2026\n# name: Q\n", b"Octave-1-L\0\0"])
def test_octave_s_own_files_are_reported_with_what_to_do(tmp_path, begin):
    (tmp_path / "p.mat").write_bytes(begin)
    assert "save -v7 FILE" in refusal(tmp_path / "p.mat")


def damaged(content, random):
    """Beginnings of the file, and copies in which bytes are changed."""
    yield from (content[:at] for at in range(0, len(content), 61))
    for _ in range(60):
        changed = bytearray(content)
        for place in random.integers(0, len(content), 4):
            changed[place] = random.integers(0, 256)
        yield bytes(changed)


def ending_of(content):
    """Of a process that reads it: its exit code, or its signal, as SciPy's compiled code trusts some of a file."""
    pid = os.fork()
    if pid == 0:
        code = 1
        try:
            faulthandler.disable()
            bounded_process.limit(len(content))
            mat._by_scipy(content)
            code = 0
        except marble.InvalidProblem as error:
            code = mat._REFUSED if error.bound else 1
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


@pytest.mark.parametrize("words", [{"format": "5"}, {"format": "4"}, {"format": "5", "do_compression": True}])
def test_a_damaged_file_is_read_or_refused_and_nothing_else(tmp_path, words):
    scipy.io.savemat(tmp_path / "p.mat", sparse(PARTS), **words)
    content = (tmp_path / "p.mat").read_bytes()
    endings = [ending_of(broken) for broken in damaged(content, np.random.default_rng(1))]
    assert endings.count(mat._REFUSED) > 20
    assert all(ending in (0, mat._REFUSED) or ending < 0 for ending in endings), endings
    for at in (len(content) // 3, len(content) - 9):
        (tmp_path / "p.mat").write_bytes(content[:at])
        assert refusal(tmp_path / "p.mat")


@needs_h5py
def test_a_damaged_file_of_version_7_3_is_read_or_refused_and_nothing_else(tmp_path):
    whole = write_73(tmp_path / "whole.mat", sparse(PARTS)).read_bytes()
    for at in range(512, len(whole), len(whole) // 12):
        for broken in (whole[:at], whole[:at] + b"\xff" * 4 + whole[at + 4:]):
            (tmp_path / "p.mat").write_bytes(broken)
            try:
                mat.load(tmp_path / "p.mat")
            except marble.InvalidProblem as error:
                assert error.bound


def test_a_reader_that_ends_or_hangs_is_an_error(tmp_path, monkeypatch):
    scipy.io.savemat(tmp_path / "p.mat", PARTS)
    real = subprocess.run
    for how, said in (("import os; os.kill(os.getpid(), 11)", "the reader failed (-11)"),
                      ("print('nonsense')", "the reader wrote no result"),
                      ("import time; time.sleep(60)", "takes more than")):
        with monkeypatch.context() as patch:
            patch.setattr(bounded_process, "_SECONDS", 0.5)
            patch.setattr(bounded_process.subprocess, "run",
                          lambda command, how=how, **words: real([sys.executable, "-c", how], **words))
            assert said in refusal(tmp_path / "p.mat")
    monkeypatch.setattr(bounded_process, "MOST_BYTES", 100)
    assert "must have at most 100 bytes" in refusal(tmp_path / "p.mat")


def test_without_h5py_the_error_says_what_to_install(tmp_path, monkeypatch):
    (tmp_path / "p.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(512, b" ") + mat._HDF5)
    monkeypatch.setattr(mat.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(marble.Unavailable, match="pip install h5py") as caught:
        mat.load(tmp_path / "p.mat")
    assert not caught.value.lost


def test_the_command_converts_to_json_and_reports_file_and_variable(tmp_path, capsys):
    scipy.io.savemat(tmp_path / "p.mat", PARTS)
    run = subprocess.run([sys.executable, "-m", "marble", "convert", "p.mat", "p.json"], cwd=tmp_path, check=True,
                         capture_output=True, env=clean_environment(MARBLE_SERVER="127.0.0.1:1"))
    assert run.stdout == run.stderr == b""
    expect(marble.Problem.load(tmp_path / "p.json"))
    assert json.loads((tmp_path / "p.json").read_text())["x0"] == [1.0, 1.0]
    assert program.main(["--server", "local", "solve", str(tmp_path / "p.mat")]) == 0
    assert "solved" in capsys.readouterr().out
    scipy.io.savemat(tmp_path / "bad.mat", {**PARTS, "g": [[1.0]]})
    out = str(tmp_path / "p.json")
    for files, said in (((str(tmp_path / "bad.mat"), out), "bad.mat: g is 1 x 1: must have 2 entries"),
                        ((str(tmp_path / "none.mat"), out), "none.mat: [Errno 2]"),
                        ((str(tmp_path / "p.mat"), str(tmp_path / "p.npz")), "p.npz: must end in .json"),
                        ((str(tmp_path / "p.mat"), str(tmp_path / "no" / "p.json")), "p.json: [Errno 2]")):
        assert program.main(["convert", *files]) == 2
        assert said in capsys.readouterr().err
