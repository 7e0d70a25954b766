"""Puts the contract into the package: the .proto files as one descriptor set, made by protoc when it is built."""

import pathlib
import shutil
import subprocess
import sys

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

HERE = pathlib.Path(__file__).resolve().parent
PROTOS = HERE.parent.parent / "proto"
MADE = pathlib.Path("src") / "marble" / "contract.pb"  # there in a source distribution, which has no .proto files


def protoc():
    if shutil.which("protoc"):
        return ["protoc"]
    try:
        import grpc_tools.protoc  # noqa: F401
    except ImportError:
        sys.exit("marble-client is built with protoc: install protobuf-compiler (Debian) or grpcio-tools (pip)")
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
        super().run()
        make_contract(pathlib.Path(self.build_lib) / "marble" / "contract.pb")


class SourceWithContract(sdist):
    def make_release_tree(self, base_dir, files):
        super().make_release_tree(base_dir, files)
        make_contract(pathlib.Path(base_dir) / MADE)


setup(cmdclass={"build_py": BuildWithContract, "sdist": SourceWithContract})
