"""Linear complementarity systems of Pinocchio models. Needs pin, with coal (4.1 was tried, with coal 3.0.3).

All derivatives are analytical: those of the smooth dynamics are of the inverse dynamics at the step's acceleration
(`computeRNEADerivatives`; `computeABADerivatives` is the same times the inverse of the mass, without damping), those of
the configuration's tangent by `dIntegrate` and `dDifference`, and the contacts' by joint Jacobians.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from marble.errors import InvalidArgument
from marble.lcs import geometry
from marble.lcs.geometry import Placed, Shape, Witness
from marble.lcs.linearization import (
    DEFAULT_MAX_GAP,
    Candidate,
    ContactPair,
    Linearization,
    Settings,
    contact_pairs,
    friction_of,
)
from marble.lcs.rotation import cross_matrix
from marble.lcs.time_stepping import Contact, SmoothDynamics
from marble.model.lcqp import vector

Array = NDArray[np.float64]

_UNLIMITED: Final = 1e10  # Pinocchio's limits are the largest double where there are none
_UNIT: Final = 1e-6


class Linearizer:
    """Linearizes one Pinocchio model again and again, with the same contacts in the same order.

    `linearizer((q, v), u=u)` returns the `Linearization` there. Not for several threads at once. Parameters as of
    `linearize`.
    """

    pairs: tuple[ContactPair, ...]
    """The contacts: indices of two geometry objects and a feature; `pairs=` accepts them."""

    def __init__(self, model: Any, state: Any, *, dt: float | None = None, geometry_model: Any = None,
                 actuation: ArrayLike | None = None, contact: str = "anitescu",
                 pairs: Sequence[Sequence[Any]] | None = None, max_gap: float = DEFAULT_MAX_GAP,
                 num_directions: int = 4, friction: ArrayLike | None = None, stiffness: float | None = None,
                 joint_limits: bool = False) -> None:
        if not isinstance(model, pin.Model):
            raise InvalidArgument("model", "must be a pinocchio.Model", value=type(model).__name__)
        if dt is None:
            raise InvalidArgument("dt", "is required: seconds of a stage")
        if getattr(model, "nvExtended", model.nv) != model.nv:
            raise InvalidArgument("model", "must not have mimic joints")
        self._settings = Settings.of(dt, contact, num_directions, max_gap, stiffness, joint_limits)
        self._model, self._data = model, model.createData()
        self._geometries = geometry_model if geometry_model is not None else pin.GeometryModel()
        self._geometry_data = self._geometries.createData()
        objects = list(self._geometries.geometryObjects)
        self._shapes = [_shape(one.geometry) for one in objects]
        self._actuation, self._inputs = _actuation(model, actuation)
        self._u_min, self._u_max = _effort_limits(model, self._actuation if actuation is None else None,
                                                  self._actuation.shape[1])
        self._limits = list(_limited_joints(model)) if joint_limits else []
        self._place(self._read(state)[0])
        self.pairs = contact_pairs(self._settings, pairs, self._possible, self._candidate, self._object, self._features)
        if friction is None and self.pairs and contact != "soft":
            raise InvalidArgument("friction", "is required: a Pinocchio model has no coefficients")
        self._friction = friction_of(friction, [0.0] * len(self.pairs))
        self._states = [f"{name}.{i}" if joint.nv > 1 else name
                        for name, joint in _joints(model) for i in range(joint.nv)]
        self._labels = [f"{objects[i].name}|{objects[j].name}|{feature}" for i, j, feature in self.pairs]
        self._labels += [f"{name} {side}" for name, _, _, _, side in self._limits]

    def __call__(self, state: Any, u: ArrayLike | None = None) -> Linearization:
        """The linearization at state = (q, v), q (nq,) and v (nv,), and the inputs u (nu,), 0 without it."""
        model, nu = self._model, self._actuation.shape[1]
        q, v = self._read(state)
        inputs = np.zeros(nu) if u is None else vector(u, "u", nu)
        smooth = self._smooth(q, v, inputs)
        self._place(q)
        candidates = [self._candidate(pair) for pair in self.pairs]
        contacts = self._settings.contacts(candidates, self._friction) + [self._limit(q, *one) for one in self._limits]
        lcs = self._settings.system(smooth, contacts, self._states, self._inputs, self._labels)
        return Linearization(lcs, q, v, inputs, self.pairs, np.array([one.gap for one in candidates]), smooth,
                             self._u_min, self._u_max, functools.partial(pin.difference, model),
                             functools.partial(pin.integrate, model))

    def at(self, state: Any, q: ArrayLike, v: ArrayLike, u: ArrayLike | None = None) -> Linearization:
        """The same at (q, v); the state does not count."""
        return self((q, v), u)

    def measure(self, state: Any) -> tuple[Array, Array]:
        """q (nq,) and v (nv,) of the state."""
        return self._read(state)

    def _read(self, state: Any) -> tuple[Array, Array]:
        if not isinstance(state, Sequence) or len(state) != 2:
            raise InvalidArgument("state", "must be (q, v)", value=repr(state))
        q = vector(state[0], "q", self._model.nq)
        if not pin.isNormalized(self._model, q, _UNIT):
            raise InvalidArgument("q", "must have quaternions and other rotations of length 1")
        return q, vector(state[1], "v", self._model.nv)

    def _smooth(self, q: Array, v: Array, u: Array) -> SmoothDynamics:
        model, data, dt = self._model, self._data, self._settings.dt
        upper = np.triu(pin.crba(model, data, q))
        mass = upper + np.triu(upper, 1).T
        damping = np.diag(model.damping)
        force = self._actuation @ u - pin.nonLinearEffects(model, data, q, v) - model.damping * v
        acceleration = np.linalg.solve(mass + dt * damping, force)
        by_q, by_v, _ = pin.computeRNEADerivatives(model, data, q, v, acceleration)
        step = dt * (v + dt * acceleration)
        there = pin.integrate(model, q, step)
        transport = (pin.dDifference(model, q, there, pin.ArgumentPosition.ARG1)
                     @ pin.dIntegrate(model, q, step, pin.ArgumentPosition.ARG0))
        return SmoothDynamics(mass, damping, acceleration, -by_q, -by_v - damping, self._actuation, v, u, transport)

    def _place(self, q: Array) -> None:
        pin.computeJointJacobians(self._model, self._data, q)
        pin.updateGeometryPlacements(self._model, self._data, self._geometries, self._geometry_data)

    def _candidate(self, pair: ContactPair) -> Candidate:
        found = geometry.witness(self._placed(pair.first), self._placed(pair.second), pair.feature,
                                 lambda: self._nearest(pair.first, pair.second))
        jacobian = self._jacobian(pair.second, found.second) - self._jacobian(pair.first, found.first)
        return Candidate(found.gap, found.normal, jacobian, True)

    def _jacobian(self, index: int, point: Array) -> Array:
        """Of the velocity of a point of a geometry object, (3, nv)."""
        joint = self._geometries.geometryObjects[index].parentJoint
        if joint == 0:
            return np.zeros((3, self._model.nv))
        rows = pin.getJointJacobian(self._model, self._data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        made: Array = rows[:3] - cross_matrix(point - self._data.oMi[joint].translation) @ rows[3:]
        return made

    def _placed(self, index: int) -> Placed:
        shape, to_shape, offset = self._shapes[index]
        placement = self._geometry_data.oMg[index]
        return Placed(shape, placement.rotation @ to_shape, placement.translation + placement.rotation @ offset)

    def _nearest(self, first: int, second: int) -> Witness:
        result, ends = coal.DistanceResult(), []
        for index in (first, second):
            placement = self._geometry_data.oMg[index]
            ends += [self._geometries.geometryObjects[index].geometry,
                     coal.Transform3s(placement.rotation, placement.translation)]
        gap = coal.distance(*ends, coal.DistanceRequest(), result)
        return Witness(float(gap), np.array(result.normal), np.array(result.getNearestPoint1()),
                       np.array(result.getNearestPoint2()))

    def _possible(self) -> Iterator[ContactPair]:
        for one in self._geometries.collisionPairs:
            for feature in self._features(one.first, one.second):
                yield ContactPair(one.first, one.second, feature)

    def _features(self, first: int, second: int) -> tuple[str, ...]:
        objects = self._geometries.geometryObjects
        if objects[first].parentJoint == objects[second].parentJoint:
            return ()
        return geometry.features(self._shapes[first][0], self._shapes[second][0])

    def _object(self, given: Any, index: int) -> int:
        count, found = self._geometries.ngeoms, given
        if isinstance(given, str):
            found = self._geometries.getGeometryId(given)
        if isinstance(found, bool) or not isinstance(found, (int, np.integer)) or not 0 <= found < count:
            raise InvalidArgument("pairs", f"must be names or indices of geometry objects, indices in [0, {count})",
                                  index=index, value=repr(given))
        return int(found)

    def _limit(self, q: Array, _: str, place: int, dof: int, bound: float, side: str) -> Contact:
        sign, row = (1.0 if side == "lower" else -1.0), np.zeros(self._model.nv)
        row[dof] = sign
        return Contact(float(sign * (q[place] - bound)), row, np.zeros((0, row.size)), 0.0, False)


def linearize(model: Any, state: Any, *, u: ArrayLike | None = None, **options: Any) -> Linearization:
    """The LCS of a Pinocchio model at state = (q, v), q (nq,) and v (nv,), and the inputs u (nu,), 0 without it.

    dt: h, seconds of a stage; required. actuation: S (nv, nu), for generalized forces S u; without it u are the forces
    of all joints but free-flyers. geometry_model: a pinocchio.GeometryModel, whose collisionPairs may touch; without it
    there are no contacts. The model's damping and armature count, its dry friction does not.

    contact: "anitescu" (one pair per direction), "stewart_trinkle" (2 more per contact) or "soft" (one spring each).
    num_directions: directions of friction, even; 2 for planar models. friction: coefficients, one for all contacts or
    one each; required unless "soft". stiffness: N/m, > 0, of the springs of "soft", or of the other
    models if they shall give way.

    pairs: the contacts, as (object, object) or (object, object, feature), objects by name or index. Without it all
    features of all collisionPairs whose gap is at most max_gap, in m. joint_limits: adds the limits of joints with one
    coordinate as pairs, after those of the contacts.

    `linearizer` returns an object for control loops, which keeps the contacts.
    """
    return Linearizer(model, state, **options)(state, u)


def _shape(shape: Any) -> tuple[Shape, Array, Array]:
    """The shape, and the rotation and the origin of its frame in the object's."""
    same, none = np.eye(3), np.zeros(3)
    makers: dict[type, Callable[[Any], Shape]] = {
        coal.Sphere: lambda one: Shape("sphere", (one.radius,)),
        coal.Capsule: lambda one: Shape("capsule", (one.radius, one.halfLength)),
        coal.Cylinder: lambda one: Shape("cylinder", (one.radius, one.halfLength)),
        coal.Box: lambda one: Shape("box", tuple(map(float, one.halfSide))),
        coal.Ellipsoid: lambda one: Shape("ellipsoid", tuple(map(float, one.radii)))}
    if isinstance(shape, coal.Halfspace):
        normal = np.array(shape.n, dtype=float)
        axis = np.eye(3)[int(np.argmin(np.abs(normal)))]
        first = cross_matrix(axis) @ normal
        first /= np.linalg.norm(first)
        return Shape("plane"), np.stack([first, cross_matrix(normal) @ first, normal], axis=1), shape.d * normal
    return makers.get(type(shape), lambda _: Shape("other"))(shape), same, none


def _joints(model: Any) -> list[tuple[str, Any]]:
    """Without the first, which stands for the world."""
    return list(zip(model.names, model.joints, strict=True))[1:]


def _actuation(model: Any, actuation: ArrayLike | None) -> tuple[Array, list[str]]:
    if actuation is not None:
        given = np.array(actuation, dtype=float)
        if given.ndim != 2 or given.shape[0] != model.nv or given.shape[1] == 0 or not np.isfinite(given).all():
            raise InvalidArgument("actuation", f"must be finite and of shape ({model.nv}, nu), nu ≥ 1",
                                  value=f"of shape {given.shape}")
        return given, [f"u{i}" for i in range(given.shape[1])]
    names: list[str] = []
    dofs: list[int] = []
    for name, joint in _joints(model):
        if joint.shortname() != "JointModelFreeFlyer":
            names += [f"{name}.{i}" if joint.nv > 1 else name for i in range(joint.nv)]
            dofs += range(joint.idx_v, joint.idx_v + joint.nv)
    if not dofs:
        raise InvalidArgument("actuation", "is required for a model without joints but free-flyers")
    return np.eye(model.nv)[:, np.array(dofs)], names


def _effort_limits(model: Any, actuation: Array | None, count: int) -> tuple[Array, Array]:
    if actuation is None:
        return np.full(count, -np.inf), np.full(count, np.inf)
    upper: Any = getattr(model, "upperEffortLimit", None)
    upper = model.effortLimit if upper is None else upper  # Pinocchio 3
    lower: Any = getattr(model, "lowerEffortLimit", -upper)
    limits = [actuation.T @ np.clip(values, -_UNLIMITED, _UNLIMITED) for values in (lower, upper)]
    return (np.where(limits[0] > -_UNLIMITED, limits[0], -np.inf), np.where(limits[1] < _UNLIMITED, limits[1], np.inf))


def _limited_joints(model: Any) -> Iterator[tuple[str, int, int, float, str]]:
    """Name, place in q, place in v, bound and side."""
    for name, joint in _joints(model):
        if joint.nq == 1 and joint.nv == 1:
            for side, bounds in (("lower", model.lowerPositionLimit), ("upper", model.upperPositionLimit)):
                bound = float(bounds[joint.idx_q])
                if math.isfinite(bound) and abs(bound) < _UNLIMITED:
                    yield name, joint.idx_q, joint.idx_v, bound, side
