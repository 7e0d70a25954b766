"""A picture of a solution: its variables, and the sides of its pairs. Needs matplotlib."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from marble.model.lcqp import Vector
from marble.model.optional import optional

_LEFT, _RIGHT, _BOTH, _MOST_STEMS, _MOST_NAMES = "#2563a8", "#c2481f", "#444444", 60, 24
_SHORTEST_LINEAR: Final = 1e-9  # of the axes of sides, which are logarithmic beyond it


def draw(title: str, z: Vector, names: list[str], s: Vector, t: Vector, tolerance: float) -> Any:
    """The figure, of pyplot. names: of all variables, or none. tolerance: up to which a side counts as zero."""
    pyplot = optional("matplotlib.pyplot", "'marble-solver[plot]'", "Solution.plot")
    figure, axes = pyplot.subplots(1, 2 if s.size else 1, figsize=(9 if s.size else 5, 3.6), squeeze=False,
                                   layout="constrained")
    figure.suptitle(title.replace("$", r"\$"))  # a name is no formula
    _draw_variables(axes[0, 0], z, names)
    if s.size:
        _draw_pairs(axes[0, 1], s, t, tolerance)
    return figure


def _draw_variables(axes: Any, z: Vector, names: list[str]) -> None:
    index = np.arange(z.size)
    axes.axhline(0.0, color="0.8", linewidth=0.8)
    if z.size <= _MOST_STEMS:
        axes.vlines(index, 0.0, z, color=_LEFT, linewidth=1)
    axes.plot(index, z, "o" if z.size <= _MOST_STEMS else ".", color=_LEFT, markersize=4)
    if 0 < len(names) <= _MOST_NAMES:
        axes.set_xticks(index, [name.replace("$", r"\$") for name in names], rotation=90)
    axes.set(xlabel="" if 0 < len(names) <= _MOST_NAMES else "variable", ylabel="z")


def _draw_pairs(axes: Any, s: Vector, t: Vector, tolerance: float) -> None:
    """Each pair as a point of the quarter plane, whose two axes are where complementarity holds."""
    left, right = np.abs(s) <= tolerance, np.abs(t) <= tolerance
    for marked, colour, label in ((left & ~right, _LEFT, "s = 0"), (right & ~left, _RIGHT, "t = 0"),
                                  (left & right, _BOTH, "s = t = 0"), (~left & ~right, "#d40000", "neither is 0")):
        if marked.any():
            axes.plot(s[marked], t[marked], "o", color=colour, markersize=4, clip_on=False,
                      label=f"{label}: {np.count_nonzero(marked)}")
    for kind in ("x", "y"):
        getattr(axes, f"set_{kind}scale")("symlog", linthresh=max(tolerance, _SHORTEST_LINEAR))
    axes.set(xlabel="s = L z + l", ylabel="t = R z + r")
    axes.legend(frameon=False)
