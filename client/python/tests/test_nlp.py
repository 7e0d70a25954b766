"""Nonlinear problems of Python functions: the C++ loop, called back."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

import marble

pytest.importorskip("marble._core")


def circle(x):
    """The lectures' example: x0³ + x1² on the circle, both at least 1."""
    return {"objective": x[0] ** 3 + x[1] ** 2, "equalities": [10 - x @ x], "inequalities": x - 1}


def slopes(x):
    return {"gradient": [3 * x[0] ** 2, 2 * x[1]], "equalities": [-2 * x], "inequalities": sp.eye(2)}


def curvature(x, multipliers):
    return np.diag([6 * x[0], 2.0]) - 2 * multipliers.y[0] * np.eye(2)


@pytest.mark.parametrize("hessian", [curvature, None])
@pytest.mark.parametrize("x0", [(2, 2), (3, 5), (1.5, 2.5), (1, 1)])
def test_the_lectures_example_ends_at_its_solution(x0, hessian):
    rows = []
    answer = marble.nlp.solve(circle, slopes, x0, hessian=hessian, progress=rows.append)
    assert answer.solved and answer.b_stationary, answer.detail
    assert np.allclose(answer.x, [1, 3], atol=1e-8)
    assert np.allclose(answer.y, [1], atol=1e-6) and np.allclose(answer.nu, [1, 0], atol=1e-6)
    assert answer.iterations <= 8 and len(rows) == answer.iterations
    assert rows[0].objective == x0[0] ** 3 + x0[1] ** 2


def test_a_pair_keeps_one_side_at_zero():
    def values(x):
        return {"objective": 0, "residuals": x - [1, 2], "G": [np.sin(x[0])], "H": [x[1]]}

    def derivatives(x):
        return {"gradient": [0, 0], "residuals": np.eye(2), "G": sp.csc_matrix(([np.cos(x[0])], ([0], [0])), (1, 2)),
                "H": sp.csc_matrix([[0.0, 1.0]])}

    answer = marble.nlp.solve(values, derivatives, [0.5, 0.5], lower=[-1, -1], upper=[1.5, 3])
    assert answer.solved and np.allclose(answer.x, [0, 2], atol=1e-8)
    assert answer.objective == pytest.approx(0.5)


def test_what_a_function_raises_comes_out():
    def broken(x):
        raise LookupError("no such contact")

    with pytest.raises(LookupError, match="no such contact"):
        marble.nlp.solve(circle, broken, [2, 2])


def test_faults_name_the_function_and_the_row():
    def no_number(x):
        return {**circle(x), "inequalities": [1.0, np.nan]}

    with pytest.raises(marble.InvalidArgument) as caught:
        marble.nlp.solve(no_number, slopes, [2, 2])
    assert (caught.value.field, caught.value.index) == ("values.inequalities", 1)

    calls = []

    def changing(x):
        calls.append(x)
        stored = sp.eye(2) if len(calls) == 1 else sp.csc_matrix([[1.0, 1.0], [0.0, 1.0]])
        return {**slopes(x), "inequalities": stored}

    with pytest.raises(marble.InvalidArgument) as caught:
        marble.nlp.solve(circle, changing, [2, 2])
    assert caught.value.field.startswith("derivatives.inequalities.")

    with pytest.raises(marble.InvalidArgument) as caught:
        marble.nlp.solve(lambda x: {"objective": 0, "G": [1.0], "H": []}, slopes, [2, 2])
    assert caught.value.field == "values.H"

    with pytest.raises(marble.InvalidArgument):
        marble.nlp.solve(lambda x: {"objectiv": 0}, slopes, [2, 2])
    with pytest.raises(marble.InvalidArgument) as caught:
        marble.nlp.solve(circle, slopes, [2, 2], curvature="some")
    assert caught.value.field == "curvature"


def test_casadi_problems_bring_their_derivatives():
    casadi = pytest.importorskip("casadi", reason="casadi is not installed (it is not in Debian)")
    for kind in (casadi.SX, casadi.MX):
        x, p = kind.sym("x", 2), kind.sym("p")
        problem = {"x": x, "p": p, "f": x[0] ** 3 + x[1] ** 2, "g": casadi.sumsqr(x) - p}
        answer = marble.nlp.solve_casadi(problem, [2, 2], p=10, lbg=0, ubg=0, lbx=1)
        assert answer.solved and np.allclose(answer.x, [1, 3], atol=1e-8) and answer.b_stationary, answer
        assert np.allclose(answer.y, [-1], atol=1e-6) and np.allclose(answer.bounds, [1, 0], atol=1e-6)
        # stackelberg1 of MacMPEC, the follower's response as a pair
        problem = {"x": x, "f": x[0] ** 2 / 2 + x[0] * x[1] / 2 - 95 * x[0], "G": x[1], "H": 2 * x[1] + x[0] / 2 - 100}
        answer = marble.nlp.solve_casadi(problem, [100, 25], lbx=0, ubx=[200, np.inf])
        assert answer.solved and answer.objective == pytest.approx(-9800 / 3)
        problem = {"x": x, "f": -x[1], "g": casadi.vertcat(x[0] - x[1], casadi.sin(x[0]))}
        answer = marble.nlp.solve_casadi(problem, [0, 0], lbg=[0, -np.inf], ubg=[5, 0.5])
        assert answer.solved and answer.x[1] == pytest.approx(np.pi / 6) and len(answer.nu) == 3
    with pytest.raises(marble.InvalidArgument):
        marble.nlp.solve_casadi({"x": x, "objective": x[0]}, [0, 0])
