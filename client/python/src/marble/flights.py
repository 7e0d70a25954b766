"""The paper's two flights, a rocket that is caught and a quadrotor through gates: their problems and pictures.

The problems are those of `marble example rocket` and `marble example gates`, which that program writes; here is where
in z the trajectory is, and what stands in its way (core/examples in the source tree).
"""

from __future__ import annotations

import os
import subprocess
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marble import programs
from marble.model import problem_file
from marble.model.lcqp import LCQP, Vector

_PATH, _BODY, _OBSTACLE, _BAND = "#2563a8", "#8a8f98", "#c2481f", "#f1ece1"

ROCKET_STEP = 17
"""Numbers of a step of the rocket: x, y, θ (m, m, rad) and others; the last step has two less."""
ROCKET_HALF_LENGTH, ROCKET_TRIGGER, ROCKET_CATCH = 2.0, 18.0, (0.5, 6.0)

GATES_STEP = 57
"""Numbers of a step of the quadrotor: x, y, z (m) and others; the last step has four less."""
GATES = (((1.5, 0.9, 1.3), 0.4), ((2.9, -0.6, 1.7), -0.8), ((4.0, 0.7, 0.9), 0.9), ((5.2, -0.5, 1.4), -0.5))
"""Centre (m) and yaw (rad) of each gate, in their order."""
GATE_HALF_EXTENT = (0.15, 0.3, 0.3)
"""Half depth, width and height of the box that counts as passed (m)."""


def problem(name: str) -> LCQP:
    """"rocket" or "gates". Raises Unavailable where there is no program marble."""
    written = subprocess.run([programs.find("marble"), "example", name], check=True, capture_output=True)
    return problem_file.parse(written.stdout, name)


def trajectory(z: Vector, step: int) -> NDArray[np.float64]:
    """The first three numbers of each step: a row a step."""
    return np.stack([z[start:start + 3] for start in range(0, len(z), step)])


def _plane(axes: Any, xlabel: str, ylabel: str) -> None:
    axes.set(xlabel=xlabel, ylabel=ylabel)
    axes.set_aspect("equal")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _draw_rocket(pyplot: Any, z: Vector) -> Any:
    figure, axes = pyplot.subplots(figsize=(6, 8), constrained_layout=True)
    rows = trajectory(z, ROCKET_STEP)
    axes.axhspan(0.0, ROCKET_TRIGGER, color=_BAND, linewidth=0, label="upright above the tower from here on")
    x, y, angle = rows.T
    along = ROCKET_HALF_LENGTH * np.stack([-np.sin(angle), np.cos(angle)])
    axes.plot([x - along[0], x + along[0]], [y - along[1], y + along[1]], color=_BODY, linewidth=2)
    axes.plot(x, y, ".-", color=_PATH, linewidth=1, label="centre of mass")
    axes.plot(*ROCKET_CATCH, "s", color=_OBSTACLE, label="where it is caught")
    axes.set_ylim(0.0, None)
    _plane(axes, "x (m)", "y (m)")
    axes.legend(loc="upper left", frameon=False)
    return figure


def _draw_gates(pyplot: Any, z: Vector) -> Any:
    figure, (above, beside) = pyplot.subplots(2, 1, figsize=(10, 7), constrained_layout=True, sharex=True)
    rows = trajectory(z, GATES_STEP)
    depth, width, height = GATE_HALF_EXTENT
    for (x, y, z_centre), yaw in GATES:
        ahead, across = depth * np.array([np.cos(yaw), np.sin(yaw)]), width * np.array([-np.sin(yaw), np.cos(yaw)])
        corners = np.array([x, y]) + np.array([ahead + across, ahead - across, -ahead - across, -ahead + across])
        above.fill(*corners.T, color=_OBSTACLE, alpha=0.25)
        low, high = corners[:, 0].min(), corners[:, 0].max()
        beside.fill([low, high, high, low], z_centre + height * np.array([-1, -1, 1, 1]), color=_OBSTACLE, alpha=0.25)
    for axes, row, label in ((above, rows[:, 1], "y (m)"), (beside, rows[:, 2], "z (m)")):
        axes.plot(rows[:, 0], row, ".-", color=_PATH, linewidth=1)
        _plane(axes, "x (m)", label)
    above.set_title("from above, and from the side; through each box in turn", fontsize="medium", loc="left")
    return figure


def save(name: str, z: Vector, path: str | os.PathLike[str]) -> None:
    """Draws the flight into a file. Needs matplotlib."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure = (_draw_rocket if name == "rocket" else _draw_gates)(pyplot, z)
    figure.savefig(path, dpi=150)
    pyplot.close(figure)
