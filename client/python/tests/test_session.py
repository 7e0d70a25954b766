"""Sessions: set up once, then only what changes."""

from __future__ import annotations

import asyncio
import concurrent.futures
import signal

import numpy as np
import pytest
import scipy.sparse as sp
from support import Absence, check, first_answer, long_solve, random_problem, stop_all, tiny, wait_until

import marble
from marble.base import contract
from marble.calls.session_core import SessionCore
from marble.hopper import NAMES, Hopper
from marble.message.requests import Call

pytestmark = pytest.mark.usefixtures("way_of_sessions")


def test_updates_change_numbers_and_nothing_else(client):
    problem = random_problem(2)
    with client.session(problem) as session:
        check(problem, session.update())
        shifted = session.update(g=problem.g + 1.0)
        check(problem.replaced(g=problem.g + 1.0), shifted)
        scaled = session.update(Q=2 * (problem.Q + sp.triu(problem.Q, 1).T), C=problem.C.toarray() * 0.5)
        check(session.problem, scaled)
        values = session.update(C=problem.C.data)
        check(problem.replaced(g=problem.g + 1.0, Q=2 * problem.Q), values)
        assert session.job_id and session.memory_bytes > 0 and session.setup_s > 0 and session.is_open
    assert not session.is_open


def test_a_warm_start_needs_less_work_than_a_cold_one(client):
    hopper = Hopper(steps=30)
    with client.session(hopper.problem()) as session:
        first = session.update()
        hopper = hopper.advanced(first.z)
        warm = session.update(hopper.problem(), shift=30)
        cold = session.update(cold=True)
    assert warm.solved and cold.solved and warm.factorizations < cold.factorizations
    check(hopper.problem(), warm)
    assert first.z.size == 30 * len(NAMES)


def test_a_builder_s_problem_is_updated_and_answered_in_its_own_terms(client):
    problem = marble.Problem(["x", "y"]).minimize(np.eye(2), [-2, -3]).bound("x", 0, 1).add_rows([[1, 1]], ub=2.5)
    with client.session(problem) as session:
        first = session.update()
        assert np.isclose(first["x"], 1) or np.isclose(first["x"] + first["y"], 2.5)
        problem.bound("x", 0, 0.25)
        second = session.update(problem)
        assert np.isclose(second["x"], 0.25) and second.bound_duals[0] > 0 and second.row_duals.shape == (1,)
        with pytest.raises(marble.InvalidProblem, match="sizes"):
            session.update(problem.copy().bound("y", lb=0))
        assert session.update().solved


def test_an_update_that_does_not_fit_is_refused_and_changes_nothing(client):
    with client.session(tiny()) as session:
        before = session.update().objective
        with pytest.raises(marble.InvalidProblem) as wrong_size:
            session.update(g=[1, 2, 3])
        assert wrong_size.value.field == "g"
        with pytest.raises(marble.InvalidProblem) as outside:
            session.update(L=[[1, 2]])
        assert (outside.value.field, outside.value.index) == ("L", (0, 1))
        with pytest.raises(marble.InvalidArgument) as option:
            session.update(options={"max_iterations": -1})
        assert option.value.field == "max_iterations"
        with pytest.raises(marble.InvalidArgument, match="h: is no option"):
            session.send(h=[1])
        assert session.update(cold=True).objective == before


def test_a_refused_update_leaves_the_problem_and_the_later_ones_without_its_numbers(client):
    for one in (client, marble.Client("local")):
        with one.session(tiny()) as session:
            before = session.problem
            with pytest.raises(marble.InvalidArgument):
                session.update(g=[7, 7], options={"max_iterations": -1})
            assert np.array_equal(session.problem.g, before.g)
            session.send(c0=1.0)
            refused = session.send(g=[7, 7], c0=5.0, options={"max_iterations": -1})
            session.send(r=[0.5])
            outcomes = {event.sequence: event.outcome for event in (session.next() for _ in range(3))}
            assert isinstance(outcomes.pop(refused), marble.InvalidArgument)
            for outcome in outcomes.values():
                check(outcome.problem, outcome)
                assert np.array_equal(outcome.problem.g, before.g) and outcome.problem.c0 == 1.0
            assert (session.problem.c0, session.problem.r[0]) == (1.0, 0.5)
            assert np.array_equal(session.problem.g, before.g)


def test_answers_come_in_order_to_who_sends_ahead(client):
    with client.session(tiny()) as session:
        numbers = [session.send(c0=float(k)) for k in range(40)]
        events = [session.next() for _ in numbers]
    assert [event.sequence for event in events] == numbers
    assert [round(event.outcome.objective) for event in events] == [k - 1 for k in range(40)]


def test_two_parts_give_the_bits_of_one_update(client):
    hopper = Hopper(steps=12)
    with client.session(hopper.problem()) as whole, client.session(hopper.problem()) as parts, \
            marble.Client("local").session(hopper.problem()) as here:
        for tick in range(4):
            now, shift = hopper.problem(), 12 if tick else None
            one = whole.update(now, shift=shift)
            for session in (parts, here):
                number = session.prepare(g=now.g, c0=now.c0, A=now.A, shift=shift)
                two = session.update(b=now.b)
                assert number == 2 * tick + 1 and two.factorizations == one.factorizations
                assert np.array_equal(two.z, one.z) and np.array_equal(two.y, one.y)
            hopper = hopper.advanced(one.z)
        for session in (parts, here):
            with pytest.raises(marble.InvalidProblem) as wrong:
                session.prepare(g=[1])
            assert wrong.value.field == "g" and session.update().solved


def test_what_the_server_refuses_of_a_first_part_is_the_update_s_error(client):
    with client.session(tiny()) as session:
        before = session.update().objective
        session.prepare(c0=5.0, options={"max_iterations": -1})
        with pytest.raises(marble.InvalidArgument):
            session.update()
        assert session.update().objective == before and session.problem.c0 == 2.0


def test_latest_only_supersedes_what_waits(start_server):
    problem, options = long_solve()
    with marble.Client(start_server("--workers", "1").address) as client, \
            client.session(tiny(), latest_only=True) as session:
        blocker = client.jobs.submit(problem, options=options, priority="realtime").job_id  # steps aside for nobody
        assert wait_until(lambda: client.info().counters["running"] == 1)
        for k in range(4):  # the first waits for the worker, each other one behind it until the next comes
            session.send(c0=float(k))
        events = [session.next() for _ in range(2)]
        client.jobs.cancel(blocker)
        events += [session.next() for _ in range(2)]
    assert [type(event.outcome) for event in events] == 2 * [marble.Superseded] + 2 * [marble.Solution]
    assert [event.sequence for event in events] == [2, 3, 1, 4]


def test_progress_is_reported_with_the_update_s_number(client):
    rows = []
    with client.session(random_problem(1), progress=lambda number, row: rows.append((number, row))) as session:
        session.update()
        session.update(cold=True)
    assert {number for number, _ in rows} == {1, 2}


def test_a_deadline_of_an_update_leaves_the_session_open(client):
    problem, options = long_solve()
    with client.session(problem, options=options) as session:
        assert session.update(deadline=0.2).status is marble.Status.TIME_LIMIT
        assert session.is_open
        assert session.update(options={"time_limit_s": 0.1}).status is marble.Status.TIME_LIMIT


def test_leaving_by_an_exception_gives_the_session_up(client):
    with pytest.raises(KeyError), client.session(tiny()):
        raise KeyError
    assert wait_until(lambda: client.info().counters["sessions"] == 0)


def test_an_idle_session_is_aborted(start_server):
    server = start_server("--session-idle-s", "1")
    with marble.Client(server.address) as client:
        session = client.session(tiny())
        assert wait_until(lambda: client.info().counters["sessions"] == 0)
        with pytest.raises(marble.Aborted):
            session.next()
        assert not session.is_open
        with pytest.raises(marble.FailedPrecondition):
            session.update()


def test_a_server_that_dies_ends_the_session(start_server):
    server = start_server()
    with marble.Client(server.address) as client:
        session = client.session(tiny(), reopen=False)
        assert session.update().solved
        server.kill()
        with pytest.raises(marble.Unavailable):
            session.update()
        assert not session.is_open


def test_a_shift_must_fit_the_problem():
    for stages, bound in ((3, "must divide the number of variables, 2"), (0, "must be a whole number >= 1")):
        with pytest.raises(marble.InvalidArgument) as refused:
            marble.Shift.by_stage(tiny(), stages)
        assert (refused.value.field, refused.value.value, refused.value.bound) == ("stages", str(stages), bound)
    assert marble.Shift.by_stage(tiny(), 2 - 1).variables == (marble.ShiftBlock(0, 2, 2),)


pytestmark = pytest.mark.usefixtures("way_of_sessions")


def _serving(servers):
    def sessions(server):
        with marble.Client(server.address) as client:
            return client.info().counters["sessions"]

    return next(server for server in servers if sessions(server))


def test_it_is_as_it_was_once_its_server_is_there_again(open_session, start_server):
    problem = random_problem(2)
    server = start_server()
    session = open_session(server.address, problem)
    assert not session.update().reopened
    session.update(g=problem.g + 1.0, options={"max_iterations": 77})
    job = session.job_id
    server.kill()
    start_server(listen=server.address)
    answer = session.update(C=0.5 * problem.C.toarray())
    check(problem.replaced(g=problem.g + 1.0, C=0.5 * problem.C), answer)
    assert answer.reopened and session.reopened == 1 and session.job_id != job
    assert answer.options["max_iterations"] == 77 and answer.job_id == session.job_id
    again = session.update(c0=7.0)
    assert not again.reopened and session.reopened == 1
    check(problem.replaced(g=problem.g + 1.0, C=0.5 * problem.C, c0=7.0), again)


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_it_goes_on_at_the_next_server(open_session, start_server, how):
    servers = [start_server("--drain-grace-s", "60") for _ in range(2)]
    session = open_session([server.address for server in servers], tiny())
    assert session.update().solved
    _serving(servers).process.send_signal(how)
    answers = []
    assert wait_until(lambda: answers.append(session.update(c0=5.0)) or session.reopened)
    assert answers[-1].reopened and answers[-1].objective == pytest.approx(4.0)


def test_all_that_was_sent_is_answered_once_and_in_order(open_session, start_server):
    server = start_server("--workers", "1")
    problem, options = long_solve()
    session = open_session(server.address, tiny())
    assert session.update().solved
    with marble.Client(server.address) as client:
        client.jobs.submit(problem, options=options, priority="realtime")
        assert wait_until(lambda: client.info().counters["running"] == 1)
        numbers = [session.send(c0=float(k)) for k in range(5)]
        server.kill()
        numbers += [session.send(c0=float(k)) for k in range(5, 10)]
        start_server("--workers", "1", listen=server.address)
        events = [session.next() for _ in numbers]
    assert [event.sequence for event in events] == numbers
    assert [round(event.outcome.objective) for event in events] == [k - 1 for k in range(10)]
    assert [event.outcome.reopened for event in events] == [True] + 9 * [False]
    assert session.problem.c0 == 9.0 and session.update().objective == pytest.approx(8.0)


@pytest.mark.parametrize("parts", [False, True])
def test_it_starts_from_the_last_z_moved_on(open_session, start_server, parts):
    """Its answer has the bits of a new session that starts there."""
    hopper = Hopper(steps=30)
    server = start_server()
    session = open_session(server.address, hopper.problem())
    first = session.update()
    later = hopper.advanced(first.z).problem()
    server.kill()
    again = start_server(listen=server.address)
    if parts:
        session.prepare(g=later.g, shift=30)
        answer = session.update(later)
    else:
        answer = session.update(later, shift=30)
    check(later, answer)
    start = marble.Shift.by_stage(later, 30).moved(first.z)
    with marble.Client(again.address) as client, client.session(hopper.problem()) as other:
        assert np.array_equal(other.update(later, z0=start).z, answer.z)


def test_what_may_not_wait_leaves_its_numbers_and_the_session(open_session, start_server):
    server = start_server()
    session = open_session(server.address, tiny())
    assert session.update().solved
    server.kill()
    with pytest.raises(marble.Unavailable):
        session.update(c0=5.0, deadline=0.05)
    assert session.is_open and session.problem.c0 == 5.0
    start_server(listen=server.address)
    assert first_answer(session, 0.5).objective == pytest.approx(4.0) and session.reopened == 1


def test_it_tries_again_after_its_time_to_wait(open_session, start_server):
    server = start_server()
    session = open_session(server.address, tiny(), {"wait": 0.2})
    number = session.send(c0=3.0)
    assert session.next().sequence == number
    server.kill()
    number = session.send(c0=4.0)
    with pytest.raises(marble.Unavailable):
        session.next()
    assert session.is_open
    start_server(listen=server.address)
    events = []

    def is_reported():
        try:
            events.append(session.next())
        except marble.Unavailable:
            return False
        return True

    assert wait_until(is_reported)
    assert events[0].sequence == number and events[0].outcome.objective == pytest.approx(3.0)


def test_it_is_opened_on_a_server_that_comes_back(open_session, start_server):
    server = start_server()
    server.kill()
    absence = Absence(server.address)
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        opened = pool.submit(open_session, server.address, tiny(), {"wait": 60})
        absence.wait()
        absence.end()
        start_server(listen=server.address)
        session = opened.result(60)
    assert session.update().solved and session.reopened == 0


def test_it_may_be_given_up_while_its_server_is_lost(start_server):
    server = start_server()
    with marble.Client(server.address, wait=3600) as client, \
            concurrent.futures.ThreadPoolExecutor(1) as pool:
        session = client.session(tiny())
        assert session.update().solved
        server.kill()
        absence = Absence(server.address)
        update = pool.submit(session.update)
        absence.wait()
        session.cancel()
        with pytest.raises(marble.Error):
            update.result(60)
        absence.end()
    assert not session.is_open


def test_leaving_it_says_nothing_of_a_server_that_is_gone(start_server):
    server = start_server()
    with marble.Client(server.address) as client, client.session(tiny()) as session:
        assert session.update().solved
        server.kill()

    async def scenario():
        other = start_server()
        async with marble.aio.Client(other.address) as aio, aio.session(tiny()) as session:
            assert (await session.update()).solved
            other.kill()

    asyncio.run(scenario())


def test_each_set_up_has_an_epoch_and_what_has_another_is_ignored():
    request, response = contract.message("SessionRequest"), contract.message("SessionResponse")
    core = SessionCore(tiny(), None, reopen=True)
    assert request.FromString(core.set_up(Call(), False)).setup.epoch == 0
    core.take(response(ready={"epoch": 0}).SerializeToString())
    assert request.FromString(core.update(c0=3.0)).update.epoch == 0
    again = request.FromString(core.set_up_again()).setup
    assert again.epoch == 1 and again.problem.constant == 2.0
    core.take(response(ready={"epoch": 1}).SerializeToString())
    updates = [request.FromString(message).update for message in core.again()]
    assert [(one.sequence, one.epoch, one.problem.constant) for one in updates] == [(1, 1, 3.0)]
    error = {"sequence": 1, "status": {"code": 4, "message": "too late"}}
    assert core.take(response(error={**error, "epoch": 0}).SerializeToString()) == (False, None)
    done, event = core.take(response(error={**error, "epoch": 1}).SerializeToString())
    assert done and isinstance(event.outcome, marble.DeadlineExceeded)
    assert request.FromString(core.update(c0=4.0)).update.epoch == 1


def test_an_update_given_up_while_a_session_is_reopened_keeps_no_later_one():
    core = SessionCore(tiny(), None, reopen=True)
    core.set_up(Call(), False)
    core.set_up_again()
    core.update(c0=1.0)
    core.give_up(1)
    core.again()  # as a preparation, which has no result
    for number in (2, 3):
        core.update(c0=float(number))
        core.settle(number, kept=True)
    assert not core._updates


def test_a_reopen_that_is_late_does_not_end_the_session(open_session, start_server):
    servers = [start_server("--drain-grace-s", "60") for _ in range(2)]
    session = open_session([server.address for server in servers], tiny(), answer_grace=0.05)
    assert session.update().solved
    left = _serving(servers)
    other = next(server for server in servers if server is not left)
    stop_all(other.process)
    left.process.send_signal(signal.SIGTERM)

    def is_refused():
        try:
            session.update(c0=5.0, deadline=0.2)
        except (marble.Unavailable, marble.DeadlineExceeded):
            return True
        return False

    assert wait_until(is_refused) and is_refused() and session.is_open
    other.process.send_signal(signal.SIGCONT)
    assert wait_until(lambda: not is_refused())
    assert session.update(c0=6.0).objective == pytest.approx(5.0) and session.reopened == 1
