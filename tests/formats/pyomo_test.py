#!/usr/bin/env python3
"""Complementarity conditions as Pyomo writes them are solved as Pyomo's words mean them.

Every model is min (y - y_wanted)^2 + (w - w_wanted)^2 with one condition on w and y, and bounds on both. What is best
is found from the condition's own pieces, each a box, with no .nl file in between.

usage: pyomo_test.py MARBLE
"""

import itertools
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import pyomo.environ as pyo
from pyomo.mpec import Complementarity, complements

MARBLE = sys.argv[1]
INF = float("inf")
FREE = (-INF, INF)
WANTED = list(itertools.product((60.0, 20.0, -60.0), (-5.0, 5.0)))


def best(pieces, y_bounds, wanted):
    """The least cost over boxes ((y_low, y_high), (w_low, w_high)) within the bounds on y."""
    costs = []
    for y_box, w_box in pieces:
        low, high = max(y_box[0], y_bounds[0]), min(y_box[1], y_bounds[1])
        if low > high:
            continue
        y = min(max(wanted[0], low), high)
        w = min(max(wanted[1], w_box[0]), w_box[1])
        costs.append((y - wanted[0]) ** 2 + (w - wanted[1]) ** 2)
    return min(costs)


# What is written, and the pieces of its meaning.
CONDITIONS = {
    "w >= 0, y >= 0": (lambda m: complements(m.w >= 0, m.y >= 0), [((0, 0), (0, INF)), ((0, INF), (0, 0))]),
    "y >= 0, w >= 0": (lambda m: complements(m.y >= 0, m.w >= 0), [((0, 0), (0, INF)), ((0, INF), (0, 0))]),
    "w >= 0, y <= 50": (lambda m: complements(m.w >= 0, m.y <= 50), [((50, 50), (0, INF)), ((-INF, 50), (0, 0))]),
    "w <= 0, y <= 50": (lambda m: complements(m.w <= 0, m.y <= 50), [((50, 50), (-INF, 0)), ((-INF, 50), (0, 0))]),
    "w <= 0, y >= 0": (lambda m: complements(m.w <= 0, m.y >= 0), [((0, 0), (-INF, 0)), ((0, INF), (0, 0))]),
    "w + 1 >= 0, 50 - y >= 0": (lambda m: complements(m.w + 1 >= 0, 50 - m.y >= 0),
                                [((50, 50), (-1, INF)), ((-INF, 50), (-1, -1))]),
    "w == 3, y": (lambda m: complements(m.w == 3, m.y), [(FREE, (3, 3))]),
}
# Pyomo keeps the looser of two upper bounds, so that no case has y below 50.
BOUNDS = {"free": FREE, "lower": (0.0, INF), "upper": (-INF, 50.0), "both": (-3.0, 50.0)}


def model(bounds, wanted):
    m = pyo.ConcreteModel()
    m.w = pyo.Var()
    m.y = pyo.Var(bounds=tuple(None if abs(b) == INF else b for b in bounds))
    m.cost = pyo.Objective(expr=(m.y - wanted[0]) ** 2 + (m.w - wanted[1]) ** 2)
    return m


def solve(paths):
    run = subprocess.run([MARBLE, "solve", "--local", "--quiet", "--output", "json", "--option", "num_starts=8",
                          *map(str, paths)], capture_output=True, text=True)
    return [json.loads(line) for line in run.stdout.splitlines()]


def sides(path):
    """The k of every row "5 k i"."""
    lines = [line.split("#")[0].split() for line in path.read_text().splitlines()]
    rows = lines[lines.index(["r"]) + 1:lines.index(["b"])]
    return [int(row[1]) for row in rows if row[0] == "5"]


def main():
    folder = Path(tempfile.mkdtemp())
    cases, seen = [], set()  # what, file, best

    def write(m, what, expected):
        path = folder / f"{len(cases)}.nl"
        m.write(str(path), format="nl")
        cases.append((what, path, expected))
        return path

    for (words, (condition, pieces)), (kind, bounds), wanted in itertools.product(
            CONDITIONS.items(), BOUNDS.items(), WANTED):
        m = model(bounds, wanted)
        m.condition = Complementarity(expr=condition(m))
        pyo.TransformationFactory("mpec.nl").apply_to(m)
        seen.update(sides(write(m, f"{words}; y {kind}; wanted {wanted}", best(pieces, bounds, wanted))))
    assert seen == {1, 2}, seen

    # This Pyomo's transformation fails where k would be 3 or 0; its writer takes the row as it would make it.
    mixed = [((0, 0), (0, INF)), ((0, 50), (0, 0)), ((50, 50), (-INF, 0))]
    for k, bounds, pieces in ((3, (0.0, 50.0), mixed), (0, FREE, [(FREE, (0, 0))])):
        for wanted in WANTED:
            m = model(bounds, wanted)
            m.body = pyo.Var()
            m.is_w = pyo.Constraint(expr=m.body == m.w)
            m.row = pyo.Constraint(expr=0 <= m.body)
            m.row._complementarity, m.row._vid = k, id(m.y)
            assert sides(write(m, f"k = {k}; wanted {wanted}", best(pieces, bounds, wanted))) == [k]
    answers = solve([path for _, path, _ in cases])
    assert len(answers) == len(cases)
    for (what, path, expected), answer in zip(cases, answers):
        got = answer.get("objective")
        assert answer["status"] == "solved" and abs(got - expected) <= 1e-6 * (1 + abs(expected)), \
            f"{what}: expected {expected}, got {answer['status']} {got}\n{path.read_text()}"

    # 0 <= w <= 5 complements y loses its 5 on Pyomo's way: refused where that can be detected.
    m = model((0.0, 50.0), (60.0, -5.0))
    m.condition = Complementarity(expr=complements(pyo.inequality(0, m.w, 5), m.y))
    pyo.TransformationFactory("mpec.nl").apply_to(m)
    path = folder / "lost.nl"
    m.write(str(path), format="nl")
    answer = solve([path])[0]
    assert answer["status"] == "error" and "5 0 " in json.dumps(answer), answer

    # Eight pairs, each variable with two bounds, stay eight.
    m = pyo.ConcreteModel()
    m.y = pyo.Var(range(8), bounds=(0, 50))
    m.w = pyo.Var(range(8))
    m.cost = pyo.Objective(expr=sum((m.y[i] - 60) ** 2 + (m.w[i] + i - 4) ** 2 + m.y[i] * m.w[(i + 1) % 8]
                                    for i in range(8)))
    m.pairs = Complementarity(range(8), rule=lambda m, i: complements(m.w[i] >= 0, m.y[i] >= 0))
    pyo.TransformationFactory("mpec.nl").apply_to(m)
    path = folder / "qpec.nl"
    m.write(str(path), format="nl")
    subprocess.run([MARBLE, "convert", str(path), str(folder / "qpec.json")], check=True)
    assert len(json.loads((folder / "qpec.json").read_text())["l"]) == 8
    print(f"{len(cases)} models of Pyomo solved as they are meant")


main()
