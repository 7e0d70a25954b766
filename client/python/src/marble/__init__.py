"""Marble, a solver of quadratic programs with linear complementarity constraints: in process or on a Marble server.

    min ½ zᵀQz + gᵀz + c0   s.t.   A z + b = 0,   C z + d ≥ 0,   0 ≤ L z + l ⊥ R z + r ≥ 0

`solve` takes matrices, dense or scipy.sparse; `Problem` builds a problem of two-sided rows, bounds and pairs; `Client`
keeps a connection, with sessions, batches and jobs; `marble.aio` has the same for asyncio. MARBLE_SERVER is the default
server. If it is not set, `solve` runs in this process and a `Client` uses 127.0.0.1:50051; the address "local" is this
process for both.
"""

import importlib
import pathlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from marble import aio as aio
    from marble.api import *  # noqa: F403
    from marble.api import __all__ as __all__

_MODULES = ("aio", "errors", "flights", "hopper", "layers", "lcs", "mat", "nlp")  # which need no further package


def _version() -> str:
    file = pathlib.Path(__file__).with_name("VERSION")
    try:
        return file.read_text(encoding="utf-8").strip()
    except FileNotFoundError:
        raise ImportError(f"{file} is missing: build or install marble-solver, do not import its sources") from None


if not TYPE_CHECKING:  # the names are declared above
    def __getattr__(name: str) -> Any:
        """Loads numpy and the rest when a name of the package is first used; asyncio with marble.aio."""
        own = pathlib.Path(__file__).with_name(name)
        if own.is_dir() or own.with_suffix(".py").is_file():
            return importlib.import_module(f"marble.{name}")
        if name.startswith("__") and name != "__all__":
            raise AttributeError(f"module 'marble' has no attribute {name!r}")
        api = importlib.import_module("marble.api")
        try:
            value = getattr(api, name)
        except AttributeError:
            raise AttributeError(f"module 'marble' has no attribute {name!r}") from None
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        """What the package offers, without adapters, which need other packages: inspect imports all of these."""
        own = (name for name in globals() if name.startswith("__"))
        return sorted({*own, *_MODULES, *importlib.import_module("marble.api").__all__})


__version__ = _version()
