"""A plan as a picture or a moving one, by matplotlib."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from marble.robots.plan import Plan

_PATH, _BODY, _FIXED, _MARK = "#2563a8", "#5b6068", "#b8860b", "#c2481f"
_POSES = 15


def save(plan: Plan, path: str | os.PathLike[str]) -> None:
    """Draws it into a file: some of its steps, or into a .gif a step a frame. By matplotlib, and pillow for a .gif."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.animation import FuncAnimation, PillowWriter

    scene = plan.robot.scene(plan.tables)
    points = np.vstack([scene.path, *scene.fixed, *(line for lines in scene.bodies for line in lines)])
    (left, low), (right, high) = points.min(axis=0), points.max(axis=0)
    width, height = max(right - left, 1e-3), max(high - low, 1e-3)
    margin, scale = 0.05 * max(width, height), min(9 / width, 7 / height)
    figure, axes = pyplot.subplots(figsize=(scale * width + 1.2, scale * height + 1.2), constrained_layout=True)
    axes.set(xlim=(left - margin, right + margin), ylim=(low - margin, high + margin), xlabel=scene.axes[0],
             ylabel=scene.axes[1])
    axes.set_aspect("equal")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for line in scene.fixed:
        axes.plot(*line.T, color=_FIXED, linewidth=2)
    axes.plot(*scene.path.T, color=_PATH, linewidth=1)
    if os.fspath(path).endswith(".gif"):
        moving = [axes.plot([], [], color=_BODY, linewidth=2)[0] for _ in scene.bodies[0]]

        def frame(k: int) -> Any:
            for drawn, line in zip(moving, scene.bodies[k], strict=True):
                drawn.set_data(*line.T)
            return moving

        movie = FuncAnimation(figure, frame, frames=len(scene.bodies), blit=True)
        movie.save(os.fspath(path), writer=PillowWriter(fps=max(1, round(1 / plan.robot.step_s))))
    else:
        every = -(-len(scene.bodies) // _POSES)
        for lines in scene.bodies[::every]:
            for line in lines:
                axes.plot(*line.T, color=_BODY, linewidth=0.8, alpha=0.7)
        axes.plot(*scene.marks.T, "o", color=_MARK, markersize=3.5)
        figure.savefig(path, dpi=150)
    pyplot.close(figure)
