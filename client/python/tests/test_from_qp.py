"""Problems as solvers of QPs have them, l ≤ A x ≤ u; and sparse arrays wherever sparse matrices are taken."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from support import full

import marble

_FORMATS = ["csc", "csr", "coo", "bsr", "dia", "lil", "dok"]


def _qp(seed: int):
    """P, q, A, l, u with rows of every kind, feasible by construction; convex."""
    random = np.random.default_rng(seed)
    n, m = 6, 8
    root = random.normal(size=(n, n))
    A, inside = random.normal(size=(m, n)) * (random.random((m, n)) < 0.6), np.abs(random.normal(size=n))
    low = np.where(np.arange(m) % 4 == 1, -np.inf, A @ inside - 0.1)
    high = np.where(np.arange(m) % 4 == 2, np.inf, A @ inside + 0.1)
    low[0] = high[0] = A[0] @ inside
    return root @ root.T + np.eye(n), 3 * random.normal(size=n), A, low, high


@pytest.mark.parametrize("seed", range(4))
def test_rows_between_limits_are_equalities_and_inequalities(seed):
    P, q, A, low, high = _qp(seed)
    low[1], high[2] = -1e30, 1e20  # as OSQP has infinity
    problem = marble.Problem.from_qp(P, q, A, low, high, c0=2.5, name="from a QP")
    n, n_e, n_i, n_c = problem.compile().sizes
    two_sided = np.isfinite(low) & np.isfinite(high) & (np.abs(low) < 1e20) & (np.abs(high) < 1e20) & (low != high)
    assert (n, n_e, n_i, n_c) == (6, 1, 7 + int(two_sided.sum()), 0)
    answer = marble.solve(problem, server="local")
    assert answer.solved and answer.problem.name == "from a QP"
    z, y = answer.z, answer.row_duals
    assert np.isclose(answer.objective, 0.5 * z @ P @ z + q @ z + 2.5)
    np.testing.assert_allclose(P @ z + q + A.T @ y, 0, atol=1e-6)  # OSQP's y
    assert (A @ z >= low - 1e-6).all() and (A @ z <= high + 1e-6).all()


def test_pairs_are_of_variables():
    answer = marble.solve(marble.Problem.from_qp(2 * np.eye(3), [-2, -4, -2], pairs=[(0, 1), [1, 2]]), server="local")
    np.testing.assert_allclose(answer.z, [0, 2, 0], atol=1e-6)
    assert answer.proved and answer.s.tolist() == answer.z[:2].tolist()
    same = marble.Problem.from_qp(2 * np.eye(3), [-2, -4, -2], pairs=np.array([[0, 1], [1, 2]], np.uint8))
    assert marble.solve(same, server="local").z.tobytes() == answer.z.tobytes()
    assert marble.Problem.from_qp(None, [1.0], pairs=[]).compile().sizes == (1, 0, 0, 0)


def test_the_upper_triangle_stands_for_the_whole():
    P, q, A, low, high = _qp(0)
    whole = marble.Problem.from_qp(P, q, A, low, high).compile()
    for half in (np.triu(P), sp.csc_matrix(np.triu(P)), sp.triu(sp.csr_array(P))):
        other = marble.Problem.from_qp(half, q, A, low, high).compile()
        assert (full(other.Q) != full(whole.Q)).nnz == 0
    with pytest.raises(marble.InvalidProblem, match="symmetric") as caught:
        marble.Problem.from_qp(np.tril(P), q)
    assert caught.value.field == "P"


@pytest.mark.parametrize(("arguments", "field", "index"), [
    ({"P": np.eye(3)}, "P", None),
    ({"P": [[1, np.nan], [np.nan, 1]]}, "P", (1, 0)),
    ({"q": []}, "q", None),
    ({"q": [1, np.inf]}, "q", 1),
    ({"q": ["a", "b"]}, "q", None),
    ({"A": np.eye(3)}, "A", None),
    ({"A": None}, "A", None),
    ({"l": [0, 0, 0]}, "l", None),
    ({"l": [0, 2]}, "l", 1),
    ({"l": [0, np.inf]}, "l", 1),
    ({"u": [1, np.nan]}, "u", 1),
    ({"u": [1, -1e20]}, "u", 1),
    ({"pairs": [(0, 2)]}, "pairs", (0, 1)),
    ({"pairs": [(0, 1), (-1, 0)]}, "pairs", (1, 0)),
    ({"pairs": [0, 1]}, "pairs", None),
    ({"pairs": [(0, 1), (0,)]}, "pairs", None),
    ({"pairs": [(0.0, 1.0)]}, "pairs", None),
    ({"pairs": [(True, False)]}, "pairs", None),
    ({"pairs": [("a", "b")]}, "pairs", None),
    ({"z0": [1.0]}, "z0", None),
    ({"c0": np.nan}, "c0", 0),
])
def test_errors_name_the_arguments_of_the_call(arguments, field, index):
    given = {"P": np.eye(2), "q": [1, 1], "A": np.eye(2), "l": [0, 0], "u": [1, 1], **arguments}
    with pytest.raises(marble.InvalidProblem) as caught:
        marble.Problem.from_qp(**given)
    assert (caught.value.field, caught.value.index) == (field, index)


@pytest.mark.parametrize("form", _FORMATS)
def test_sparse_arrays_are_taken_wherever_matrices_are(form):
    def of(dense):
        return getattr(sp, f"{form}_array")(np.asarray(dense, dtype=float))

    Q, row = [[2, 1], [1, 2]], [[1.0, 1.0]]
    one, other = [[1.0, 0.0]], [[0.0, 1.0]]
    dense = marble.LCQP(Q, [-2, -4], C=row, d=[3], L=one, R=other)
    sparse = marble.LCQP(of(Q), [-2, -4], C=of(row), d=[3], L=of(one), R=of(other))
    for letter in "QCLR":
        assert type(getattr(sparse, letter)) is sp.csc_matrix
        np.testing.assert_array_equal(getattr(sparse, letter).toarray(), getattr(dense, letter).toarray())
    built = marble.Problem(2).minimize(of(Q), [-2, -4]).add_rows(of(row), -3).add_pairs(of(one), of(other))
    answers = [marble.solve(dense, server="local"), marble.solve(built, server="local")]
    with marble.Client("local") as local, local.session(dense) as session:
        answers += [session.update(Q=of(Q), L=of(one)), local.coupled([dense], [of(row)], [2.0]).solution]
    np.testing.assert_allclose([answer.z[1] for answer in answers], 2.0, atol=1e-5)
    with pytest.raises(marble.InvalidProblem) as caught:
        marble.LCQP(of([[1, np.nan], [np.nan, 1]]), [1, 1])
    assert caught.value.field == "Q"


def test_a_sparse_vector_is_one_row():
    try:
        row = sp.coo_array(np.array([0.0, 2.0]))
    except ValueError:
        pytest.skip("this scipy has no sparse vectors")
    if row.ndim != 1:
        pytest.skip("this scipy has no sparse vectors")
    assert marble.LCQP(None, [1, 1], C=row).C.toarray().tolist() == [[0.0, 2.0]]
