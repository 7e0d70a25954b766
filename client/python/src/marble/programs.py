"""The programs that a wheel brings along, marble-server and marble; elsewhere those of PATH."""

from __future__ import annotations

import os
import pathlib
import shutil
import sys
from collections.abc import Sequence
from typing import NoReturn

from marble.errors import Unavailable


def find(name: str) -> str:
    """The program's path. Raises Unavailable where there is none."""
    own = pathlib.Path(__file__).with_name("bin") / name
    found = str(own) if own.is_file() else shutil.which(name)
    if found is None:
        raise Unavailable(f"there is no {name} in PATH: install it, or a wheel of marble-solver, which brings it along")
    return found


def run(name: str, arguments: Sequence[str]) -> NoReturn:
    """Goes on as the program."""
    path = find(name)
    os.execv(path, [name, *arguments])


def marble() -> NoReturn:
    """The command `marble` of a wheel."""
    run("marble", sys.argv[1:])


def marble_server() -> NoReturn:
    """The command `marble-server` of a wheel."""
    run("marble-server", sys.argv[1:])
