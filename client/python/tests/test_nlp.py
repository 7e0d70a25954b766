"""Nonlinear problems of Python functions: the C++ loop, called back."""

from __future__ import annotations

import dataclasses

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


@pytest.mark.parametrize("method", ["slp", "penalty", "alag", "barrier"])
def test_other_methods_end_there_too(method):
    rows = []
    answer = marble.nlp.solve(circle, slopes, [2, 2], hessian=curvature, nonlinear_method=method, progress=rows.append)
    assert answer.solved and np.allclose(answer.x, [1, 3], atol=1e-5), answer.detail
    assert answer.b_stationary is (True if method == "slp" else None)
    assert rows[0].objective == 12 and [row.iteration for row in rows] == sorted({row.iteration for row in rows})


def test_methods_that_do_not_fit_say_so():
    def refused(**settings):
        with pytest.raises(marble.InvalidArgument) as caught:
            marble.nlp.solve(circle, slopes, **settings)
        return caught.value.field

    assert refused(x0=[2, 2], nonlinear_method="newton") == "nonlinear_method"
    assert refused(x0=[2, 2], nonlinear_method="slp", curvature="bfgs") == "settings.curvature"
    assert refused(x0=[1, 1], nonlinear_method="barrier") == "values.inequalities"  # it begins inside


def gate(x):
    """A pair that keeps the point off (1, 2), where its residuals are zero."""
    return {"objective": 0, "residuals": x - [1, 2], "G": [np.sin(x[0])], "H": [x[1]]}


def gate_slopes(x):
    return {"gradient": [0, 0], "residuals": np.eye(2), "G": sp.csc_matrix(([np.cos(x[0])], ([0], [0])), (1, 2)),
            "H": sp.csc_matrix([[0.0, 1.0]])}


def test_a_pair_keeps_one_side_at_zero():
    answer = marble.nlp.solve(gate, gate_slopes, [0.5, 0.5], lower=[-1, -1], upper=[1.5, 3])
    assert answer.solved and np.allclose(answer.x, [0, 2], atol=1e-8)
    assert answer.objective == pytest.approx(0.5)


@pytest.mark.parametrize("stored", [sp.coo_matrix, sp.csr_matrix, sp.csc_matrix, sp.lil_matrix, sp.csr_array])
def test_sparse_jacobians_may_be_stored_in_any_way(stored):
    """A chain x[k + 1] = x[k] + 0.1 sin x[k] + u[k], whose pushes are small and whose pairs keep it from falling."""
    n = 30
    entries = np.concatenate([np.arange(n), np.arange(1, n), np.arange(n)])
    columns = np.concatenate([np.arange(n), np.arange(n - 1), n + np.arange(n)])

    def values(z):
        x, u = z[:n], z[n:]
        before = np.concatenate([[1.0], x[:-1]])
        return {"objective": 0.5 * u @ u + 0.5 * np.sum((x - 2) ** 2),
                "equalities": x - before - 0.1 * np.sin(before) + u, "G": u, "H": x - 0.5}

    def derivatives(z):
        x, u = z[:n], z[n:]
        numbers = np.concatenate([np.ones(n), -1 - 0.1 * np.cos(x[:-1]), np.ones(n)])
        made = sp.coo_matrix((numbers, (entries, columns)), (n, 2 * n))
        return {"gradient": np.concatenate([x - 2, u]), "equalities": stored(made),
                "G": stored(sp.eye(n, 2 * n, k=n)), "H": stored(sp.eye(n, 2 * n))}

    answer = marble.nlp.solve(values, derivatives, np.concatenate([np.ones(n), np.zeros(n)]), blocks=[n, n])
    at = values(answer.x)
    assert answer.solved and answer.b_stationary, answer.detail
    assert np.abs(at["equalities"]).max() < 1e-6 and np.abs(np.minimum(at["G"], at["H"])).max() < 1e-6


def bits(answer):
    return [np.asarray(getattr(answer, field.name)).tobytes() if field.name not in ("status", "detail")
            else getattr(answer, field.name) for field in dataclasses.fields(answer)]


@pytest.mark.parametrize("named_by", ["client", "address", "environment"])
def test_on_a_server_every_bit_is_as_in_process(server, client, named_by, monkeypatch):
    there = {"client": client, "address": server.address, "environment": None}[named_by]
    here = (marble.nlp.solve(circle, slopes, [3, 5], hessian=curvature),
            marble.nlp.solve(gate, gate_slopes, [0.5, 0.5], lower=[-1, -1], upper=[1.5, 3]),
            marble.nlp.solve(lambda x: {"objective": x[0], "equalities": [x @ x + 1]},
                             lambda x: {"gradient": [1, 0], "equalities": [2 * x]}, [1, 1]))
    assert [answer.solved for answer in here] == [True, True, False]  # the last by elastic subproblems
    if named_by == "environment":
        monkeypatch.setenv("MARBLE_SERVER", server.address)
    served = (marble.nlp.solve(circle, slopes, [3, 5], hessian=curvature, server=there),
              marble.nlp.solve(gate, gate_slopes, [0.5, 0.5], lower=[-1, -1], upper=[1.5, 3], server=there),
              marble.nlp.solve(lambda x: {"objective": x[0], "equalities": [x @ x + 1]},
                               lambda x: {"gradient": [1, 0], "equalities": [2 * x]}, [1, 1], server=there))
    assert list(map(bits, served)) == list(map(bits, here))


def test_each_subproblem_is_an_update_of_a_session_that_ends_with_the_solve(server, client):
    before = client.info().counters
    answer = marble.nlp.solve(circle, slopes, [3, 5], hessian=curvature, server=client)
    assert answer.solved and answer.ticks > 2
    after = client.info().counters
    assert after["sessions"] == before["sessions"]
    assert after["updates_total"] - before["updates_total"] == answer.ticks


def test_a_server_that_dies_is_reported_in_words(start_server):
    one, calls = start_server(), []

    def killing(x):
        calls.append(x)
        if len(calls) == 3:
            one.kill()
        return circle(x)

    with pytest.raises(marble.Unavailable):
        marble.nlp.solve(killing, slopes, [3, 5], hessian=curvature, server=one.address)


class TwoServers:
    """Behind one address; the one that has a session can be killed."""

    def __init__(self, start_server):
        self.servers = [start_server(), start_server()]
        self.address = ",".join(server.address for server in self.servers)

    def kill_the_one_in_use(self):
        for server in list(self.servers):
            with marble.Client(server.address) as alone:
                used = alone.info().counters["sessions"] > 0
            if used:
                server.kill()
                self.servers.remove(server)


def test_with_reopen_a_solve_goes_on_elsewhere(start_server):
    two, calls = TwoServers(start_server), []

    def killing(x):
        calls.append(x)
        if len(calls) == 2:
            two.kill_the_one_in_use()
        return circle(x)

    answer = marble.nlp.solve(killing, slopes, [2, 2], hessian=curvature, server=two.address, reopen=True)
    assert len(two.servers) == 1 and answer.solved and answer.reopened == 1, answer
    assert np.allclose(answer.x, [1, 3], atol=1e-8)
    two.servers[0].kill()
    with pytest.raises(marble.Unavailable):
        marble.nlp.solve(circle, slopes, [3, 5], hessian=curvature, server=two.address, reopen=True)


@pytest.mark.parametrize("prepared", [False, True])
def test_real_time_iteration_ends_in_words_or_goes_on_elsewhere(start_server, prepared):
    def ticks(reopen):
        two = TwoServers(start_server)
        with marble.nlp.RealTime(gate, gate_slopes, [0.5, 0.5], lower=[-1, -1], upper=[1.5, 3], server=two.address,
                                 reopen=reopen) as loop:
            for number in range(6):
                if number == 3 and not prepared:
                    two.kill_the_one_in_use()
                loop.prepare()
                if number == 3 and prepared:
                    two.kill_the_one_in_use()
                yield loop.feedback([])

    steps = list(ticks(reopen=True))
    assert [tick.reopened for tick in steps] == [0, 0, 0, 1, 0, 0] and {tick.outcome for tick in steps} == {"answered"}
    assert np.allclose(steps[-1].x, [0, 2], atol=1e-6)
    with pytest.raises(marble.Unavailable):
        list(ticks(reopen=False))


def test_the_time_limit_ends_it_on_a_server_too(client):
    answer = marble.nlp.solve(circle, slopes, [3, 5], hessian=curvature, server=client, time_limit_s=1e-9)
    assert answer.status is marble.Status.TIME_LIMIT and answer.x.tolist() == [3, 5]


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

    infinite = marble.nlp.solve(circle, slopes, [2, 2], hessian=lambda x, m: [[1, 0], [0, np.inf]])
    assert infinite.solved and "Hessians were not finite" in infinite.detail

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


def test_real_time_iteration_follows_what_is_measured(server):
    """A mass on a line before a wall, ten stages of position, speed, force and the wall's push."""
    stages, h, parts = 10, 0.1, 4
    n = 2 + parts * stages

    def values(x):
        s, before = x[2:].reshape(stages, parts), np.vstack([x[:2], x[2:].reshape(stages, parts)[:-1, :2]])
        position = s[:, 0] - before[:, 0] - h * s[:, 1]
        speed = s[:, 1] - before[:, 1] - h * (s[:, 2] - s[:, 3] - 0.5 * np.sin(s[:, 0]))
        return {"objective": 0.0, "residuals": np.concatenate([s[:, 0] - 2, 0.1 * s[:, 1], 0.1 * s[:, 2]]),
                "equalities": np.column_stack([position, speed]).ravel(), "G": 1 - s[:, 0], "H": s[:, 3]}

    def derivatives(x):
        E, R = sp.lil_matrix((2 * stages, n)), sp.lil_matrix((3 * stages, n))
        G, H = sp.lil_matrix((stages, n)), sp.lil_matrix((stages, n))
        for k in range(stages):
            at, last = 2 + parts * k, max(0, 2 + parts * (k - 1)) if k else 0
            E[2 * k, at], E[2 * k, last], E[2 * k, at + 1] = 1, -1, -h
            E[2 * k + 1, at + 1], E[2 * k + 1, last + 1] = 1, -1
            E[2 * k + 1, at + 2], E[2 * k + 1, at + 3], E[2 * k + 1, at] = -h, h, 0.5 * h * np.cos(x[at])
            G[k, at], H[k, at + 3] = -1, 1
            R[k, at], R[stages + k, at + 1], R[2 * stages + k, at + 2] = 1, 0.1, 0.1
        given = {"equalities": E, "G": G, "H": H, "residuals": R}
        return {"gradient": np.zeros(n), **{name: matrix.tocsc() for name, matrix in given.items()}}

    block = marble.ShiftBlock
    shift = marble.Shift(variables=[block(0, 4, 2), block(2, parts * stages, parts)],
                         equalities=[block(0, 2 * stages, 2)], pairs=[block(0, stages, 1)])
    loops = [marble.nlp.RealTime(values, derivatives, np.zeros(n), variables=[0, 1], shift=shift, server=where)
             for where in ("local", server.address)]
    ends = []
    for loop in loops:
        with loop:
            state = np.zeros(2)
            for _ in range(20):
                loop.prepare()
                tick = loop.feedback(state)
                assert tick.outcome == "answered" and tick.deadline_met and tick.ticks == 1, tick.why
                assert np.allclose(tick.x[:2], state, atol=1e-9)
                state = tick.x[2:4]
            late = loop.feedback(state, 0.0)
            assert (late.outcome, late.deadline_met) == ("shifted", False) and late.why
            ends.append(tick)
    assert ends[0].x.tobytes() == ends[1].x.tobytes() and ends[0].factorizations == ends[1].factorizations
    assert abs(ends[0].x[0] - 1) < 1e-6 and np.max(np.abs(values(ends[0].x)["equalities"])) < 1e-6  # at the wall


def test_real_time_iteration_names_what_it_cannot_take():
    def refused(**settings):
        with pytest.raises(marble.InvalidArgument) as wrong:
            marble.nlp.RealTime(gate, gate_slopes, [0.5, 0.5], server="local", **settings)
        return wrong.value.field

    assert refused(variables=[2]) == "measured.variables" and refused(equalities=[0]) == "measured.equalities"
    assert refused(fallback="none") == "fallback" and refused(curvature="bfgs") == "settings.curvature"
    with marble.nlp.RealTime(gate, gate_slopes, [0.5, 0.5], server="local") as loop:
        with pytest.raises(marble.InvalidArgument) as wrong:
            loop.feedback([1.0])
        assert wrong.value.field == "measurement"
        assert np.allclose(loop.feedback([]).x, [0, 2], atol=0.2)


LOGISTIC = 1 / (1 + np.exp(-1))
POLES = {  # the solution; the objective with its first and second derivative
    "x - log x": (1, lambda x: (x - np.log(x), 1 - 1 / x, x**-2)),
    "1/x + x": (1, lambda x: (1 / x + x, 1 - x**-2, 2 * x**-3)),
    "(log x - 1)^2": (np.e, lambda x: ((np.log(x) - 1) ** 2, 2 * (np.log(x) - 1) / x, 2 * (2 - np.log(x)) / x**2)),
    "x log x": (1 / np.e, lambda x: (x * np.log(x), np.log(x) + 1, 1 / x)),
    "x^1.5 - x": (4 / 9, lambda x: (x**1.5 - x, 1.5 * x**0.5 - 1, 0.75 * x**-0.5)),
    "x - sqrt x": (1 / 4, lambda x: (x - x**0.5, 1 - 0.5 * x**-0.5, 0.25 * x**-1.5)),
    "1/x^2 + x": (2 ** (1 / 3), lambda x: (x**-2 + x, 1 - 2 * x**-3, 6 * x**-4)),
    "1/sqrt x + x": (0.5 ** (2 / 3), lambda x: (x**-0.5 + x, 1 - 0.5 * x**-1.5, 0.75 * x**-2.5)),
    "(1/x - 1)^2": (1, lambda x: ((1 / x - 1) ** 2, -2 * (1 / x - 1) / x**2, 6 * x**-4 - 4 * x**-3)),
    "100 x - log x": (0.01, lambda x: (100 * x - np.log(x), 100 - 1 / x, x**-2)),
    "exp(x) - e log x": (1, lambda x: (np.exp(x) - np.e * np.log(x), np.exp(x) - np.e / x, np.exp(x) + np.e * x**-2)),
    "softplus barrier": (1, lambda x: (np.log1p(np.exp(x)) - LOGISTIC * np.log(x), 1 / (1 + np.exp(-x)) - LOGISTIC / x,
                                       1 / (2 + np.exp(x) + np.exp(-x)) + LOGISTIC * x**-2)),
}


@pytest.mark.parametrize("start", [0, 1e-2, 1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("name", POLES)
def test_starts_near_a_pole_are_left_within_50_lcqps(name, start):
    solution, at = POLES[name]
    with np.errstate(all="ignore"):
        def solved(**hessian):
            return marble.nlp.solve(lambda x: {"objective": at(x[0])[0]}, lambda x: {"gradient": [at(x[0])[1]]},
                                    [start], lower=[0], upper=[10], server="local", **hessian)

        exact, updated = solved(hessian=lambda x, _: np.array([[at(x[0])[2]]])), solved()
    assert exact.solved and exact.ticks <= 50 and exact.x[0] == pytest.approx(solution, abs=1e-6), exact.detail
    assert updated.ticks <= 50 and updated.x[0] == pytest.approx(solution, abs=5e-6), updated.detail
    assert updated.solved or "almost stationary" in updated.detail


@pytest.mark.parametrize("start", [0, 1e-2, 1e-4, 1e-6, 1e-8])
def test_casadis_barrier_beside_a_pair_is_left_within_50_lcqps(start):
    casadi = pytest.importorskip("casadi", reason="casadi is not installed (it is not in Debian)")
    x = casadi.SX.sym("x", 3)
    problem = {"x": x, "f": x[0] - casadi.log(x[0]) + (x[1] - 1) ** 2 + (x[2] - 2) ** 2, "G": x[1], "H": x[2]}
    answer = marble.nlp.solve_casadi(problem, [start, 0, 1.5], lbx=0, ubx=10, server="local")
    assert answer.solved and answer.ticks <= 50 and np.allclose(answer.x, [1, 0, 2], atol=1e-6), answer.detail


def test_a_zero_step_is_no_solution_where_x_is_not_stationary():
    cases = ((1e-7, 1e6, "solved"), (5e-5, 1e6, "almost_solved"), (1, 1e15, "numerical_failure"))
    for slope, curvature, status in cases:
        answer = marble.nlp.solve(lambda x: {"objective": 1}, lambda x, slope=slope: {"gradient": [slope]}, [0],
                                  hessian=lambda x, _, curvature=curvature: np.array([[curvature]]), server="local")
        assert answer.status.value == status and answer.kkt_residual == slope and "zero" in answer.detail
