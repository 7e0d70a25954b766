"""The wheel that install.wheel has made, in a bare Debian 12 with nothing but python3-pip: the oldest glibc that it claims."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tree import CLEAN, Store

HERE = Path(__file__).resolve().parent
BUILD = Path(os.environ["MARBLE_BUILD_DIR"])


@pytest.fixture(scope="module")
def tree():
    tree = Store(BUILD / "trees").tree()
    yield tree
    tree.close()


def put(tree, path):
    """A file of this machine's, where it is here."""
    there = tree.root / str(path).lstrip("/")
    there.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(path, there)


def test_pip_installs_it_and_it_solves_and_serves(tree):
    wheels = list((BUILD / "wheels").glob("*-cp311-*.whl"))
    if not wheels:
        pytest.skip("install.wheel has made no wheel for Debian's Python")
    tree.install("python3-pip")
    assert tree.run("getconf", "GNU_LIBC_VERSION").split()[1].replace(".", "_") in wheels[0].name
    # pip reaches its index there as it does here.
    index = {name: value for name, value in os.environ.items() if name.startswith("PIP_") or name.lower().endswith("_proxy")}
    for path in ("/etc/pip.conf", index.get("PIP_CERT")):
        if path and Path(path).is_file():
            put(tree, path)
    for file in (wheels[0], HERE.parent / "install/wheel_answers.py"):
        shutil.copy(file, tree.root / "tmp")
    pip = ["python3", "-m", "pip", "install", "--quiet", "--break-system-packages", "--root-user-action", "ignore"]
    installed = subprocess.run(tree.command(*pip, f"/tmp/{wheels[0].name}"), capture_output=True, text=True,
                               env={**CLEAN, **index})
    if "No matching distribution found for" in installed.stderr:
        pytest.skip("pip has no index there")
    assert installed.returncode == 0, installed.stderr
    assert tree.run("python3", "/tmp/wheel_answers.py", MARBLE_SERVER="").strip() == "the same bits"
    assert tree.run("/usr/local/bin/marble-server", "--version").startswith("marble-server ")
    assert tree.run("/usr/local/bin/marble", "--version").startswith("marble ")
