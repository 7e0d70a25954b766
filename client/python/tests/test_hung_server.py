"""Sessions whose server hangs: it is stopped by SIGSTOP, and goes on by SIGCONT."""

from __future__ import annotations

import signal
import threading

import numpy as np
import pytest
import scipy.sparse as sp
from support import first_answer, stop_all, tiny, wait_until

import marble
from marble.calls import links

pytestmark = pytest.mark.usefixtures("way_of_sessions")

SOON, LONG = 0.02, 60.0


def _goes_on(server):
    server.process.send_signal(signal.SIGCONT)


@pytest.mark.parametrize("reopen", [False, True])
def test_an_update_returns_in_time_and_the_next_one_works_once_the_server_goes_on(open_session, start_server, reopen):
    server = start_server()
    session = open_session(server.address, tiny(), reopen=reopen)
    assert session.update(deadline=LONG).solved
    stop_all(server.process)
    for k in range(3):
        session.prepare(g=[-2.0, -2.0])
        with pytest.raises(marble.DeadlineExceeded) as caught:
            session.update(c0=float(k), deadline=SOON)
        assert str(caught.value) == "the server did not answer within 0.12 s, 0.1 s after the deadline"
        assert session.is_open
    _goes_on(server)
    answer = session.update(deadline=LONG)  # late answers are discarded, their numbers kept
    assert answer.solved and not answer.reopened and answer.objective == pytest.approx(1.0)  # of c0 = 2
    number = session.send(c0=5.0)
    event = session.next()
    assert event.sequence == number and event.outcome.objective == pytest.approx(4.0)
    session.close()


def test_updates_that_the_server_has_no_room_for_are_kept(open_session, start_server):
    n = 30_000  # numbers of 240 kB, and a window of 64 kB
    server = start_server()
    session = open_session(server.address, marble.LCQP(sp.identity(n), np.ones(n)))
    session.update(deadline=LONG)
    stop_all(server.process)
    for k in range(4):
        session.prepare(c0=float(k))
        with pytest.raises(marble.DeadlineExceeded):
            session.update(g=np.full(n, 2.0 + k), deadline=SOON)
    _goes_on(server)
    answer = session.update(deadline=LONG)
    assert answer.objective == pytest.approx(3.0 - 12.5 * n)


def test_a_server_without_answers_is_left_after_20_updates(open_session, start_server):
    servers = [start_server() for _ in range(2)]
    session = open_session([server.address for server in servers], tiny(), answer_grace=0.02)
    assert session.update(deadline=LONG).solved
    busy = next(server for server in servers if _sessions(server))
    stop_all(busy.process)
    for k in range(20):
        with pytest.raises(marble.DeadlineExceeded):
            session.update(c0=float(k), deadline=SOON)
    answer = first_answer(session, 0.2)
    assert session.reopened == 1
    assert answer.reopened and answer.objective == pytest.approx(18.0)  # of c0 = 19
    _goes_on(busy)


def test_one_that_is_not_reopened_ends_then(open_session, start_server):
    server = start_server()
    session = open_session(server.address, tiny(), reopen=False, answer_grace=0.001)
    stop_all(server.process)
    for _ in range(20):
        with pytest.raises(marble.DeadlineExceeded):
            session.update(deadline=0.001)
    with pytest.raises(marble.Unavailable, match="left 20 updates in a row without an answer"):
        session.update(deadline=0.001)
    assert not session.is_open
    _goes_on(server)


def test_closing_does_not_wait_for_it(open_session, start_server):
    server = start_server()
    session = open_session(server.address, tiny())
    stop_all(server.process)
    with pytest.raises(marble.DeadlineExceeded):
        session.update(deadline=SOON)
    session.close()
    assert not session.is_open
    _goes_on(server)
    assert wait_until(lambda: _sessions(server) == 0)


def test_closing_does_not_wait_for_it_with_an_earlier_update_under_way(open_session, start_server):
    server = start_server()
    session = open_session(server.address, tiny())
    stop_all(server.process)
    session.send(c0=1.0)
    with pytest.raises(marble.DeadlineExceeded):
        session.update(deadline=SOON)
    session.close()
    assert not session.is_open
    _goes_on(server)


def test_a_cancelled_stream_ends_after_messages_that_no_one_read():
    cancelled = threading.Event()

    class Stream:
        def __init__(self):
            self.left = links.AHEAD + 1

        def __iter__(self):
            return self

        def __next__(self):
            self.left -= 1
            if self.left < 0:
                raise StopIteration
            if self.left == 0:
                cancelled.wait()
            return b"data"

        def add_done_callback(self, _):
            pass

        def cancel(self):
            cancelled.set()

    class Rpc:
        def duplex(self, *_):
            return Stream()

    link = links._OfThread(Rpc(), b"", lambda: None)
    assert link.receive(LONG) == b"data"
    assert wait_until(lambda: link._inbox.qsize() == links.AHEAD - 1)
    link._inbox.put(b"data")  # full
    link.cancel()
    assert wait_until(lambda: None in link._inbox.queue)
    while link.receive(LONG) is not None:
        pass


@pytest.mark.parametrize("grace", [-1, float("nan"), float("inf"), 3601, "long", None, True])
def test_a_grace_is_a_number_in_its_range(open_session, start_server, grace):
    with pytest.raises(marble.InvalidArgument) as caught:
        open_session("127.0.0.1:1", tiny(), answer_grace=grace)
    assert caught.value.field == "answer_grace"


def _sessions(server):
    with marble.Client(server.address) as client:
        return client.info().counters["sessions"]
