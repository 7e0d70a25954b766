"""Without a server: the solver in this process, to the same bits and with the same classes as a server's."""

from __future__ import annotations

import asyncio
import dataclasses
import pathlib
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest
from support import Shown, check, clean_environment, long_solve, random_problem, tiny, wait_until

import marble
from marble.hopper import Hopper
from marble.in_process import core

# What differs between two solves of one problem, or says where it was solved.
OWN = {"times", "job_id", "problem"}
SAID = tuple(field.name for field in dataclasses.fields(marble.Solution) if field.name not in OWN)


@pytest.fixture
def here():
    with marble.Client("local") as one:
        yield one


def same(local: marble.Solution, remote: marble.Solution) -> None:
    for name in SAID:
        ours, theirs = getattr(local, name), getattr(remote, name)
        if isinstance(ours, np.ndarray):
            ours, theirs = ours.tobytes(), theirs.tobytes()
        assert ours == theirs, name
    assert type(local) is type(remote) and local.job_id == "" and remote.job_id


def hard() -> list[tuple[marble.LCQP, dict[str, object]]]:
    return [(tiny(), {}), (tiny(), {"path": "paper", "polish": False, "max_iterations": 77}),
            (random_problem(5), {"max_iterations": 0}), (random_problem(3), {"global_search": True}),
            (marble.LCQP([[1.0]], [0.0], C=[[1], [-1]], d=[-1, 0]), {}), (marble.LCQP(None, [-1.0]), {}),
            (Hopper(steps=10).problem(), {})]


def test_local_and_remote_give_the_same_bits(client, here):
    for problem, options in [*((random_problem(seed), {}) for seed in range(24)), *hard()]:
        same(here.solve(problem, options=options), client.solve(problem, options=options))


def test_a_conflict_is_the_same_locally_and_remotely_and_prints_its_rows(client, here):
    problem = marble.Problem(["gap", "force"]).add_rows([[1, 1]], 4, 4).bound("gap", ub=1).bound("force", -9, 2)
    for solver_ in (here, client):
        answer = solver_.solve(problem, explain=True)
        assert answer.status is marble.Status.INFEASIBLE and answer.conflict.minimal
        assert answer.conflict.equalities.tolist() == [0] and len(answer.conflict) == 3
        assert answer.conflict.lines(answer.problem, answer.variables) == [
            "A[0]: gap + force - 4 = 0", "C[0]: -gap + 1 ≥ 0", "C[2]: -force + 2 ≥ 0"]
        assert "C[2]: -force + 2 ≥ 0" in str(answer) and "3 parts, minimal" in str(answer)
        assert solver_.solve(problem).conflict is None
    pairs = marble.LCQP(None, np.zeros(2), A=[[1, 1]], b=[-2], L=np.eye(2), R=-np.eye(2), r=[0.5, 0.5])
    ours, theirs = (solver_.solve(pairs, explain=True).conflict for solver_ in (here, client))
    assert ours is not None and str(ours) == str(theirs) and len(ours) == len(theirs)


def test_explain_leaves_the_objective_out(client, here):
    infeasible = marble.Problem(["gap", "force"]).minimize(g=[-1, -1]).add_rows([[1, 1]], 4, 4).bound("gap", ub=1)
    infeasible.bound("force", -9, 2)
    unbounded = marble.LCQP([[-1.0]], [-1.0], C=[[1.0]], d=[-3.0], c0=7.0)

    async def awaited(problem):
        async with marble.aio.Client(client.address) as aio:
            return await aio.explain(problem)

    for explain in (here.explain, client.explain, lambda problem: asyncio.run(awaited(problem))):
        answer = explain(infeasible)
        assert answer.status is marble.Status.INFEASIBLE and answer.conflict.minimal and len(answer.conflict) == 3
        assert answer.problem.g.tolist() == [0, 0]
        assert answer.conflict.lines(answer.problem, answer.variables)[0] == "A[0]: gap + force - 4 = 0"
        nearest = explain(unbounded)
        assert nearest.solved and nearest.conflict is None and nearest[0] == pytest.approx(3)
        assert nearest.objective == pytest.approx(4.5), "of ½ z², without what the problem has"
    assert here.solve(unbounded, explain=True).status is marble.Status.UNBOUNDED
    assert infeasible.compile().g.tolist() == [-1, -1], "the caller's problem keeps its objective"
    with pytest.raises(marble.InvalidArgument, match="num_starts"):
        here.explain(infeasible, num_starts=0)


def test_explain_is_refused_by_sessions(client, here):
    for solver_ in (here, client):
        with pytest.raises(marble.InvalidArgument, match="explain"):
            solver_.session(tiny(), options={"explain": True})


def test_a_session_gives_the_same_bits_update_by_update(client, here):
    lcqp = Hopper(steps=10).problem()
    updates = [{}, {"g": lcqp.g * 1.01}, {"Q": 2 * lcqp.Q.data, "c0": 1.0}, {"shift": 10, "b": lcqp.b * 0.99},
               {"z0": np.zeros(lcqp.n), "options": {"max_iterations": 40}}, {"cold": True}]
    with client.session(lcqp) as there, here.session(lcqp) as local:
        assert isinstance(local, marble.Session) and local.memory_bytes > 0 and local.job_id == ""
        for update in updates:
            same(local.update(**update), there.update(**update))
    assert not local.is_open
    with pytest.raises(marble.FailedPrecondition):
        local.update()


def test_answers_hold_against_numpy_and_in_the_builder_s_terms(here):
    problem = random_problem(4)
    check(problem, here.solve(problem))
    built = marble.Problem(["x", "y"]).minimize(np.eye(2), [-2, -3]).bound("x", 0, 0.25)
    answer = here.solve(built)
    assert np.isclose(answer["x"], 0.25) and answer.bound_duals[0] > 0


def test_where_no_server_is_named_solve_stays_here_and_a_client_does_not(monkeypatch):
    for value in (None, "", "local"):
        monkeypatch.delenv("MARBLE_SERVER", raising=False)
        if value is not None:
            monkeypatch.setenv("MARBLE_SERVER", value)
        assert marble.solve(tiny()).job_id == "" and asyncio.run(marble.aio.solve(tiny())).job_id == ""
    assert marble.Client().address == "in process"
    monkeypatch.delenv("MARBLE_SERVER")
    assert marble.Client().address == "127.0.0.1:50051"
    monkeypatch.setenv("MARBLE_SERVER", "127.0.0.1:1")
    with pytest.raises(marble.Unavailable):
        marble.solve(tiny())


def test_what_only_a_server_has_says_so(here):
    assert here.address == "in process"
    for call in (here.info, here.jobs.list, lambda: here.jobs.submit(tiny()), lambda: next(here.watch())):
        with pytest.raises(marble.Unavailable, match="no server"):
            call()


@pytest.mark.parametrize("parts", [{"options": {"num_starts": 0}}, {"options": {"polish": "very"}},
                                   {"options": {"path": "long"}}, {"options": {"nothing": 1}},
                                   {"priority": "urgent"}, {"request_id": "\n"}, {"deadline": 0},
                                   {"progress_interval": -1, "progress": print}])
def test_errors_are_the_same(client, here, parts):
    raised = []
    for one in (client, here):
        with pytest.raises(marble.InvalidArgument) as caught:
            one.solve(tiny(), **parts)
        error = caught.value
        raised.append((type(error), error.field, error.index, error.bound, str(error)))
    assert raised[0] == raised[1]


def test_an_update_that_does_not_fit_changes_nothing(client, here):
    answers = []
    for one in (client, here):
        with one.session(tiny()) as session:
            session.update()
            for wrong in ({"g": [1, 2, 3]}, {"options": {"num_starts": 0}, "c0": 7.0}, {"deadline": -1},
                          {"shift": marble.Shift(variables=[marble.ShiftBlock(0, 5, 1)]), "c0": 7.0}):
                with pytest.raises(marble.InvalidArgument):
                    session.update(**wrong)
            assert session.is_open
            answers.append(session.update())
            last = session.problem.c0
    assert last == 2.0 and answers[0].objective == answers[1].objective
    same(answers[1], answers[0])


def test_progress_is_reported_on_the_caller_s_thread_and_what_it_raises_ends_the_solve(here):
    rows = []
    here.solve(random_problem(3), progress=lambda row: rows.append((row, threading.get_ident())), iterate_every=1)
    assert [row.iteration for row, _ in rows] == sorted(row.iteration for row, _ in rows) and len(rows) > 1
    assert {thread for _, thread in rows} == {threading.get_ident()}
    assert all(row.z.size == random_problem(3).n for row, _ in rows)
    problem, options = long_solve()

    def enough(row):
        raise ValueError(row.iteration)

    with pytest.raises(ValueError):
        here.solve(problem, options=options, progress=enough)


def test_what_a_solve_is_doing_is_reported_where_no_iteration_ends(here):
    shown = Shown()
    handle = here.solve_async(Hopper().problem(), options={"num_starts": 500}, progress=shown)
    assert wait_until(lambda: any(text.startswith("further starts: ") for text in shown.words))
    handle.stop()
    assert handle.result(60).solved  # the best of the starts so far


def test_other_threads_run_while_one_solves(here):
    problem, options = long_solve()
    rows: list[int] = []
    handle = here.solve_async(problem, options=options, progress=lambda row: rows.append(row.iteration))
    assert wait_until(lambda: len(rows) > 3) and not handle.done()
    handle.stop()
    best = handle.result(60)
    assert best.status is marble.Status.CANCELLED and best.z.size == problem.n and handle.job_id() == ""
    given_up = here.solve_async(problem, options=options)
    given_up.cancel()
    with pytest.raises(marble.Cancelled):
        given_up.result(60)
    assert here.solve_async(tiny()).result(60).solved


def test_an_update_of_a_session_that_runs_out_of_time_has_its_best_point(here):
    problem, options = long_solve()
    with here.session(problem, options=options) as session:
        late = session.update(deadline=0.05)
        assert late.status is marble.Status.TIME_LIMIT and late.origin is marble.PointOrigin.SOLVE


def test_a_deadline_gives_the_solve_up_and_a_time_limit_does_not(here):
    problem, options = long_solve()
    with pytest.raises(marble.DeadlineExceeded):
        here.solve(problem, options=options, deadline=0.05)
    with pytest.raises(marble.DeadlineExceeded), marble.Client("local", timeout=0.05) as hasty:
        hasty.solve(problem, options=options)
    limited = here.solve(problem, options={**options, "time_limit_s": 0.05})
    assert limited.status is marble.Status.TIME_LIMIT and limited.options["time_limit_s"] == 0.05


@pytest.mark.parametrize("call", ["client.solve(problem, options=options)",
                                  "client.session(problem, options=options).update()"])
def test_ctrl_c_is_a_keyboard_interrupt_and_the_next_solve_runs(call):
    program = f"""
import sys, threading, time, os, signal
sys.path.insert(0, {str(pathlib.Path(__file__).parent)!r})
from support import long_solve, tiny
import marble
problem, options = long_solve()
client = marble.Client("local")
begun = threading.Event()
old = signal.getsignal(signal.SIGINT)
def interrupt():
    while sys._current_frames()[main].f_code.co_name not in ("compute", "_outcome"):
        time.sleep(0.01)
    time.sleep(0.05)
    os.kill(os.getpid(), signal.SIGINT)
main = threading.get_ident()
threading.Thread(target=interrupt).start()
try:
    {call}
except KeyboardInterrupt:
    print("interrupted", client.solve(tiny()).solved, signal.getsignal(signal.SIGINT) is old)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120,
                          env=clean_environment(PYTHONPATH=":".join(sys.path)))
    assert done.stdout == "interrupted True True\n", done.stderr


def test_the_caller_s_handler_of_ctrl_c_stays_where_it_is_the_caller_s_own(here):
    seen = []
    before = signal.signal(signal.SIGINT, lambda *_: seen.append(1))
    try:
        threading.Timer(0.05, lambda: signal.raise_signal(signal.SIGINT)).start()
        problem, options = long_solve()
        assert here.solve(problem, options={**options, "time_limit_s": 0.3}).status is marble.Status.TIME_LIMIT
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_batch_is_answered_in_order_with_an_error_where_there_is_one(here):
    items = [marble.BatchItem(tiny(), tag="a"), marble.BatchItem(tiny(), options={"num_starts": 0}), random_problem(1)]
    answers = list(here.batch(iter(items)))
    assert [answer.index for answer in answers] == [0, 1, 2] and answers[0].tag == "a"
    assert answers[0].result().solved and answers[2].result().solved
    with pytest.raises(marble.InvalidArgument):
        answers[1].result()
    with pytest.raises(marble.InvalidProblem):
        list(here.batch([3]))


def test_asyncio_solves_on_other_threads_and_a_cancelled_task_stops(client):
    async def scenario():
        problem, options = long_solve()
        async with marble.aio.Client("local") as here:
            rows = []
            running = asyncio.ensure_future(here.solve(problem, options=options, progress=rows.append))
            same(await here.solve(random_problem(2)), client.solve(random_problem(2)))
            while not rows:
                await asyncio.sleep(0.01)
            running.cancel()
            with pytest.raises(asyncio.CancelledError):
                await running

            def enough(_):
                raise ValueError

            with pytest.raises(ValueError):
                await here.solve(problem, options=options, progress=enough)
            async with here.session(tiny()) as session:
                first = await session.update()
                number = await session.send(g=[-3, -3])
                event = await session.next()
                assert first.solved and event.sequence == number and event.outcome.solved and session.is_open
            assert not session.is_open
            answers = [answer async for answer in here.batch([tiny(), tiny()])]
            assert [answer.index for answer in answers] == [0, 1] and answers[1].result().solved
            with pytest.raises(marble.Unavailable):
                await here.info()

    asyncio.run(scenario())


def test_answers_own_their_arrays(here):
    problem = random_problem(7)
    z = here.solve(problem).z
    kept = z.copy()
    for seed in range(5):
        here.solve(random_problem(seed))
    assert z.tobytes() == kept.tobytes() and z.flags.writeable


def test_without_the_extension_the_error_says_what_is_missing(monkeypatch):
    core.cache_clear()
    monkeypatch.setitem(sys.modules, "marble._core", None)
    try:
        with pytest.raises(marble.Unavailable, match=r"no solver of its own.*MARBLE_SERVER"):
            marble.solve(tiny())
        with pytest.raises(marble.Unavailable):
            marble.Client("local")
    finally:
        core.cache_clear()


def test_the_import_loads_not_even_numpy_and_a_solve_here_neither_grpc_nor_protobuf():
    program = ("import sys, marble; print('numpy' in sys.modules); marble.solve([[2.0]], [-2.0]); "
               "print([name for name in ('grpc', 'google.protobuf', 'asyncio') if name in sys.modules])")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True,
                          env=clean_environment(PYTHONPATH=":".join(sys.path)))
    assert done.stdout == "False\n[]\n"


def test_derivatives_of_an_answer_are_differences_of_answers_nearby():
    problem = random_problem(3)
    answer = marble.solve(problem, server="local")
    sensitivity = marble.Sensitivity(answer)
    assert sensitivity.smooth
    random = np.random.default_rng(0)
    direction = {"g": random.normal(size=problem.n), "b": random.normal(size=problem.b.size),
                 "l": random.normal(size=problem.l.size)}
    change = sensitivity.jvp(**direction)
    h = 1e-6

    def moved(step):
        parts = {name: getattr(problem, name) + step * by for name, by in direction.items()}
        return marble.solve(problem.replaced(**parts), server="local", warm_start=answer,
                            max_local_search_factorizations=0)

    near = [moved(h), moved(-h)]
    for name in ("z", "y", "xi", "eta"):
        np.testing.assert_allclose(getattr(change, name), (getattr(near[0], name) - getattr(near[1], name)) / (2 * h),
                                   rtol=1e-4, atol=1e-4)
    weights = random.normal(size=problem.n)
    gradient = sensitivity.vjp(z=weights)
    assert set(gradient) == {*"gbdlrQACLR"} and gradient["A"].shape == problem.A.data.shape
    assert sum(gradient[name] @ by for name, by in direction.items()) == pytest.approx(weights @ change.z)
    with pytest.raises(marble.InvalidArgument, match=r"direction.g.*must have"):
        sensitivity.jvp(g=[1.0])
    with pytest.raises(marble.InvalidArgument, match="direction is h"):
        sensitivity.jvp(h=[1.0])
    with pytest.raises(marble.Unsolved):
        marble.Sensitivity(marble.solve(problem, server="local", max_iterations=0, path="paper", polish=False))
