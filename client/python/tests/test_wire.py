"""Arrays cross to the wire and back as protobuf itself would write and read them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import scipy.sparse as sp
from support import random_problem

import marble
from marble.base import contract
from marble.base.fields import name_in_message
from marble.message import answers, records, requests, wire
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


def test_an_option_is_set_by_its_name():
    message = requests.options_message({"global_search": True, "node_limit": 3})
    assert message.global_search is True and message.node_limit == 3
    with pytest.raises(marble.InvalidArgument, match="num_starts_"):
        requests.options_message({"num_starts_": 2})


def test_what_a_tree_does_not_know_is_infinite_and_what_it_knows_comes_as_it_was_sent():
    response = contract.message("SolveResponse")()
    response.solution.status = 1
    plain = answers.solve_response(response.SerializeToString(), None)
    assert (plain.proved, plain.bound, plain.gap, plain.nodes) == (False, -np.inf, np.inf, 0)
    tree = dict(proved=True, bound=np.inf, gap=0.25, nodes=2**40, open_nodes=7, reused_nodes=8)
    for name, value in tree.items():
        setattr(response.solution, name, value)
    read = answers.solve_response(response.SerializeToString(), None)
    assert {name: getattr(read, name) for name in tree} == tree
    row = contract.message("Progress")(nodes=1, incumbent=-3.0)
    progress = answers.progress(row)
    assert (progress.incumbent, progress.bound, progress.gap, progress.nodes) == (-3.0, -np.inf, np.inf, 1)
    row.ClearField("incumbent")
    assert answers.progress(row).incumbent == np.inf


# What Python leaves out of a message, or has in another class.
ELSEWHERE = {"Solution": {"coupled", "scenarios"}, "Progress": {"stage", "scenarios"},
             "CoupledOutcome": {"coupling_multipliers"}, "JobEvent": {"pairs"}}


@pytest.mark.parametrize(("kind", "message"), [
    (marble.Solution, "Solution"), (marble.Times, "Times"), (marble.Violations, "Violations"),
    (marble.Conflict, "Conflict"), (marble.Progress, "Progress"), (marble.SampleAverageStage, "SampleAverageStage"),
    (marble.OutOfSample, "OutOfSample"), (marble.Coordination, "CoupledOutcome"), (marble.Job, "JobInfo"),
    (marble.ArrayProgress, "ArrayProgress"), (marble.Trace, "Trace"), (marble.PairSides, "PairSides"),
    (marble.JobDetails, "GetJobResponse"), (marble.Infeasibility, "Infeasibility"),
    (marble.JobPage, "ListJobsResponse"), (marble.JobEvent, "JobEvent"),
    (marble.Submitted, "SubmitResponse"), (marble.SubmittedArray, "SubmitArrayResponse"),
    (marble.ServerInfo, "GetInfoResponse")], ids=lambda value: value if isinstance(value, str) else "")
def test_every_field_of_a_message_has_its_attribute(kind, message):
    known = {name_in_message(field.name, field.metadata).partition(".")[0] for field in dataclasses.fields(kind)}
    assert set(contract.descriptor(message).fields_by_name) - known == ELSEWHERE.get(message, set())


def test_a_field_that_a_server_does_not_know_takes_its_default():
    assert answers.solve_response(b"\x12\x02\x08\x01", None).origin is marble.PointOrigin.SOLVE
    job = records.read(marble.Job, contract.message("JobInfo")(kind=1, state=2, priority=3))
    assert (job.status, job.error, job.array, job.stages, job.activity) == (None, None, None, (), "")
    assert (job.incumbent, job.bound, job.gap, job.sizes) == (np.inf, -np.inf, np.inf, (0, 0, 0, 0))
    assert records.read(marble.Trace, contract.message("Trace")()).stride == 1


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
