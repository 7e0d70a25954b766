"""Small linear complementarity problems, and steps of LCSs: for the tests of linearizers."""

import numpy as np


def lemke(M, q):
    """λ of 0 ≤ λ ⊥ M λ + q ≥ 0 by Lemke's method with a lexicographic ratio test. Raises where a ray ends it."""
    diagonal = np.diag(M)
    scale = np.where(diagonal > 0, 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1)), 1.0)
    largest = np.abs(M * scale).max(axis=1, initial=0.0)
    scale = np.where((diagonal <= 0) & (largest > 0), 1 / np.where(largest > 0, largest, 1), scale)
    return scale * _scaled(scale[:, None] * M * scale, scale * q)


def _scaled(M, q):
    n = len(q)
    if n == 0 or q.min() >= 0:
        return np.zeros(n)
    # Columns: w, z, the artificial variable, and the right-hand side with the identity that breaks ties.
    table = np.hstack([np.eye(n), -M, -np.ones((n, 1)), q[:, None], np.eye(n)]).astype(float)
    basis, entering, row = list(range(n)), 2 * n, int(np.argmin(q))
    for _ in range(50 * n + 100):
        leaving, basis[row] = basis[row], entering
        table[row] /= table[row, entering]
        others = np.arange(n) != row
        table[others] -= np.outer(table[others, entering], table[row])
        if leaving == 2 * n:
            z = np.zeros(2 * n + 1)
            z[basis] = table[:, 2 * n + 1]
            return np.maximum(z[n:2 * n], 0.0)
        entering = leaving + n if leaving < n else leaving - n
        up = np.flatnonzero(table[:, entering] > 1e-9)
        if not up.size:
            raise ArithmeticError("Lemke's method ends in a ray")
        ratios = table[up, 2 * n + 1:] / table[up, entering][:, None]
        least = ratios[:, 0].min()
        artificial = [i for i, k in enumerate(up) if basis[k] == 2 * n and ratios[i, 0] <= least + 1e-12]
        first = artificial[0] if artificial else min(range(len(up)), key=lambda i: tuple(ratios[i]))
        row = int(up[first])
    raise ArithmeticError("Lemke's method does not end")


def step(lcs, x, u):
    """x₊ and λ."""
    force = lemke(lcs.F, lcs.E @ x + lcs.H @ u + lcs.c)
    slack = lcs.E @ x + lcs.F @ force + lcs.H @ u + lcs.c
    assert np.abs(np.minimum(force, slack)).max(initial=0.0) < 1e-7 * (1 + np.abs(lcs.c).max(initial=0.0))
    return lcs.A @ x + lcs.B @ u + lcs.D @ force + lcs.d, force
