"""A plan's contacts over its horizon: gaps and forces, as numbers and as a picture. A picture needs matplotlib."""

from __future__ import annotations

import os
from typing import Any, NamedTuple

import numpy as np

from marble.errors import InvalidArgument
from marble.lcs.planner import Plan
from marble.lcs.system import LCS, Array
from marble.model.optional import optional

_GAP, _FORCE, _TOUCH = "#2563a8", "#c2481f", "#f3ddd2"


class ContactHistory(NamedTuple):
    """A contact in the stages of a plan.

    gap: (N,), at the end of each stage, in m or rad, 0 while a soft contact is compressed; of a system that has not
    been made by linearize the second side of the pair. force: (N,), along the normal in each stage, in N or N m; of
    such a system λ.
    """

    gap: Array
    force: Array


def contact_histories(plan: Plan, lcs: LCS) -> dict[str, ContactHistory]:
    """The contacts of a plan, by their names.

    lcs: of which the plan was made: `step.linearization.lcs` of a ControlStep. InvalidArgument if its sizes differ.

    The gap is dt times the mean of the rows of all friction directions in Anitescu's model, in which tangential parts
    cancel out, and the force is the sum of their multipliers.
    """
    sizes = (plan.x.shape[1], plan.u.shape[1], plan.lam.shape[1])
    if sizes != (lcs.nx, lcs.nu, lcs.nl) or lcs.stages not in (None, len(plan.u)):
        raise InvalidArgument("lcs", f"must have {sizes[0]} states, {sizes[1]} inputs and {sizes[2]} pairs, as the "
                              "plan has", value=repr(lcs))
    stages = [lcs.stage(k) for k in range(len(plan.u))]
    sides = np.array([s.E @ x + s.F @ lam + s.H @ u + s.c
                      for s, x, u, lam in zip(stages, plan.x[:-1], plan.u, plan.lam, strict=True)])
    sides = sides.reshape(plan.lam.shape)
    names = lcs.names.get("pairs", tuple(f"pair {i}" for i in range(lcs.nl)))
    made: dict[str, list[int]] = {}
    for index, name in enumerate(names):
        label, _, kind = name.rpartition(" ")
        if kind == "normal" or kind.startswith("edge"):
            made.setdefault(label, []).append(index)
        elif kind != "slip" and not kind.startswith("friction"):
            made[name] = [index]
    is_mechanical = lcs.dt is not None and "pairs" in lcs.names
    scale = lcs.dt if is_mechanical and lcs.dt is not None else 1.0
    return {label: ContactHistory(scale * sides[:, columns].mean(axis=1), plan.lam[:, columns].sum(axis=1))
            for label, columns in made.items()}


def save(plan: Plan, lcs: LCS, path: str | os.PathLike[str]) -> None:
    """Draws gaps and forces over the horizon into a file, a row for each contact; its suffix selects the format.

    Stages in which a contact has a force are shaded. Arguments as in contact_histories; the system must have pairs.
    """
    histories = contact_histories(plan, lcs)
    if not histories:
        raise InvalidArgument("lcs", "must have pairs", value=repr(lcs))
    matplotlib: Any = optional("matplotlib", "matplotlib", "a picture")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    step = 1.0 if lcs.dt is None else lcs.dt
    edges = step * np.arange(len(plan.u) + 1)
    largest = max(float(one.force.max()) for one in histories.values())
    figure, rows = pyplot.subplots(len(histories), 1, sharex=True, squeeze=False, constrained_layout=True,
                                   figsize=(8, 1.2 + 1.5 * len(histories)))
    for axes, (label, one) in zip(rows[:, 0], histories.items(), strict=True):
        for k in np.flatnonzero(one.force > 1e-6 * max(largest, 1e-12)):
            axes.axvspan(edges[k], edges[k + 1], color=_TOUCH, linewidth=0)
        axes.step(edges, [*one.gap, one.gap[-1]], where="post", color=_GAP)
        axes.set_ylabel("gap", color=_GAP)
        axes.set_title(label, loc="left", fontsize="small")
        axes.set_ylim(bottom=min(0.0, 1.1 * float(one.gap.min())))
        other = axes.twinx()
        other.step(edges, [*one.force, one.force[-1]], where="post", color=_FORCE)
        other.set_ylabel("force", color=_FORCE)
        other.set_ylim(0, 1.1 * max(largest, 1e-12))
        for side in ("top",):
            axes.spines[side].set_visible(False)
            other.spines[side].set_visible(False)
    rows[-1, 0].set_xlabel("stage" if lcs.dt is None else "s")
    figure.savefig(path, dpi=150)
    pyplot.close(figure)
