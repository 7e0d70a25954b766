"""Who calls, how it is encrypted, and which of several servers answers."""

from __future__ import annotations

import json
import subprocess

import numpy as np
import pytest
from support import PROGRAM, SERVER, clean_environment, random_problem, tiny, wait_until

import marble
from marble.hopper import Hopper


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
    with marble.Client(server.address, token=token) as client, pytest.raises(marble.Unavailable):
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
        assert client.info().client == "planner" and client.solve(tiny()).solved


@pytest.mark.parametrize(("options", "field"), [
    ({"tls_ca": "/nowhere"}, "tls_ca"),
    ({"tls_ca": __file__}, "tls_ca"),
    ({"tls_certificate": "a"}, "tls_key"),
    ({"token": "with space"}, "token"),
    ({"name": "x" * 65}, "name"),
])
def test_bad_credentials_are_told_by_field(options, field):
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


def test_a_call_is_repeated_while_its_server_restarts(start_server, tmp_path):
    path = f"unix:{tmp_path}/again.sock"
    first = start_server(listen=path)
    with marble.Client(path) as client:
        assert client.solve(tiny()).solved
        first.stop()
        start_server(listen=path)
        assert wait_until(lambda: _solved(client))


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
