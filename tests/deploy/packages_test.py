"""The Debian packages in a fresh Debian 12: installed, started as the unit says, used, built against, purged."""

import configparser
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "install"))
import elf
from machine import Machine
from tree import CLEAN, Store, run

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ["MARBLE_BUILD_DIR"])
UNIT = "/lib/systemd/system/marble-server.service"
# What upgrading, logging and looking up leave in any Debian, whatever package comes and goes.
TRACES = re.compile(r"var/(lib/(dpkg|apt|systemd|ucf)|log|cache)/|var/lib/(dpkg|systemd)|etc/(passwd|group|g?shadow|subuid|subgid)-?$|"
                    r"etc/ld\.so\.cache|etc/\.pwd\.lock|var/tmp/systemd-private-")  # a machine that was switched off


@pytest.fixture(scope="module")
def packages():
    folder = BUILD / "packages"
    shutil.rmtree(folder, ignore_errors=True)
    run(ROOT / "deploy/make-packages", folder, BUILD)
    return {file.name.split("_")[0]: file for file in folder.glob("*.deb")}


@pytest.fixture(scope="module")
def tree():
    tree = Store(BUILD / "trees").tree()
    yield tree
    tree.close()


def service(tree):
    unit = configparser.ConfigParser(strict=False, interpolation=None)
    unit.optionxform = str
    unit.read_string(tree.read(UNIT))
    return unit["Service"]


def eventually(condition, what, limit_s=60):
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.1)
    raise AssertionError(f"never happened: {what}")


def test_lintian_finds_no_fault(packages):
    if shutil.which("lintian") is None:
        pytest.skip("lintian is not installed")
    # The tag asks for the number of a request to include it in Debian.
    print(run("lintian", "--allow-root", "--fail-on=error,warning", "--suppress-tags=initial-upload-closes-no-bugs",
              *packages.values()))


def test_their_programs_are_hardened_and_search_no_relative_folder_for_libraries(packages, tmp_path):
    for package in packages.values():
        run("dpkg-deb", "--extract", package, tmp_path)
    programs = list(elf.linked_files(tmp_path))
    assert {path.name for path in programs} == {"marble", "marble-all", "marble-load", "marble-server"}
    assert not [fault for path in programs for fault in elf.search_path_faults(path)]
    if shutil.which("hardening-check") is None:
        pytest.skip("hardening-check (devscripts) is not installed")
    assert not elf.hardening_faults(*programs)


def test_the_program_comes_with_manual_pages_and_completions(packages, tmp_path):
    run("dpkg-deb", "--extract", packages["marble-cli"], tmp_path)
    for name in ("man/man1/marble.1.gz", "man/man1/marble-solve.1.gz", "man/man1/marble-load.1.gz",
                 "bash-completion/completions/marble", "zsh/vendor-completions/_marble",
                 "fish/vendor_completions.d/marble.fish"):
        assert (tmp_path / "usr/share" / name).stat().st_size > 100, name


def test_they_depend_on_what_debian_has_and_no_compiler(tree, packages):
    # First what they need, so that what they bring themselves can be distinguished.
    for name in ("marble-server", "marble-cli"):
        depends = run("dpkg-deb", "--field", packages[name], "Depends")
        first = [re.split(r"[ |(]", part.strip())[0] for part in depends.split(",")]
        tree.install(*first)
    tree.before = tree.files()
    tree.install(packages["marble-server"], packages["marble-cli"])
    for compiler in ("usr/bin/gcc", "usr/bin/g++", "usr/bin/cc", "usr/bin/make", "usr/bin/protoc"):
        assert not tree.has(compiler)
    assert tree.run("marble-server", "--version").startswith("marble-server ")


def test_the_account_can_do_nothing_else(tree):
    fields = [line.split(":") for line in tree.read("etc/passwd").splitlines() if line.startswith("marble:")]
    assert len(fields) == 1
    assert fields[0][5:] == ["/nonexistent", "/usr/sbin/nologin"]
    assert tree.read("etc/shadow").count("marble:!") == 1


def test_the_configuration_is_valid_and_kept_when_changed(tree, packages):
    config = "/etc/marble/marble.toml"
    assert tree.run("marble-server", "--config", config, "--check-config", user="marble") == "ok\n"
    changed = tree.read(config) + "\n[solver]\ntime_limit_s = 7\n"
    (tree.root / config[1:]).write_text(changed)
    tree.install("--reinstall", packages["marble-server"])
    assert tree.read(config) == changed


def test_the_unit_is_well_hardened_and_leaves_time_to_drain(tree):
    run("systemd-analyze", "security", "--offline=yes", "--threshold=15", f"--root={tree.root}", "marble-server.service")
    stop_s = int(service(tree)["TimeoutStopSec"])
    printed = tree.run("marble-server", "--config", "/etc/marble/marble.toml", "--print-config")
    drain_s = sum(float(re.search(rf"^{name} = (\S+)", printed, re.M).group(1)) for name in ("drain_notice_s", "drain_grace_s"))
    assert stop_s >= drain_s + 10


def test_its_command_line_starts_a_server_that_says_when_it_is_ready(tree):
    unit = service(tree)
    notified = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    notified.bind(str(tree.root / "tmp/notify"))
    os.chmod(tree.root / "tmp/notify", 0o777)
    notified.settimeout(60)
    places = ["/run/" + unit["RuntimeDirectory"], "/var/lib/" + unit["StateDirectory"]]  # systemd makes them
    tree.run("install", "-d", "-o", unit["User"], "-g", unit["Group"], *places)
    # A network of its own: the unit's ports may be taken here.
    script = "ip link set lo up; exec chroot --userspec=marble:marble \"$@\""
    server = subprocess.Popen(["unshare", "--net", "sh", "-c", script, "sh", str(tree.root), *unit["ExecStart"].split()],
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                              env={**CLEAN, "NOTIFY_SOCKET": "/tmp/notify"})
    try:
        assert notified.recv(100) == b"READY=1"

        def marble(*arguments):
            return run("nsenter", f"--target={server.pid}", "--net", *tree.command("marble", *arguments), env=CLEAN)

        assert marble("health").strip() == "serving"
        (tree.root / "tmp/rocket.json").write_text(marble("example", "rocket"))
        assert "solved" in marble("solve", "--quiet", "--output", "json", "/tmp/rocket.json")
        assert marble("health", "--server", "unix:/run/marble/marble.sock").strip() == "serving"
        assert "0 jobs without an answer" in tree.run("marble-server", "--config", "/etc/marble/marble.toml", "--check-state")
        server.send_signal(signal.SIGTERM)
        assert notified.recv(100) == b"STOPPING=1"
        output, _ = server.communicate(timeout=60)
        assert server.returncode == 0, output
        assert "stopped" in output
    finally:
        server.kill()
        tree.run("rm", "-rf", *places, "/tmp/notify", "/tmp/rocket.json")


def test_systemd_starts_watches_reloads_and_stops_it(tree):
    machine = Machine(tree)
    try:
        if not machine.running:
            pytest.skip(machine.why)

        def show(name):
            return machine.run("systemctl", "show", "--value", "--property", name, "marble-server").strip()

        def status(pid):
            fields = machine.run("cat", f"/proc/{pid}/status").splitlines()
            return dict(line.split(":\t", 1) for line in fields if ":\t" in line)

        machine.run("systemctl", "start", "marble-server")  # returns when the server has said it is ready
        assert machine.run("marble", "health").strip() == "serving"
        machine.run("sh", "-c", "marble example rocket > /tmp/rocket.json")
        assert "solved" in machine.run("marble", "solve", "--quiet", "--output", "json", "/tmp/rocket.json")

        first = show("MainPID")
        facts = status(first)
        assert facts["NoNewPrivs"] == "1" and facts["Seccomp"] == "2" and int(facts["CapBnd"], 16) == 0
        assert facts["Uid"].split()[0] != "0"

        # It is hidden from others' processes, but must see when the machine began: alerts ask for its own start.
        ask = "import urllib.request; print(urllib.request.urlopen('http://127.0.0.1:50080/metrics').read().decode())"
        metrics = run("nsenter", f"--target={machine.first()}", "--net", "/usr/bin/python3", "-c", ask)
        started_s = float(re.search(r"^process_start_time_seconds (\S+)", metrics, re.M).group(1))
        assert abs(time.time() - started_s) < 3600

        machine.run("systemctl", "reload", "marble-server")
        assert show("MainPID") == first and show("ActiveState") == "active"

        machine.run("sh", "-c", f"kill -KILL {first}")
        eventually(lambda: show("MainPID") not in ("0", first) and show("ActiveState") == "active", "a restart")
        assert "solved" in machine.run("marble", "solve", "--quiet", "--output", "json", "/tmp/rocket.json")

        machine.run("systemctl", "stop", "marble-server")
        assert (show("ActiveState"), show("Result"), show("ExecMainStatus")) == ("inactive", "success", "0")
    finally:
        machine.close()


def commands_of_the_runbook():
    """Its indented lines, without what comes after a #, and the commands in its table of alerts."""
    text = (ROOT / "server/OPERATE.md").read_text()
    blocks = re.findall(r"^    (.+?)(?:\s+#.*)?$", text + (ROOT / "deploy/FLEET.md").read_text(), re.M)
    alerts = re.findall(r"`([^`]+)`", text[text.index("## Alerts"):text.index("## Upgrade")])
    ours = ("apt-get ", "install ", "journalctl ", "marble ", "marble-load ", "marble-server ", "systemctl ", "systemd-analyze ")
    return [line for line in blocks + alerts if line.startswith(ours)]


def test_each_command_of_the_runbook_works_there(tree, packages):
    home = tree.root / "root"
    shutil.copytree(BUILD / "packages", home / "packages")
    for name in ("new.pem", "new.key"):
        (home / name).write_text("renewed")
    commands = commands_of_the_runbook()
    assert len(commands) > 20
    machine = Machine(tree)
    try:
        if not machine.running:
            pytest.skip(machine.why)
        for command in commands:
            machine.run("systemctl", "start", "marble-server")
            done = machine.ask("sh", "-c", f"cd /root && {command} </dev/null")
            nothing_found = command.startswith("journalctl") and done.returncode == 1 and "No entries" in done.stdout
            assert done.returncode == 0 or nothing_found, f"{command}: {done.stdout}{done.stderr}"
        assert (tree.root / "etc/marble/server.key").stat().st_mode & 0o777 == 0o640
    finally:
        machine.close()
        for path in (home / "packages", home / "new.pem", home / "new.key", *(tree.root / "etc/marble").glob("server.*")):
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)


def test_programs_are_built_against_the_library_and_its_contract(tree, packages):
    builder = Store(BUILD / "trees").tree()
    try:
        builder.install(packages["marble-dev"], "g++", "cmake", "ninja-build")
        shutil.copytree(ROOT / "tests/install/consumer", builder.root / "tmp/consumer")
        builder.run("cmake", "-S", "/tmp/consumer", "-B", "/tmp/build", "-G", "Ninja")
        builder.run("cmake", "--build", "/tmp/build")
        assert "objective 0.500000" in builder.run("/tmp/build/consumer")
        for contract in ("--descriptor_set_in=/usr/share/marble/marble.binpb", "--proto_path=/usr/share/marble/proto"):
            builder.run("protoc", contract, "--python_out=/tmp", "marble/v1/service.proto")
            (builder.root / "tmp/marble/v1/service_pb2.py").unlink()
    finally:
        builder.close()


def test_removing_keeps_the_configuration_and_purging_leaves_nothing(tree):
    tree.run("apt-get", "remove", "--yes", "marble-server", "marble-cli")
    assert tree.has("/etc/marble/marble.toml") and not tree.has("/usr/bin/marble-server")
    tree.run("apt-get", "purge", "--yes", "marble-server", "marble-cli")
    left = {path for path in tree.files() - tree.before if not TRACES.search(path)}
    assert not left
