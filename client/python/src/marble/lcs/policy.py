"""A controller as the policy of an environment of gymnasium."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import marble
from marble.errors import InvalidArgument
from marble.lcs.controller import Controller
from marble.lcs.statistics import ControlStatistics
from marble.lcs.system import Array
from marble.lcs.task import Task


class Policy:
    """Plans the actions of an environment whose unwrapped one has a MuJoCo model and data, as gymnasium's robots have::

        with gymnasium.make("Hopper-v5") as env, Policy(env, task) as policy:
            observation, info = env.reset(seed=0)
            for step in range(500):
                observation, reward, terminated, truncated, info = env.step(policy(observation))

    The policy reads the state from the environment, not from the observation. Actions are the model's inputs; wrappers
    that rescale them are refused. task: its rate must be that of the environment, 1 / env.unwrapped.dt, divided by a
    whole number; between two plans the actions are those of Controller.input. An episode begins when the time of the
    simulation is not that of the next step: the last plan is then forgotten. server, options: as in Controller.

    A context manager. Raises InvalidArgument of "env", "rate" and what Controller raises.
    """

    def __init__(self, env: Any, task: Task, *, server: str | Sequence[str] | marble.Client | None = None,
                 options: Mapping[str, Any] | None = None, **more_options: Any) -> None:
        inner: Any = getattr(env, "unwrapped", None)
        if any(getattr(inner, name, None) is None for name in ("model", "data", "dt", "action_space")):
            raise InvalidArgument("env", "must be an environment whose unwrapped one has model, data and dt",
                                  value=type(env).__name__)
        if env.action_space != inner.action_space or env.action_space.shape != (inner.model.nu,):
            raise InvalidArgument("env.action_space", f"must be {inner.action_space}, of {inner.model.nu} inputs",
                                  value=str(env.action_space))
        self.controller: Controller = Controller(inner.model, task, server=server, options=options, **more_options)
        self._hold = task.substeps(inner.dt, f"{1 / inner.dt:g} Hz, of the environment,")
        self._env, self._count, self._next_s = inner, 0, math.nan

    def __call__(self, observation: Any = None) -> Array:
        """The action (nu,) to take now."""
        data, env = self._env.data, self._env
        if not abs(data.time - self._next_s) <= env.dt / 2:
            self._count = 0
            self.controller.reset()
        self._next_s = data.time + env.dt
        phase = self._count % self._hold
        self._count += 1
        u = self.controller.step(data).u if phase == 0 else self.controller.input(data, phase * env.dt)
        return np.asarray(u, dtype=env.action_space.dtype)

    @property
    def statistics(self) -> ControlStatistics:
        """The controller's, over all episodes."""
        return self.controller.statistics

    def close(self) -> None:
        """Ends the session; the environment stays open."""
        self.controller.close()

    def __enter__(self) -> Policy:
        return self

    def __exit__(self, kind: object, *rest: object) -> None:
        self.controller.__exit__(kind, *rest)
