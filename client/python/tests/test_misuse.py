"""What no program should do: every misuse is an exception of marble.errors, the same in process and on a server."""

from __future__ import annotations

import asyncio
import concurrent.futures
import copy
import multiprocessing
import os
import pathlib
import pickle
import subprocess
import sys
import threading

import numpy as np
import pytest
import scipy.sparse as sp
from support import clean_environment, long_solve, random_problem, tiny

import marble
from marble import errors


@pytest.fixture(params=["local", "remote"])
def either(request, server):
    with marble.Client("local" if request.param == "local" else server.address) as one:
        yield one


@pytest.mark.parametrize("values", [
    "ab", b"ab", ["1", "2"], np.array(["1", "2"]), [object(), 1], None, {}, {1, 2}, [[1, 2], [3]], [10**400, 1],
    np.array([1j, 2]), np.array(["2020-01-01", "2020-01-02"], "M8[D]"), np.zeros(2, dtype=[("a", "f8")]),
    np.ma.array([1.0, 2.0], mask=[0, 1]), sp.csc_matrix([[1.0], [2.0]]), [np.inf, 1], [np.nan, 1],
], ids=lambda values: f"{type(values).__name__}-{str(values)[:12]}")
def test_what_is_no_vector_of_real_numbers_is_refused(values):
    with pytest.raises(marble.InvalidProblem) as caught:
        marble.LCQP(None, values)
    assert caught.value.field == "g"
    with marble.Client("local") as client, client.session(tiny()) as session:
        for part in ("g", "z0"):
            if values is not None:
                with pytest.raises(marble.InvalidProblem) as caught:
                    session.update(**{part: values})
                assert caught.value.field == part
        assert session.update().solved


@pytest.mark.parametrize("values", [
    np.float16([-2, -2]), np.longdouble([-2, -2]), np.array([-2.0, -2.0], ">f8"), np.full(4, -2.0)[::2],
    np.full((2, 1), -2.0), np.array([-2, -2], object), np.ma.array([-2.0, -2.0]), (-2, -2),
], ids=lambda values: str(getattr(values, "dtype", "tuple")))
def test_real_numbers_count_whatever_their_layout(either, values):
    if isinstance(values, np.ndarray):
        values.flags.writeable = False
    assert either.solve(marble.LCQP(2 * np.eye(2), values, L=[1, 0], R=[0, 1], c0=2.0)).objective == pytest.approx(1)


def _broken(kind: str, **arrays: object) -> object:
    made = sp.random(40, 40, 0.3, random_state=1).asformat(kind)
    for name, change in arrays.items():
        setattr(made, name, change(getattr(made, name)))
    return made


def _with(at: int, value: int):
    def change(array):
        changed = array.copy()
        changed[at] = value
        return changed
    return change


@pytest.mark.parametrize(("kind", "arrays"), [
    *((kind, arrays) for kind in ("csc", "csr") for arrays in (
        {"indices": _with(3, 10**6)}, {"indices": _with(0, -1)}, {"indptr": _with(1, 10**6)}, {"indptr": _with(0, 5)},
        {"indptr": _with(-1, 10**6)}, {"indptr": lambda a: a[:-1]}, {"data": lambda a: a[:3]},
        {"indices": lambda a: a[:3]})),
    ("coo", {"row": _with(0, 10**6)}), ("coo", {"col": _with(0, -1)}), ("coo", {"data": lambda a: a[:3]}),
    ("bsr", {"indices": _with(0, 10**6)}), ("csc", {"data": lambda a: a * 1j}),
], ids=lambda part: part if isinstance(part, str) else "-".join(part))
def test_a_sparse_matrix_with_arrays_that_do_not_fit_is_refused_before_scipy_reads_them(kind, arrays):
    for field in "QACLR":
        parts = {field: _broken(kind, **arrays)}
        with pytest.raises(marble.InvalidProblem) as caught:
            marble.LCQP(parts.pop("Q", None), np.ones(40), **parts)
        assert caught.value.field == field


def test_a_sparse_matrix_may_have_room_behind_its_entries():
    roomy = sp.csc_matrix([[1.0, 0.0]])
    roomy.data, roomy.indices = np.append(roomy.data, np.nan), np.append(roomy.indices, 0)
    assert marble.LCQP(None, [1, 1], A=roomy).A.nnz == 1


@pytest.mark.parametrize(("wrong", "field"), [
    ({"options": "x"}, "options"), ({"options": [1]}, "options"), ({"options": {1: 2}}, "options"),
    ({"options": {"num_starts": None}}, "num_starts"), ({"options": {"num_starts": float("nan")}}, "num_starts"),
    ({"options": {"num_starts": np.array([1, 2])}}, "num_starts"), ({"options": {"num_starts": 10**400}}, "num_starts"),
    ({"options": {"kappa_initial": 10**400}}, "kappa_initial"), ({"options": {"kappa_initial": "x"}}, "kappa_initial"),
    ({"deadline": "x"}, "deadline"), ({"deadline": float("nan")}, "deadline"), ({"deadline": True}, "deadline"),
    ({"request_id": 5}, "request_id"), ({"request_id": b"x"}, "request_id"), ({"request_id": "\ud800"}, "request_id"),
    ({"progress": 5}, "progress"), ({"progress": print, "progress_interval": "x"}, "progress_interval"),
    ({"progress": print, "iterate_every": 1.5}, "iterate_every"), ({"warm_start": {}}, "warm_start"),
    ({"sensitivity": "x"}, "sensitivity"), ({"priority": 5}, "priority"),
])
def test_an_argument_of_a_wrong_type_is_named(either, wrong, field):
    with pytest.raises(marble.InvalidArgument) as caught:
        either.solve(tiny(), **wrong)
    assert caught.value.field == field


@pytest.mark.parametrize("deadline", [float("inf"), 1e300, np.float32(60), 2**40])
def test_a_deadline_that_never_comes_is_none(either, deadline):
    assert either.solve(tiny(), deadline=deadline).solved


def test_texts_that_are_no_unicode_are_no_crash(client):
    assert marble.LCQP(None, [1.0], name="\ud800").name == "?"
    with pytest.raises(marble.InvalidProblem, match="name"):
        marble.LCQP(None, [1.0], name=5)
    with pytest.raises(marble.NotFound):
        client.jobs.get("\ud800")


def test_composite_arguments_of_a_wrong_type_are_named(either):
    for call, field in ((lambda: either.scenarios(tiny(), "x"), "scenarios"),
                        (lambda: either.coupled(["x"], [None], [1.0]), "problem"),
                        (lambda: either.segments(tiny(), [0, 2**32], 2), "stages"),
                        (lambda: either.segments(tiny(), [0.5, 1], 2), "stages")):
        with pytest.raises(marble.InvalidArgument) as caught:
            call()
        assert caught.value.field == field


def test_a_closed_client_says_so(either):
    either.close()
    either.close()
    for call in (lambda: either.solve(tiny()), lambda: either.solve_async(tiny()), lambda: either.session(tiny()),
                 lambda: list(either.batch([tiny()])), lambda: either.coupled([tiny()], [None], [])):
        with pytest.raises(marble.FailedPrecondition, match="closed"):
            call()
    if either.address != "in process":
        for call in (either.info, either.jobs.list, lambda: next(either.watch())):
            with pytest.raises(marble.FailedPrecondition, match="closed"):
                call()


@pytest.mark.parametrize("where", ["local", "remote"])
def test_a_closed_asynchronous_client_says_so(server, where):
    async def use() -> None:
        async with marble.aio.Client("local" if where == "local" else server.address) as client:
            pass
        with pytest.raises(marble.FailedPrecondition, match="closed"):
            await client.solve(tiny())

    asyncio.run(use())


def test_a_cancelled_task_gives_its_solve_up(server):
    async def use() -> None:
        problem, options = long_solve()
        async with marble.aio.Client(server.address) as client:
            rows = asyncio.Event()
            task = asyncio.ensure_future(client.solve(problem, options=options, progress=lambda row: rows.set()))
            await asyncio.wait_for(rows.wait(), 60)
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task
            assert (await client.solve(tiny())).solved

    asyncio.run(use())


def test_a_progress_function_may_use_the_client_but_not_its_own_session(either):
    inner = []
    either.solve(tiny(), progress=lambda row: inner.append(either.solve(tiny()).solved))
    assert inner and all(inner)
    for use in (lambda session: session.update(), lambda session: session.close()):
        session = either.session(tiny(), progress=lambda sequence, row, use=use: use(session))
        with pytest.raises(marble.FailedPrecondition, match="in use"):
            session.update()
        session.cancel()


def test_threads_share_a_session_and_may_close_it(either):
    session, faults = either.session(random_problem(3)), []

    def work() -> None:
        try:
            while True:
                session.update()
        except BaseException as error:
            faults.append(error)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    session.close()
    for thread in threads:
        thread.join(60)
    assert len(faults) == 4 and all(isinstance(fault, marble.Error) for fault in faults), faults


@pytest.mark.parametrize("error", [
    marble.InvalidProblem("A", "must be finite", index=(1, 2), value=3.0),
    marble.InvalidArgument("num_starts", "must be 1"),
    marble.Refused("full", 2.0), marble.NotFound("no job"), marble.DeadlineExceeded("late"), marble.Unavailable("away"),
], ids=lambda error: type(error).__name__)
def test_errors_may_be_pickled_and_copied(error):
    for made in (pickle.loads(pickle.dumps(error)), copy.deepcopy(error)):
        assert type(made) is type(error) and str(made) == str(error) and made.__dict__ == error.__dict__


def test_an_unsolved_answer_may_be_pickled():
    with marble.Client("local") as client:
        answer = client.solve(marble.LCQP(None, [-1.0]))
    with pytest.raises(errors.Unsolved) as caught:
        answer.raise_if_unsolved()
    made = pickle.loads(pickle.dumps(caught.value))
    assert str(made) == str(caught.value) and made.solution.status is answer.status


def test_an_error_leaves_a_pool_of_processes_whole():
    with concurrent.futures.ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork")) as pool:
        with pytest.raises(marble.InvalidProblem, match="finite"):
            pool.submit(marble.LCQP, None, [float("nan")]).result(60)
        assert pool.submit(marble.solve, None, [1.0], C=[1.0]).result(60).solved


def test_a_forked_process_solves_in_process():
    with marble.Client("local") as client:
        assert client.solve(tiny()).solved
        child = os.fork()
        if child == 0:
            os._exit(0 if client.solve(tiny()).solved else 1)
        assert os.waitpid(child, 0)[1] == 0 and client.solve(tiny()).solved


PROGRAM = """
import contextlib, threading, marble
from support import long_solve
client, (problem, options), begun = marble.Client({address!r}), long_solve(), threading.Event()
def solve():
    with contextlib.suppress(marble.Cancelled):
        client.solve(problem, options=options, progress=lambda row: begun.set())
use = {{"handle": lambda: client.solve_async(problem, options=options, progress=lambda row: begun.set()),
       "thread": lambda: threading.Thread(target=solve, daemon=True).start(),
       "session": lambda: (client.session(problem, options={{**options, "max_iterations": 1}}).update(), begun.set())}}
kept = use[{kind!r}]()
assert begun.wait(60)
print("leaves")
"""


@pytest.mark.parametrize("kind", ["handle", "thread", "session"])
def test_an_interpreter_ends_while_something_is_under_way(either, server, kind):
    address = "local" if either.address == "in process" else server.address
    folder = pathlib.Path(__file__).parent
    done = subprocess.run([sys.executable, "-c", PROGRAM.format(address=address, kind=kind)], capture_output=True,
                          text=True, timeout=120, cwd=folder, env=clean_environment())
    assert (done.returncode, done.stdout, done.stderr) == (0, "leaves\n", "")
