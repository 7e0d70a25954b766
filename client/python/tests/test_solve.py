"""marble.solve and Client.solve: answers, progress, what ends a solve."""

from __future__ import annotations

import dataclasses
import io
import json
import math
import pathlib
import sys
import threading

import numpy as np
import pytest
import scipy.sparse as sp
from support import Shown, check, long_solve, random_problem, tiny, wait_until

import marble
from marble.base import tables
from marble.hopper import Hopper
from marble.message.progress import ProgressLine, described
from marble.model.solution import Progress, Violations
from marble.model.solution_kind import SolutionFacts


def test_matrices_go_in_and_numpy_arrays_come_out(server):
    answer = marble.solve([[2, 0], [0, 2]], [-2, -2], L=[1, 0], R=[0, 1], c0=2, server=server.address, name="first")
    assert answer.status is marble.Status.SOLVED and answer.solved
    assert isinstance(answer.z, np.ndarray) and sorted(np.round(answer.z, 9).tolist()) == [0, 1]
    assert np.isclose(answer.objective, 1.0)
    assert answer.job_id and answer.times.total_s > 0 and answer.factorizations > 0
    assert answer.raise_if_unsolved() is answer


def test_the_server_is_the_environment_s(server, monkeypatch):
    monkeypatch.setenv("MARBLE_SERVER", server.address)
    assert marble.solve(tiny()).solved


def test_where_nobody_listens_the_error_says_what_to_do(monkeypatch):
    monkeypatch.setattr(tables, "DEFAULT_ADDRESS", "127.0.0.1:1")  # where surely nobody listens
    with pytest.raises(marble.Unavailable, match=r"marble-server.*MARBLE_SERVER=local"):
        marble.Client().solve(tiny())


@pytest.mark.parametrize("seed", range(24))
def test_random_answers_hold_against_numpy(client, seed):
    problem = random_problem(seed)
    answer = client.solve(problem)
    assert answer.status is marble.Status.SOLVED, answer
    check(problem, answer)


def test_options_by_name_are_used_and_returned(server, client):
    answer = marble.solve(tiny(), server=client, options={"path": "paper"}, max_iterations=77, polish=False)
    assert answer.options["max_iterations"] == 77
    assert answer.options["path"] == "paper" and answer.options["polish"] is False
    assert set(answer.options) == set(client.info().options)


def test_a_solve_that_ends_unsolved_is_an_answer(client):
    limited = client.solve(random_problem(5), options={"max_iterations": 0})
    assert limited.status is marble.Status.ITERATION_LIMIT and not limited.solved and limited.detail
    with pytest.raises(marble.Unsolved) as caught:
        limited.raise_if_unsolved()
    assert caught.value.solution is limited
    infeasible = client.solve(marble.LCQP([[1.0]], [0.0], C=[[1], [-1]], d=[-1, 0]))
    assert infeasible.status is marble.Status.INFEASIBLE and infeasible.certificate.size == 2
    unbounded = client.solve(marble.LCQP(None, [-1.0]))
    assert unbounded.status is marble.Status.UNBOUNDED and unbounded.certificate.size == 1


def test_a_start_is_taken(client):
    for z0, objective in (([1.0, 0.0], -1.0), ([0.0, 1.0], -3.0)):
        problem = marble.LCQP(2 * np.eye(2), [-2, -4], L=[1, 0], R=[0, 1], z0=z0)
        rows = []
        assert client.solve(problem, options={"max_local_search_factorizations": 0}, progress=rows.append).solved
        assert rows[0].iteration == 0 and rows[0].objective == pytest.approx(objective, abs=1e-12)


def test_an_answer_is_started_from_here_and_there(server, client):
    problem = random_problem(3)
    first = client.solve(problem)
    next_one = problem.replaced(g=problem.g + 1e-3)
    answers = [marble.solve(next_one, server=where, warm_start=first) for where in (server.address, "local", client)]
    assert all(answer.solved and answer.factorizations < first.factorizations for answer in answers)
    assert len({(answer.z.tobytes(), answer.eta.tobytes(), answer.factorizations) for answer in answers}) == 1
    for where in (server.address, "local"):
        with pytest.raises(marble.InvalidArgument, match=r"warm_start.z.*: must have \d+ entries"):
            marble.solve(tiny(), server=where, warm_start=first)
    with pytest.raises(marble.InvalidArgument, match="warm_start is list: must be a Solution"):
        client.solve(problem, warm_start=[1.0])


def test_progress_is_reported_on_the_calling_thread(client):
    rows, threads = [], set()

    def report(row):
        rows.append(row)
        threads.add(threading.get_ident())

    answer = client.solve(random_problem(1), progress=report, iterate_every=1)
    assert threads == {threading.get_ident()}
    iterations = [row.iteration for row in rows]
    assert iterations == sorted(iterations) and len(rows) >= 2
    assert any(row.z.size == answer.z.size for row in rows)


def test_progress_can_be_shown(client, capsys):
    assert client.solve(random_problem(1), progress=True).solved
    assert "iterations" in capsys.readouterr().err


def test_what_a_solve_is_doing_is_reported_where_no_iteration_ends(client):
    shown = Shown()
    handle = client.solve_async(Hopper().problem(), options={"num_starts": 500}, progress=shown)
    assert wait_until(lambda: any(text.startswith("further starts: ") for text in shown.words))
    job, = [job for job in client.jobs.list().jobs if job.state is marble.JobState.RUNNING]
    assert job.activity.startswith("further starts: ")
    handle.cancel()


def test_what_a_callback_raises_ends_the_solve(client):
    problem, options = long_solve()

    def refuse(row):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        client.solve(problem, options=options, progress=refuse)
    assert wait_until(lambda: client.info().counters["running"] == 0)


def test_a_deadline_gives_the_solve_up(client):
    problem, options = long_solve()
    with pytest.raises(marble.DeadlineExceeded):
        client.solve(problem, options=options, deadline=0.3)
    assert wait_until(lambda: client.info().counters["running"] == 0)


def test_a_time_limit_returns_the_best_iterate(client):
    problem, options = long_solve()
    answer = client.solve(problem, options={**options, "time_limit_s": 0.2})
    assert answer.status is marble.Status.TIME_LIMIT and answer.z.size == problem.n


def test_a_handle_waits_cancels_and_stops(client):
    handle = client.solve_async(tiny())
    assert handle.result(60).solved and handle.done() and handle.job_id() == handle.result().job_id

    problem, options = long_solve()
    reported = threading.Event()
    given_up = client.solve_async(problem, options=options, progress=lambda row: reported.set())
    assert reported.wait(60) and not given_up.done()
    with pytest.raises(TimeoutError):
        given_up.result(0.01)
    given_up.cancel()
    with pytest.raises(marble.Cancelled):
        given_up.result(60)

    reported.clear()
    stopped = client.solve_async(problem, options=options, progress=lambda row: reported.set())
    assert reported.wait(60)
    stopped.stop()
    answer = stopped.result(60)
    assert answer.status is marble.Status.CANCELLED and answer.z.size == problem.n


def test_many_threads_share_a_client(client):
    handles = [client.solve_async(random_problem(seed)) for seed in range(16)]
    for seed, handle in enumerate(handles):
        check(random_problem(seed), handle.result(60))


def test_a_large_problem_goes_there_and_back(client):
    n = 60_000
    band = sp.diags([np.full(n - 1, -1.0), np.full(n, 3.0), np.full(n - 1, -1.0)], [-1, 0, 1])
    problem = marble.LCQP(band, -np.ones(n), C=sp.identity(n), d=np.zeros(n))
    answer = client.solve(problem, deadline=120)
    assert answer.solved
    check(problem, answer)


def test_a_solution_is_worth_reading(client):
    answer = client.solve(tiny())
    text = repr(answer)
    assert "tiny: solved" in text and "2 variables" in text and "objective" in text and "1 pairs" in text
    evil = client.solve(marble.LCQP([[1.0]], [0.0], name="<script>"))
    html = evil._repr_html_()
    assert "&lt;script&gt;" in html and "<script>" not in html and "objective" in html


def row(**tree):
    return Progress(121, 3, 2.5, Violations(0.0, 0.0, 1e-3), 1e-9, 0.1, 10.0, 1.0, 0.0, 130, 0.2, **tree)


def test_a_search_reports_its_residuals():
    assert described(row()) == "objective 2.5, violation 1.0e-03, kkt 1.0e-09"


@pytest.mark.parametrize("tree, text", [
    ({"incumbent": 5.0, "bound": 4.5, "gap": 0.1}, "best 5, bound 4.5, gap 1.0e-01, 17 nodes, 4 open"),
    ({"incumbent": 5.0}, "best 5, no bound yet, 17 nodes, 4 open"),
    ({"bound": 4.5}, "no point yet, bound 4.5, 17 nodes, 4 open"),
])
def test_a_proof_reports_what_is_known_of_the_optimum(tree, text):
    assert described(row(nodes=17, open_nodes=4, **tree)) == text


@pytest.mark.parametrize("bar", [True, False])
def test_the_line_shows_a_tree_that_takes_no_iterations(bar, monkeypatch):
    if bar:
        pytest.importorskip("tqdm")
    else:
        monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    stream = io.StringIO()
    line = ProgressLine(stream)
    line(row())
    line(row(incumbent=5.0, bound=4.5, gap=0.1, nodes=17, open_nodes=4))
    line.close()
    assert "gap 1.0e-01, 17 nodes" in stream.getvalue()


TABLES = pathlib.Path(__file__).resolve().parents[3] / "tests/answers"
CASES = json.loads((TABLES / "kinds.json").read_text("utf-8"))
BUDGETS = json.loads((TABLES / "budgets.json").read_text("utf-8"))


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["text"])
def test_a_kind_follows_the_table_of_cases(case):
    facts = {"gap": math.inf, **case["facts"], "status": marble.Status(case["facts"]["status"])}
    given = SolutionFacts(**facts)
    assert (given.kind.value, given.text, given.what_to_try) == (case["kind"], case["text"], case["what_to_try"])


def test_every_kind_has_a_case():
    assert {case["kind"] for case in CASES} == {kind.value for kind in marble.SolutionKind}


def contact(**options):
    return marble.solve(2 * np.eye(2), [-2, -4], L=[1, 0], R=[0, 1], server="local", **options)


def test_a_small_problem_is_printed_as_proved_with_the_nodes_of_its_tree():
    answer = contact()
    assert answer.kind is marble.SolutionKind.PROVED_OPTIMAL and answer.what_to_try == ""
    assert answer.nodes >= 1 and answer.open_nodes == 0
    text = repr(answer)
    assert "answer        proved optimal" in text and f"{answer.nodes} node" in text
    assert "what to try" not in text and "  proof " not in text


def test_a_local_answer_is_printed_with_what_to_try():
    answer = contact(max_small_problem_nodes=0)
    assert answer.kind is marble.SolutionKind.LOCAL_MINIMUM and answer.nodes == 0
    text = repr(answer)
    assert "answer        local minimum; no bound is known" in text
    assert "what to try   num_starts=8 searches 8 times" in text and "global_search=true searches" in text
    assert "num_starts=16 searches twice as often" in contact(max_small_problem_nodes=0, num_starts=8).what_to_try


@pytest.mark.parametrize("case", BUDGETS, ids=str)
def test_a_budget_is_spent_as_the_table_of_cases_says(case):
    work = {name: case[name] for name in ("options", "factorizations", "detail")}
    assert dataclasses.replace(contact(), **work).facts.budget_spent is case["spent"]


def test_with_global_the_proof_has_its_line():
    assert "  proof         proved optimal: bound" in repr(contact(global_search=True))
