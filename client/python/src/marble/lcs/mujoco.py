"""Linear complementarity systems of MuJoCo models. Needs mujoco (3.3.7 and 4.0 were tried).

Derivatives: those by the velocity are MuJoCo's analytical ones (`qDeriv` of its implicit integrators), and so are the
Jacobians of contacts (`mj_jac`). MuJoCo has none by the configuration: `mjd_transitionFD` and `mjd_inverseFD` are
finite differences, of the step with contacts and of the inverse dynamics. Here they are central differences of
`mj_forward` without constraints; those by the inputs too, which are exact for motors, position and velocity servos.
"""

from __future__ import annotations

import copy
import functools
import itertools
from collections.abc import Iterator, Sequence
from typing import Any, Final

import mujoco as mj
import numpy as np
from numpy.typing import ArrayLike, NDArray

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

_STEP: Final = 1e-5  # of differences by the configuration, rad or m
_INPUT_STEP: Final = 1e-3
_TOUCHING: Final = 1e-7  # m: mj_geomDistance has no direction below
_NEAR: Final = 1e-3  # m: where its contacts are better
_DOFS: Final = {mj.mjtJoint.mjJNT_FREE: ("x", "y", "z", "rx", "ry", "rz"), mj.mjtJoint.mjJNT_BALL: ("rx", "ry", "rz"),
                mj.mjtJoint.mjJNT_SLIDE: ("",), mj.mjtJoint.mjJNT_HINGE: ("",)}
_IGNORABLE: Final = ("equality", "frictionloss", "tendon_limits")


class Linearizer:
    """Linearizes one MuJoCo model again and again, with the same contacts in the same order.

    `linearizer(data)` returns the `Linearization` at data.qpos, data.qvel and data.ctrl; data is not changed. The model
    is copied: later changes to it have no effect. Not for several threads at once. Parameters as of `linearize`.
    """

    def __init__(self, model: Any, data: Any, *, dt: float | None = None, contact: str = "anitescu",
                 pairs: Sequence[Sequence[Any]] | None = None, max_gap: float = DEFAULT_MAX_GAP,
                 num_directions: int = 4, friction: ArrayLike | None = None, stiffness: float | None = None,
                 joint_limits: bool | str = False, ignore: Sequence[str] = ()) -> None:
        if not isinstance(model, mj.MjModel):
            raise InvalidArgument("model", "must be a mujoco.MjModel", value=type(model).__name__)
        if isinstance(joint_limits, str) and joint_limits not in ("pairs", "bounds"):
            raise InvalidArgument("joint_limits", 'must be False, True, "pairs" or "bounds"', value=repr(joint_limits))
        has_bounds = isinstance(joint_limits, str) and joint_limits == "bounds"
        if isinstance(joint_limits, str):
            joint_limits = not has_bounds  # as pairs
        self._settings = Settings.of(model.opt.timestep if dt is None else dt, contact, num_directions, max_gap,
                                     stiffness, joint_limits)
        _check_supported(model, ignore)
        self._model = copy.copy(model)
        self._set_smooth()
        self._data = mj.MjData(self._model)
        self._shapes = [_shape(model, geom) for geom in range(model.ngeom)]
        self._limits = _limited_joints(model) if joint_limits else []
        self._bounds = _limited_joints(model) if has_bounds else None
        for joint, side in self._bounds or ():
            if side == "angle":
                raise InvalidArgument("model.jnt_limited", "must be 0 for a ball joint: bounds are those of hinges and "
                                      "slides", index=joint, value=1)
        m = self._model
        pattern: Any = m if hasattr(m, "D_rownnz") else self._data  # of qDeriv; MuJoCo 3 has it in the data
        self._rows, self._columns = np.repeat(np.arange(m.nv), pattern.D_rownnz), pattern.D_colind.copy()
        limited = np.asarray(model.actuator_ctrllimited, dtype=bool)
        self._u_min = np.where(limited, model.actuator_ctrlrange[:, 0], -np.inf)
        self._u_max = np.where(limited, model.actuator_ctrlrange[:, 1], np.inf)
        self._read(data, None)
        mj.mj_forward(self._model, self._data)
        self.pairs = contact_pairs(self._settings, pairs, self._near,
                                   lambda pair: self._candidate(pair, *_parameters(model, pair.first, pair.second)),
                                   self._geom, self._features)
        self._fixed = [_parameters(model, pair.first, pair.second) for pair in self.pairs]
        self._friction = friction_of(friction, [mu for _, mu, _ in self._fixed])
        kinds = [mj.mjtJoint(kind) for kind in model.jnt_type]
        self._rotations = [int(model.jnt_dofadr[joint]) + (3 if kind == mj.mjtJoint.mjJNT_FREE else 0)
                           for joint, kind in enumerate(kinds)
                           if kind in (mj.mjtJoint.mjJNT_FREE, mj.mjtJoint.mjJNT_BALL)]
        joints = [m.joint(joint).name or f"joint{joint}" for joint in range(m.njnt)]
        self._states = [f"{name}.{dof}" if dof else name for name, kind in zip(joints, kinds, strict=True)
                        for dof in _DOFS[kind]]
        self._inputs = [m.actuator(i).name or f"actuator{i}" for i in range(m.nu)]
        self._labels = [f"{self._name(pair.first)}|{self._name(pair.second)}|{pair.feature}" for pair in self.pairs]
        self._labels += [f"{joints[joint]} {side}" for joint, side in self._limits]

    pairs: tuple[ContactPair, ...]
    """The contacts: ids of two geoms and a feature; `pairs=` accepts them, for example after some are left out."""

    def __call__(self, data: Any, u: ArrayLike | None = None) -> Linearization:
        """The linearization at the state of data. u (nu,): the inputs there; data.ctrl without it."""
        self._read(data, u)
        return self._linearization()

    def at(self, data: Any, q: ArrayLike, v: ArrayLike, u: ArrayLike | None = None) -> Linearization:
        """The linearization at a configuration q (nq,) and a velocity v (nv,), with all else as in data."""
        m, d = self._model, self._data
        self._read(data, u)
        d.qpos[:], d.qvel[:] = vector(q, "q", m.nq), vector(v, "v", m.nv)
        mj.mj_normalizeQuat(m, d.qpos)
        return self._linearization()

    def measure(self, data: Any) -> tuple[Array, Array]:
        """The configuration (nq,), with quaternions of length 1, and the velocity (nv,) of data."""
        self._check_data(data)
        q = data.qpos.copy()
        mj.mj_normalizeQuat(self._model, q)
        return q, data.qvel.copy()

    def _linearization(self) -> Linearization:
        m, d = self._model, self._data
        q, v, ctrl = d.qpos.copy(), d.qvel.copy(), d.ctrl.copy()
        smooth, contacts, gaps = self._smooth(q, v, ctrl)
        lcs = self._settings.system(smooth, contacts, self._states, self._inputs, self._labels)
        return Linearization(lcs, q, v, ctrl, self.pairs, gaps, smooth, self._u_min, self._u_max,
                             functools.partial(_difference, m), functools.partial(_integrate, m), self._joint_bounds(q))

    def _set_smooth(self) -> None:
        """No constraints, and no limits of inputs and forces: these are the controller's."""
        m, off = self._model, mj.mjtDisableBit
        m.opt.disableflags |= int(off.mjDSBL_CONSTRAINT) | int(off.mjDSBL_CLAMPCTRL) | int(off.mjDSBL_SENSOR)
        m.actuator_ctrllimited[:] = 0
        m.actuator_forcelimited[:] = 0
        m.jnt_actfrclimited[:] = 0

    def _check_data(self, data: Any) -> None:
        m = self._model
        if not isinstance(data, mj.MjData):
            raise InvalidArgument("data", "must be a mujoco.MjData", value=type(data).__name__)
        for field, size in (("qpos", m.nq), ("qvel", m.nv), ("ctrl", m.nu)):
            values = getattr(data, field)
            if values.size != size:
                raise InvalidArgument(f"data.{field}", f"must have {size} entries, as the model has",
                                      value=f"{values.size} entries")
            if not np.isfinite(values).all():
                bad = int(np.argmin(np.isfinite(values)))
                raise InvalidArgument(f"data.{field}", "must be finite", index=bad, value=values[bad])

    def _read(self, data: Any, u: ArrayLike | None) -> None:
        m, d = self._model, self._data
        self._check_data(data)
        kind = mj.mjtState.mjSTATE_INTEGRATION
        state = np.zeros(mj.mj_stateSize(m, kind))
        mj.mj_getState(m, data, state, kind)
        mj.mj_setState(m, d, state, kind)
        mj.mj_normalizeQuat(m, d.qpos)
        if u is not None:
            d.ctrl[:] = vector(u, "u", m.nu)

    def _smooth(self, q: Array, v: Array, ctrl: Array) -> tuple[SmoothDynamics, list[Contact], Array]:
        m, d, nv = self._model, self._data, self._model.nv
        mj.mj_forward(m, d)
        candidates = [self._candidate(pair, *fixed) for pair, fixed in zip(self.pairs, self._fixed, strict=True)]
        contacts = self._settings.contacts(candidates, self._friction) + [self._limit(*limit) for limit in self._limits]
        force, inverse = d.qfrc_smooth.copy(), np.zeros((nv, nv))
        mj.mj_solveM(m, d, inverse, np.eye(nv))
        mass = np.linalg.inv(inverse)
        fast, f_v = (self._force_by_velocity(q, v, integrator) for integrator in
                     (mj.mjtIntegrator.mjINT_IMPLICITFAST, mj.mjtIntegrator.mjINT_IMPLICIT))
        damping = -(fast + fast.T) / 2
        acceleration = np.linalg.solve(mass + self._settings.dt * damping, force)
        d.qpos[:], d.qvel[:] = q, v
        mj.mj_forward(m, d)
        f_u = np.zeros((nv, m.nu))
        for j in range(m.nu):
            sides = []
            for step in (_INPUT_STEP, -_INPUT_STEP):
                d.ctrl[j] = ctrl[j] + step
                mj.mj_fwdActuation(m, d)
                sides.append(d.qfrc_actuator.copy())
            f_u[:, j] = (sides[0] - sides[1]) / (2 * _INPUT_STEP)
            d.ctrl[j] = ctrl[j]
        f_q, unit, inertial = np.zeros((nv, nv)), np.zeros(nv), np.zeros(nv)
        for j in range(nv):
            sides = []
            for step in (_STEP, -_STEP):
                d.qpos[:] = q
                unit[j] = 1.0
                mj.mj_integratePos(m, d.qpos, unit, step)
                unit[j] = 0.0
                mj.mj_forward(m, d)
                mj.mj_mulM(m, d, inertial, acceleration)
                sides.append(d.qfrc_smooth - inertial)
            f_q[:, j] = (sides[0] - sides[1]) / (2 * _STEP)
        smooth = SmoothDynamics(mass, damping, acceleration, f_q, f_v, f_u, v, ctrl,
                                self._transport(v + self._settings.dt * acceleration))
        return smooth, contacts, np.array([one.gap for one in candidates])

    def _force_by_velocity(self, q: Array, v: Array, integrator: Any) -> Array:
        """The derivative that one of the implicit integrators uses; "implicitfast" leaves out the Coriolis forces."""
        m, d = self._model, self._data
        own = m.opt.integrator
        d.qpos[:], d.qvel[:] = q, v
        mj.mj_forward(m, d)
        m.opt.integrator = integrator
        mj.mj_implicit(m, d)
        m.opt.integrator = own
        made = np.zeros((m.nv, m.nv))
        made[self._rows, self._columns] = d.qDeriv
        return made

    def _transport(self, v: Array) -> Array:
        made = np.eye(v.size)
        for at in self._rotations:
            made[at:at + 3, at:at + 3] = rotation.transport(self._settings.dt * v[at:at + 3])
        return made

    def _joint_bounds(self, q: Array) -> tuple[Array, Array] | None:
        if self._bounds is None:
            return None
        m = self._model
        lower, upper = np.full(m.nv, -np.inf), np.full(m.nv, np.inf)
        for joint, side in self._bounds:
            (low, high), margin, at = m.jnt_range[joint], m.jnt_margin[joint], m.jnt_dofadr[joint]
            made, limit = (lower, low + margin) if side == "lower" else (upper, high - margin)
            made[at] = limit - q[m.jnt_qposadr[joint]]
        return lower, upper

    def _limit(self, joint: int, side: str) -> Contact:
        m, row = self._model, np.zeros(self._model.nv)
        at, q = m.jnt_dofadr[joint], self._data.qpos[m.jnt_qposadr[joint]:]
        low, high = m.jnt_range[joint]
        if side == "angle":
            axis = np.zeros(3)
            mj.mju_quat2Vel(axis, q[:4], 1.0)
            angle = float(np.linalg.norm(axis))
            gap = max(low, high) - angle
            row[at:at + 3] = -axis / angle if angle > 0 else 0.0
        else:
            gap = q[0] - low if side == "lower" else high - q[0]
            row[at] = 1.0 if side == "lower" else -1.0
        return Contact(float(gap - m.jnt_margin[joint]), row, np.zeros((0, m.nv)), 0.0, False)

    def _candidate(self, pair: ContactPair, margin: float, _: float, dimension: int) -> Candidate:
        m, d = self._model, self._data
        found = geometry.witness(self._placed(pair.first), self._placed(pair.second), pair.feature,
                                 lambda: self._nearest(pair.first, pair.second))
        jacobian, of_first = np.zeros((3, m.nv)), np.zeros((3, m.nv))
        mj.mj_jac(m, d, jacobian, None, found.second, m.geom_bodyid[pair.second])
        mj.mj_jac(m, d, of_first, None, found.first, m.geom_bodyid[pair.first])
        return Candidate(found.gap - margin, found.normal, jacobian - of_first, dimension > 1)

    def _placed(self, geom: int) -> Placed:
        return Placed(self._shapes[geom], self._data.geom_xmat[geom].reshape(3, 3), self._data.geom_xpos[geom])

    def _nearest(self, first: int, second: int) -> Witness:
        m, d, points = self._model, self._data, np.zeros(6)
        if m.geom_type[first] > m.geom_type[second]:  # MuJoCo 3.3 exchanges the points of such a pair
            return self._nearest(second, first).reversed()
        far = 10 * float(m.stat.extent)
        gap = mj.mj_geomDistance(m, d, first, second, far, points)
        touching = self._touching(first, second) if gap < _NEAR else None
        if touching is not None:
            return touching
        if _TOUCHING < abs(gap) < far:
            return Witness(gap, (points[3:] - points[:3]) / gap, points[:3].copy(), points[3:].copy())
        offset = d.geom_xpos[second] - d.geom_xpos[first]
        return Witness(gap, offset / np.linalg.norm(offset), d.geom_xpos[first].copy(), d.geom_xpos[second].copy())

    def _touching(self, first: int, second: int) -> Witness | None:
        """MuJoCo's deepest contact, if it has one: mj_geomDistance is imprecise there, and has no direction at 0."""
        m, d = self._model, self._data
        flags, margins = m.opt.disableflags, m.geom_margin.copy()
        m.opt.disableflags = flags & ~int(mj.mjtDisableBit.mjDSBL_CONSTRAINT)
        m.geom_margin[[first, second]] = _NEAR
        mj.mj_collision(m, d)
        m.opt.disableflags, m.geom_margin[:] = flags, margins
        contacts = [one for one in d.contact if {*one.geom} == {first, second}]
        if not contacts:
            return None
        one = min(contacts, key=lambda contact: float(contact.dist))
        normal = one.frame[:3] if one.geom[0] == first else -one.frame[:3]
        gap = float(one.dist)
        return Witness(gap, normal.copy(), one.pos - gap / 2 * normal, one.pos + gap / 2 * normal)

    def _possible(self) -> Iterator[ContactPair]:
        for first, second in itertools.combinations(range(self._model.ngeom), 2):
            if _may_collide(self._model, first, second):
                for feature in self._features(first, second):
                    yield ContactPair(first, second, feature)

    def _near(self) -> list[ContactPair]:
        """The possible pairs without those that are certainly farther than max_gap, unless all are."""
        possible = list(self._possible())
        return [pair for pair in possible if self._may_be_near(pair, self._settings.max_gap)] or possible

    def _may_be_near(self, pair: ContactPair, gap: float) -> bool:
        m, d, (i, j, _) = self._model, self._data, pair
        if "plane" in (self._shapes[i].kind, self._shapes[j].kind):
            return True
        reach = m.geom_rbound[i] + m.geom_rbound[j] + _parameters(m, i, j)[0] + gap
        return bool(np.linalg.norm(d.geom_xpos[i] - d.geom_xpos[j]) <= reach)

    def _features(self, first: int, second: int) -> tuple[str, ...]:
        return geometry.features(self._shapes[first], self._shapes[second]) if first != second else ()

    def _geom(self, given: Any, index: int) -> int:
        m = self._model
        found = mj.mj_name2id(m, mj.mjtObj.mjOBJ_GEOM, given) if isinstance(given, str) else given
        if isinstance(found, bool) or not isinstance(found, (int, np.integer)) or not 0 <= found < m.ngeom:
            raise InvalidArgument("pairs", f"must be names or ids of geoms, ids in [0, {m.ngeom})", index=index,
                                  value=repr(given))
        return int(found)

    def _name(self, geom: int) -> str:
        return self._model.geom(geom).name or f"geom{geom}"


def linearize(model: Any, data: Any, *, u: ArrayLike | None = None, **options: Any) -> Linearization:
    """The LCS of a MuJoCo model at data.qpos, data.qvel and the inputs u (nu,), data.ctrl without it.

    dt: h, seconds of a stage; model.opt.timestep without it. contact: "anitescu" (one pair per direction),
    "stewart_trinkle" (2 more per contact) or "soft" (one spring each). num_directions: directions of friction, even; 2
    for planar models. friction: coefficients instead of the geoms', one for all contacts or one each; only sliding
    friction is modelled. stiffness: N/m, > 0, of the springs of "soft"; None in the other models: contacts do not give
    way. With a stiffness, such as 3e5, their forces are unique, and plans with flat feet take less to solve.

    pairs: the contacts, as (geom, geom) or (geom, geom, feature), geoms by name or id. Without it all features of all
    geoms that MuJoCo may let collide and whose gap in data is at most max_gap, in m. joint_limits: True or "pairs"
    adds the limits of joints as pairs, after those of the contacts: two of a hinge or a slide, one of a ball. "bounds"
    adds no pairs, but `Linearization.joint_bounds`, of hinges and slides: a plan then keeps the limits by its inputs
    and contacts alone, and cannot lean on them. It costs less to solve.

    ignore: parts of the model to leave out: "equality", "frictionloss", "tendon_limits". Otherwise they are errors, as
    actuators with activations are.

    The gap is that of the geoms less their margin, at which MuJoCo lets them rest. `linearizer` returns an object for
    control loops, which keeps the contacts and is faster: this function copies the model.
    """
    return Linearizer(model, data, **options)(data, u)


def _check_supported(model: Any, ignore: Sequence[str]) -> None:
    if isinstance(ignore, str | bytes) or not isinstance(ignore, Sequence):
        raise InvalidArgument("ignore", f"must be a sequence of {', '.join(_IGNORABLE)}", value=type(ignore).__name__)
    for index, name in enumerate(ignore):
        if not isinstance(name, str) or name not in _IGNORABLE:
            raise InvalidArgument("ignore", f"must be of {', '.join(_IGNORABLE)}", index=index, value=repr(name))
    for field, bound in (("nu", "must be ≥ 1: an LCS has inputs"), ("nv", "must be ≥ 1: the model has no joints")):
        if getattr(model, field) == 0:
            raise InvalidArgument(f"model.{field}", bound, value=0)
    for field, name in (("na", "activations"), ("nflex", "flexible bodies"), ("nhistory", "delays")):
        if getattr(model, field, 0) > 0:
            raise InvalidArgument(f"model.{field}", f"must be 0: {name} are not supported", value=getattr(model, field))
    parts = {"equality": ("model.eq_active0", model.eq_active0 != 0),
             "frictionloss": ("model.dof_frictionloss", model.dof_frictionloss > 0),
             "tendon_limits": ("model.tendon_limited", model.tendon_limited != 0)}
    parts_too = {"frictionloss": ("model.tendon_frictionloss", model.tendon_frictionloss > 0)}
    for name, (field, present) in (*parts.items(), *parts_too.items()):
        if name not in ignore and np.any(present):
            raise InvalidArgument(field, f'is not supported; ignore=["{name}"] leaves it out',
                                  index=int(np.argmax(present)))


def _shape(model: Any, geom: int) -> Shape:
    kinds = mj.mjtGeom
    size = tuple(float(value) for value in model.geom_size[geom])
    return {kinds.mjGEOM_PLANE: Shape("plane"), kinds.mjGEOM_SPHERE: Shape("sphere", size[:1]),
            kinds.mjGEOM_CAPSULE: Shape("capsule", size[:2]), kinds.mjGEOM_CYLINDER: Shape("cylinder", size[:2]),
            kinds.mjGEOM_BOX: Shape("box", size), kinds.mjGEOM_ELLIPSOID: Shape("ellipsoid", size),
            }.get(mj.mjtGeom(model.geom_type[geom]), Shape("other"))


def _limited_joints(model: Any) -> list[tuple[int, str]]:
    made: list[tuple[int, str]] = []
    for joint in range(model.njnt):
        if model.jnt_limited[joint]:
            is_ball = mj.mjtJoint(model.jnt_type[joint]) == mj.mjtJoint.mjJNT_BALL
            made += [(joint, side) for side in (["angle"] if is_ball else ["lower", "upper"])]
    return made


def _may_collide(model: Any, first: int, second: int) -> bool:
    """MuJoCo's filter of pairs of geoms."""
    if _explicit(model, first, second) is not None:
        return True
    bodies = sorted((int(model.geom_bodyid[first]), int(model.geom_bodyid[second])))
    welds = [int(model.body_weldid[body]) for body in bodies]
    if welds[0] == welds[1] or (bodies[0] << 16) + bodies[1] in model.exclude_signature:
        return False
    parents = [int(model.body_weldid[model.body_parentid[weld]]) for weld in welds]
    of_parent = 0 not in welds and (welds[0] == parents[1] or welds[1] == parents[0])
    if of_parent and not model.opt.disableflags & int(mj.mjtDisableBit.mjDSBL_FILTERPARENT):
        return False
    types, affinities = model.geom_contype, model.geom_conaffinity
    return bool(types[first] & affinities[second] or types[second] & affinities[first])


def _explicit(model: Any, first: int, second: int) -> int | None:
    """The <pair> of the two geoms."""
    ours = ((model.pair_geom1 == first) & (model.pair_geom2 == second)
            | (model.pair_geom1 == second) & (model.pair_geom2 == first))
    return int(np.argmax(ours)) if ours.any() else None


def _parameters(model: Any, first: int, second: int) -> tuple[float, float, int]:
    """Margin in m, sliding friction and number of dimensions, as MuJoCo combines them."""
    adds, subtracts_gap = _margin_rule()
    explicit = _explicit(model, first, second)
    if explicit is not None:
        margin, gap = model.pair_margin[explicit], model.pair_gap[explicit]
        friction, dimension = model.pair_friction[explicit][0], model.pair_dim[explicit]
    else:
        ids = [first, second]
        of_geoms = (model.geom_margin[ids], model.geom_gap[ids])
        margin, gap = (values.sum() if adds else values.max() for values in of_geoms)
        top = model.geom_priority[ids] == model.geom_priority[ids].max()
        friction, dimension = model.geom_friction[ids, 0][top].max(), model.geom_condim[ids][top].max()
    return float(margin - gap if subtracts_gap else margin), float(friction), int(dimension)


@functools.cache
def _margin_rule() -> tuple[bool, bool]:
    """Whether this version of MuJoCo adds the margins of two geoms (or takes the larger), and subtracts gaps."""
    geom = '<body pos="{0} 0 0"><freejoint/><geom size=".1" margin="{1}" gap="{2}"/></body>'
    model = mj.MjModel.from_xml_string(
        f"<mujoco><worldbody>{geom.format(0, 0.3, 0.05)}{geom.format(0.15, 0.1, 0.02)}</worldbody></mujoco>")
    data = mj.MjData(model)
    mj.mj_forward(model, data)
    margin = float(data.contact[0].includemargin)
    rules = {(False, False): 0.3, (False, True): 0.25, (True, False): 0.4, (True, True): 0.33}
    return min(rules, key=lambda rule: abs(rules[rule] - margin))


def _difference(model: Any, q_from: Array, q: Array) -> Array:
    made = np.zeros(model.nv)
    mj.mj_differentiatePos(model, made, 1.0, q_from, q)
    return made


def _integrate(model: Any, q: Array, tangent: Array) -> Array:
    made = np.array(q)
    mj.mj_integratePos(model, made, tangent, 1.0)
    return made
