"""Linearizers by the library that a model belongs to."""

from __future__ import annotations

import importlib
from typing import Any, Final

from marble.errors import InvalidArgument
from marble.lcs.linearization import Linearization

_MODULES: Final = {"mujoco": "mujoco", "pinocchio": "pinocchio", "pydrake": "drake"}


def linearize(model: Any, state: Any, **options: Any) -> Linearization:
    """The linear complementarity system of a robot model at a state, with what relates its state to the model's.

    model, state: a mujoco.MjModel and its MjData; a pinocchio.Model and (q, v); or a pydrake MultibodyPlant and its
    context. options: as of `linearize` in marble.lcs.mujoco, marble.lcs.pinocchio or marble.lcs.drake.
    Raises InvalidArgument that names what is wrong; ImportError without the library.
    """
    made: Linearization = _module(model).linearize(model, state, **options)
    return made


def linearizer(model: Any, state: Any, **options: Any) -> Any:
    """The same for control loops: an object that is called with a state, and u=, and returns the linearization there.

    It chooses the contacts once, by `state`, so that the LCS has the same pairs in the same order at every call.
    """
    return _module(model).Linearizer(model, state, **options)


def _module(model: Any) -> Any:
    library = type(model).__module__.partition(".")[0]
    if library not in _MODULES:
        raise InvalidArgument("model", "must be a mujoco.MjModel, a pinocchio.Model or a pydrake MultibodyPlant",
                              value=f"{type(model).__module__}.{type(model).__qualname__}")
    return importlib.import_module(f"marble.lcs.{_MODULES[library]}")
