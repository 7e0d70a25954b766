"""Many problems on one stream, and jobs that outlive the connection."""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import itertools
import queue
import signal

import numpy as np
import pytest
import scipy.sparse as sp
from support import Absence, Relay, check, long_solve, random_problem, tiny, wait_until

import marble


def test_every_problem_of_a_batch_is_answered_once(client):
    answers = {answer.index: answer for answer in client.batch(random_problem(seed) for seed in range(100))}
    assert sorted(answers) == list(range(100))
    for seed, answer in answers.items():
        check(random_problem(seed), answer.result())


def test_a_batch_answers_in_the_items_own_terms_and_reports_refusals(client):
    built = marble.Problem(["x"]).minimize([[1.0]], [-3.0]).bound("x", ub=1)
    items = [marble.BatchItem(built, tag="built"), marble.BatchItem(tiny(), "bad", {"max_iterations": -1}),
             marble.BatchItem(tiny(), ("tuple", 1))]
    answers = {answer.tag: answer for answer in client.batch(items)}
    assert answers["built"].result()["x"] == pytest.approx(1) and answers["built"].result().bound_duals[0] > 0
    assert isinstance(answers["bad"].error, marble.InvalidArgument) and answers["bad"].error.field == "max_iterations"
    with pytest.raises(marble.InvalidArgument):
        answers["bad"].result()
    assert answers["tuple", 1].solution.solved


def test_an_endless_batch_is_read_as_it_is_served(client):
    taken = itertools.count()
    problems = (tiny() for _ in iter(lambda: next(taken), None))
    answers = list(itertools.islice(client.batch(problems), 300))
    assert len(answers) == 300
    assert wait_until(lambda: client.info().counters["queued"] == 0)


def test_what_the_source_raises_is_raised(client):
    def source():
        yield tiny()
        raise RuntimeError("no more")

    with pytest.raises(RuntimeError, match="no more"):
        list(client.batch(source()))
    with pytest.raises(marble.InvalidProblem, match="LCQP"):
        list(client.batch([tiny(), "nonsense"]))


def test_a_submitted_job_outlives_its_connection(server, client):
    problem = random_problem(4)
    with marble.Client(server.address) as other:
        job = other.jobs.submit(problem, request_id="mine", priority="batch")
    answer = client.jobs.result(job.job_id, wait=True, problem=problem)
    check(problem, answer)
    bare = client.jobs.result(job.job_id)
    assert bare.z.tobytes() == answer.z.tobytes()
    details = client.jobs.get(job.job_id)
    assert details.job.state is marble.JobState.FINISHED and details.job.status is marble.Status.SOLVED
    assert details.job.request_id == "mine" and details.job.priority is marble.Priority.BATCH
    assert details.trace.rows and "max_iterations" in details.options
    client.jobs.delete(job.job_id)
    with pytest.raises(marble.NotFound):
        client.jobs.result(job.job_id)


def test_a_job_says_why_its_problem_is_infeasible(client):
    problem = marble.LCQP(np.eye(2), [0, 0], A=[1, 0], b=-1, C=[3, 0], d=-6, L=[1, 0], R=[0, 1])  # z0 = 1, 3 z0 >= 6
    for explain in (False, True):
        job = client.jobs.submit(problem, explain=explain)
        answer = client.jobs.result(job.job_id, wait=True)
        assert answer.status is marble.Status.INFEASIBLE
        why = client.jobs.get(job.job_id).infeasibility
        assert why.multipliers.tolist() == answer.certificate[why.rows].tolist() and why.rows.dtype == np.int32
        assert (set(why.rows), why.more_rows, why.more_parts) == ({0, 1}, 0, 0)
        assert (why.conflict is None) != explain
    assert why.conflict.equalities.tolist() == why.conflict.inequalities.tolist() == [0] and why.conflict.minimal
    assert len(why.conflict) == len(answer.conflict) == 2
    job = client.jobs.submit(tiny())
    assert client.jobs.result(job.job_id, wait=True).solved
    assert client.jobs.get(job.job_id).infeasibility is None


def test_a_job_is_watched_cancelled_and_answered_with_its_best_iterate(client):
    problem, options = long_solve()
    job = client.jobs.submit(problem, options=options)
    with pytest.raises(marble.FailedPrecondition):
        client.jobs.result(job.job_id)
    states = []
    for event in client.jobs.watch(job.job_id, progress_interval=0.01):
        states.append(event.job.state)
        if event.job.state is marble.JobState.RUNNING and event.rows:
            client.jobs.cancel(job.job_id)
    assert states[-1] is marble.JobState.FINISHED and marble.JobState.RUNNING in states
    assert client.jobs.result(job.job_id, wait=True).status is marble.Status.CANCELLED


def test_jobs_are_listed_in_pages_newest_first(client):
    ids = [client.jobs.submit(tiny()).job_id for _ in range(5)]
    for job_id in ids:
        client.jobs.result(job_id, wait=True)
    page = client.jobs.list(limit=2, states=["finished"])
    assert [job.job_id for job in page.jobs] == ids[:-3:-1] and page.more
    assert client.jobs.list(limit=1, before=page.jobs[-1].job_id).jobs[0].job_id == ids[2]


def test_all_jobs_can_be_watched(client):
    problem, options = long_solve()
    job_id = client.jobs.submit(problem, options=options).job_id
    assert any(event.job.job_id == job_id for event in client.watch())
    client.jobs.delete(job_id)


def _ids(client):
    return {job.job_id for job in client.jobs.list().jobs}


def test_a_submission_whose_answer_got_lost_is_sent_again_and_is_one_job(server, client):
    large, before = marble.LCQP(sp.eye(1000, format="csc"), np.ones(1000)), _ids(client)
    with (Relay(server.address) as relay, marble.Client(relay.address) as far,
          concurrent.futures.ThreadPoolExecutor(1) as pool):
        submitted = pool.submit(far.jobs.submit, large)
        assert wait_until(lambda: _ids(client) != before)
        relay.cut()
        job = submitted.result(60)
    assert _ids(client) - before == {job.job_id}
    assert client.jobs.result(job.job_id, wait=True).solved


COUNT = 300


def _plain(address, problems, received, **more):
    with marble.Client(address, **more) as client:
        for answer in client.batch(problems):
            received(answer)


async def _on_a_thread(problems):
    each = iter(problems)
    while (problem := await asyncio.to_thread(next, each, None)) is not None:
        yield problem


def _asynchronous(address, problems, received, **more):
    async def scenario():
        async with marble.aio.Client(address, **more) as client:
            async for answer in client.batch(_on_a_thread(problems)):
                received(answer)
                await asyncio.sleep(0)

    asyncio.run(scenario())


@pytest.fixture(params=[_plain, _asynchronous], ids=["plain", "asyncio"])
def batch(request):
    """Runs a batch on a thread: the future of its end, and the queue of its answers."""
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        def begin(address, problems, **more):
            answers = queue.Queue()
            return pool.submit(request.param, address, problems, answers.put, **more), answers

        yield begin


def _some(answers, count):
    return [answers.get(timeout=60) for _ in range(count)]


def _rest(end, answers):
    end.result(120)
    found = []
    with contextlib.suppress(queue.Empty):
        while True:
            found.append(answers.get_nowait())
    return found


def _check_all(found, count=COUNT):
    assert sorted(answer.index for answer in found) == list(range(count))
    for answer in found:
        check(random_problem(answer.index % 7), answer.result())


def _problems(count=COUNT):
    return (random_problem(index % 7) for index in range(count))


def _answered(address):
    with marble.Client(address) as client:
        return client.info().counters["answered_total"]


def test_a_batch_goes_on_once_its_server_is_there_again(batch, start_server):
    server = start_server("--batch-window", "8")
    end, answers = batch(server.address, _problems())
    found = _some(answers, 20)
    server.kill()
    absence = Absence(server.address)
    absence.wait()
    found += _some(answers, answers.qsize())
    absence.end()
    again = start_server(listen=server.address)
    answered_before = len(found)
    found += _rest(end, answers)
    _check_all(found)
    assert _answered(again.address) <= COUNT - answered_before


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_a_batch_goes_on_at_the_next_server(batch, start_server, how):
    servers = [start_server("--batch-window", "8", "--drain-grace-s", "60") for _ in range(2)]
    end, answers = batch([server.address for server in servers], _problems())
    found = _some(answers, 20)
    serving = next(server for server in servers if _answered(server.address) > 0)
    serving.process.send_signal(how)
    found += _rest(end, answers)
    _check_all(found)


def test_a_batch_goes_on_after_a_restart_by_the_book(batch, start_server):
    server = start_server("--batch-window", "8")
    end, answers = batch(server.address, _problems())
    found = _some(answers, 20)
    server.stop()
    start_server(listen=server.address)
    found += _rest(end, answers)
    _check_all(found)


def test_a_source_may_wait_for_the_answers_that_were_lost(batch, start_server):
    """The source is within its own next() when the server is lost: what is open goes first, and past it."""
    long, options = long_solve()
    server, may_go_on = start_server("--workers", "1"), queue.Queue()

    def problems():
        yield marble.BatchItem(long, options=options)
        may_go_on.get(timeout=60)
        yield tiny()

    end, answers = batch(server.address, problems())
    with marble.Client(server.address) as client:
        assert wait_until(lambda: client.info().counters["running"] == 1)
        server.kill()
        start_server("--workers", "1", listen=server.address)
        assert wait_until(lambda: client.info().counters["running"] == 1)
        job = next(job for job in client.jobs.list(states=["running"]).jobs)
        client.jobs.cancel(job.job_id)
    first, = _some(answers, 1)
    assert first.index == 0 and first.result().status is marble.Status.CANCELLED
    may_go_on.put(None)
    last, = _rest(end, answers)
    assert last.index == 1 and last.result().solved


def test_a_batch_gives_up_when_its_time_to_wait_is_over(batch, start_server):
    long, options = long_solve()
    server = start_server()
    end, _ = batch(server.address, [marble.BatchItem(long, options=options)], wait=0.3)
    with marble.Client(server.address) as client:
        assert wait_until(lambda: client.info().counters["running"] == 1)
    server.kill()
    with pytest.raises(marble.Unavailable):
        end.result(60)


def test_what_the_source_raises_is_raised_while_the_server_is_lost_too(batch, start_server):
    server, may_fail = start_server(), queue.Queue()

    def problems():
        yield tiny()
        may_fail.get(timeout=60)
        raise RuntimeError("no more")

    end, answers = batch(server.address, problems())
    _some(answers, 1)
    server.kill()
    absence = Absence(server.address)
    absence.wait()
    may_fail.put(None)
    with pytest.raises(RuntimeError, match="no more"):
        end.result(60)
    absence.end()
