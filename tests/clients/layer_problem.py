"""A problem with every part, well away from corners: what layers are tested on."""

import numpy as np

import marble

NAMES = "gbdlrQACLR"


def problem():
    """Six variables, an equality, two inequalities and two pairs, one with each side at zero."""
    random = np.random.default_rng(11)
    root = random.normal(size=(6, 6))
    z = random.normal(size=6)
    A, C, L, R = (random.normal(size=(rows, 6)) for rows in (1, 2, 2, 2))
    return marble.LCQP(root @ root.T + np.eye(6), random.normal(size=6), A=A, b=-A @ z, C=C, d=-C @ z + [0.0, 1.0],
                       L=L, l=-L @ z + [0.0, 1.0], R=R, r=-R @ z + [1.0, 0.0])


def numbers():
    """Of the problem, in the order of NAMES."""
    one = problem()
    return [np.array(getattr(one, name).data if name in "QACLR" else getattr(one, name)) for name in NAMES]


def settings():
    """Every solve on the branch of one answer, so that differences stay on it."""
    start = marble.solve(problem(), server="local")
    assert start.solved and marble.Sensitivity(start).smooth
    return {"start": start, "options": {"max_local_search_factorizations": 0}}
