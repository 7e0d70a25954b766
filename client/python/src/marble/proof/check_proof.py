#!/usr/bin/env python3
"""Checks a proof that `marble solve --proof` has written, in exact rational numbers.

    python3 check_proof.py PROBLEM.json PROOF.jsonl

It shares nothing with the solver and needs only Python's own library. What it says follows from the problem file and
the proof file alone: core/ALGORITHM.md, "Proofs in files", has the formulas.
"""

from __future__ import annotations

import argparse
import copy
import json
import math
import sys
from collections import Counter
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any, TextIO

HOLDS, FAILS, BAD_FILE, ASSUMES = 0, 1, 2, 4
VERDICTS = {HOLDS: "holds", FAILS: "does not follow", BAD_FILE: "bad file", ASSUMES: "holds for |z| <= radius"}
MOST_BYTES = 1 << 30  # of a problem file, and of a line of a proof
MOST_LEAVES, MOST_ENTRIES = 10_000_000, 1 << 27  # the second of one vector
BOX_BITS = 64  # bounds of variables are multiples of 2^-64, rounded outwards
BOX_PASSES, REPAIR_ROUNDS = 30, 12
SAME = Fraction(1, 10**9)  # a bound is claimed to this part of max(1, |bound|): what rounding leaves of it

Vector = dict[int, Any]  # entries that are not zero; integers, or fractions after a repair
Row = list[tuple[int, int]]


class BadFile(Exception):
    """A file that is not what it should be: which, where, and what must hold."""


class NoProof(Exception):
    """The claim does not follow: why."""


def must(condition: bool, what: str, error: type[Exception] = BadFile) -> None:
    """What is wrong where the condition does not hold."""
    if not condition:
        raise error(what)


def number(value: Any, name: str) -> float:
    """A finite number of a file."""
    if type(value) not in (int, float) or not abs(value) <= sys.float_info.max:
        raise BadFile(f"{name}: must be a finite number")
    return float(value)


def index(value: Any, bound: int, name: str) -> int:
    """A whole number in [0, bound)."""
    if type(value) is not int or not 0 <= value < bound:
        raise BadFile(f"{name} = {str(value)[:40]}: must be a whole number in [0, {bound})")
    return int(value)


def array(value: Any, name: str) -> list[Any]:
    """A list of a file."""
    must(isinstance(value, list), f"{name}: must be a list")
    return value  # type: ignore[no-any-return]


def parse(text: str, name: str) -> dict[str, Any]:
    """A JSON object, each of its keys once."""
    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        must(len(dict(pairs)) == len(pairs), f"{name}: a key is there twice")
        return dict(pairs)

    try:
        value = json.loads(text, object_pairs_hook=once)
    except (ValueError, RecursionError) as error:
        raise BadFile(f"{name}: no JSON: {str(error)[:120]}") from None
    must(isinstance(value, dict), f"{name}: must be an object")
    return dict(value)


def parse_problem(path: Path) -> dict[str, Any]:
    """The object of a problem file; of a file in another format the error says how to convert it."""
    must(path.stat().st_size <= MOST_BYTES, f"{path}: must have at most {MOST_BYTES} bytes")
    try:
        return parse(path.read_text("utf-8"), str(path))
    except (BadFile, UnicodeDecodeError) as error:
        if path.suffix == ".json":
            raise
        raise BadFile(f"{path}: must be a problem in JSON; this command writes it with the same numbers, for which the "
                      f"proof holds too: marble convert {path} {path.with_suffix('.json')} ({error})") from None


def shift_of(values: list[float]) -> int:
    """The least k with which 2^k times each of these doubles is whole."""
    return max((value.as_integer_ratio()[1].bit_length() - 1 for value in values if value), default=0)


def whole(value: float, shift: int) -> int:
    """2^shift times a double, which is whole."""
    top, bottom = value.as_integer_ratio()
    return (top << shift) // bottom


class Problem:
    """The LCQP; all numbers as integers, 2^shift times what they are."""

    def __init__(self, path: Path) -> None:
        data = parse_problem(path)
        self.n = index(data.get("n"), MOST_ENTRIES, "n")
        triplets, vectors, sizes = (dict[str, Any]() for _ in range(3))
        for block, offset in (("Q", "g"), ("A", "b"), ("C", "d"), ("L", "l"), ("R", "r")):
            matrix = data.get(block) or {"rows": 0, "i": [], "j": [], "v": []}
            must(isinstance(matrix, dict), f"{block}: must be an object")
            sizes[block] = rows = index(matrix.get("rows"), MOST_ENTRIES, f"{block}.rows")
            must(not rows or matrix.get("cols") == self.n, f"{block}.cols: must be n = {self.n}")
            i, j, v = (array(matrix.get(key), f"{block}.{key}") for key in "ijv")
            must(len(i) == len(j) == len(v), f"{block}: i, j and v must be as long as each other")
            triplets[block] = [(index(a, rows, f"{block}.i"), index(c, self.n, f"{block}.j"), number(x, f"{block}.v"))
                               for a, c, x in zip(i, j, v, strict=True)]
            vectors[offset] = [number(x, offset) for x in array(data.get(offset) or [], offset)]
            size = self.n if block == "Q" else rows
            must(len(vectors[offset]) == size, f"{offset}: must have {size} entries")
        must(sizes["Q"] in (0, self.n) and sizes["L"] == sizes["R"], "Q must be n x n, and L have as many rows as R")
        self.c0 = Fraction(number(data.get("c0") or 0, "c0"))
        self.shift = shift_of([x for part in triplets.values() for _, _, x in part] +
                              [x for part in vectors.values() for x in part])
        self.equalities, self.inequalities, self.pairs = sizes["A"], sizes["C"], sizes["L"]
        self.g, self.b, d, l, r = ([whole(x, self.shift) for x in part] for part in vectors.values())
        self.o = d + l + r
        self.A = self._rows(triplets["A"], sizes["A"])
        self.J = [row for block in "CLR" for row in self._rows(triplets[block], sizes[block])]
        self.Q: dict[tuple[int, int], int] = {}  # the upper triangle: that is what the solver computes with
        for row, column, value in triplets["Q"]:
            if row <= column:
                self.Q[row, column] = self.Q.get((row, column), 0) + whole(value, self.shift)

    def _rows(self, entries: list[tuple[int, int, float]], count: int) -> list[Row]:
        rows: list[dict[int, int]] = [{} for _ in range(count)]
        for i, j, value in entries:
            rows[i][j] = rows[i].get(j, 0) + whole(value, self.shift)
        return [[(j, value) for j, value in sorted(row.items()) if value] for row in rows]

    def sides(self, pair: int) -> tuple[int, int]:
        """The rows of J that are a pair's s and t."""
        return self.inequalities + pair, self.inequalities + self.pairs + pair

    def curvature_shift(self) -> Fraction | None:
        """The least of 0 and some tiny e with which Q + e I is positive semidefinite; None if Q is not convex."""
        largest = max((abs(v) for v in self.Q.values()), default=0)
        shifts = [Fraction(0)] + [Fraction(largest, 1 << k) for k in (50, 46, 42, 38)]
        return next((shift / (1 << self.shift) for shift in shifts if self._semidefinite(shift)), None)

    def _semidefinite(self, shift: Fraction) -> bool:
        columns: dict[int, dict[int, Fraction]] = {}
        for (i, j), value in self.Q.items():
            columns.setdefault(i, {})[j] = columns.setdefault(j, {})[i] = Fraction(value)
        for i in columns:
            columns[i][i] = columns[i].get(i, Fraction(0)) + shift
        while columns:  # L D L^T by minimum degree
            pivot = min(columns, key=lambda i: len(columns[i]))
            column = columns.pop(pivot)
            diagonal = column.pop(pivot)
            rest = {i: value for i, value in column.items() if value}
            if diagonal < 0 or (diagonal == 0 and rest):
                return False
            for i in column:
                del columns[i][pivot]
            for i, left in rest.items():
                factor = left / diagonal
                for j, right in rest.items():
                    columns[i][j] = columns[i].get(j, Fraction(0)) - factor * right
        return True


class Box:
    """Bounds of the variables that rows imply, 2^BOX_BITS times what they are, rounded outwards; None: infinite."""

    def __init__(self, problem: Problem, fixed: set[int], start: Box | None, radius: float | None = None) -> None:
        self.lower: list[int | None] = list(start.lower) if start else [None] * problem.n
        self.upper: list[int | None] = list(start.upper) if start else [None] * problem.n
        if radius is not None:
            far = -(-whole(radius, BOX_BITS + 1080) >> 1080)
            self.lower = [-far if x is None else max(x, -far) for x in self.lower]
            self.upper = [far if x is None else min(x, far) for x in self.upper]
        rows = [(row, o, True) for row, o in zip(problem.A, problem.b, strict=True)]
        rows += [(row, o, i in fixed) for i, (row, o) in enumerate(zip(problem.J, problem.o, strict=True))]
        self.empty = False  # no point is feasible
        for _ in range(BOX_PASSES):
            if not sum(self._tighten(*row) for row in rows) or self.empty:
                break

    def _tighten(self, row: Row, offset: int, equality: bool) -> bool:
        # a row's sum of a z + o >= 0 bounds each term from below by what the others are at most; = 0 from above too.
        changed = False
        for sign in (1, -1) if equality else (1,):
            at = [(sign * a, self.upper[j] if sign * a > 0 else self.lower[j]) for j, a in row]
            infinite = sum(x is None for _, x in at)
            if infinite > 1:
                continue
            total = sum(a * x for a, x in at if x is not None) + (sign * offset << BOX_BITS)
            for (j, _), (a, x) in zip(row, at, strict=True):
                if infinite and x is not None:
                    continue
                others = total - a * (x or 0)  # a z_j + others >= 0
                low, high = self.lower[j], self.upper[j]
                if a > 0 and (low is None or -others // a - low > abs(low) >> 6):
                    self.lower[j] = low = -others // a
                    changed = True
                elif a < 0 and (high is None or high + -others // -a > abs(high) >> 6):
                    self.upper[j] = high = -(-others // -a)
                    changed = True
                self.empty = self.empty or (low is not None and high is not None and low > high)
        return changed


class Leaf:
    """A case of the proof: sides of pairs that are zero, and multipliers that prove something of it."""

    def __init__(self, problem: Problem, data: dict[str, Any], name: str) -> None:
        self.assigned: dict[int, int] = {}
        for side, key in enumerate("st"):
            for pair in array(data.get(key), f"{name}.{key}"):
                first = self.assigned.setdefault(index(pair, problem.pairs, f"{name}.{key}"), side)
                must(first == side, f"{name}: pair {pair} has both sides fixed")
        self.fixed = {problem.sides(pair)[side] for pair, side in self.assigned.items()}
        must(data.get("proves") in ("bound", "contradiction"), f"{name}.proves: must be bound or contradiction")
        self.contradiction = data["proves"] == "contradiction"
        parts = {key: self._sparse(data.get(key, {}), size, f"{name}.{key}")
                 for key, size in (("z", problem.n), ("y", problem.equalities), ("nu", problem.inequalities),
                                   ("xi", problem.pairs), ("eta", problem.pairs))}
        self.shift = shift_of([x for part in parts.values() for x in part.values()])
        z, y, nu, xi, eta = ({i: whole(x, self.shift) for i, x in part.items()} for part in parts.values())
        s, t = ({problem.sides(i)[side]: x for i, x in part.items()} for side, part in enumerate((xi, eta)))
        self.z, self.y, self.mu = {} if self.contradiction else z, y, nu | s | t
        for row, value in self.mu.items():
            must(value >= 0 or row in self.fixed, f"{name}: the multiplier of row {row} of [C; L; R] is negative",
                 NoProof)

    @staticmethod
    def _sparse(data: Any, size: int, name: str) -> dict[int, float]:
        must(isinstance(data, dict), f"{name}: must be an object")
        i = [index(x, size, f"{name}.i") for x in array(data.get("i", []), f"{name}.i")]
        v = [number(x, f"{name}.v") for x in array(data.get("v", []), f"{name}.v")]
        must(len(v) == len(i) == len(set(i)), f"{name}: i and v must be as long as each other, and no index twice")
        return {a: x for a, x in zip(i, v, strict=True) if x}


class Checker:
    """What leaves prove of a problem."""

    def __init__(self, problem: Problem, radius: float | None) -> None:
        self.problem, self.radius = problem, radius
        self.box = Box(problem, set(), None)
        self.curvature = problem.curvature_shift()
        self.curved = {i for pair in problem.Q for i in pair}
        self.assumed = 0
        self.entries: list[list[tuple[str, int, int]]] = [[] for _ in range(problem.n)]  # of [Q, A^T, -J^T], by row
        for (i, j), a in problem.Q.items():
            self.entries[i].append(("z", j, a))
            if i != j:
                self.entries[j].append(("z", i, a))
        for kind, rows, sign in (("y", problem.A, 1), ("m", problem.J, -1)):
            for i, row in enumerate(rows):
                for j, a in row:
                    self.entries[j].append((kind, i, sign * a))

    def bound(self, leaf: Leaf, enough: Fraction) -> Fraction | float | None:
        """What the leaf proves of the objective (user units), or of 0 <= 0, its contradiction; None: nothing."""
        best: Fraction | None = None

        def better(found: Fraction | None) -> bool:
            nonlocal best
            best = found if best is None or (found is not None and found > best) else best
            return best is not None and (best > 0 if leaf.contradiction else best >= enough)

        if better(self._evaluate(leaf, self.box)):
            return best
        box = Box(self.problem, leaf.fixed, self.box)
        if box.empty:
            return math.inf
        if better(self._evaluate(leaf, box)) or better(self._repair(leaf, box)):
            return best
        ray = copy.copy(leaf)  # multipliers that grow without end contradict the rows by themselves
        ray.contradiction, ray.z = True, {}
        if not leaf.contradiction and (self._repair(ray, box) or 0) > 0:
            return math.inf
        before = best
        if self.radius is not None:
            better(self._evaluate(leaf, Box(self.problem, leaf.fixed, box, self.radius)))
        self.assumed += best != before
        return best

    def _residual(self, leaf: Leaf, z: Vector, y: Vector, mu: Vector, one: int) -> tuple[list[Any], Fraction]:
        # r = Q z + g + A^T y - J^T mu and -1/2 z'Qz + b'y - o'mu; without Q and g of a contradiction.
        p = self.problem
        r: list[Any] = [0] * p.n if leaf.contradiction else [g * one for g in p.g]
        value: Any = 0
        for multipliers, rows, offsets, sign in ((y, p.A, p.b, 1), (mu, p.J, p.o, -1)):
            for i, multiplier in multipliers.items():
                value += sign * offsets[i] * multiplier
                for j, a in rows[i]:
                    r[j] += sign * a * multiplier
        total = Fraction(value, one << p.shift) if isinstance(value, int) else value / (one << p.shift)
        if not leaf.contradiction:
            quadratic: Any = 0
            for (i, j), a in p.Q.items():
                zi, zj = z.get(i, 0), z.get(j, 0)
                r[i] += a * zj
                quadratic += a * zi * zj if i == j else 2 * a * zi * zj
                r[j] += a * zi if i != j else 0
            total += p.c0 - Fraction(quadratic) / (2 * one * one << p.shift)
        return r, total

    def _settle(self, leaf: Leaf, box: Box, r: list[Any], value: Fraction, z: Vector, one: int) -> Fraction | None:
        # What is left of r, and of the curvature, is paid for at the worst point of the box.
        paid: Any = 0
        for j, rest in enumerate(r):
            if rest:
                at = box.lower[j] if rest > 0 else box.upper[j]
                if at is None:
                    return None
                paid += rest * at
        value += Fraction(paid) / (one << self.problem.shift + BOX_BITS)
        if leaf.contradiction or self.curvature is None or not self.curvature:
            return value if leaf.contradiction or self.curvature == 0 else None
        for j in self.curved:
            ends = [Fraction(x, 1 << BOX_BITS) for x in (box.lower[j], box.upper[j]) if x is not None]
            if len(ends) < 2:
                return None
            value -= self.curvature * max((x - Fraction(z.get(j, 0)) / one) ** 2 for x in ends) / 2
        return value

    def _evaluate(self, leaf: Leaf, box: Box) -> Fraction | None:
        one = 1 << leaf.shift
        r, value = self._residual(leaf, leaf.z, leaf.y, leaf.mu, one)
        return self._settle(leaf, box, r, value, leaf.z, one)

    def _repair(self, leaf: Leaf, box: Box) -> Fraction | None:
        """Multipliers near the leaf's own with which nothing is left of r where no bound pays for it."""
        one = 1 << leaf.shift
        vectors = {kind: {i: Fraction(x, one) for i, x in part.items()}
                   for kind, part in (("z", leaf.z), ("y", leaf.y), ("m", leaf.mu))}
        wanted: set[int] = set()
        for _ in range(REPAIR_ROUNDS):
            r, value = self._residual(leaf, vectors["z"], vectors["y"], vectors["m"], 1)
            bad = {j for j, rest in enumerate(r) if rest and (box.lower if rest > 0 else box.upper)[j] is None}
            if not bad:
                return self._settle(leaf, box, r, value, vectors["z"], 1)
            wanted |= bad
            moves = self._solve(leaf, {j: -Fraction(r[j]) for j in wanted}, vectors["m"])
            if moves is None:
                return None
            for (kind, i), move in moves.items():
                vectors[kind][i] = vectors[kind].get(i, Fraction(0)) + move
            for i in [i for i, x in vectors["m"].items() if x < 0 and i not in leaf.fixed]:
                del vectors["m"][i]  # without this row another time
        return None

    def _solve(self, leaf: Leaf, right: dict[int, Fraction], mu: Vector) -> dict[tuple[str, int], Fraction] | None:
        # Elimination: of multipliers that may have any sign, or are large enough to move, first.
        large = 1000 * max(abs(x) for x in right.values()) / (1 << self.problem.shift)
        rows: dict[int, dict[tuple[str, int], Fraction]] = {}
        where: dict[tuple[str, int], set[int]] = {}
        rank: dict[tuple[str, int], tuple[int, float]] = {}
        for j in right:
            rows[j] = {}
            for kind, i, a in self.entries[j]:
                free = kind == "y" or (kind == "z" and not leaf.contradiction) or (kind == "m" and i in leaf.fixed)
                if a and (free or (kind == "m" and mu.get(i, 0) > 0)):
                    rows[j][kind, i] = Fraction(a)
                    where.setdefault((kind, i), set()).add(j)
                    rank[kind, i] = (0, 0.0) if free or mu[i] > large else (1, -float(mu[i]))
        done: list[tuple[int, tuple[str, int]]] = []
        left = set(rows)
        while left:
            j = min(left, key=lambda k: (len(rows[k]), k))
            left.discard(j)
            row = rows[j]
            if not row and right[j]:
                return None
            if not row:
                continue
            pivot = min(row, key=lambda c: (rank[c][0], len(where[c]), rank[c][1], c))
            done.append((j, pivot))
            for k in where[pivot] & left:
                factor = rows[k].pop(pivot) / row[pivot]
                right[k] -= factor * right[j]
                for column, entry in ((c, x) for c, x in row.items() if c != pivot):
                    rows[k][column] = rows[k].get(column, Fraction(0)) - factor * entry
                    where[column].add(k)
                    if not rows[k][column]:
                        del rows[k][column]
                        where[column].discard(k)
            for column in row:
                where[column].discard(j)
        moves: dict[tuple[str, int], Fraction] = {}
        for j, pivot in reversed(done):
            moves[pivot] = (right[j] - sum(a * moves[c] for c, a in rows[j].items() if c in moves)) / rows[j][pivot]
        return moves


def check_cover(leaves: list[dict[int, int]], pairs: int) -> None:
    """That each choice of a zero side for every pair is a case of some leaf."""
    steps, most = 0, 100 * (len(leaves) + 1) * (pairs + 1)
    stack = [leaves]
    while stack:
        cases = stack.pop()
        steps += 1 + len(cases)
        must(steps <= most, "the leaves are no tree: it takes too long to see whether they cover every branch", NoProof)
        if any(not case for case in cases):
            continue
        count = Counter(pair for case in cases for pair in case)
        must(bool(count), "the leaves do not cover every branch", NoProof)
        pair = max(count, key=lambda p: (count[p], -p))
        for side in (0, 1):
            here = [case for case in cases if case.get(pair, side) == side]
            stack.append([{p: s for p, s in case.items() if p != pair} for case in here])


def judge_point(problem: Problem, head: dict[str, Any]) -> tuple[Fraction, dict[str, Any]]:
    """The objective of the head's point, and how much it violates equalities, inequalities and pairs."""
    z = [Fraction(number(x, "point")) for x in array(head["point"], "point")]
    must(len(z) == problem.n, f"point: must have {problem.n} entries")

    def at(rows: list[Row], offsets: list[int]) -> list[Fraction]:
        return [(sum((a * z[j] for j, a in row), Fraction(o))) / (1 << problem.shift)
                for row, o in zip(rows, offsets, strict=True)]

    (objective,) = at([list(enumerate(problem.g))], [0])
    objective += sum((a * z[i] * z[j] / (2 if i == j else 1) for (i, j), a in problem.Q.items()),
                     Fraction(0)) / (1 << problem.shift) + problem.c0
    rows, pairs = at(problem.J, problem.o), map(problem.sides, range(problem.pairs))
    violations = {"equality": max([Fraction(0), *(abs(x) for x in at(problem.A, problem.b))]),
                  "inequality": max([Fraction(0), *(-x for x in rows[:problem.inequalities])]),
                  "complementarity": max([Fraction(0), *(abs(min(rows[s], rows[t])) for s, t in pairs)])}
    feasible = all(x <= number(head.get(f"{key}_tolerance"), f"{key}_tolerance") for key, x in violations.items())
    return objective, {"violations": {key: float(x) for key, x in violations.items()}, "feasible": feasible}


def check(problem: Problem, file: TextIO, path: Path) -> tuple[int, dict[str, Any]]:
    """Of an open proof: the exit code, and what was found out."""
    lines = iter(partial(file.readline, MOST_BYTES), "")
    head = parse(next(lines, ""), f"{path}: line 1")
    must(head.get("format") == "marble-proof" and head.get("version") == 1,
         f"{path}: line 1: must be the head of a proof of version 1")
    for key in ("n", "equalities", "inequalities", "pairs"):
        must(head.get(key) == getattr(problem, key), f"{path}: line 1: {key} must be {getattr(problem, key)}")
    claim = head.get("claim")
    must(claim in ("bound", "infeasible"), f"{path}: line 1: claim must be bound or infeasible")
    radius = None if head.get("radius") is None else number(head["radius"], "radius")
    claimed = Fraction(number(head.get("bound"), "bound")) if claim == "bound" else Fraction(0)
    enough = claimed - SAME * max(Fraction(1), abs(claimed))
    count = index(head.get("leaves"), MOST_LEAVES + 1, "leaves")
    checker = Checker(problem, radius)
    cases: list[dict[int, int]] = []
    proved: Fraction | float = math.inf
    for at in range(count):
        name = f"leaf {at}"
        leaf = Leaf(problem, parse(next(lines, ""), f"{path}: line {at + 2}"), name)
        must(claim == "bound" or leaf.contradiction, f"{name} is no contradiction", NoProof)
        value = checker.bound(leaf, enough)
        if value is None or (leaf.contradiction and value <= 0):
            raise NoProof(f"{name}: its multipliers prove nothing")
        proved = proved if leaf.contradiction else min(proved, value)
        cases.append(leaf.assigned)
    end = parse(next(lines, ""), f"{path}: last line")
    must(end == {"end": count} and next(lines, None) is None, f'{path}: the last line must be {{"end": {count}}}')
    check_cover(cases, problem.pairs)
    found: dict[str, Any] = {"claim": claim, "leaves": count, "assumed": checker.assumed,
                             "radius": radius if checker.assumed else None}
    if claim == "bound":
        found["bound"] = math.nextafter(float(proved), -math.inf) if proved < math.inf else None
        found["claimed"] = float(claimed)
        must(proved >= enough, f"the leaves prove {found['bound']!r} only, {float(claimed)!r} is claimed", NoProof)
        if head.get("point") is not None:
            objective, point = judge_point(problem, head)
            found.update(point, objective=float(objective), gap=float((objective - min(proved, objective))
                                                                      / max(Fraction(1), abs(objective))))
            found["optimal"] = found["gap"] <= number(head.get("relative_gap_tolerance"), "relative_gap_tolerance")
    return ASSUMES if checker.assumed else HOLDS, found


def main(arguments: list[str] | None = None) -> int:
    """As a program."""
    parser = argparse.ArgumentParser(
        description="Check proofs of marble solve --proof in exact rational numbers. Prints a JSON object for each.",
        epilog="exit code: 0 the claim holds, 1 it does not follow, 2 a file is bad, 4 it holds for |z| <= the radius "
               "that the proof records; of several the largest")
    parser.add_argument("file", type=Path, nargs="+",
                        help="the problem, as JSON (see: marble convert), and what --proof has written, in turns")
    given = parser.parse_args(arguments)
    if len(given.file) % 2:
        parser.error("each problem needs its proof")
    worst = HOLDS
    for problem, proof in zip(given.file[::2], given.file[1::2], strict=True):
        try:
            with proof.open(encoding="utf-8") as file:
                code, found = check(Problem(problem), file, proof)
        except (NoProof, BadFile, OSError, UnicodeDecodeError, MemoryError) as error:
            code = FAILS if isinstance(error, NoProof) else BAD_FILE
            found = {"error": str(error) or type(error).__name__}
        worst = max(worst, code)
        print(json.dumps({"verdict": VERDICTS[code], **found}))
    return worst


if __name__ == "__main__":
    sys.exit(main())
