#!/usr/bin/env python3
"""Solves a QP by PIQP, Clarabel and OSQP, those of them that are installed, and prints a line for each: name, seconds of
set-up and solve (the least of TURNS), objective, largest violation.

Usage: qp_peers.py PROBLEM.json TURNS        as `suite qp --peers` calls it; PROBLEM.json as client/FORMATS.md says, no pairs
"""

import json
import sys
import time

import numpy as np
import scipy.sparse as sp


def load(path):
    with open(path, encoding="utf-8") as file:
        problem = json.load(file)

    def matrix(name):
        part = problem.get(name)
        if part is None:
            return sp.csc_matrix((0, problem["n"]))
        return sp.csc_matrix((part["v"], (part["i"], part["j"])), (part["rows"], part["cols"]))

    vectors = {name: np.array(problem.get(name, []), dtype=float) for name in ("g", "b", "d")}
    return {"Q": matrix("Q"), "A": matrix("A"), "C": matrix("C"), **vectors}


def piqp(p):
    import piqp as package

    solver = package.SparseSolver()
    solver.settings.eps_abs = solver.settings.eps_rel = 1e-9
    begin = time.perf_counter()
    solver.setup(p["Q"], p["g"], p["A"], -p["b"], p["C"], -p["d"], np.full(len(p["d"]), 1e30))
    solver.solve()
    return time.perf_counter() - begin, np.array(solver.result.x)


def clarabel(p):
    import clarabel as package

    rows = sp.vstack([p["A"], -p["C"]], format="csc")
    offset = np.concatenate([-p["b"], p["d"]])
    cones = [package.ZeroConeT(len(p["b"]))] if len(p["b"]) else []
    cones.append(package.NonnegativeConeT(len(p["d"])))
    settings = package.DefaultSettings()
    settings.verbose = False
    upper = sp.triu(p["Q"], format="csc")
    begin = time.perf_counter()
    answer = package.DefaultSolver(upper, p["g"], rows, offset, cones, settings).solve()
    return time.perf_counter() - begin, np.array(answer.x)


def osqp(p):
    import osqp as package

    rows = sp.vstack([p["A"], p["C"]], format="csc")
    least = np.concatenate([-p["b"], -p["d"]])
    most = np.concatenate([-p["b"], np.full(len(p["d"]), np.inf)])
    solver = package.OSQP()
    begin = time.perf_counter()
    solver.setup(sp.triu(p["Q"], format="csc"), p["g"], rows, least, most, verbose=False, eps_abs=1e-6, eps_rel=1e-6,
                 polishing=True, max_iter=20000, time_limit=30.0)
    x = solver.solve(raise_error=False).x
    return time.perf_counter() - begin, np.array(x)


def main():
    problem = load(sys.argv[1])
    for solve in (piqp, clarabel, osqp):
        try:
            turns = [solve(problem) for _ in range(int(sys.argv[2]))]
        except ImportError:
            continue
        z = turns[0][1]
        violation = max(np.abs(problem["A"] @ z + problem["b"]).max(initial=0.0),
                        -(problem["C"] @ z + problem["d"]).min(initial=0.0))
        objective = 0.5 * z @ (problem["Q"] @ z) + problem["g"] @ z
        print(solve.__name__, min(seconds for seconds, _ in turns), objective, violation)


if __name__ == "__main__":
    main()
