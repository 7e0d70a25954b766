"""Errors have field, index and bound; and nothing hangs."""

from __future__ import annotations

import grpc
import numpy as np
import pytest
import scipy.sparse as sp
from support import long_solve, tiny, wait_until

import marble
from marble import errors
from marble.base import contract, tables


@pytest.mark.parametrize(("parts", "field", "index"), [
    ({"g": []}, "g", None),
    ({"g": [1, np.nan]}, "g", 1),
    ({"g": ["x"]}, "g", None),
    ({"g": [1, 2], "Q": np.eye(3)}, "Q", None),
    ({"g": [1, 2], "Q": [[1, 2], [0, 1]]}, "Q", (0, 1)),
    ({"g": [1, 2], "A": [[1, 2, 3]]}, "A", None),
    ({"g": [1, 2], "A": sp.csc_matrix([[0, np.inf]])}, "A", (0, 1)),
    ({"g": [1, 2], "A": [[1, 2]], "b": [1, 2]}, "b", None),
    ({"g": [1, 2], "b": [1]}, "b", None),
    ({"g": [1, 2], "L": [[1, 2]]}, "R", None),
    ({"g": [1, 2], "z0": [1]}, "z0", None),
    ({"g": [1, 2], "c0": np.inf}, "c0", 0),
])
def test_a_bad_problem_is_refused_before_anything_is_sent(parts, field, index):
    with pytest.raises(marble.InvalidProblem) as caught:
        marble.LCQP(parts.pop("Q", None), parts.pop("g"), **parts)
    assert (caught.value.field, caught.value.index) == (field, index)
    assert isinstance(caught.value, ValueError) and caught.value.bound in str(caught.value)


@pytest.mark.parametrize(("above", "below", "fits"), [
    (1.0, 1.0 + 5e-13, True),
    (1.0, 1.0 + 5e-10, True),  # of the rows' largest entries, which are 1e3
    (1.0, 1.0 + 2e-9, False),
    (1e-15, 0.0, True),  # what should be zero
    (0.0, -1e-10, True),
    (0.0, 1e-8, False),
])
def test_q_is_symmetric_to_the_server_s_tolerance(above, below, fits):
    Q = [[1e3, above], [below, 1e3]]
    if fits:
        assert marble.LCQP(Q, [0, 0]).Q[0, 1] == above
        return
    with pytest.raises(marble.InvalidProblem, match=r"must be symmetric, as \(Q \+ Q.T\) / 2 is") as caught:
        marble.LCQP(Q, [0, 0])
    assert (caught.value.field, caught.value.index) == ("Q", (0, 1))


def test_products_of_matrices_are_symmetric_enough_and_the_upper_triangle_counts():
    for seed in range(20):
        B = np.random.default_rng(seed).normal(size=(150, 150))
        weights = np.random.default_rng(seed + 1000).normal(size=150)  # indefinite: diagonals cancel
        Q = B.T @ (weights[:, None] * B)
        assert not (Q == Q.T).all()
        for form in (np.asarray, sp.csc_matrix, sp.csr_matrix):
            taken = marble.LCQP(form(Q), np.zeros(150))
            np.testing.assert_array_equal(taken.Q.toarray(), np.triu(Q))
        Q[70, 3] += 1e-6
        with pytest.raises(marble.InvalidProblem) as caught:
            marble.LCQP(Q, np.zeros(150))
        assert caught.value.index == (3, 70)
    condensed = [[4, 0, 1e-17], [0, 2, 0], [0, 0, 3]]
    assert marble.solve(condensed, [-4, -2, -3], server="local").z == pytest.approx([1, 1, 1])
    with pytest.raises(marble.InvalidProblem):  # the size of another variable is no excuse
        marble.LCQP([[4, 0, 1e-6], [0, 1e20, 0], [0, 0, 3]], [0, 0, 0])


def test_every_code_of_the_contract_has_an_exception_of_its_own():
    seen = {}
    for code, name in tables.ERRORS.items():
        error = errors.from_status(contract.message("google.rpc.Status")(code=code, message="m"))
        assert seen.setdefault(name, type(error)) is type(error)
        if code != 12:  # UNIMPLEMENTED: no Marble server
            assert grpc.StatusCode[name.upper()].value[0] == code
    assert len(set(seen.values())) == len(seen) and marble.Error not in seen.values()


def test_every_status_says_what_to_try():
    assert [status.value for status in marble.Status] == list(contract.enum_numbers("Status"))[1:]
    assert all(status.advice for status in marble.Status if status is not marble.Status.SOLVED)


PLACES = [
    ("problem.gradient", 3, "g", 3),
    ("solve.problem.equality_matrix.values", 7, "A.values", 7),
    ("update.problem.hessian_values", 2, "Q.values", 2),
    ("setup.options.max_iterations", None, "max_iterations", None),
    ("initial_point.z", 1, "z0", 1),
    ("warm_start.complementarity_multipliers_l", 5, "warm_start.xi", 5),
    ("update.shift.pairs[2].by", None, "shift.pairs[2].by", None),
]


def _invalid(*details):
    status = contract.message("google.rpc.Status")(code=3, message="m")
    for name, message in details:
        status.details.add(type_url="type.googleapis.com/" + name, value=message.SerializeToString())
    return errors.from_status(status)


def _bad_request(path, index, description):
    packed = contract.message("google.rpc.BadRequest")()
    packed.field_violations.add(field=path if index is None else f"{path}[{index}]", description=description)
    return "google.rpc.BadRequest", packed


@pytest.mark.parametrize(("path", "entry", "field", "index"), PLACES)
def test_the_server_s_fields_become_the_letters_of_the_equation(path, entry, field, index):
    fault = contract.message("Fault")(field=path, index=entry, value="is this, or that", bound="must be, well, finite")
    error = _invalid(_bad_request(path, entry, "prose"), ("marble.v1.Fault", fault))
    assert (error.field, error.index) == (field, index)
    assert (error.value, error.bound) == ("is this, or that", "must be, well, finite"), "no prose is taken apart"
    assert isinstance(error, marble.InvalidProblem) == field.startswith(("g", "A", "Q", "z0"))


@pytest.mark.parametrize(("path", "entry", "field", "index"), PLACES)
def test_an_older_server_s_errors_have_their_place_and_its_words(path, entry, field, index):
    error = _invalid(_bad_request(path, entry, "is nan, must be finite"))
    assert (error.field, error.index, error.value, error.bound) == (field, index, "", "is nan, must be finite")


@pytest.mark.parametrize(("options", "field"), [
    ({"max_iterations": -1}, "max_iterations"),
    ({"path": "scenic"}, "path"),
    ({"no_such": 1}, "no_such"),
    ({"polish": "very"}, "polish"),
    ({"num_starts": 0}, "num_starts"),
    ({"relative_gap_tolerance": 1.0}, "relative_gap_tolerance"),
    ({"relative_gap_tolerance": -1e-9}, "relative_gap_tolerance"),
    ({"node_limit": 0}, "node_limit"),
])
def test_a_bad_option_is_reported_by_its_name(client, options, field):
    with pytest.raises(marble.InvalidArgument) as caught:
        client.solve(tiny(), options=options)
    assert caught.value.field == field


def test_bad_arguments_of_a_call_are_refused(client):
    for wrong, field in (({"priority": "urgent"}, "priority"), ({"request_id": "\n"}, "request_id"),
                         ({"deadline": 0}, "deadline"), ({"progress_interval": -1, "progress": print},
                                                         "progress_interval")):
        with pytest.raises(marble.InvalidArgument) as caught:
            client.solve(tiny(), **wrong)
        assert caught.value.field == field


@pytest.mark.parametrize("address", ["nowhere", "host:0", "host:99999", ":1", "unix:", "a:1,unix:/b", ""])
def test_a_bad_address_is_reported_at_once(address):
    with pytest.raises((marble.InvalidArgument, marble.Unavailable)):
        marble.Client(address)


def test_nobody_there_is_unavailable():
    with marble.Client("127.0.0.1:1") as client, pytest.raises(marble.Unavailable):
        client.solve(tiny(), deadline=30)


def test_a_full_queue_refuses_and_says_when_to_come_again(start_server):
    server = start_server("--workers", "1", "--queue-jobs", "1")
    problem, options = long_solve()
    with marble.Client(server.address) as client:
        running = client.solve_async(problem, options=options)
        assert wait_until(lambda: client.info().counters["running"] == 1)
        waiting = client.solve_async(tiny())
        assert wait_until(lambda: client.info().counters["queued"] == 1)
        with pytest.raises(marble.Refused) as caught:
            client.solve(tiny())
        assert caught.value.retry_after is not None and caught.value.retry_after > 0
        running.cancel()
        assert waiting.result(60).solved


def test_a_message_beyond_the_limit_is_refused(start_server):
    server = start_server("--message-bytes", "2000")
    with marble.Client(server.address) as client, pytest.raises(marble.Refused):
        client.solve(marble.LCQP(None, np.ones(1000)))


def test_the_text_of_an_error_names_everything():
    error = marble.InvalidProblem("A", "must be finite", index=(1, 2), value=float("nan"))
    assert str(error) == "A[1, 2] is nan: must be finite"
