"""Problems in JSON files, the format of `marble example` and `marble solve`.

One object: n, c0, g, Q, A, b, C, d, L, l, R, r, x0 (where to start, or null), name. A matrix is
{"rows", "cols", "i", "j", "v"}, triplets counted from 0; equal coordinates add up; a missing block is empty.
"""

from __future__ import annotations

import json
import os
import pathlib
from typing import Any

import numpy as np

from marble.base.lazy import lazy
from marble.errors import InvalidProblem
from marble.model.lcqp import LCQP, mirrored

sp: Any = lazy("scipy.sparse")

_BLOCKS = (("A", "b"), ("C", "d"), ("L", "l"), ("R", "r"))


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise InvalidProblem(twice, "is there twice")
    return found


def _integers(part: dict[str, Any], key: str, field: str, end: int) -> Any:
    values = np.array(part[key])
    if values.size == 0:
        return np.zeros(0, dtype=np.int64)
    if values.ndim != 1 or values.dtype.kind not in "iu":
        raise InvalidProblem(f"{field}.{key}", "must be whole numbers")
    bad = np.flatnonzero((values < 0) | (values >= end))
    if bad.size:
        raise InvalidProblem(f"{field}.{key}", f"must be in [0, {end})", index=int(bad[0]), value=values[bad[0]])
    return values


def _read_matrix(part: Any, field: str, n: int) -> Any:
    if part is None:
        return None
    for key in ("rows", "cols", "i", "j", "v"):
        if not isinstance(part, dict) or key not in part:
            raise InvalidProblem(f"{field}.{key}", "is missing")
    rows, columns = part["rows"], part["cols"]
    if columns != n:
        raise InvalidProblem(f"{field}.cols", f"must be {n} (n)", value=columns)
    if not isinstance(rows, int) or rows < 0:
        raise InvalidProblem(f"{field}.rows", "must be a whole number >= 0", value=rows)
    i, j = _integers(part, "i", field, rows), _integers(part, "j", field, n)
    v = np.array(part["v"], dtype=np.float64)
    if not len(i) == len(j) == len(v):
        raise InvalidProblem(field, "must have as many i and j as v", value=f"{len(i)}, {len(j)}, {len(v)} entries")
    bad = np.flatnonzero(~np.isfinite(v))
    if bad.size:
        raise InvalidProblem(f"{field}.v", "must be finite", index=int(bad[0]), value=v[bad[0]])
    return sp.coo_matrix((v, (i, j)), shape=(rows, n)).tocsc()


def parse(text: str | bytes, name: str = "") -> LCQP:
    """The problem in a file's text; `name` is its name if the text has none. InvalidProblem has field and index."""
    try:
        content = json.loads(text, object_pairs_hook=_unique)
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise InvalidProblem("", f"is not JSON: {error}") from None
    if not isinstance(content, dict):
        raise InvalidProblem("", "must be one JSON object")
    for key in ("n", "g"):
        if content.get(key) is None:
            raise InvalidProblem(key, "is missing")
    n = content["n"]
    if not isinstance(n, int) or len(content["g"]) != n:
        raise InvalidProblem("g", f"must have {n} entries (n)", value=f"{len(content['g'])} entries")
    parts: dict[str, Any] = {}
    for letter, offset in _BLOCKS:
        parts[letter] = _read_matrix(content.get(letter), letter, n)
        parts[offset] = content.get(offset)
    return LCQP(_read_matrix(content.get("Q"), "Q", n), content["g"], c0=content.get("c0") or 0.0,
                z0=content.get("x0"), name=content.get("name") or name, **parts)


def load(path: str | os.PathLike[str]) -> LCQP:
    """The problem in a JSON file. OSError where it cannot be read."""
    path = pathlib.Path(path)
    return parse(path.read_bytes(), path.stem)


def _write_matrix(values: Any) -> dict[str, Any]:
    entries = sp.coo_matrix(values)
    return {"rows": values.shape[0], "cols": values.shape[1], "i": entries.row.tolist(), "j": entries.col.tolist(),
            "v": entries.data.tolist()}


def text_of(problem: LCQP) -> str:
    """The text of a JSON file; numbers are written so that they are read back bit by bit."""
    content: dict[str, Any] = {"name": problem.name, "n": problem.n, "c0": problem.c0, "g": problem.g.tolist(),
                               "Q": _write_matrix(mirrored(problem.Q))}
    for letter, offset in _BLOCKS:
        content[letter] = _write_matrix(getattr(problem, letter))
        content[offset] = getattr(problem, offset).tolist()
    content["x0"] = None if problem.z0 is None else problem.z0.tolist()
    return json.dumps(content, allow_nan=False) + "\n"


def save(problem: LCQP, path: str | os.PathLike[str]) -> None:
    """Writes a JSON file."""
    pathlib.Path(path).write_text(text_of(problem), encoding="utf-8")
