"""Problems and their changes in the form of marble._core."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from marble.model.lcqp import LCQP, csc


def changed(problem: LCQP, changes: Mapping[str, Any]) -> LCQP:
    """By vectors and values of matrices by their letters."""
    parts: dict[str, Any] = {}
    for name, value in changes.items():
        if name in "QACLR":
            old = getattr(problem, name)
            parts[name] = csc(np.asarray(value), old.indices, old.indptr, old.shape)
        else:
            parts[name] = value if name == "c0" else np.asarray(value)
    return problem.replaced(**parts)


def problem_of(parts: Mapping[str, Any]) -> LCQP:
    """Of c0, vectors and matrices (data, indices, indptr, rows) by their letters."""
    vectors = {name: np.array(parts[name]) for name in "gbdlr"}
    n = vectors["g"].size
    matrices = {}
    for name in "QACLR":
        data, indices, indptr, rows = parts[name]
        if rows:
            matrices[name] = csc(np.array(data), np.array(indices, dtype=np.int32), np.array(indptr, dtype=np.int32),
                                 (rows, n))
    return LCQP(None, vectors["g"], c0=parts["c0"]).replaced(**vectors, **matrices)
