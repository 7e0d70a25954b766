"""Arrays: many problems as one job."""

from __future__ import annotations

import asyncio
import concurrent.futures
import itertools
import pickle

import numpy as np
import pytest
from support import Relay, Server, check, long_solve, random_problem, tiny, wait_until

import marble
import marble.aio


def _gap(number: int) -> dict[str, object]:
    """New numbers for tiny(): its objective is then number²."""
    return {"g": [-2.0 * number, -2.0], "c0": float(number**2)}


def test_every_problem_of_an_array_is_answered_once(client):
    problems = [random_problem(seed) for seed in range(100)]
    array = client.jobs.submit_array(problems, name="hundred")
    assert array.elements == 100
    answers = list(client.jobs.array(array.job_id, problems=problems))
    assert sorted(answer.index for answer in answers) == list(range(100))
    assert [answer.sequence for answer in answers] == list(range(1, 101))
    for answer in answers:
        check(problems[answer.index], answer.result())
    job = client.jobs.get(array.job_id).job
    assert job.kind is marble.JobKind.ARRAY and job.problem_name == "hundred" and job.state is marble.JobState.FINISHED
    assert job.array == marble.ArrayProgress(elements=100, done=100, solved=100, failed=0)
    assert client.jobs.get(client.jobs.submit(tiny()).job_id).job.array is None


def test_new_numbers_for_a_base_answer_as_whole_problems(client):
    base = random_problem(7)
    wholes = [base.replaced(g=base.g * scale, b=base.b * scale, A=base.A * 2.0) for scale in (0.5, 1.0, 2.0)]
    changes = [{"g": whole.g, "b": whole.b, "A": whole.A} for whole in wholes]
    array = client.jobs.submit_array([*changes, {}, marble.ArrayItem()], base=base)
    answers = {answer.index: answer.result() for answer in client.jobs.array(array.job_id)}
    for index, whole in enumerate([*wholes, base, base]):
        np.testing.assert_array_equal(answers[index].z, client.solve(whole).z)


def test_items_have_options_and_starts_of_their_own(client):
    start = client.solve(tiny())
    items = [marble.ArrayItem(options={"max_iterations": 7}), marble.ArrayItem(tiny(), warm_start=start)]
    array = client.jobs.submit_array(items, base=tiny(), options={"max_iterations": 9})
    answers = {answer.index: answer.result() for answer in client.jobs.array(array.job_id)}
    assert [answers[index].options["max_iterations"] for index in (0, 1)] == [7, 9]


def test_an_answer_is_in_the_terms_of_its_problem(client):
    built = marble.Problem(["x"]).minimize([[1.0]], [-3.0]).bound("x", ub=1)
    array = client.jobs.submit_array([built])
    (answer,) = client.jobs.array(array.job_id, problems=[built])
    assert answer.result()["x"] == pytest.approx(1) and answer.result().bound_duals[0] > 0


def test_reading_goes_on_where_it_was_left(client):
    array = client.jobs.submit_array([_gap(number) for number in range(60)], base=tiny())
    first = list(itertools.islice(client.jobs.array(array.job_id), 20))
    rest = list(client.jobs.array(array.job_id, after=first[-1].sequence))
    assert sorted(answer.index for answer in [*first, *rest]) == list(range(60))
    assert list(client.jobs.array(array.job_id, after=60)) == []


def test_errors_name_their_element(client):
    with pytest.raises(marble.InvalidProblem) as caught:
        client.jobs.submit_array([{}, {"g": [1.0]}], base=tiny())
    assert caught.value.field == "elements[1].g"
    with pytest.raises(marble.InvalidArgument, match=r"elements\[0\].problem"):
        client.jobs.submit_array([{"g": [1.0, 2.0]}])
    with pytest.raises(marble.InvalidArgument) as refused:  # by the server
        client.jobs.submit_array([marble.ArrayItem(options={"max_iterations": -1})], base=tiny())
    assert refused.value.field == "elements[0].max_iterations"
    assert pickle.loads(pickle.dumps(refused.value)).field == "elements[0].max_iterations"
    with pytest.raises(marble.InvalidArgument, match="at least one"):
        client.jobs.submit_array([])
    with pytest.raises(marble.NotFound):
        list(client.jobs.array("nowhere"))


def test_a_failed_element_is_an_answer_with_its_error(client):
    problem, options = long_solve()
    array = client.jobs.submit_array(
        [tiny(), *(marble.ArrayItem(problem, options=options) for _ in range(30))])
    answers = client.jobs.array(array.job_id)
    assert next(answers).result().solved
    client.jobs.cancel(array.job_id)
    with pytest.raises(marble.Cancelled):
        list(answers)
    assert client.jobs.get(array.job_id).job.state is marble.JobState.FINISHED


def test_an_array_whose_acceptance_got_lost_is_sent_again_and_is_one_job(server, client):
    problems = [random_problem(seed) for seed in range(100)]
    before = {job.job_id for job in client.jobs.list().jobs}
    with (Relay(server.address) as relay, marble.Client(relay.address) as far,
          concurrent.futures.ThreadPoolExecutor(1) as pool):
        submitted = pool.submit(far.jobs.submit_array, problems)
        assert wait_until(lambda: {job.job_id for job in client.jobs.list().jobs} != before)
        relay.cut()
        array = submitted.result(60)
    assert {job.job_id for job in client.jobs.list().jobs} - before == {array.job_id}
    assert sorted(answer.index for answer in client.jobs.array(array.job_id)) == list(range(100))


def test_a_reader_waits_for_a_server_that_is_killed_and_comes_back(tmp_path):
    state = ("--state-dir", str(tmp_path / "state"), "--job-starts", "1000")
    server = Server(tmp_path, *state)
    with marble.Client(server.address, wait=60) as client:
        array = client.jobs.submit_array([_gap(number) for number in range(400)], base=tiny())
        answers = []
        for answer in client.jobs.array(array.job_id):
            answers.append(answer)
            if len(answers) in (10, 200):
                server.kill()
                server = Server(tmp_path, *state, listen=server.address)
        assert [answer.sequence for answer in answers] == list(range(1, 401))
        assert sorted(answer.index for answer in answers) == list(range(400))
    assert server.stop() == 0


def test_a_full_quota_is_waited_out(tmp_path):
    server = Server(tmp_path, "--workers", "1", "--client-queued", "1")
    with marble.Client(server.address) as client:
        problem, options = long_solve()
        first = client.jobs.submit_array([marble.ArrayItem(problem, options=options)])
        with pytest.raises((marble.Refused, marble.DeadlineExceeded)):  # the deadline may pass within a try
            client.jobs.submit_array([tiny()], deadline=0.2)
        assert wait_until(lambda: client.jobs.get(first.job_id).job.state is marble.JobState.RUNNING)
        client.jobs.delete(first.job_id)
        second = client.jobs.submit_array([tiny()])
        assert [answer.result().solved for answer in client.jobs.array(second.job_id)] == [True]
    assert server.stop() == 0


def test_arrays_of_asyncio(server):
    async def main() -> list[int]:
        async with marble.aio.Client(server.address) as client:
            array = await client.jobs.submit_array([_gap(number) for number in range(30)], base=tiny())
            return [answer.index async for answer in client.jobs.array(array.job_id)]

    assert sorted(asyncio.run(main())) == list(range(30))
