"""A program that asks for "local" has a server of its own, which lives no longer than it does."""

from __future__ import annotations

import os
import pathlib
import signal
import subprocess
import sys

from support import SERVER, clean_environment, wait_until

PROGRAM = """
import marble, time
answer = marble.solve([[2, 0], [0, 2]], [-2, -2], L=[1, 0], R=[0, 1], c0=2)
again = marble.Client()
print(answer.solved, again.solve(marble.LCQP([[2]], [-2])).solved, again.address, flush=True)
"""


def environment(**more: str) -> dict[str, str]:
    path = f"{pathlib.Path(SERVER).parent}{os.pathsep}{os.environ['PATH']}"
    return clean_environment(**{"PATH": path, "MARBLE_SERVER": "local", **more})


def gone(address: str) -> bool:
    folder = pathlib.Path(address.removeprefix("unix:")).parent
    listed = subprocess.run(["pgrep", "-f", str(folder)], capture_output=True, text=True, check=False).stdout
    return not listed.split()


def test_two_calls_share_it_and_it_ends_with_the_program(tmp_path):
    told = subprocess.run([sys.executable, "-c", PROGRAM], env=environment(TMPDIR=str(tmp_path)), capture_output=True,
                          text=True, timeout=60, check=True)
    solved, again, address = told.stdout.split()
    assert (solved, again) == ("True", "True"), told
    assert told.stderr == ""
    assert address.startswith(f"unix:{tmp_path}")
    assert gone(address)
    assert list(tmp_path.iterdir()) == [], "its folder is gone too"


def test_a_program_that_is_killed_leaves_no_server(tmp_path):
    program = subprocess.Popen([sys.executable, "-c", PROGRAM + "time.sleep(60)"], stdout=subprocess.PIPE, text=True,
                               env=environment(TMPDIR=str(tmp_path)))
    address = program.stdout.readline().split()[2]
    assert not gone(address)
    program.send_signal(signal.SIGKILL)
    program.wait()
    assert wait_until(lambda: gone(address))


def test_settings_meant_for_a_server_elsewhere_do_not_reach_it(tmp_path):
    told = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=60, check=True,
                          env=environment(TMPDIR=str(tmp_path), MARBLE_TOKENS="/nowhere", MARBLE_WORKERS="1"))
    assert told.stdout.startswith("True True")


def test_a_server_that_is_named_is_asked_instead(server, tmp_path):
    told = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=60, check=True,
                          env=environment(TMPDIR=str(tmp_path), MARBLE_SERVER=server.address))
    assert told.stdout.split() == ["True", "True", server.address]


def test_one_that_was_lost_is_started_again(tmp_path):
    lines = PROGRAM + """
import marble.connection.local
marble.connection.local._server._process.kill()
marble.connection.local._server._process.wait()
print(marble.solve([[2]], [-2]).solved)
"""
    told = subprocess.run([sys.executable, "-c", lines], env=environment(TMPDIR=str(tmp_path)), capture_output=True,
                          text=True, timeout=60, check=True)
    assert told.stdout.split()[-1] == "True"


def test_where_none_is_installed_the_error_says_what_to_do(tmp_path):
    told = subprocess.run([sys.executable, "-c", PROGRAM], env=environment(PATH=str(tmp_path)), capture_output=True,
                          text=True, timeout=60, check=False)
    assert told.returncode != 0
    assert "Unavailable" in told.stderr and "marble-server" in told.stderr and "MARBLE_SERVER" in told.stderr


def test_a_certificate_without_a_server_is_a_mistake(tmp_path):
    authority = tmp_path / "ca.pem"
    authority.write_text("-----BEGIN CERTIFICATE-----")
    told = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=60, check=False,
                          env=environment(MARBLE_TLS_CA=str(authority)))
    assert told.returncode != 0 and "InvalidArgument: address" in told.stderr.splitlines()[-1]
