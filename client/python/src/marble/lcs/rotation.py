"""Rotations as vectors: the tangent space of free and ball joints."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SMALL: Final = 1e-4  # rad; below it the series is exact in double precision


def cross_matrix(w: Array) -> Array:
    """The matrix of w × ·, (3, 3)."""
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def transport(w: Array) -> Array:
    """The derivative of log(exp(δ) exp(w)) by δ at 0, (3, 3): the inverse of the left Jacobian of SO(3).

    w: rad, (3,), shorter than 2π.
    """
    angle = float(np.linalg.norm(w))
    by_square = 1 / 12 if angle < _SMALL else (1 - angle / 2 / math.tan(angle / 2)) / angle**2
    W = cross_matrix(w)
    made: Array = np.eye(3) - W / 2 + by_square * (W @ W)
    return made
