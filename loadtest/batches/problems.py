"""Tiny problems that differ by their index, with answers that are known without a solver."""

import math

import marble
import numpy as np

BASE = marble.LCQP(np.eye(2), [0.0, 0.0], L=[1, 0], R=[0, 1])


def change(index):
    """Numbers of: the point of 0 <= z0 _|_ z1 >= 0 that is nearest to (1 + index % 7, -sqrt(2 + 2 index))."""
    first, second = 1.0 + index % 7, -math.sqrt(2.0 + 2.0 * index)
    return {"g": [-first, -second], "c0": 0.5 * first**2 + 1.0 + index}


def problem(index):
    return marble.LCQP(np.eye(2), **change(index), L=[1, 0], R=[0, 1])


def is_right(index, objective, z):
    near = abs(z[0] - (1.0 + index % 7)) < 1e-6 and abs(z[1]) < 1e-6
    return near and abs(objective - (1.0 + index)) < 1e-6 * (1.0 + index)
