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


def main():
    folder = Path(tempfile.mkdtemp())
    parts = {"Q": np.array([[2.0, 0.5], [0.5, 2.0]]), "g": np.array([[-2.0], [1.0 / 3.0]]), "L": np.array([[1.0, 0.0]]),
             "R": np.array([[0.0, 1.0]])}
    own = {"Q": parts["Q"], "g": parts["g"].ravel(), "c0": np.array(1.5), "L": parts["L"], "R": parts["R"],
           "l": np.array([-0.25]), "x0": np.array([1, 2])}
    wanted = {"Q": parts["Q"], "g": [-2.0, 1.0 / 3.0], "L": parts["L"], "l": [-0.25], "R": parts["R"], "r": [0.0],
              "x0": [1.0, 2.0]}
    np.savez(folder / "dense.npz", **own)
    np.savez_compressed(folder / "packed.npz", **{**own, "Q": np.asfortranarray(parts["Q"])})
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
        scipy.io.mmwrite(market / f"{name}.mtx", sp.coo_matrix(parts[name]))
    scipy.io.mmwrite(market / "g.mtx", parts["g"])
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
