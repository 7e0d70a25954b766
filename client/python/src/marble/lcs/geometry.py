"""Signed distances between simple shapes, with the points and the normal at which they are attained.

A pair of shapes has one or several features, each with a distance of its own: a box and a plane have the eight corners,
a capsule and a plane the two ends. The features of a pair never change, so that a contact keeps its place in an LCS.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from marble.lcs.rotation import cross_matrix

Array = NDArray[np.float64]


class Shape(NamedTuple):
    """A shape in its own frame, around the origin; axes are z.

    kind and size: "plane" (), the half-space z ≤ 0; "sphere" (radius); "capsule" and "cylinder" (radius, half length);
    "box" and "ellipsoid" (three half lengths); "other", known to the library alone. In m.
    """

    kind: str
    size: tuple[float, ...] = ()


class Placed(NamedTuple):
    """A shape in the world: rotation (3, 3) from its frame, position (3,) of its origin."""

    shape: Shape
    rotation: Array
    position: Array


class Witness(NamedTuple):
    """A signed distance in m, the unit normal from the first to the second shape, and the nearest point of each."""

    gap: float
    normal: Array
    first: Array
    second: Array

    def reversed(self) -> Witness:
        """The same with the shapes in the other order."""
        return Witness(self.gap, -self.normal, self.second, self.first)


_ORDER: Final = ("plane", "box", "capsule", "sphere", "cylinder", "ellipsoid", "other")
_SIGNS: Final = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))  # the corners of a box
_ROUND: Final = ("sphere", "capsule")
_PARALLEL: Final = 1e-12  # of the squared sine between two axes
_COINCIDENT: Final = 1e-9  # m


def features(first: Shape, second: Shape) -> tuple[str, ...]:
    """The names of a pair's features: "nearest", "end0", "corner3", "rim5"; of two boxes "first.corner0" and others."""
    kinds = (first.kind, second.kind)
    if _ORDER.index(kinds[0]) > _ORDER.index(kinds[1]):
        return tuple(_swapped(name) for name in features(second, first))
    corners = tuple(f"corner{i}" for i in range(8))
    if kinds[0] == "plane":
        return {"plane": (), "box": corners, "capsule": ("end0", "end1"),
                "cylinder": tuple(f"rim{i}" for i in range(8))}.get(kinds[1], ("nearest",))
    if kinds == ("box", "box"):
        return (*(f"{which}.{corner}" for which in ("first", "second") for corner in corners), "nearest")
    if kinds == ("box", "capsule"):
        return ("end0", "end1", "nearest")
    return ("nearest",)


def witness(first: Placed, second: Placed, feature: str, nearest: Callable[[], Witness]) -> Witness:
    """The signed distance of a feature. nearest: asks the library for the nearest points of the two shapes, in order;
    called for pairs of shapes that have no formula here.
    """
    kinds = (first.shape.kind, second.shape.kind)
    if _ORDER.index(kinds[0]) > _ORDER.index(kinds[1]):
        return witness(second, first, _swapped(feature), lambda: nearest().reversed()).reversed()
    if kinds[0] == "plane" and kinds[1] != "other":
        return _of_plane(first, second, feature)
    if feature == "nearest" and kinds[0] in _ROUND and kinds[1] in _ROUND:
        a, b = _nearest_on_segments(*_segment(first), *_segment(second))
        return _of_cores(a, b, first.shape.size[0], second.shape.size[0], first, second)
    if kinds == ("box", "sphere"):
        return _of_box(first, second.position, second.shape.size[0])
    if feature.startswith("end"):
        return _of_box(first, _segment(second)[int(feature[3:])], second.shape.size[0])
    if feature.startswith("first."):
        return _of_box(second, _corner(first, int(feature[-1])), 0.0).reversed()
    if feature.startswith("second."):
        return _of_box(first, _corner(second, int(feature[-1])), 0.0)
    return nearest()


def _swapped(feature: str) -> str:
    which, dot, rest = feature.partition(".")
    return f"{'second' if which == 'first' else 'first'}.{rest}" if dot else feature


def _corner(box: Placed, index: int) -> Array:
    local: Array = _SIGNS[index] * np.array(box.shape.size)
    return box.position + box.rotation @ local


def _segment(placed: Placed) -> tuple[Array, Array]:
    """The ends of the axis of a capsule; the centre of a sphere, twice."""
    half = placed.shape.size[1] * placed.rotation[:, 2] if placed.shape.kind == "capsule" else np.zeros(3)
    return placed.position - half, placed.position + half


def _of_plane(plane: Placed, other: Placed, feature: str) -> Witness:
    normal = plane.rotation[:, 2]
    kind, size = other.shape
    if kind == "box":
        point = _corner(other, int(feature[-1]))
    elif kind == "cylinder":
        point = _rim(other, normal, int(feature[-1]))
    elif kind == "ellipsoid":
        axes = other.rotation * np.array(size)
        reach = axes.T @ normal
        point = other.position - axes @ reach / np.linalg.norm(reach)
    else:
        centre = _segment(other)[int(feature[3:]) if kind == "capsule" else 0]
        point = centre - size[0] * normal
    gap = float(normal @ (point - plane.position))
    return Witness(gap, normal, point - gap * normal, point)


def _rim(cylinder: Placed, normal: Array, index: int) -> Array:
    """Four points on the rim of each cap: the lowest one, and the others a quarter turn apart."""
    radius, half = cylinder.shape.size
    axis = cylinder.rotation[:, 2]
    down = -normal + axis * (axis @ normal)
    length = float(np.linalg.norm(down))
    down = down / length if length > _COINCIDENT else cylinder.rotation[:, 0]
    side = cross_matrix(axis) @ down
    direction = (down, side, -down, -side)[index % 4]
    point: Array = cylinder.position + (half if index >= 4 else -half) * axis + radius * direction
    return point


def _of_box(box: Placed, centre: Array, radius: float) -> Witness:
    """The box and a ball; from within, over the side that is nearest."""
    half = np.array(box.shape.size)
    local = box.rotation.T @ (centre - box.position)
    inside = np.clip(local, -half, half)
    offset = local - inside
    distance = float(np.linalg.norm(offset))
    if distance > _COINCIDENT:
        direction = offset / distance
    else:
        k = int(np.argmax(np.abs(local) - half))
        direction = np.zeros(3)
        direction[k] = 1.0 if local[k] >= 0 else -1.0
        distance = float(abs(local[k]) - half[k])
        inside[k] = direction[k] * half[k]
    normal = box.rotation @ direction
    return Witness(distance - radius, normal, box.position + box.rotation @ inside, centre - radius * normal)


def _nearest_on_segments(a0: Array, a1: Array, b0: Array, b1: Array) -> tuple[Array, Array]:
    """The nearest points of two segments, which may be points (Ericson, Real-Time Collision Detection, 5.1.9)."""
    along_a, along_b, between = a1 - a0, b1 - b0, a0 - b0
    aa, bb, ab = float(along_a @ along_a), float(along_b @ along_b), float(along_a @ along_b)
    ca, cb = float(along_a @ between), float(along_b @ between)
    s = 0.0
    if aa > 0 and bb > 0:
        determinant = aa * bb - ab * ab
        s = 0.5 if determinant <= _PARALLEL * aa * bb else min(max((ab * cb - ca * bb) / determinant, 0.0), 1.0)
    elif aa > 0:
        s = min(max(-ca / aa, 0.0), 1.0)
    t = (ab * s + cb) / bb if bb > 0 else 0.0
    if not 0 <= t <= 1:
        t = min(max(t, 0.0), 1.0)
        s = min(max((ab * t - ca) / aa, 0.0), 1.0) if aa > 0 else 0.0
    return a0 + s * along_a, b0 + t * along_b


def _of_cores(a: Array, b: Array, radius_a: float, radius_b: float, first: Placed, second: Placed) -> Witness:
    """Two balls around these centres."""
    offset = b - a
    distance = float(np.linalg.norm(offset))
    if distance > _COINCIDENT:
        normal = offset / distance
    else:  # the axes cross: any common perpendicular will do
        normal = cross_matrix(first.rotation[:, 2]) @ second.rotation[:, 2]
        length = float(np.linalg.norm(normal))
        normal = normal / length if length > _COINCIDENT else first.rotation[:, 0]
    return Witness(distance - radius_a - radius_b, normal, a + radius_a * normal, b - radius_b * normal)
