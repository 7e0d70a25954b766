"""Readers of foreign files, each in a process with memory and time in proportion to the length of the file.

What such a file says is foreign data for a parser in C or C++, whose end must not be the end of the caller.
"""

from __future__ import annotations

import os
import pathlib
import resource
import subprocess
import sys
from typing import Final

MOST_BYTES: Final = 1 << 30
_BYTES, _BYTES_A_BYTE = 2 << 30, 100  # of address space
_SECONDS, _BYTES_A_SECOND = 60, 1 << 20


class Failed(Exception):
    """The file is too long, or its reader takes too long; the text says which."""


def run(module: str, path: pathlib.Path) -> subprocess.CompletedProcess[bytes]:
    """Runs `python -m MODULE PATH`, which calls `limit`. Raises Failed, and OSError where the file cannot be opened."""
    with path.open("rb"):
        size = path.stat().st_size
    if size > MOST_BYTES:
        raise Failed(f"must have at most {MOST_BYTES} bytes, has {size}")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(part for part in sys.path if part)}
    seconds = _SECONDS + size // _BYTES_A_SECOND
    try:
        return subprocess.run([sys.executable, "-m", module, str(path)], env=environment, capture_output=True,
                              timeout=2 * seconds, check=False)
    except subprocess.TimeoutExpired:
        raise Failed(f"takes more than {2 * seconds} s to be read") from None


def limit(size: int) -> None:
    """Limits this process, the reader of a file of `size` bytes."""
    for what, most in ((resource.RLIMIT_AS, _BYTES + _BYTES_A_BYTE * size),
                       (resource.RLIMIT_CPU, _SECONDS + size // _BYTES_A_SECOND), (resource.RLIMIT_CORE, 0)):
        hard = resource.getrlimit(what)[1]
        resource.setrlimit(what, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))
