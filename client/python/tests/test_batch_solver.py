"""Batches of numbers for one pattern: arrays in and out, checked against solves one by one."""

from __future__ import annotations

import pathlib
import subprocess
import sys

import numpy as np
import pytest
from support import clean_environment, full, random_problem, tiny

import marble

SEEDS = (2, 3, 7)  # with equalities, inequalities and pairs


def numbers(problem: marble.LCQP, n: int, seed: int = 0) -> dict[str, np.ndarray]:
    random = np.random.default_rng(seed)
    return {"g": problem.g + 0.3 * random.normal(size=(n, problem.n)), "c0": random.normal(size=n),
            "d": problem.d + 0.1 * random.random(size=(n, problem.d.size)),
            "A": problem.A.data + np.zeros((n, 1))}


def check(problem: marble.LCQP, given: dict[str, np.ndarray], result: marble.BatchResult) -> None:
    """Everything that a result says of itself, computed again from the arrays alone."""
    Q = full(problem.Q)
    for i in range(len(result)):
        g, d, c0, z = given["g"][i], given["d"][i], given["c0"][i], result.z[i]
        s, t = problem.L @ z + problem.l, problem.R @ z + problem.r
        violations = [np.abs(problem.A @ z + problem.b).max(initial=0.0),
                      np.maximum(0.0, -(problem.C @ z + d)).max(initial=0.0), np.abs(np.minimum(s, t)).max(initial=0.0)]
        assert max(violations) <= 1e-6
        np.testing.assert_allclose(result.violations[i], violations, atol=1e-12)
        assert np.isclose(result.objective[i], 0.5 * z @ (Q @ z) + g @ z + c0, rtol=1e-10, atol=1e-10)
        gradient = (Q @ z + g + problem.A.T @ result.y[i] - problem.C.T @ result.nu[i] - problem.L.T @ result.xi[i]
                    - problem.R.T @ result.eta[i])
        assert np.abs(gradient).max() <= 1e-5 and result.nu[i].min(initial=0.0) >= -1e-6


@pytest.mark.parametrize("seed", SEEDS)
def test_each_answer_is_no_higher_than_a_solve_of_its_own_and_right(seed):
    problem, n = random_problem(seed), 40
    given = numbers(problem, n)
    result = marble.BatchSolver(problem).solve(**given, multipliers=True)
    assert result.solved.all() and set(result.status) == {marble.Status.SOLVED} and len(result) == n
    check(problem, given, result)
    for i in range(n):
        own = problem.replaced(g=given["g"][i], d=given["d"][i], c0=given["c0"][i])
        alone = marble.solve(own, server="local")
        assert result.objective[i] <= alone.objective + 1e-6 * max(1.0, abs(alone.objective))


def test_threads_and_batches_before_it_change_no_bit():
    problem = random_problem(3)
    given = numbers(problem, 70)
    solver = marble.BatchSolver(problem)
    results = [solver.solve(**given, threads=threads, multipliers=True) for threads in (1, 2, 3, None)]
    results.append(marble.BatchSolver(problem).solve(**given, threads=2, multipliers=True))
    for name in ("status_codes", "z", "objective", "violations", "kkt_residual", "factorizations", "y", "nu", "xi",
                 "eta"):
        assert len({getattr(result, name).tobytes() for result in results}) == 1, name


def test_arrays_of_doubles_are_not_copied_and_others_give_the_same_bits():
    problem = tiny()
    solver = marble.BatchSolver(problem)
    g = np.random.default_rng(1).integers(-9, 9, size=(50, 2)).astype(float)
    assert np.shares_memory(solver._table(g, "g"), g)
    results = [solver.solve(g=same) for same in (g, g.astype(np.float32), g.astype(int), np.asfortranarray(g),
                                                 np.repeat(g, 2, axis=0)[::2], g.tolist())]
    assert len({result.z.tobytes() for result in results}) == 1
    np.testing.assert_array_equal(g, np.random.default_rng(1).integers(-9, 9, size=(50, 2)))


def test_the_values_of_matrices_stand_in_the_order_of_the_pattern():
    problem = random_problem(3)
    random, n = np.random.default_rng(5), 12
    values = {name: getattr(problem, name).data * (1.0 + 0.01 * random.normal(size=(n, getattr(problem, name).nnz)))
              for name in "QCLR"}
    result = marble.BatchSolver(problem, max_small_problem_nodes=0).solve(**values)
    for i in range(n):
        parts = {}
        for name in "QCLR":
            parts[name] = getattr(problem, name).copy()
            parts[name].data = values[name][i]
        own = marble.LCQP(full(parts["Q"]), problem.g, A=problem.A, b=problem.b, C=parts["C"], d=problem.d,
                          L=parts["L"], l=problem.l, R=parts["R"], r=problem.r)
        alone = marble.solve(own, server="local", max_small_problem_nodes=0)
        assert result.solved[i] and result.objective[i] <= alone.objective + 1e-6


def test_a_result_is_a_start_and_points_are():
    problem = random_problem(7)
    given = numbers(problem, 30)
    solver = marble.BatchSolver(problem)
    first = solver.solve(**given, multipliers=True)
    again = solver.solve(**given, start=first)
    assert again.factorizations.sum() <= first.factorizations.sum()
    assert (again.objective <= first.objective + 1e-9).all()
    assert (solver.solve(**given, z0=first.z).objective <= first.objective + 1e-9).all()
    assert again.y is None and first.y.shape == (30, problem.b.size)
    assert solver.memory_bytes > 0 and "30 of 30" in repr(again)


def test_no_elements_and_no_arrays():
    solver = marble.BatchSolver(tiny())
    assert len(solver.solve(count=0)) == 0 and solver.solve(g=np.empty((0, 2))).z.shape == (0, 2)
    np.testing.assert_allclose(solver.solve(count=3).objective, 1.0)


@pytest.mark.parametrize("given, error, text", [
    ({"g": [[0, 1], [np.nan, 2]]}, marble.InvalidProblem, "g[1, 0] is nan: must be finite"),
    ({"g": np.ones((3, 2)), "c0": [0.0, 1.0, -np.inf]}, marble.InvalidProblem, "c0[2] is -inf: must be finite"),
    ({"z0": [[0, np.inf]]}, marble.InvalidProblem, "z0[0, 1] is inf: must be finite"),
    ({"L": [[np.nan]]}, marble.InvalidProblem, "L[0, 0] is nan: must be finite"),
    ({"g": np.ones((3, 3))}, marble.InvalidProblem, "g is of shape (3, 3): must have the shape (n, 2)"),
    ({"g": np.ones(2)}, marble.InvalidProblem, "g is of shape (2,): must have the shape (n, 2)"),
    ({"g": [[1, 2], [3]]}, ValueError, ""),
    ({"c0": np.ones((2, 1))}, marble.InvalidProblem, "c0 is of shape (2, 1): must have the shape (n,)"),
    ({"A": np.ones((2, 1))}, marble.InvalidProblem, "A is of shape (2, 1): must have the shape (n, 0)"),
    ({"g": np.ones((2, 2)), "l": np.ones((3, 1))}, marble.InvalidProblem,
     "l is 3 elements: must have 2 elements, as many as the batch"),
    ({"g": np.ones((2, 2)), "count": 3}, marble.InvalidProblem,
     "g is 2 elements: must have 3 elements, as many as the batch"),
    ({"g": np.ones((2, 2), complex)}, marble.InvalidProblem,
     "g is of type complex128: must be an array of real numbers"),
    ({"g": np.ma.masked_array(np.ones((2, 2)))}, marble.InvalidProblem, ""),
    ({}, marble.InvalidArgument, "count: must be given where no array is"),
    ({"count": -1}, marble.InvalidArgument, "count is -1: must be a whole number in [0, 100000000]"),
    ({"count": 2**63}, marble.InvalidArgument, ""),
    ({"count": True}, marble.InvalidArgument, ""),
    ({"count": 1, "threads": 0}, marble.InvalidArgument, "threads is 0: must be None or a whole number in [1, 256]"),
    ({"count": 1, "threads": 257}, marble.InvalidArgument, ""),
    ({"count": 1, "start": 3}, marble.InvalidArgument, "start is int: must be a BatchResult"),
    ({"count": 1, "x0": [[1, 2]]}, TypeError, ""),
])
def test_bad_arguments_are_named_and_nothing_has_changed(given, error, text):
    solver = marble.BatchSolver(tiny())
    with pytest.raises(error) as raised:
        solver.solve(**given)
    assert not text or str(raised.value) == text
    assert solver.solve(count=2).solved.all()


def test_a_start_of_another_batch_is_refused():
    solver, other = marble.BatchSolver(tiny()), marble.BatchSolver(random_problem(3))
    for start, text in ((solver.solve(count=2), "multipliers"), (solver.solve(count=3, multipliers=True), "2 elements"),
                        (other.solve(count=2, multipliers=True), "pattern")):
        with pytest.raises(marble.InvalidArgument, match=text):
            solver.solve(count=2, start=start)


def test_options_are_those_of_a_solve():
    with pytest.raises(marble.InvalidArgument, match="explain"):
        marble.BatchSolver(tiny(), explain=True)
    with pytest.raises(marble.InvalidArgument, match="max_iterations"):
        marble.BatchSolver(tiny(), options={"max_iterations": -1})
    late = marble.BatchSolver(tiny(), time_limit_s=0.0).solve(count=5)
    assert set(late.status) == {marble.Status.TIME_LIMIT} and not late.solved.any()
    assert np.isnan(late.z).all() and np.isnan(late.objective).all() and not late.factorizations.any()


def test_ctrl_c_ends_a_batch_and_the_next_one_runs():
    program = f"""
import os, signal, sys, threading, time
sys.path.insert(0, {str(pathlib.Path(__file__).parent)!r})
from support import long_solve, tiny
import marble
problem, options = long_solve()
solver = marble.BatchSolver(problem, options=options)
main = threading.get_ident()
def interrupt():
    while sys._current_frames()[main].f_code.co_name != "solve":
        time.sleep(0.01)
    time.sleep(0.05)
    os.kill(os.getpid(), signal.SIGINT)
threading.Thread(target=interrupt).start()
try:
    solver.solve(count=3, threads=2)
except KeyboardInterrupt:
    print("interrupted", marble.BatchSolver(tiny()).solve(count=2).solved.all())
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120,
                          env=clean_environment(PYTHONPATH=":".join(sys.path)))
    assert done.stdout == "interrupted True\n", done.stderr
