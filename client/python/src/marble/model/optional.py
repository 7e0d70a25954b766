"""Packages that only some functions of marble.lcs need."""

from __future__ import annotations

import importlib
from typing import Any

from marble.errors import Unavailable


def optional(module: str, package: str, what: str) -> Any:
    """The module; Unavailable if it is not installed, with the package that `what` needs."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise Unavailable(f"{what} needs {module.partition('.')[0]}: pip install {package} ({error})") from None
