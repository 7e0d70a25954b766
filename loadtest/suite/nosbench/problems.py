"""Reads problems of NOSBENCH: JSON with CasADi's serialized expressions; and chooses among them by their names.

    min f(w, p)   s.t.   lbw <= w <= ubw,   lbg <= g(w, p) <= ubg,   0 <= G(w, p) ⊥ H(w, p) >= 0
"""

import dataclasses
import hashlib
import json
import math
import pathlib

import numpy as np

TUNING = pathlib.Path(__file__).with_name("tuning.txt")
LARGEST = 200_000_000  # bytes of a file
_EXPRESSIONS = ("w", "p")
_FUNCTIONS = ("augmented_objective_fun", "g_fun", "G_fun", "H_fun")
_NUMBERS = ("w0", "lbw", "ubw", "p0", "lbg", "ubg")


class BadProblem(ValueError):
    """A file that is not a problem; names the field."""


@dataclasses.dataclass(frozen=True)
class Problem:
    """CasADi expressions (SX) of w and p, and numbers: w0, lbw, ubw of w, p0 of p, lbg and ubg of g."""

    name: str
    w: object
    p: object
    f: object
    g: object
    G: object
    H: object
    w0: np.ndarray
    lbw: np.ndarray
    ubw: np.ndarray
    p0: np.ndarray
    lbg: np.ndarray
    ubg: np.ndarray


def class_of(name):
    """The class of a problem: its name up to the first "_"."""
    return name.partition("_")[0]


def files_of(folder):
    """{name: path} of the problems in a folder, or in its problems/casadi as the repository has them."""
    folder = pathlib.Path(folder)
    inner = folder / "problems" / "casadi"
    found = {path.stem: path for path in sorted((inner if inner.is_dir() else folder).glob("*.json"))}
    if not found:
        raise BadProblem(f"{folder}: no *.json here, nor in problems/casadi")
    return found


def read(path):
    """The problem in a file. Errors: BadProblem names the file, the field and, of numbers, the index."""
    import casadi as ca

    path = pathlib.Path(path)
    if path.stat().st_size > LARGEST:
        raise BadProblem(f"{path.name}: {path.stat().st_size} bytes, must be at most {LARGEST}")
    try:
        given = json.loads(path.read_text())
    except ValueError as error:
        raise BadProblem(f"{path.name}: not JSON, {error}") from None
    if not isinstance(given, dict):
        raise BadProblem(f"{path.name}: must be an object")
    for field in (*_EXPRESSIONS, *_FUNCTIONS, *_NUMBERS):
        if field not in given:
            raise BadProblem(f"{path.name}: {field} is missing")
    numbers = {field: _numbers(path.name, field, given[field]) for field in _NUMBERS}
    w, p = (_deserialized(path.name, field, given[field], ca.SX) for field in _EXPRESSIONS)
    functions = {}
    for field in _FUNCTIONS:
        function = _deserialized(path.name, field, given[field], ca.Function)
        if (function.n_in(), function.n_out()) != (2, 1):
            raise BadProblem(f"{path.name}: {field} must be a function of w and p with one result")
        try:
            functions[field] = ca.densify(ca.vec(function(w, p)))
        except RuntimeError as error:
            raise BadProblem(f"{path.name}: {field} does not take w and p, {error}") from None
    f, g, G, H = functions.values()
    for field, size, count in (("w0", "w", w.numel()), ("lbw", "w", w.numel()), ("ubw", "w", w.numel()),
                               ("p0", "p", p.numel()), ("lbg", "g_fun", g.numel()), ("ubg", "g_fun", g.numel())):
        if numbers[field].size != count:
            raise BadProblem(f"{path.name}: {field} has {numbers[field].size} entries, must have {count}, as {size}")
    if f.numel() != 1:
        raise BadProblem(f"{path.name}: augmented_objective_fun has {f.numel()} results, must have 1")
    if G.numel() != H.numel():
        raise BadProblem(f"{path.name}: H_fun has {H.numel()} rows, must have {G.numel()}, as G_fun")
    return Problem(path.stem, w, p, f, g, G, H, **numbers)


def _numbers(name, field, given):
    given = given if isinstance(given, list) else [given]
    for i, value in enumerate(given):
        if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
            raise BadProblem(f"{name}: {field}[{i}] is {str(value)[:40]!r}, must be a number")
        if field in ("w0", "p0") and math.isinf(value):
            raise BadProblem(f"{name}: {field}[{i}] is {value}, must be finite")
    return np.array(given, dtype=float)


def _deserialized(name, field, text, kind):
    if not isinstance(text, str):
        raise BadProblem(f"{name}: {field} must be a string, as CasADi serializes")
    try:
        return kind.deserialize(text)
    except Exception as error:  # CasADi raises RuntimeError and others
        raise BadProblem(f"{name}: {field} is nothing that CasADi has serialized, "
                         f"{str(error).splitlines()[0] if str(error) else type(error).__name__}") from None


def stratified(names, count, seed):
    """`count` of the names, from each class in proportion and at least one, the same everywhere.

    A class of k of the n names gets count k / n, rounded by largest remainders (ties: by name of the class), and at
    least 1; the names of a class are ordered by the SHA-256 of "seed:name", and the first ones are taken.
    """
    classes = {}
    for name in sorted(names):
        classes.setdefault(class_of(name), []).append(name)
    if not len(classes) <= count <= len(names):
        raise ValueError(f"count is {count}, must be from {len(classes)}, the number of classes, to {len(names)}")
    due = {key: count * len(each) / len(names) for key, each in classes.items()}
    taken = {key: max(1, math.floor(share)) for key, share in due.items()}
    while sum(taken.values()) != count:
        step = 1 if sum(taken.values()) < count else -1
        open_ = [key for key in sorted(classes) if 1 <= taken[key] + step <= len(classes[key])]
        taken[max(open_, key=lambda key: step * (due[key] - taken[key]))] += step
    return sorted(name for key, each in classes.items() for name in
                  sorted(each, key=lambda name: hashlib.sha256(f"{seed}:{name}".encode()).hexdigest())[:taken[key]])


def tuning_names():
    """The names of the tuning sample; lines with # are comments."""
    return [line for line in TUNING.read_text().split("\n") if line and not line.startswith("#")]
