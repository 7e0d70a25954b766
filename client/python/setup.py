"""Puts into the package what the whole project has once: its version, its contract and its address.

The contract is the .proto files as one descriptor set, made by protoc when the package is built. A source distribution
has neither the .proto files nor the project's VERSION around it, and carries both in the package. The address is
MARBLE_REPOSITORY, as for the documentation, or GitHub's own variables; where there is none, the metadata has no links.
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

HERE = pathlib.Path(__file__).resolve().parent
PROJECT = HERE.parent.parent
PROTOS = PROJECT / "proto"
PACKAGE = pathlib.Path("src") / "marble"
MADE = PACKAGE / "contract.pb"


def version_file():
    carried = HERE / PACKAGE / "VERSION"
    return carried if carried.is_file() else PROJECT / "deploy" / "VERSION"


def repository():
    server, name = os.environ.get("GITHUB_SERVER_URL"), os.environ.get("GITHUB_REPOSITORY")
    return (os.environ.get("MARBLE_REPOSITORY") or (f"{server}/{name}" if server and name else "")).rstrip("/")


def description(address):
    """The README; links to files, which a package index does not have, lead to the repository, or become plain text."""
    def link(found):
        words, target = found.groups()
        if re.match(r"[a-z]+:|#", target):
            return found[0]
        path, mark, place = target.partition("#")
        path = os.path.normpath(f"client/python/{path}")
        return f"[{words}]({address}/blob/HEAD/{path}{mark}{place})" if address else words

    text = (HERE / "README.md").read_text(encoding="utf-8")
    return re.sub(r"\[((?:[^\[\]]|\n)*)\]\(([^()\s]+)\)", link, text)


def urls(address):
    return {"Homepage": address, "Documentation": f"{address}/blob/HEAD/docs/index.md", "Source": address,
            "Changelog": f"{address}/blob/HEAD/CHANGELOG.md"} if address else {}


def protoc():
    if shutil.which("protoc"):
        return ["protoc"]
    try:
        import grpc_tools.protoc  # noqa: F401
    except ImportError:
        sys.exit("marble-solver is built with protoc: install protobuf-compiler (Debian) or grpcio-tools (pip)")
    return [sys.executable, "-m", "grpc_tools.protoc"]


def make_contract(target):
    target.parent.mkdir(parents=True, exist_ok=True)
    if (HERE / MADE).is_file():
        if (HERE / MADE) != target.resolve():
            shutil.copyfile(HERE / MADE, target)
        return
    files = sorted(str(path.relative_to(PROTOS)) for folder in ("marble/v1", "google/rpc")
                   for path in (PROTOS / folder).glob("*.proto"))
    if not files:
        sys.exit(f"no .proto files in {PROTOS}")
    subprocess.run([*protoc(), "-I", str(PROTOS), "--include_imports", f"--descriptor_set_out={target}", *files],
                   check=True)


class BuildWithContract(build_py):
    def run(self):
        for built in (pathlib.Path(self.build_lib) / "marble").rglob("*.py"):  # an earlier module hides a present one
            if not (HERE / "src" / built.relative_to(self.build_lib)).is_file():
                built.unlink()
        super().run()
        shutil.copyfile(version_file(), pathlib.Path(self.build_lib) / "marble" / "VERSION")
        make_contract(pathlib.Path(self.build_lib) / "marble" / "contract.pb")


class SourceWithContract(sdist):
    def make_release_tree(self, base_dir, files):
        super().make_release_tree(base_dir, files)
        make_contract(pathlib.Path(base_dir) / MADE)
        shutil.copyfile(version_file(), pathlib.Path(base_dir) / PACKAGE / "VERSION")


setup(version=version_file().read_text(encoding="utf-8").strip(),
      long_description=description(repository()), long_description_content_type="text/markdown",
      project_urls=urls(repository()),
      cmdclass={"build_py": BuildWithContract, "sdist": SourceWithContract})
