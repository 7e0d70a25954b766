"""The hopper's plan as a picture or an animation, by matplotlib; or in a terminal, without it."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marble.hopper import NAMES, Hopper, trajectory
from marble.model.lcqp import Vector

_BODY, _FOOT, _LEG, _GROUND = "#2563a8", "#c2481f", "#8a8f98", "#d9d4c7"


def _ground_line(hopper: Hopper, low: float, high: float) -> tuple[list[float], list[float]]:
    xs, zs = [low], [hopper.ground(low)]
    for edge in sorted(hopper.stair_x):
        xs += [edge, edge]
        zs += [zs[-1], hopper.ground(np.nextafter(edge, np.inf))]
    return [*xs, high], [*zs, zs[-1]]


def _axes(pyplot: Any, hopper: Hopper, rows: NDArray[np.float64]) -> Any:
    figure, axes = pyplot.subplots(figsize=(10, 4.2), constrained_layout=True)
    low, high = float(rows[:, [0, 2]].min()) - 0.3, float(rows[:, [0, 2]].max()) + 0.3
    xs, zs = _ground_line(hopper, low, high)
    axes.fill_between(xs, zs, -0.3, color=_GROUND, linewidth=0)
    axes.set(xlim=(low, high), ylim=(-0.15, float(rows[:, 1].max()) + 0.2), xlabel="x (m)", ylabel="z (m)")
    axes.set_aspect("equal")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return figure, axes


def save(hopper: Hopper, z: Vector, path: str | os.PathLike[str]) -> None:
    """Draws the plan into a file: every step of it, or, into a .gif, a step a frame. Needs matplotlib."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.animation import FuncAnimation, PillowWriter

    rows = trajectory(z)
    figure, axes = _axes(pyplot, hopper, rows)
    axes.plot(rows[:, 0], rows[:, 1], color=_BODY, linewidth=1, label="body")
    axes.plot(rows[:, 2], rows[:, 3], color=_FOOT, linewidth=1, label="foot")
    if os.fspath(path).endswith(".gif"):
        leg, = axes.plot([], [], color=_LEG, linewidth=2)
        ends = axes.scatter([0, 0], [0, 0], s=[160, 50], color=[_BODY, _FOOT], zorder=3)

        def frame(k: int) -> Any:
            leg.set_data(rows[k, [0, 2]], rows[k, [1, 3]])
            ends.set_offsets(rows[k, :4].reshape(2, 2))
            return leg, ends

        movie = FuncAnimation(figure, frame, frames=len(rows), blit=True)
        movie.save(os.fspath(path), writer=PillowWriter(fps=round(1 / hopper.step_s)))
    else:
        axes.plot(rows[:, [0, 2]].T, rows[:, [1, 3]].T, color=_LEG, linewidth=0.6, alpha=0.6)
        pressed = rows[:, NAMES.index("normal_force")] > 1e-3
        axes.plot(rows[pressed, 2], rows[pressed, 3], "o", color=_FOOT, markersize=4, label="foot on the ground")
        axes.legend(loc="upper left", frameon=False)
        figure.savefig(path, dpi=150)
    pyplot.close(figure)


def text(hopper: Hopper, z: Vector, columns: int = 100, lines: int = 18) -> str:
    """Draws the plan with characters: o the body, . the foot, # the ground."""
    rows = trajectory(z)
    low, high = float(rows[:, [0, 2]].min()) - 0.1, float(rows[:, [0, 2]].max()) + 0.1
    top = float(rows[:, 1].max()) + 0.05
    canvas = [[" "] * columns for _ in range(lines)]

    def put(x: float, height: float, mark: str) -> None:
        column = round((x - low) / (high - low) * (columns - 1))
        line = round((top - height) / (top + 0.05) * (lines - 1))
        if 0 <= line < lines and 0 <= column < columns:
            canvas[line][column] = mark

    for column in range(columns):
        x = low + (high - low) * column / (columns - 1)
        for height in np.arange(-0.05, hopper.ground(x) + 1e-9, top / (2 * lines)):
            put(x, float(height), "#")
    for row in rows:
        put(row[2], row[3], ".")
        put(row[0], row[1], "o")
    return "\n".join("".join(line).rstrip() for line in canvas)
