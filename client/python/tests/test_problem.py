"""The builder: two-sided rows, bounds, pairs; answers in the same terms."""

from __future__ import annotations

import itertools
import json
import subprocess

import numpy as np
import pytest
import scipy.sparse as sp
from support import PROGRAM, clean_environment, full, random_problem

import marble
from marble.hopper import Hopper


def _stated(seed: int):
    """A random problem as it is stated, and its parts."""
    random = np.random.default_rng(seed)
    n, m = int(random.integers(3, 12)), int(random.integers(1, 8))
    root = random.normal(size=(n, n))
    Q, g = root @ root.T + np.eye(n), 3 * random.normal(size=n)
    A, inside = random.normal(size=(m, n)), random.normal(size=n)
    kind = random.integers(0, 5, size=m)  # none, lower, upper, both, equal
    low = np.where(np.isin(kind, [1, 3]), A @ inside - 0.1, -np.inf)
    high = np.where(np.isin(kind, [2, 3]), A @ inside + 0.1, np.inf)
    low, high = np.where(kind == 4, A @ inside, low), np.where(kind == 4, A @ inside, high)
    if np.count_nonzero(kind == 4) >= n:
        low[kind == 4], high[kind == 4] = -np.inf, np.inf
    lb = np.where(random.random(n) < 0.5, inside - 0.2, -np.inf)
    ub = np.where(random.random(n) < 0.5, inside + 0.2, np.inf)
    problem = marble.Problem(n).minimize(Q, g).add_rows(A, low, high).bound(None, lb, ub)
    return problem, (Q, g, A, low, high, lb, ub)


@pytest.mark.parametrize("seed", range(20))
def test_multipliers_come_back_for_rows_and_bounds_with_osqp_s_signs(client, seed):
    problem, (Q, g, A, low, high, lb, ub) = _stated(seed)
    answer = client.solve(problem)
    assert answer.solved, answer
    z, rows, bounds = answer.z, answer.row_duals, answer.bound_duals
    assert rows.shape == low.shape and bounds.shape == z.shape
    np.testing.assert_allclose(Q @ z + g + A.T @ rows + bounds, 0, atol=1e-6)
    for values, duals, below, above in ((A @ z, rows, low, high), (z, bounds, lb, ub)):
        assert (values >= below - 1e-6).all() and (values <= above + 1e-6).all()
        equal = below == above
        assert (duals[(np.abs(values - above) > 1e-4) & ~equal] <= 1e-6).all()
        assert (duals[(np.abs(values - below) > 1e-4) & ~equal] >= -1e-6).all()


def test_a_problem_is_compiled_again_only_when_it_has_changed():
    problem = marble.Problem(2).minimize(np.eye(2), [-1.0, -2.0]).add_rows([[1.0, 1.0]], -4.0, 4.0)
    changes = (lambda: problem.minimize(np.eye(2), [-3.0, 0.0]), lambda: problem.add_rows([[0.0, 1.0]], 0.5, 0.5),
               lambda: problem.bound(0, 0.25, 2.0), lambda: problem.add_pair(0, 1), lambda: problem.start_at([1, 1]))
    seen = [problem.compile()]
    for change in changes:
        assert problem.compile() is seen[-1]
        change()
        seen.append(problem.compile())
    g, rows, bounds, pairs, start = itertools.pairwise(seen)
    assert [part.g[0] for part in g] == [-1.0, -3.0] and [part.b.size for part in rows] == [0, 1]
    assert [part.d.tolist() for part in bounds] == [[4.0, 4.0], [4.0, 4.0, -0.25, 2.0]]
    assert [part.l.size for part in pairs] == [0, 1] and start[0].z0 is None and start[1].z0.tolist() == [1.0, 1.0]
    problem.name = "renamed"
    assert problem.compile().name == "renamed"


def test_names_stand_for_variables(client):
    problem = marble.Problem(["slip", "force"], name="friction")
    problem.minimize(np.eye(2), [-1, -2]).add_pair("slip", "force").bound("force", ub=1.5)
    answer = client.solve(problem)
    assert np.isclose(answer["force"], 1.5) and np.isclose(answer["slip"], 0.0) and answer["force"] == answer[1]
    assert answer.problem.name == "friction" and "friction: solved" in repr(answer)


def test_pairs_may_have_offsets(client):
    problem = marble.Problem(2).minimize(np.eye(2), [2.0, 1.0]).add_pair(0, 1, l=1.0, r=2.0)
    answer = client.solve(problem)
    assert np.isclose(answer.s.min(), answer.z[0] + 1.0) and np.isclose(answer.t[0], answer.z[1] + 2.0)
    assert min(answer.s[0], answer.t[0]) <= 1e-9


def test_equal_limits_are_an_equality_and_infinite_ones_nothing():
    for none in (np.inf, 1e20, 1e30):
        problem = marble.Problem(2).add_rows(np.eye(2), [1, -none], [1, none]).bound(1, lb=3, ub=3).bound(0, -none, 7)
        compiled = problem.compile()
        assert compiled.sizes == (2, 2, 1, 0)
        assert compiled.b.tolist() == [-1, -3] and compiled.d.tolist() == [7]
        assert compiled.C.toarray().tolist() == [[-1, 0]]


def test_a_compiled_problem_survives_the_builder():
    for seed in range(5):
        problem = random_problem(seed)
        again = marble.Problem.of(problem).compile()
        for letter in "QACLR":
            np.testing.assert_array_equal(getattr(again, letter).toarray(), getattr(problem, letter).toarray())
        for letter in "gbdlr":
            np.testing.assert_array_equal(getattr(again, letter), getattr(problem, letter))


def test_files_are_those_of_the_command_line(tmp_path, server):
    problem = random_problem(7)
    marble.Problem.of(problem).start_at(np.ones(problem.n)).save(tmp_path / "mine.json")
    run = subprocess.run([PROGRAM, "solve", "--server", server.address, "--quiet", "--output", "json",
                          str(tmp_path / "mine.json")], capture_output=True, text=True, env=clean_environment(),
                         check=True)
    assert json.loads(run.stdout)["status"] == "solved"
    loaded = marble.Problem.load(tmp_path / "mine.json").compile()
    assert (full(loaded.Q) != full(problem.Q)).nnz == 0
    np.testing.assert_array_equal(loaded.z0, np.ones(problem.n))


def test_the_hopper_is_the_command_line_s_bit_by_bit(tmp_path):
    file = tmp_path / "hopper.json"
    file.write_bytes(subprocess.run([PROGRAM, "example", "hopper"], capture_output=True, check=True).stdout)
    theirs, ours = marble.Problem.load(file).compile(), Hopper().problem()
    for letter in "QACLR":
        a, b = getattr(theirs, letter), getattr(ours, letter)
        assert a.indices.tobytes() == b.indices.tobytes() and a.data.tobytes() == b.data.tobytes()
    for letter in "gbdlr":
        np.testing.assert_array_equal(getattr(theirs, letter), getattr(ours, letter))
    assert theirs.c0 == ours.c0


@pytest.mark.parametrize(("text", "field", "index"), [
    ("[1]", "", None),
    ("{", "", None),
    ('{"g": [1]}', "n", None),
    ('{"n": 1, "g": [1, 2]}', "g", None),
    ('{"n": 1, "g": [NaN]}', "g", 0),
    ('{"n": 1, "g": [1], "g": [1]}', "g", None),
    ('{"n": 1, "g": [1], "A": {"rows": 1, "cols": 1, "i": [0]}}', "A.j", None),
    ('{"n": 1, "g": [1], "A": {"rows": 1, "cols": 1, "i": [0, 1], "j": [0, 0], "v": [1, 1]}, "b": [0]}', "A.i", 1),
    ('{"n": 1, "g": [1], "A": {"rows": 1, "cols": 1, "i": [0], "j": [0], "v": [1e999]}, "b": [0]}', "A.v", 0),
])
def test_a_bad_file_is_reported_with_field_and_index(tmp_path, text, field, index):
    file = tmp_path / "bad.json"
    file.write_text(text)
    with pytest.raises(marble.InvalidProblem) as caught:
        marble.Problem.load(file)
    assert (caught.value.field, caught.value.index) == (field, index)


@pytest.mark.parametrize(("wrong", "field", "index"), [
    (lambda p: p.add_rows(np.eye(3)), "A", None),
    (lambda p: p.add_rows([[1, np.nan]]), "A", (0, 1)),
    (lambda p: p.add_rows(np.eye(2), [0, 5], [1, 4]), "lb", 1),
    (lambda p: p.add_rows(np.eye(2), [0, np.inf]), "lb", 1),
    (lambda p: p.add_rows(np.eye(2), [0, 1e20]), "lb", 1),
    (lambda p: p.bound(None, ub=-1e20), "ub", 0),
    (lambda p: p.add_rows(np.eye(2), ub=[0, np.nan]), "ub", 1),
    (lambda p: p.add_rows(np.eye(2), ub=[0, 1, 2]), "ub", None),
    (lambda p: p.bound("nobody", 0, 1), "variable", None),
    (lambda p: p.add_pair(0, 2), "variable", None),
    (lambda p: p.add_pairs(np.eye(2), [[1, 0]]), "R", None),
    (lambda p: p.start_at([1]), "z0", None),
    (lambda p: p.minimize([[1, 2], [3, 4]]).compile(), "Q", (0, 1)),
])
def test_errors_are_raised_before_anything_is_sent(wrong, field, index):
    with pytest.raises(marble.InvalidProblem) as caught:
        wrong(marble.Problem(["a", "b"]))
    assert (caught.value.field, caught.value.index) == (field, index)


def test_dense_lists_and_sparse_data_are_the_same_problem():
    random = np.random.default_rng(0)
    for n, m, rounding in ((1, 1, 0.0), (2, 3, 1e-14), (7, 5, 1e-14), (7, 5, 0.0)):
        half = np.where(random.random((n, n)) < 0.5, 0.0, random.normal(size=(n, n)))
        Q, C = half + half.T, np.where(random.random((m, n)) < 0.5, 0.0, random.normal(size=(m, n)))
        Q[0, -1] += rounding * abs(Q[0, -1])  # which is no asymmetry
        forms = [marble.LCQP(form(Q), np.ones(n), C=form(C), L=form(C), R=form(-C))
                 for form in (sp.csc_matrix, sp.coo_matrix, np.asarray, np.asfortranarray, np.ndarray.tolist)]
        for other in forms[1:]:
            for name in "QACLR":
                ours, theirs = getattr(forms[0], name), getattr(other, name)
                assert type(theirs) is sp.csc_matrix and theirs.shape == ours.shape and theirs.has_canonical_format
                for part in ("data", "indices", "indptr"):
                    assert getattr(theirs, part).dtype == getattr(ours, part).dtype
                    np.testing.assert_array_equal(getattr(theirs, part), getattr(ours, part))
    for form in (np.asarray, sp.csc_matrix):
        for wrong, index in (([[1, 2], [3, 1]], (0, 1)), ([[1, 0], [0, np.nan]], (1, 1))):
            with pytest.raises(marble.InvalidProblem) as caught:
                marble.LCQP(form(np.array(wrong, dtype=float)), [0, 0])
            assert (caught.value.field, caught.value.index) == ("Q", index)
