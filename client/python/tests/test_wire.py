"""Arrays cross to the wire and back as protobuf itself would write and read them."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from support import random_problem

import marble
from marble.base import contract
from marble.message import answers, requests, wire
from marble.message.requests import Call


@pytest.mark.parametrize("largest", [1, 127, 128, 16383, 16384, 2**21 - 1, 2**21, 2**28, 2**31 - 1])
def test_integers_are_written_as_protobuf_writes_them(largest):
    values = np.unique(np.geomspace(1, largest, 50).astype(np.int64)) - 1
    values = np.append(values, largest)
    part = wire.Encoder("SparseMatrix")
    part.integers("row_indices", values)
    expected = contract.message("SparseMatrix")(row_indices=values.tolist()).SerializeToString()
    assert part.finish() == expected


def test_a_request_reads_back_as_the_problem_that_was_given():
    problem = next(p for p in map(random_problem, range(99)) if min(p.sizes) > 0)
    message = contract.message("SolveRequest").FromString(
        requests.solve(problem, Call({"path": "paper", "polish": False}, "batch", "id")))
    assert list(message.problem.gradient) == problem.g.tolist()
    assert list(message.problem.equality_matrix.values) == problem.A.data.tolist()
    assert list(message.problem.equality_matrix.column_pointers) == problem.A.indptr.tolist()
    assert list(message.problem.hessian.row_indices) == problem.Q.indices.tolist()
    assert (message.problem.hessian_form, message.priority, message.request_id) == (2, 3, "id")
    assert (message.options.path, message.options.polish) == (2, False)


def test_an_answer_decodes_to_the_numbers_that_were_encoded():
    response = contract.message("SolveStreamResponse")()
    response.result.job_id = "j"
    response.result.solution.z.extend([1.5, -0.0, 5e-324])
    response.result.solution.violations.equality = 0.25
    response.result.solution.certificate.extend([7.0])
    message, arrays = wire.decode("SolveStreamResponse", response.SerializeToString())
    assert message.result.job_id == "j" and message.result.solution.violations.equality == 0.25
    assert arrays["result.solution.z"].tobytes() == np.array([1.5, -0.0, 5e-324]).tobytes()
    assert arrays["result.solution.certificate"].tolist() == [7.0]
    assert len(message.result.solution.z) == 0


def test_a_word_of_python_names_an_option_with_an_underscore_behind():
    assert getattr(requests.options_message({"global_": True, "node_limit": 3}), "global") is True
    assert getattr(requests.options_message({"global": True}), "global") is True
    with pytest.raises(marble.InvalidArgument, match="starts_"):
        requests.options_message({"starts_": 2})


def test_what_a_tree_does_not_know_is_infinite_and_what_it_knows_comes_as_it_was_sent():
    response = contract.message("SolveResponse")()
    response.solution.status = 1
    plain = answers.solve_response(response.SerializeToString(), None)
    assert (plain.proved, plain.bound, plain.gap, plain.nodes) == (False, -np.inf, np.inf, 0)
    tree = dict(proved=True, bound=np.inf, gap=0.25, nodes=2**40, open_nodes=7, warm_nodes=8)
    for name, value in tree.items():
        setattr(response.solution, name, value)
    told = answers.solve_response(response.SerializeToString(), None)
    assert {name: getattr(told, name) for name in tree} == tree
    row = contract.message("Progress")(nodes=1, incumbent=-3.0)
    progress = answers.progress(row)
    assert (progress.incumbent, progress.bound, progress.gap, progress.nodes) == (-3.0, -np.inf, np.inf, 1)
    row.ClearField("incumbent")
    assert answers.progress(row).incumbent == np.inf


def test_the_enums_are_those_of_the_contract():
    for kind in (marble.Status, marble.Stationarity, marble.SecondOrder, marble.Priority, marble.JobKind,
                 marble.JobState):
        names = set(contract.enum_names(kind.__name__).values()) - {"unspecified"}
        assert {member.value for member in kind} == names


@pytest.mark.parametrize("kind", [sp.csc_matrix, sp.csr_matrix, sp.coo_matrix, sp.csr_array, sp.lil_matrix, np.array])
def test_any_form_of_a_matrix_gives_the_same_bytes(kind):
    dense = [[4.0, 1.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, 2.0]]
    A = [[0.0, 2.0, 1.0]]
    reference = requests.solve(marble.LCQP(dense, [1, 2, 3], A=A), Call())
    assert requests.solve(marble.LCQP(kind(dense), [1, 2, 3], A=kind(A)), Call()) == reference


def test_unsorted_and_repeated_entries_add_up():
    coo = sp.coo_matrix(([1.0, 2.0, 3.0], ([0, 0, 0], [1, 1, 0])), shape=(1, 2))
    problem = marble.LCQP(None, [1, 1], A=coo)
    assert problem.A.toarray().tolist() == [[3.0, 3.0]] and problem.A.indices.tolist() == [0, 0]


def test_the_problem_owns_its_arrays():
    g, A = np.ones(2), sp.csc_matrix(np.ones((1, 2)))
    problem = marble.LCQP(None, g, A=A)
    g[:] = 5
    A.data[:] = 5
    assert problem.g.tolist() == [1, 1] and problem.A.data.tolist() == [1, 1]
