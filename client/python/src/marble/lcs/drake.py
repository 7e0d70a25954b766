"""Linear complementarity systems of Drake's MultibodyPlants. Needs drake (1.51 was tried).

The derivatives are those of Drake's inverse dynamics by AutoDiff, at the step's acceleration; the contacts' are
Jacobians of the plant.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, InitializeAutoDiff
from pydrake.geometry import Box, Capsule, Cylinder, Ellipsoid, GeometryId, HalfSpace, Sphere
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces, MultibodyForces_, QuaternionFloatingJoint

from marble.errors import InvalidArgument
from marble.lcs import geometry, rotation
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
from marble.lcs.time_stepping import Contact, SmoothDynamics
from marble.model.lcqp import vector

Array = NDArray[np.float64]

_MAKERS: Final[dict[type, Callable[[Any], Shape]]] = {
    Sphere: lambda one: Shape("sphere", (one.radius(),)),
    Capsule: lambda one: Shape("capsule", (one.radius(), one.length() / 2)),
    Cylinder: lambda one: Shape("cylinder", (one.radius(), one.length() / 2)),
    Box: lambda one: Shape("box", (one.width() / 2, one.depth() / 2, one.height() / 2)),
    Ellipsoid: lambda one: Shape("ellipsoid", (one.a(), one.b(), one.c())),
    HalfSpace: lambda _: Shape("plane")}


class Linearizer:
    """Linearizes one MultibodyPlant again and again, with the same contacts in the same order.

    `linearizer(context, u=u)` returns the `Linearization` there. Not for several threads at once. Parameters as of
    `linearize`.
    """

    pairs: tuple[ContactPair, ...]
    """The contacts: GeometryIds of two shapes and a feature; `pairs=` accepts them."""

    def __init__(self, plant: Any, context: Any, *, dt: float | None = None, contact: str = "anitescu",
                 pairs: Sequence[Sequence[Any]] | None = None, max_gap: float = DEFAULT_MAX_GAP,
                 num_directions: int = 4, friction: ArrayLike | None = None, stiffness: float | None = None,
                 joint_limits: bool = False) -> None:
        if not isinstance(plant, MultibodyPlant) or not plant.is_finalized():
            raise InvalidArgument("model", "must be a finalized MultibodyPlant of doubles", value=type(plant).__name__)
        if dt is None and plant.time_step() == 0:
            raise InvalidArgument("dt", "is required for a plant of continuous time: seconds of a stage")
        self._settings = Settings.of(plant.time_step() if dt is None else dt, contact, num_directions, max_gap,
                                     stiffness, joint_limits)
        for field, count in (("num_constraints()", plant.num_constraints()),
                             ("num_velocities()", int(plant.num_velocities() == 0)),
                             ("num_actuators()", int(plant.num_actuators() == 0))):
            if count:
                raise InvalidArgument(f"model.{field}", "must be 0: constraints are not supported"
                                      if "constraints" in field else "must be ≥ 1")
        self._plant, self._differentiable = plant, plant.ToAutoDiffXd()
        self._own, self._derived = plant.CreateDefaultContext(), self._differentiable.CreateDefaultContext()
        self._joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
        self._floating = [(joint.position_start(), joint.velocity_start()) for joint in self._joints
                          if isinstance(joint, QuaternionFloatingJoint)]
        self._actuation = np.array(plant.MakeActuationMatrix())
        self._limits = list(_limited(self._joints)) if joint_limits else []
        self._read(context)
        inspector = self._query.inspector() if self._query is not None else None
        ids = [] if inspector is None else [one for one in inspector.GetAllGeometryIds()
                                            if inspector.GetProximityProperties(one) is not None]
        self._shapes = {one: _shape(inspector.GetShape(one)) for one in ids}
        self._bodies = {one: plant.GetBodyFromFrameId(inspector.GetFrameId(one)) for one in ids}
        self._names = {one: inspector.GetName(one) for one in ids}
        self._candidates = [] if inspector is None else sorted(inspector.GetCollisionCandidates(),
                                                               key=lambda pair: [one.get_value() for one in pair])
        self.pairs = contact_pairs(self._settings, pairs, self._possible,
                                   lambda pair: self._candidate(context, pair), self._geometry, self._features)
        of_shapes = {one: _friction(inspector, one) for pair in self.pairs for one in pair[:2]}
        self._friction = friction_of(friction, [_combined(of_shapes[first], of_shapes[second])
                                                for first, second, _ in self.pairs])
        self._states = [f"{joint.name()}.{suffix}" if suffix else joint.name() for joint in self._ordered()
                        for suffix in [joint.velocity_suffix(i) if joint.num_velocities() > 1 else ""
                                       for i in range(joint.num_velocities())]]
        self._inputs = [plant.get_joint_actuator(index).name() for index in plant.GetJointActuatorIndices()]
        self._labels = [f"{self._names[i]}|{self._names[j]}|{feature}" for i, j, feature in self.pairs]
        self._labels += [f"{joint.name()} {side}" for joint, _, side in self._limits]

    def __call__(self, context: Any, u: ArrayLike | None = None) -> Linearization:
        """The linearization at the state of the plant's context and the inputs u (nu,), 0 without it."""
        plant, nu = self._plant, self._actuation.shape[1]
        q, v = self._read(context)
        inputs = np.zeros(nu) if u is None else vector(u, "u", nu)
        smooth = self._smooth(context, q, v, inputs)
        candidates = [self._candidate(context, pair) for pair in self.pairs]
        contacts = self._settings.contacts(candidates, self._friction) + [self._limit(q, *one) for one in self._limits]
        lcs = self._settings.system(smooth, contacts, self._states, self._inputs, self._labels)
        return Linearization(lcs, q, v, inputs, self.pairs, np.array([one.gap for one in candidates]), smooth,
                             np.array(plant.GetEffortLowerLimits()), np.array(plant.GetEffortUpperLimits()),
                             self._difference, self._integrate)

    def at(self, context: Any, q: ArrayLike, v: ArrayLike, u: ArrayLike | None = None) -> Linearization:
        """The linearization at a configuration q (nq,) and a velocity v (nv,), with all else as in the plant's context.

        The context is changed meanwhile, and has its own state again afterwards.
        """
        plant = self._plant
        state = np.concatenate([vector(q, "q", plant.num_positions()), vector(v, "v", plant.num_velocities())])
        own = np.concatenate(self._read(context))
        plant.SetPositionsAndVelocities(context, state)
        try:
            return self(context, u)
        finally:
            plant.SetPositionsAndVelocities(context, own)

    def measure(self, context: Any) -> tuple[Array, Array]:
        """The configuration (nq,) and the velocity (nv,) of the plant's context."""
        return self._read(context)

    def _ordered(self) -> list[Any]:
        return sorted((joint for joint in self._joints if joint.num_velocities()),
                      key=lambda one: int(one.velocity_start()))

    def _read(self, context: Any) -> tuple[Array, Array]:
        try:
            self._plant.ValidateContext(context)
        except (RuntimeError, TypeError) as error:
            raise InvalidArgument("context", f"must be the plant's ({error})") from None
        state = np.array(self._plant.GetPositionsAndVelocities(context))
        if not np.isfinite(state).all():
            bad = int(np.argmin(np.isfinite(state)))
            raise InvalidArgument("context", "must have a finite state", index=bad, value=state[bad])
        self._query = _query(self._plant, context)
        return state[:self._plant.num_positions()], state[self._plant.num_positions():]

    def _smooth(self, context: Any, q: Array, v: Array, u: Array) -> SmoothDynamics:
        plant, dt, nv = self._plant, self._settings.dt, v.size
        mass = np.array(plant.CalcMassMatrix(context))
        damping = np.zeros((nv, nv))
        for joint in self._ordered():
            at = slice(joint.velocity_start(), joint.velocity_start() + joint.num_velocities())
            damping[at, at] = np.diag(joint.GetDampingVector(context))
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        force = self._actuation @ u - plant.CalcInverseDynamics(context, np.zeros(nv), forces)
        acceleration = np.linalg.solve(mass + dt * damping, force)

        differentiable, derived = self._differentiable, self._derived
        derived.SetTimeStateAndParametersFrom(context)
        of_q, of_v, none = np.eye(2 * nv)[:nv], np.eye(2 * nv)[nv:], np.zeros((nv, 2 * nv))
        to_rates = np.stack([plant.MapVelocityToQDot(context, unit) for unit in np.eye(nv)], axis=1)
        differentiable.SetPositions(derived, InitializeAutoDiff(q, to_rates @ of_q))
        differentiable.SetVelocities(derived, InitializeAutoDiff(v, of_v))
        derived_forces = MultibodyForces_[AutoDiffXd](differentiable)
        differentiable.CalcForceElementsContribution(derived, derived_forces)
        residual = _gradient(differentiable.CalcInverseDynamics(
            derived, InitializeAutoDiff(acceleration, none), derived_forces), 2 * nv)

        after = v + dt * acceleration
        rates = _gradient(differentiable.MapVelocityToQDot(derived, InitializeAutoDiff(after, none)), 2 * nv)
        transport = np.eye(nv) + dt * np.stack([plant.MapQDotToVelocity(context, column) for column in rates[:, :nv].T],
                                               axis=1)
        for _, first in self._floating:  # v turns in the world's frame
            turn = slice(first, first + 3)
            transport[turn, turn] = rotation.transport(-dt * after[turn])
        return SmoothDynamics(mass, damping, acceleration, -residual[:, :nv], -residual[:, nv:], self._actuation, v, u,
                              transport)

    def _difference(self, q_from: Array, q: Array) -> Array:
        self._plant.SetPositions(self._own, q_from)
        made = np.array(self._plant.MapQDotToVelocity(self._own, q - q_from))
        for position, at in self._floating:
            turn = _times(q[position:position + 4], _inverse(q_from[position:position + 4]))
            length = float(np.linalg.norm(turn[1:]))
            angle = 2 * math.atan2(length, abs(turn[0]))
            sign = math.copysign(1.0, turn[0])
            made[at:at + 3] = sign * turn[1:] * (angle / length if length > 0 else 2.0)
        return made

    def _integrate(self, q: Array, tangent: Array) -> Array:
        self._plant.SetPositions(self._own, q)
        made = np.array(q + self._plant.MapVelocityToQDot(self._own, tangent))
        for position, at in self._floating:
            half = tangent[at:at + 3] / 2
            angle = float(np.linalg.norm(half))
            turn = np.concatenate([[math.cos(angle)], np.sinc(angle / np.pi) * half])
            made[position:position + 4] = _times(turn, q[position:position + 4])
        return made

    def _candidate(self, context: Any, pair: ContactPair) -> Candidate:
        found = geometry.witness(self._placed(pair.first), self._placed(pair.second), pair.feature,
                                 lambda: self._nearest(pair.first, pair.second))
        jacobian = (self._jacobian(context, pair.second, found.second)
                    - self._jacobian(context, pair.first, found.first))
        return Candidate(found.gap, found.normal, jacobian, True)

    def _jacobian(self, context: Any, one: Any, point: Array) -> Array:
        plant, body = self._plant, self._bodies[one]
        local = body.EvalPoseInWorld(context).inverse() @ point
        world = plant.world_frame()
        made: Array = plant.CalcJacobianTranslationalVelocity(context, JacobianWrtVariable.kV, body.body_frame(), local,
                                                              world, world)
        return made

    def _placed(self, one: Any) -> Placed:
        pose = self._query.GetPoseInWorld(one)
        return Placed(self._shapes[one], pose.rotation().matrix(), pose.translation())

    def _nearest(self, first: Any, second: Any) -> Witness:
        found = self._query.ComputeSignedDistancePairClosestPoints(first, second)
        return Witness(float(found.distance), -np.array(found.nhat_BA_W),
                       self._query.GetPoseInWorld(first) @ found.p_ACa,
                       self._query.GetPoseInWorld(second) @ found.p_BCb)

    def _possible(self) -> Iterator[ContactPair]:
        for first, second in self._candidates:
            for feature in self._features(first, second):
                yield ContactPair(first, second, feature)

    def _features(self, first: Any, second: Any) -> tuple[str, ...]:
        if self._bodies[first].index() == self._bodies[second].index():
            return ()
        return geometry.features(self._shapes[first], self._shapes[second])

    def _geometry(self, given: Any, index: int) -> Any:
        found = [one for one, name in self._names.items() if given in (name, name.rpartition("::")[2])] \
            if isinstance(given, str) else [given] if isinstance(given, GeometryId) and given in self._names else []
        if len(found) != 1:
            raise InvalidArgument("pairs", "must be GeometryIds or unambiguous names of shapes with proximity roles",
                                  index=index, value=repr(given))
        return found[0]

    def _limit(self, q: Array, joint: Any, bound: float, side: str) -> Contact:
        sign, row = (1.0 if side == "lower" else -1.0), np.zeros(self._plant.num_velocities())
        row[joint.velocity_start()] = sign
        return Contact(float(sign * (q[joint.position_start()] - bound)), row, np.zeros((0, row.size)), 0.0, False)


def linearize(plant: Any, context: Any, *, u: ArrayLike | None = None, **options: Any) -> Linearization:
    """The LCS of a MultibodyPlant at the state of its context, and the inputs u (nu,) of its actuators, 0 without it.

    dt: h, seconds of a stage; plant.time_step() without it. contact: "anitescu" (one pair per direction),
    "stewart_trinkle" (2 more per contact) or "soft" (one spring each). num_directions: directions of friction, even; 2
    for planar models. friction: coefficients instead of the shapes' coefficients of dynamic friction, as Drake combines
    them, one for all contacts or one each. stiffness: N/m, > 0, of the springs of "soft", or of the other
    models if they shall give way.

    pairs: the contacts, as (shape, shape) or (shape, shape, feature), shapes by name or GeometryId. Without it all
    features of all candidates of collision whose gap is at most max_gap, in m. The context must be part of a diagram's
    whose SceneGraph is connected to the plant; otherwise there are no contacts. joint_limits: adds the limits of joints
    with one coordinate as pairs, after those of the contacts.

    Forces from input ports other than the actuators' u and gains of controllers in the plant do not count. Constraints
    are errors. `linearizer` returns an object for control loops, which keeps the contacts.
    """
    return Linearizer(plant, context, **options)(context, u)


def _gradient(values: Any, count: int) -> Array:
    """(n, count); AutoDiffXd without derivatives are constants."""
    found: Array = ExtractGradient(values)
    return found if found.shape[1] == count else np.zeros((len(values), count))


def _shape(shape: Any) -> Shape:
    return _MAKERS.get(type(shape), lambda _: Shape("other"))(shape)


def _query(plant: Any, context: Any) -> Any:
    port = plant.get_geometry_query_input_port()
    return port.Eval(context) if plant.geometry_source_is_registered() and port.HasValue(context) else None


def _friction(inspector: Any, one: Any) -> float:
    properties = inspector.GetProximityProperties(one)
    value = properties.GetPropertyOrDefault("material", "coulomb_friction", None)
    return 1.0 if value is None else float(value.dynamic_friction())


def _combined(first: float, second: float) -> float:
    """As Drake's CalcContactFrictionFromSurfaceProperties."""
    return 2 * first * second / (first + second) if first + second > 0 else 0.0


def _limited(joints: Sequence[Any]) -> Iterator[tuple[Any, float, str]]:
    for joint in joints:
        if joint.num_positions() == 1 and joint.num_velocities() == 1:
            for side, bounds in (("lower", joint.position_lower_limits()), ("upper", joint.position_upper_limits())):
                if math.isfinite(bounds[0]):
                    yield joint, float(bounds[0]), side


def _times(a: Array, b: Array) -> Array:
    """The product of quaternions (w, x, y, z)."""
    vector_part = a[0] * b[1:] + b[0] * a[1:] + rotation.cross_matrix(a[1:]) @ b[1:]
    return np.concatenate([[a[0] * b[0] - a[1:] @ b[1:]], vector_part])


def _inverse(a: Array) -> Array:
    return np.array([a[0], -a[1], -a[2], -a[3]]) / float(a @ a)
