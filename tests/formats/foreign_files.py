#!/usr/bin/env python3
"""Files that SciPy and NumPy write are read by `marble convert` as the problem they hold, and the other way round.

usage: foreign_files.py MARBLE
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import scipy.io
import scipy.sparse as sp

MARBLE = sys.argv[1]


def dense(block, columns):
    matrix = np.zeros((block["rows"], columns))
    np.add.at(matrix, (block["i"], block["j"]), block["v"])
    return matrix


def convert(source, target):
    subprocess.run([MARBLE, "convert", str(source), str(target)], check=True)


def refused(source, text):
    target = source.with_suffix(".refused.json")
    run = subprocess.run([MARBLE, "convert", str(source), str(target)], capture_output=True, text=True)
    assert run.returncode == 2 and text in run.stderr, (text, run.stderr)


def expect(path, parts):
    """The JSON at `path` holds these parts, dense."""
    problem = json.loads(path.read_text())
    columns = len(problem["g"])
    for name, wanted in parts.items():
        got = dense(problem[name], columns) if name in "QACLR" else np.array(problem[name])
        np.testing.assert_array_equal(got, wanted, err_msg=f"{path.name}: {name}")


def lcqpow_parts():
    """LCQPow's naming: 0 <= L x - lbL complements R x - lbR >= 0, lbA <= A x <= ubA, lb <= x <= ub."""
    return {
        "Q": np.array([[2.0, 0.5], [0.5, 2.0]]),
        "g": np.array([[-2.0], [1.0 / 3.0]]),
        "L": np.array([[1.0, 0.0]]),
        "R": np.array([[0.0, 1.0]]),
        "lbL": np.array([[0.25]]),
        "A": np.array([[1.0, 1.0], [1.0, -1.0]]),
        "lbA": np.array([[-1.0], [0.5]]),
        "ubA": np.array([[np.inf], [0.5]]),
        "lb": np.array([[-4.0], [-np.inf]]),
        "ub": np.array([[np.inf], [5.0]]),
        "x0": np.array([[1.0], [1.0]]),
    }


def main():
    folder = Path(tempfile.mkdtemp())
    mat = lcqpow_parts()
    wanted = {
        "Q": mat["Q"],
        "g": [-2.0, 1.0 / 3.0],
        "A": [[1.0, -1.0]],
        "b": [-0.5],
        "C": [[1.0, 1.0], [1.0, 0.0], [0.0, -1.0]],
        "d": [1.0, 4.0, 5.0],
        "L": [[1.0, 0.0]],
        "l": [-0.25],
        "R": [[0.0, 1.0]],
        "r": [0.0],
        "x0": [1.0, 1.0],
    }
    for name, keywords in (("v5.mat", {"format": "5"}), ("v4.mat", {"format": "4"}),
                           ("packed.mat", {"format": "5", "do_compression": True})):
        scipy.io.savemat(folder / name, mat, **keywords)
        convert(folder / name, folder / (name + ".json"))
        expect(folder / (name + ".json"), wanted)
    sparse = {name: sp.csc_matrix(part) if name in "QLRA" else part for name, part in mat.items()}
    scipy.io.savemat(folder / "sparse.mat", sparse)
    convert(folder / "sparse.mat", folder / "sparse.json")
    expect(folder / "sparse.json", wanted)
    scipy.io.savemat(folder / "short.mat", {**mat, "lbA": np.array([[1.0]])})
    refused(folder / "short.mat", "lbA")
    scipy.io.savemat(folder / "complex.mat", {**mat, "Q": mat["Q"] * 1j})
    refused(folder / "complex.mat", "Q = complex: must be real")

    own = {"Q": mat["Q"], "g": mat["g"].ravel(), "c0": np.array(1.5), "L": mat["L"], "R": mat["R"],
           "l": np.array([-0.25]), "x0": np.array([1, 2])}
    wanted = {"Q": mat["Q"], "g": [-2.0, 1.0 / 3.0], "L": mat["L"], "l": [-0.25], "R": mat["R"], "r": [0.0],
              "x0": [1.0, 2.0]}
    np.savez(folder / "dense.npz", **own)
    np.savez_compressed(folder / "packed.npz", **{**own, "Q": np.asfortranarray(mat["Q"])})
    csr = sp.csr_matrix(np.array([[2.0, 0.5], [0.5, 2.0]]))
    np.savez(folder / "csr.npz", **{k: v for k, v in own.items() if k != "Q"}, Q_data=csr.data, Q_indices=csr.indices,
             Q_indptr=csr.indptr, Q_shape=csr.shape, Q_format="csr")
    for name in ("dense", "packed", "csr"):
        convert(folder / f"{name}.npz", folder / f"{name}.json")
        expect(folder / f"{name}.json", wanted)
        assert json.loads((folder / f"{name}.json").read_text())["c0"] == 1.5
    np.savez(folder / "bad.npz", **{**own, "g": np.array([1.0, 2.0, 3.0])})
    refused(folder / "bad.npz", "g = 3 x 1: must have 2 entries")

    market = folder / "market"
    market.mkdir()
    for name in ("Q", "L", "R"):
        scipy.io.mmwrite(market / f"{name}.mtx", sp.coo_matrix(mat[name]))
    scipy.io.mmwrite(market / "g.mtx", mat["g"])
    scipy.io.mmwrite(market / "l.mtx", np.array([[-0.25]]))
    convert(market, folder / "market.json")
    expect(folder / "market.json", {name: wanted[name] for name in ("Q", "g", "L", "l", "R", "r")})

    hopper = folder / "hopper.json"
    hopper.write_text(subprocess.run([MARBLE, "example", "hopper"], check=True, capture_output=True, text=True).stdout)
    problem = json.loads(hopper.read_text())
    columns = len(problem["g"])
    convert(hopper, folder / "hopper.npz")
    convert(hopper, f"{folder}/hopper/")
    arrays = np.load(folder / "hopper.npz")
    for name in "QACLR":
        matrix = dense(problem[name], columns)
        packed = sp.csc_matrix((arrays[f"{name}.data"], arrays[f"{name}.indices"], arrays[f"{name}.indptr"]),
                               arrays[f"{name}.shape"])
        np.testing.assert_array_equal(packed.toarray(), matrix)
        np.testing.assert_array_equal(scipy.io.mmread(folder / "hopper" / f"{name}.mtx").toarray(), matrix)
    np.testing.assert_array_equal(arrays["g"], problem["g"])
    np.testing.assert_array_equal(scipy.io.mmread(folder / "hopper" / "g.mtx").ravel(), problem["g"])
    print("every file was read and refused as it should be")


main()
