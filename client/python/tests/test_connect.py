"""Who calls, how it is encrypted, and which of several servers answers."""

from __future__ import annotations

import asyncio
import collections
import concurrent.futures
import inspect
import json
import pathlib
import signal
import subprocess
import sys

import grpc
import numpy as np
import pytest
from support import PROGRAM, SERVER, clean_environment, long_solve, random_problem, tiny, wait_until

import marble
import marble.aio
from marble.aio.local import AioLocalTransport
from marble.aio.remote import AioRemoteTransport
from marble.hopper import Hopper
from marble.transport.local import LocalTransport
from marble.transport.remote import RemoteTransport
from marble.transport.transport import Transport


def _openssl(folder, *arguments):
    subprocess.run(["openssl", *arguments], cwd=folder, check=True, capture_output=True)


@pytest.fixture(scope="module")
def authority(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tls")
    key = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")
    _openssl(folder, "req", "-x509", *key, "-days", "2", "-subj", "/CN=test authority", "-keyout", "ca.key", "-out",
             "ca.pem")
    for name, alternative in (("server", "DNS:localhost,IP:127.0.0.1"), ("planner", "DNS:planner")):
        _openssl(folder, "req", *key, "-subj", f"/CN={name}", "-addext", f"subjectAltName={alternative}", "-keyout",
                 f"{name}.key", "-out", f"{name}.csr")
        _openssl(folder, "x509", "-req", "-in", f"{name}.csr", "-CA", "ca.pem", "-CAkey", "ca.key", "-days", "2",
                 "-copy_extensions", "copy", "-out", f"{name}.pem")
    return folder


def _token(folder, roles):
    made = subprocess.run([SERVER, "--new-token", roles], capture_output=True, text=True, env=clean_environment(),
                          check=True).stdout.split("\n")
    with open(folder / "tokens.txt", "a") as file:
        file.write(made[1] + "\n")
    return made[0]


def test_tls_and_tokens(start_server, authority, tmp_path, monkeypatch):
    token, watcher = _token(tmp_path, "planner:solve"), _token(tmp_path, "watcher:observe")
    server = start_server("--tls-certificate", str(authority / "server.pem"), "--tls-key",
                          str(authority / "server.key"), "--tokens", str(tmp_path / "tokens.txt"))
    ca = str(authority / "ca.pem")
    with marble.Client(server.address, tls_ca=ca, token=token) as client:
        assert client.solve(tiny()).solved
        assert client.info().client == "planner" and client.info().roles == ("solve",)
    with marble.Client(server.address, tls_ca=ca, token="wrong") as client, pytest.raises(marble.Unauthenticated):
        client.solve(tiny())
    with marble.Client(server.address, tls_ca=ca, token=watcher) as client, pytest.raises(marble.PermissionDenied):
        client.solve(tiny())
    with (marble.Client(server.address, token=token) as client,
          pytest.raises(marble.Unavailable, match=r"does the server want TLS \(tls=True, MARBLE_TLS_CA\)")):
        client.solve(tiny(), deadline=30)
    with (marble.Client(server.address, token=token, tls=True) as client,
          pytest.raises(marble.Unavailable, match="tls_ca or MARBLE_TLS_CA names who vouches for the server")):
        client.solve(tiny(), deadline=30)
    monkeypatch.setenv("MARBLE_SERVER", server.address)
    monkeypatch.setenv("MARBLE_TOKEN", token)
    monkeypatch.setenv("MARBLE_TLS_CA", ca)
    assert marble.solve(tiny()).solved


def test_a_client_s_certificate_names_it(start_server, authority):
    server = start_server("--tls-certificate", str(authority / "server.pem"), "--tls-key",
                          str(authority / "server.key"), "--tls-client-ca", str(authority / "ca.pem"))
    with marble.Client(server.address, tls_ca=str(authority / "ca.pem"),
                       tls_certificate=str(authority / "planner.pem"),
                       tls_key=str(authority / "planner.key")) as client:
        assert client.info().client == "cert:planner" and client.solve(tiny()).solved
    with (marble.Client(server.address, tls_ca=str(authority / "ca.pem")) as client,
          pytest.raises(marble.Unavailable, match=r"or a certificate of the client \(MARBLE_TLS_CERTIFICATE\)")):
        client.info()


def test_a_server_without_tls_is_reported_to_a_client_with_it(server, authority):
    for options in ({"tls": True}, {"tls_ca": str(authority / "ca.pem")}):
        with (marble.Client(server.address, **options) as client,
              pytest.raises(marble.Unavailable, match="does the server speak without TLS")):
            client.info()
    with marble.Client("127.0.0.1:1") as client, pytest.raises(marble.Unavailable) as nobody:
        client.info()
    assert "TLS" not in str(nobody.value)


@pytest.mark.parametrize(("options", "field"), [
    ({"tls_ca": "/nowhere"}, "tls_ca"),
    ({"tls_ca": __file__}, "tls_ca"),
    ({"tls_certificate": "a"}, "tls_key"),
    ({"token": "with space"}, "token"),
    ({"name": "x" * 65}, "name"),
])
def test_bad_credentials_are_reported_by_field(options, field):
    with pytest.raises(marble.InvalidArgument) as caught:
        marble.Client("127.0.0.1:1", **options)
    assert caught.value.field == field and "with space" not in str(caught.value)


def test_a_client_has_the_name_it_gave_itself(server):
    with marble.Client(server.address, name="arm-7") as client:
        assert client.info().client == "arm-7"


def test_a_unix_socket_serves_too(start_server, tmp_path):
    server = start_server(listen=f"unix:{tmp_path}/m.sock")
    with marble.Client(server.address) as client:
        assert client.solve(tiny()).solved


def test_several_servers_take_turns_and_one_may_die(start_server):
    servers = [start_server(), start_server()]
    with marble.Client([server.address for server in servers]) as client:
        def counts():
            totals = []
            for server in servers:
                with marble.Client(server.address) as one:
                    totals.append(one.info().counters["answered_total"])
            return totals

        assert wait_until(lambda: client.solve(tiny()).solved and min(counts()) > 0)
        servers[0].kill()
        assert all(client.solve(tiny()).solved for _ in range(20))


def test_a_name_stands_for_all_its_addresses(server):
    with marble.Client(f"dns:///localhost:{server.address.rpartition(':')[2]}") as client:
        assert all(client.solve(tiny()).solved for _ in range(3))
    with pytest.raises(marble.InvalidArgument) as caught:
        marble.Client("dns:///localhost")
    assert caught.value.field == "address"


def test_a_client_outlives_a_restart_of_its_server(start_server, tmp_path):
    path = f"unix:{tmp_path}/again.sock"
    first = start_server(listen=path)
    with marble.Client(path) as client:
        assert client.solve(tiny()).solved
        first.stop()
        start_server(listen=path)
        assert wait_until(lambda: _solved(client))


class _Draining(grpc.GenericRpcHandler):
    """A server that is always about to go."""

    def __init__(self):
        self.calls = collections.Counter()

    def service(self, details):
        def refuse(request, context):
            self.calls[details.method.rpartition("/")[2]] += 1
            context.abort(grpc.StatusCode.UNAVAILABLE, "the server is draining")

        return grpc.unary_unary_rpc_method_handler(refuse)


def test_only_calls_that_are_the_same_when_made_twice_are_repeated():
    handler, server = _Draining(), grpc.server(concurrent.futures.ThreadPoolExecutor(2))
    server.add_generic_rpc_handlers((handler,))
    port = server.add_insecure_port("127.0.0.1:0")
    server.start()
    with marble.Client(f"127.0.0.1:{port}") as client:
        for call in (lambda: client.solve(tiny()), lambda: client.jobs.submit(tiny()), client.info,
                     lambda: client.jobs.delete("x")):
            with pytest.raises(marble.Unavailable, match="draining"):
                call()
    server.stop(0)
    handler.calls.pop("Check")  # between tries
    assert handler.calls == {"Solve": 4, "Submit": 4, "GetInfo": 4, "Delete": 1}


def test_a_draining_server_is_left_out_of_the_turns(start_server):
    servers = [start_server("--workers", "1", "--drain-grace-s", "3600"), start_server("--workers", "1")]
    problem, options = long_solve()
    with marble.Client(servers[0].address, wait=0) as one, \
            marble.Client([server.address for server in servers]) as both:
        busy = one.solve_async(problem, options=options)
        assert wait_until(lambda: one.info().counters["running"] == 1)
        servers[0].process.send_signal(signal.SIGTERM)
        # Only then: what it accepts before it knows of the signal waits behind the long solve.
        assert wait_until(lambda: _refuses(one))
        assert all(both.solve(tiny()).solved for _ in range(30))
        busy.cancel()


def test_ctrl_c_frees_the_worker(start_server):
    server = start_server()
    script = ("import support, marble; problem, options = support.long_solve(); "
              "marble.solve(problem, options=options)")
    environment = clean_environment(MARBLE_SERVER=server.address,
                                    PYTHONPATH=str(pathlib.Path(marble.__file__).parent.parent))
    run = subprocess.Popen([sys.executable, "-c", script], cwd=pathlib.Path(__file__).parent, stderr=subprocess.PIPE,
                           env=environment)
    with marble.Client(server.address) as client:
        assert wait_until(lambda: client.info().counters["running"] == 1)
        run.send_signal(signal.SIGINT)
        assert b"KeyboardInterrupt" in run.communicate(timeout=60)[1]
        assert wait_until(lambda: client.info().counters["running"] == 0)


def _refuses(client):
    try:
        client.jobs.submit(tiny())
    except marble.Unavailable:
        return True
    return False


def _solved(client):
    try:
        return client.solve(tiny()).solved
    except marble.Unavailable:
        return False


@pytest.mark.parametrize("name", ["hopper", "rocket", "gates", "qpec"])
def test_the_same_bits_as_the_command_line(client, tmp_path, name):
    file = tmp_path / f"{name}.json"
    file.write_bytes(subprocess.run([PROGRAM, "example", name], capture_output=True, check=True).stdout)
    for place in (["--server", client.address], ["--local"]):
        run = subprocess.run([PROGRAM, "solve", *place, "--quiet", "--output", "json", str(file)],
                             capture_output=True, text=True, env=clean_environment(), check=False)
        theirs = json.loads(run.stdout)
        for problem in (marble.Problem.load(file), marble.Problem.load(file).compile()):
            ours = client.solve(problem)
            assert ours.status.value == theirs["status"]
            assert ours.z.tobytes() == np.array(theirs["z"]).tobytes()
            assert ours.xi.tobytes() == np.array(theirs["complementarity_multipliers"]["L"]).tobytes()
            assert ours.objective == theirs["objective"]


def test_repeated_solves_give_the_same_bits(client):
    for problem in (Hopper(steps=20).problem(), random_problem(11)):
        assert client.solve(problem).z.tobytes() == client.solve(problem).z.tobytes()


def public(kind: type) -> set[str]:
    return {name for name, value in vars(kind).items() if callable(value) and not name.startswith("_")}


@pytest.mark.parametrize("kind", [LocalTransport, RemoteTransport])
def test_a_transport_for_threads_has_every_call(kind):
    assert public(Transport) - public(kind) <= {"coordinate"}, "run() is coordinate() where this process solves"


@pytest.mark.parametrize("kind", [AioLocalTransport, AioRemoteTransport])
def test_a_transport_for_asyncio_has_every_call_that_its_client_makes(kind):
    assert public(Transport) - public(kind) == {"start", "subproblems"}


@pytest.mark.parametrize(("threads", "aio"), [(marble.Client, marble.aio.Client), (marble.Jobs, marble.aio.Jobs)],
                         ids=["client", "jobs"])
def test_the_clients_have_the_same_methods_with_the_same_parameters(threads, aio):
    own = public(threads) - {"solve_async"}
    assert own == public(aio)
    for name in own - {"batch", "session"}:
        ours, theirs = (inspect.signature(getattr(kind, name)) for kind in (threads, aio))
        assert ours == theirs, name
        assert name == "close" or getattr(aio, name).__doc__ == getattr(threads, name).__doc__


@pytest.mark.parametrize("address", ["local", None])
def test_an_invalid_argument_of_an_awaited_call_is_raised_by_the_await(server, address):
    async def scenario():
        async with marble.aio.Client(address or server.address) as client:
            results = await asyncio.gather(client.solve(tiny(), num_starts=0), client.solve(3), client.solve(tiny()),
                                           return_exceptions=True)
            assert [type(result) for result in results] == [marble.InvalidArgument, marble.InvalidProblem,
                                                            marble.Solution]

    asyncio.run(scenario())


def test_asyncio_refuses_to_coordinate_blocks_on_servers(server):
    async def scenario():
        async with marble.aio.Client(server.address) as client:
            with pytest.raises(marble.InvalidArgument, match="sessions"):
                await client.coupled([tiny()], [None], [], sessions=True)

    asyncio.run(scenario())


@pytest.mark.parametrize("ask", [lambda client: client.info(), lambda client: client.jobs.list(),
                                 lambda client: list(client.watch()), lambda client: list(client.jobs.array("id")),
                                 lambda client: client.jobs.submit(tiny())])
def test_without_a_server_its_own_calls_are_unavailable(ask):
    with marble.Client("local") as client, pytest.raises(marble.Unavailable, match="no server"):
        ask(client)
