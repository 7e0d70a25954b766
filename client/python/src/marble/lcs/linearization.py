"""What the linearizers of all libraries share: their options, the choice of contacts, and the result."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from marble.base.checks import is_number, is_whole
from marble.errors import InvalidArgument
from marble.lcs.system import LCS
from marble.lcs.time_stepping import (
    CONTACT_MODELS,
    Contact,
    SmoothDynamics,
    matrices,
    multipliers,
    tangent_directions,
)
from marble.model.lcqp import vector

Array = NDArray[np.float64]

MAX_DIRECTIONS: Final = 998
DEFAULT_MAX_GAP: Final = 0.1
"""m."""
_SAME: Final = 1e-9  # of two rows, relative


class ContactPair(NamedTuple):
    """Two shapes that may touch, as the library identifies them, and the feature at which they do.

    feature: "nearest", the nearest points of both; "end0", "end1" of a capsule; "corner0" … "corner7" of a box, of two
    boxes with "first." or "second." in front; "rim0" … "rim7" of a cylinder on a plane.
    """

    first: Any
    second: Any
    feature: str


@dataclasses.dataclass(frozen=True, repr=False)
class Linearization:
    """A model's LCS at (q, v, u), with what relates its state to the model's.

    The state is x = (δq, v): δq (nv,) is the tangent at q that leads to a configuration, v (nv,) the velocity, in the
    library's own coordinates. A controller starts from x0 and converts its targets by `state`.
    """

    lcs: LCS
    q: Array
    """(nq,) The configuration at which δq is 0."""
    v: Array
    """(nv,) The velocity there."""
    u: Array
    """(nu,) The inputs there."""
    pairs: tuple[ContactPair, ...]
    """The contacts, in the order of their multipliers."""
    gaps: Array
    """Signed distances of `pairs` in m, less the margin at which they touch; negative where they penetrate."""
    smooth: SmoothDynamics
    """The dynamics without contacts."""
    u_min: Array
    """(nu,) Lower bounds of the inputs; −inf where the model has none."""
    u_max: Array
    """(nu,) Upper bounds; inf where the model has none."""
    _difference: Callable[[Array, Array], Array]
    _integrate: Callable[[Array, Array], Array]
    joint_limits: tuple[Array, Array] | None = None
    """Lower and upper limits (nv,) of δq, infinite where a joint has none; None unless joint_limits="bounds"."""

    @property
    def x0(self) -> Array:
        """(nx,) The state at which the model is: (0, v)."""
        return np.concatenate([np.zeros(self.v.size), self.v])

    def state(self, q: ArrayLike, v: ArrayLike) -> Array:
        """The x of a configuration (nq,) and a velocity (nv,)."""
        return np.concatenate([self._difference(self.q, vector(q, "q", self.q.size)), vector(v, "v", self.v.size)])

    def configuration(self, x: ArrayLike) -> tuple[Array, Array]:
        """The configuration (nq,) and the velocity (nv,) of a state x (nx,)."""
        values = vector(x, "x", 2 * self.v.size)
        return self._integrate(self.q, values[:self.v.size]), values[self.v.size:]

    def joint_bounds(self, x: ArrayLike, stages: int) -> tuple[Array, Array] | None:
        """Lower and upper bounds (stages, nv) of δq in the stages 1 to N of a plan from x (nx,); None without limits.

        They are the limits, relaxed where a joint is beyond one or would get there: in the first half of the stages, to
        the way on which its present speed falls evenly to zero; in the second half, with even acceleration, half the
        way back to the limit. A plan is feasible if the joint can be braked so and brought back; if not, it may not be.
        """
        if self.joint_limits is None:
            return None
        values, nv = vector(x, "x", 2 * self.v.size), self.v.size
        k = np.arange(1, stages + 1)
        half = (stages + 1) // 2
        braked = np.minimum(k, half)
        way = (self.lcs.dt or 0.0) * (braked - braked * (braked - 1) / (2 * half))  # of a speed of 1
        rest = 1 - 0.5 * (np.maximum(k - half, 0) / max(stages - half, 1)) ** 2
        reached = values[:nv] + np.outer(way, values[nv:])
        lower, upper = self.joint_limits
        below, above = np.maximum(lower - reached, 0.0), np.maximum(reached - upper, 0.0)
        return lower - rest[:, None] * below, upper + rest[:, None] * above

    def __repr__(self) -> str:
        return f"<Linearization: {self.lcs!r}, {len(self.pairs)} contacts>"


class Candidate(NamedTuple):
    """A contact at the present state: gap less the margin in m, unit normal (3,) from first to second, Jacobian (3, nv)
    of the velocity of the second relative to the first, and whether it has friction."""

    gap: float
    normal: Array
    jacobian: Array
    has_friction: bool


@dataclasses.dataclass(frozen=True)
class Settings:
    """The options of a linearizer that do not depend on the library, checked."""

    dt: float
    contact: str
    num_directions: int
    max_gap: float
    stiffness: float
    joint_limits: bool

    @classmethod
    def of(cls, dt: Any, contact: Any, num_directions: Any, max_gap: Any, stiffness: Any,
           joint_limits: Any) -> Settings:
        """Raises InvalidArgument with the name of the option."""
        if not isinstance(contact, str) or contact not in CONTACT_MODELS:
            raise InvalidArgument("contact", f"must be one of {', '.join(CONTACT_MODELS)}", value=repr(contact))
        if not is_whole(num_directions, 2, MAX_DIRECTIONS) or num_directions % 2:
            raise InvalidArgument("num_directions", f"must be 2 (planar) or an even number of at most {MAX_DIRECTIONS}",
                                  value=num_directions)
        gap = max_gap if is_number(max_gap) else math.nan
        if not gap >= 0:
            raise InvalidArgument("max_gap", "must be ≥ 0 m", value=max_gap)
        if contact == "soft" and stiffness is None:
            raise InvalidArgument("stiffness", 'is required by contact="soft": N/m')
        if stiffness is not None:
            positive(stiffness, "stiffness", "N/m")
        if not isinstance(joint_limits, bool | np.bool_):
            raise InvalidArgument("joint_limits", "must be True or False", value=repr(joint_limits))
        return cls(positive(dt, "dt", "s"), contact, int(num_directions), float(gap),
                   float(stiffness) if stiffness is not None else math.inf, bool(joint_limits))

    def chosen(self, pairs: Sequence[ContactPair], at: Sequence[Candidate]) -> list[int]:
        """Which candidates to keep if the caller does not choose: those within max_gap; of those with equal rows in a
        planar model the first. InvalidArgument if there are candidates and all are too far."""
        kept: list[int] = []
        rows: list[Array] = []
        for i, one in enumerate(at):
            if one.gap > self.max_gap:
                continue
            if self.num_directions == 2:
                directions = np.stack([one.normal, tangent_directions(one.normal, one.jacobian, 2)[0]])
                row = np.concatenate([[one.gap], (directions @ one.jacobian).ravel()])
                if any(np.abs(row - other).max() <= _SAME * (1 + np.abs(row).max()) for other in rows):
                    continue
                rows.append(row)
            kept.append(i)
        if at and not kept:
            nearest = min(range(len(at)), key=lambda i: at[i].gap)
            raise InvalidArgument("max_gap", f"must be ≥ {at[nearest].gap:g} m, the gap of the nearest pair "
                                  f"{_text(pairs[nearest])}; or pass pairs=", value=self.max_gap)
        return kept

    def contacts(self, candidates: Iterable[Candidate], friction: Sequence[float]) -> list[Contact]:
        """The contacts as rows on the velocities."""
        made = []
        for one, mu in zip(candidates, friction, strict=True):
            rubs = one.has_friction and mu > 0 and self.contact != "soft"
            directions = tangent_directions(one.normal, one.jacobian, self.num_directions) if rubs else np.zeros((0, 3))
            made.append(Contact(one.gap, one.normal @ one.jacobian, directions @ one.jacobian, mu, True))
        return made

    def system(self, smooth: SmoothDynamics, contacts: Sequence[Contact], states: Sequence[str], inputs: Sequence[str],
               labels: Sequence[str]) -> LCS:
        """labels: one for each contact."""
        names = [f"{label} {name}" for label, one in zip(labels, contacts, strict=True)
                 for name in multipliers(len(one.tangents), self.contact, one.soft)]
        return LCS(**matrices(smooth, contacts, self.dt, self.contact, self.stiffness), dt=self.dt,
                   names={"states": (*(f"δ{name}" for name in states), *(f"v {name}" for name in states)),
                          "inputs": tuple(inputs), "pairs": tuple(names)})


def positive(value: Any, field: str, unit: str) -> float:
    """A finite number > 0, or InvalidArgument."""
    if not (is_number(value) and math.isfinite(value) and value > 0):
        raise InvalidArgument(field, f"must be finite and > 0 {unit}", value=value)
    return float(value)


def friction_of(friction: Any, defaults: Sequence[float]) -> list[float]:
    """The friction coefficient of each contact: one for all, one each, or the defaults."""
    if friction is None:
        return list(defaults)
    values = vector(friction, "friction")
    if np.ndim(friction) == 0:
        values = np.full(len(defaults), values[0])
    if values.size != len(defaults):
        raise InvalidArgument("friction", f"must be a number, or one for each of the {len(defaults)} contacts",
                              value=f"{values.size} entries")
    if (values < 0).any():
        bad = int(np.argmax(values < 0))
        raise InvalidArgument("friction", "must be ≥ 0", index=bad, value=values[bad])
    return [float(value) for value in values]


def contact_pairs(settings: Settings, pairs: Any, possible: Callable[[], Iterable[ContactPair]],
                  candidate: Callable[[ContactPair], Candidate], shape_of: Callable[[Any, int], Any],
                  features_of: Callable[[Any, Any], tuple[str, ...]]) -> tuple[ContactPair, ...]:
    """Those that the caller chose, or of the possible ones those that `Settings.chosen` keeps."""
    if pairs is not None:
        return tuple(_given_pairs(pairs, shape_of, features_of))
    found = list(possible())
    return tuple(found[i] for i in settings.chosen(found, [candidate(pair) for pair in found]))


def _given_pairs(pairs: Any, shape_of: Callable[[Any, int], Any],
                 features_of: Callable[[Any, Any], tuple[str, ...]]) -> list[ContactPair]:
    """The pairs of (first, second) for all features, or (first, second, feature).

    shape_of: identifies a shape by what the caller gave, in the pair of that index, or raises InvalidArgument.
    """
    if isinstance(pairs, str | bytes) or not isinstance(pairs, Sequence):
        raise InvalidArgument("pairs", "must be a sequence of (first, second) or (first, second, feature)",
                              value=repr(pairs))
    made: list[ContactPair] = []
    for index, given in enumerate(pairs):
        if isinstance(given, str | bytes) or not isinstance(given, Sequence) or len(given) not in (2, 3):
            raise InvalidArgument("pairs", "must be (first, second) or (first, second, feature)", index=index,
                                  value=repr(given))
        first, second = (shape_of(one, index) for one in given[:2])
        possible = features_of(first, second)
        if not possible:
            raise InvalidArgument("pairs", "cannot touch", index=index, value=repr(tuple(given)))
        wanted = possible if len(given) == 2 else (given[2],)
        for feature in wanted:
            if feature not in possible:
                raise InvalidArgument("pairs", f"must have a feature of {', '.join(possible)}", index=index,
                                      value=repr(feature))
            pair = ContactPair(first, second, feature)
            if pair in made:
                raise InvalidArgument("pairs", "must not occur twice", index=index, value=repr(tuple(given)))
            made.append(pair)
    return made


def _text(pair: ContactPair) -> str:
    return f"({pair.first}, {pair.second}, {pair.feature!r})"
