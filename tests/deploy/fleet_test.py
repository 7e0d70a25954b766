"""Three servers behind HAProxy, nginx and Envoy with the files of deploy/proxies, and behind our client's own balancing."""

import http.client
import json
import shutil
import signal
import subprocess

import marble
import pytest
from marble.base import contract

from fleet import BUILD, Envoy, Fleet, HAProxy, Load, Nginx, NoProxy, QuietConnection, example, example_file, eventually

ENGINES = [HAProxy, Nginx, Envoy, NoProxy]


@pytest.fixture(scope="module")
def fleet():
    fleet = Fleet()
    yield fleet
    fleet.close()


@pytest.fixture(scope="module")
def problem():
    return example()


@pytest.fixture(params=ENGINES, ids=lambda engine: engine.__name__)
def engine(request, fleet):
    kind = request.param
    if kind is not NoProxy and not shutil.which(kind.program) and not (BUILD / "envoy" / kind.program).exists():
        pytest.skip(f"{kind.program} cannot be had")
    running = kind()
    yield running
    running.close()


def gained(fleet, before):
    return [now - then for now, then in zip(fleet.answered(), before)]


def test_all_three_get_work(fleet, engine, problem):
    before = fleet.answered()
    load = Load(engine.target, problem)
    load.wait_for(150)
    assert load.stop().errors == []
    shares = gained(fleet, before)
    assert sum(shares) == load.solved
    assert min(shares) > load.solved / 10


def test_what_a_killed_server_had_is_repeated_elsewhere_and_answered(fleet, engine, problem):
    killed = fleet.servers[0]
    load = Load(engine.target, problem)
    load.wait_for(30)
    killed.kill()
    load.wait_for(100)
    killed.start()
    eventually(lambda: killed.answered() > 0, "work for the server that came back")
    assert load.stop().errors == []


def test_a_rolling_restart_under_full_load_is_seen_by_nobody(fleet, engine, problem):
    # Behind a proxy a client that repeats nothing sees no error either.
    load = Load(engine.target, problem, repeating=isinstance(engine, NoProxy))
    for server in fleet.servers:
        load.wait_for(20)
        engine.take_out(server.name)
        server.stop()
        load.wait_for(20)
        server.start()
        engine.take_in(server.name)
    load.wait_for(20)
    assert load.stop().errors == []


def test_an_old_worker_of_nginx_ends_though_a_connection_was_silent_when_it_was_reported(fleet):
    class Impatient(Nginx):
        def command(self):
            words = super().command()
            text = self.file.read_text().replace("keepalive_time 1m;", "keepalive_time 2s;")
            assert "keepalive_time 2s;" in text
            self.file.write_text(text)
            return words

    engine = Impatient()
    quiet = QuietConnection()
    try:
        eventually(lambda: engine.has_accepted(quiet.upstream[0]), "the connection with a worker")
        old = engine.workers()
        engine.process.send_signal(signal.SIGHUP)
        eventually(lambda: engine.workers() - old and engine.workers() & old == engine.leaving(), "the word to the old workers")
        with marble.Client(quiet.address) as client:
            eventually(lambda: client.info() and not engine.workers() & old, "the old workers' end")
    finally:
        quiet.close()
        engine.close()


def test_with_time_of_notice_haproxy_needs_no_word_from_the_operator(fleet, problem):
    def start_anew(flags):
        for server in fleet.servers:
            server.kill()
            server.flags = flags
            server.start()

    start_anew(["--drain-notice-s", "3"])
    engine = HAProxy()
    try:
        load = Load(engine.target, problem, repeating=False)
        for server in fleet.servers:
            load.wait_for(20)
            server.stop()
            server.start()
            engine.take_in(server.name)
        load.wait_for(20)
        assert load.stop().errors == []
    finally:
        engine.close()
        start_anew([])


@pytest.mark.parametrize("engine", [HAProxy, Nginx, Envoy], indirect=True, ids=lambda engine: engine.__name__)
def test_a_server_with_much_other_work_gets_less(fleet, engine, problem):
    busy = fleet.servers[1]
    other = Load(busy.address, example(steps=20), clients=4)
    before = fleet.answered()
    load = Load(engine.target, problem)
    load.wait_for(150)
    assert load.stop().errors == []
    others = other.stop().solved
    shares = gained(fleet, before)
    shares[1] -= others
    assert shares[1] < 0.7 * min(shares[0], shares[2]), shares


def test_the_cpp_client_takes_turns_and_repeats_what_a_killed_server_had(fleet, tmp_path):
    file = tmp_path / "hopper.json"
    file.write_bytes(example_file())
    files = [file] * 40
    before, killed = fleet.answered(), fleet.servers[2]
    programs = [subprocess.Popen([BUILD / "bin/marble", "solve", "--server", NoProxy.target, "--quiet", "--output", "json", *files],
                                 stdout=subprocess.PIPE, stderr=subprocess.PIPE) for _ in range(4)]
    # Each program begins with the server it reached first: how even the turns are early on is chance.
    eventually(lambda: min(gained(fleet, before)) > 3, "answers by all three")
    killed.kill()
    outputs = [program.communicate(timeout=200) for program in programs]
    killed.start()
    for program, (answers, errors) in zip(programs, outputs):
        assert program.returncode == 0, errors.decode()
        assert [json.loads(line)["status"] for line in answers.splitlines()] == ["solved"] * len(files)


def test_browsers_reach_envoy_by_grpc_web(fleet):
    if not shutil.which("envoy") and not (BUILD / "envoy/envoy").exists():
        pytest.skip("envoy cannot be had")
    engine = Envoy()
    try:
        connection = http.client.HTTPConnection(engine.target)
        connection.request("POST", "/marble.v1.Server/GetInfo", b"\0\0\0\0\0",
                           {"content-type": "application/grpc-web+proto", "origin": "https://planner.example"})
        answer = connection.getresponse()
        body = answer.read()
        assert answer.status == 200
        assert answer.headers["access-control-allow-origin"] == "https://planner.example"
        size = int.from_bytes(body[1:5], "big")
        info = contract.message("GetInfoResponse").FromString(body[5:5 + size])
        assert info.workers == 1
        assert b"grpc-status:0" in body[5 + size:]
    finally:
        engine.close()
