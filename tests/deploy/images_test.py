"""The Dockerfile's last stage, made on a plain Debian 12 tree as no engine runs here; and what compose.yaml refers to."""

import json
import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest
import yaml

import dockerfile
from tree import CLEAN, Store, run

ROOT = Path(__file__).resolve().parents[2]
DOCKER = ROOT / "deploy/docker"
BUILD = Path(os.environ["MARBLE_BUILD_DIR"])


class StrictLoader(yaml.SafeLoader):
    """A key given twice is an error."""

    def construct_mapping(self, node, deep=False):
        keys = [self.construct_object(key, deep=deep) for key, _ in node.value]
        assert len(keys) == len(set(keys)), f"a key twice, line {node.start_mark.line + 1}"
        return super().construct_mapping(node, deep)


def load(path):
    return yaml.load(path.read_text(), StrictLoader)


@pytest.fixture(scope="module")
def stages():
    return dockerfile.read(DOCKER / "Dockerfile")


@pytest.fixture(scope="module")
def image(stages):
    work = BUILD / "image"
    shutil.rmtree(work, ignore_errors=True)
    run(ROOT / "deploy/make-packages", work / "packages", BUILD)
    tree = Store(BUILD / "trees").tree()
    dockerfile.build(tree, stages[-1], ROOT, {"build": work})
    yield tree
    tree.close()


def test_the_first_stage_installs_from_the_package_list_and_makes_the_packages(stages):
    first, last = stages
    assert (first.name, first.base, last.base) == ("build", "debian:12-slim", "debian:12-slim")
    commands = " ".join(text for word, text in first.instructions if word == "RUN")
    assert "deploy/install-packages build" in commands and "deploy/make-packages /packages" in commands


def test_the_last_stage_has_no_compiler_and_no_leftovers(image):
    for program in ("gcc", "g++", "cc", "ld", "make", "cmake", "protoc", "python3", "perl5.36-x86_64-linux-gnu"):
        assert not image.has(f"usr/bin/{program}"), program
    assert not image.has("packages") and not list((image.root / "var/lib/apt/lists").glob("*"))


def test_it_runs_as_a_user_that_is_not_root_answers_its_health_check_solves_and_drains(image, stages):
    last = stages[-1]
    user = last.last("USER")
    assert user not in ("root", "0")
    command = dockerfile.exec_form(last.last("ENTRYPOINT")) + dockerfile.exec_form(last.last("CMD"))
    check = dockerfile.exec_form(re.search(r"CMD (.*)", last.last("HEALTHCHECK")).group(1))
    script = "ip link set lo up; exec chroot --userspec=\"$0\" \"$@\""
    server = subprocess.Popen(["unshare", "--net", "sh", "-c", script, f"{user}:{user}", str(image.root), *command],
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=CLEAN)

    def inside(*words, check=True):
        return subprocess.run(["nsenter", f"--target={server.pid}", "--net", *image.command(*words, user=user)],
                              capture_output=True, text=True, check=check, env=CLEAN)

    try:
        end = time.monotonic() + 60
        while inside(*check, check=False).returncode != 0:
            assert time.monotonic() < end and server.poll() is None
            time.sleep(0.2)
        uid = re.search(r"^Uid:\s+(\d+)", Path(f"/proc/{server.pid}/status").read_text(), re.M).group(1)
        assert uid != "0"
        problem = inside("marble", "example", "rocket").stdout
        (image.root / "tmp/rocket.json").write_text(problem)
        answer = json.loads(inside("marble", "solve", "--quiet", "--output", "json", "/tmp/rocket.json").stdout)
        assert answer["status"] == "solved"
        server.send_signal(signal.Signals[last.last("STOPSIGNAL")])
        log, _ = server.communicate(timeout=60)
        assert server.returncode == 0
        assert json.loads(log.splitlines()[-1])["event"] == "stopped"
    finally:
        server.kill()
    assert inside_fails(image, check, user)


def inside_fails(image, check, user):
    """Nobody serves: the check says so."""
    return subprocess.run(["unshare", "--net", *image.command(*check, user=user)], capture_output=True, env=CLEAN).returncode != 0


def test_compose_refers_to_files_and_services_that_are_there():
    compose = load(DOCKER / "compose.yaml")
    assert set(compose) == {"name", "services", "volumes"}
    known = {"build", "image", "ports", "stop_grace_period", "restart", "read_only", "tmpfs", "cap_drop", "security_opt", "cpus",
             "mem_limit", "command", "volumes", "depends_on", "environment"}
    for name, service in compose["services"].items():
        assert set(service) <= known, name
        for volume in service.get("volumes", []):
            source = volume.split(":")[0]
            assert (DOCKER / source).is_file() if source.startswith(".") else source in compose["volumes"], volume
        assert set(service.get("depends_on", [])) <= set(compose["services"])
        for port in service["ports"]:
            assert port.startswith("127.0.0.1:"), "published on loopback alone"
    marble = compose["services"]["marble"]
    assert (DOCKER / marble["build"]["context"]).resolve() == ROOT and (ROOT / marble["build"]["dockerfile"]).is_file()
    options = run(BUILD / "bin/marble-server", "--config", DOCKER / "marble.toml", *marble["command"][2:], "--print-config")
    assert re.search(r"^workers = 4\b", options, re.M)
    drain_s = sum(float(re.search(rf"^{name} = (\S+)", options, re.M).group(1)) for name in ("drain_notice_s", "drain_grace_s"))
    assert int(marble["stop_grace_period"].rstrip("s")) >= drain_s + 10


def test_prometheus_and_grafana_find_the_server_and_our_dashboard(tmp_path):
    for name in ("prometheus.yml",):
        shutil.copy(DOCKER / name, tmp_path)
    shutil.copy(ROOT / "deploy/prometheus/alerts.yml", tmp_path)
    run("promtool", "check", "config", tmp_path / "prometheus.yml")
    targets = load(DOCKER / "prometheus.yml")["scrape_configs"][0]["dns_sd_configs"][0]
    compose = load(DOCKER / "compose.yaml")["services"]
    assert targets["names"] == ["marble"] and "marble" in compose and targets["port"] == 50080
    source = load(DOCKER / "grafana-datasources.yml")["datasources"][0]
    assert source["url"] == "http://prometheus:9090" and "prometheus" in compose
    folder = load(DOCKER / "grafana-dashboards.yml")["providers"][0]["options"]["path"]
    mounts = [volume.split(":") for volume in compose["grafana"]["volumes"]]
    shown = [source for source, target, _ in mounts if target.startswith(folder + "/")]
    assert [json.loads((DOCKER / file).read_text())["title"] for file in shown] == ["Marble"]
