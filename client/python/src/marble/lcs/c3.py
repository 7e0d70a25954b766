"""Options files of C3 as tasks of Marble: horizon, costs, contact model, bounds and rate. Needs PyYAML.

    options = marble.lcs.c3_options("c3_controller_options.yaml")
    with marble.lcs.Controller(model, options.task(target=(q, v), pairs=pairs), state=data) as controller:
        ...

C3 is consensus complementarity control (A. Aydinoglu et al., IEEE Trans. Robotics 40, 2024). The fields are those of
the structs C3ControllerOptions, C3Options and LCSFactoryOptions of the library c3 (github.com/DAIRLab/c3), and of the
flat files of dairlib (github.com/DAIRLab/dairlib), where all are at the top.
"""

from __future__ import annotations

import dataclasses
import math
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from marble.base.checks import is_number, is_whole
from marble.errors import InvalidArgument
from marble.lcs.system import Array
from marble.lcs.task import Target, Task
from marble.model.optional import optional

MAX_FILE_BYTES: Final = 256 * 1024
MAX_DEPTH: Final = 8
MAX_STAGES_OF_C3: Final = 10_000
MAX_ENTRIES: Final = 1000
"""Of a vector."""
MAX_COST_ENTRIES: Final = 10_000_000
"""Of all stages' Q, where gamma is not 1."""

_SECTIONS: Final = ("c3_options", "lcs_factory_options")
_CONTACT_MODELS: Final = {"stewart_and_trinkle": "stewart_trinkle", "anitescu": "anitescu",
                          "frictionless_spring": "soft"}
_USED: Final = frozenset((
    "N", "dt", "gamma", "w_Q", "w_R", "q_vector", "r_vector", "publish_frequency", "u_horizontal_limits",
    "u_vertical_limits", "contact_model", "num_contacts", "spring_stiffness", "mu", "mu_per_contact",
    "num_friction_directions", "num_friction_directions_per_contact", "contact_pair_configs"))
_OF_PAIRS: Final = {"mu": "", "num_friction_directions": "", "body_A": "pairs", "body_B": "pairs",
                    "body_A_collision_geom_indices": "pairs", "body_B_collision_geom_indices": "pairs",
                    "planar_normal_direction": "planar", "num_active_contact_pairs": "pairs"}
_WHY: Final = {
    "solver": "Marble solves each step without penalties and projections",
    "pairs": "the contacts are those of task(pairs=...)",
    "planar": "with 2 directions, friction acts where a contact can move most",
    "change": "inputs cost (u - u_ref)'R(u - u_ref), not their difference from the last solve's; see Task.R_change",
    "predict": "plans start at the measured state",
    "unused": "C3 does not use it either"}
_IGNORED: Final = {
    **dict.fromkeys(("projection_type", "warm_start", "end_on_qp_step", "scale_lcs", "num_threads",
                     "num_outer_threads", "delta_option", "M", "qp_projection_alpha", "qp_projection_scaling",
                     "final_augmented_cost_contact_scaling", "final_augmented_cost_contact_indices", "admm_iter", "rho",
                     "rho_scale", "w_G", "w_U", *(f"{kind}_{part}" for kind in "gu" for part in (
                         "vector", "x", "gamma", "lambda", "lambda_n", "lambda_t", "u", "eta", "eta_slack", "eta_n",
                         "eta_t"))), "solver"),
    **dict.fromkeys(("planar_normal_direction", "planar_normal_direction_per_contact"), "planar"),
    "penalize_input_change": "change", "g_size": "unused", "u_size": "unused", "solve_dt": "unused",
    **dict.fromkeys(("use_predicted_x0", "solve_time_filter_alpha"), "predict")}
_UNSUPPORTED: Final = ("quaternion_weight", "quaternion_regularizer_fraction", "state_prediction_joints",
                       "use_robust_formulation", "workspace_limits", "workspace_margins")
"""Errors unless they are 0, false or empty."""
_NUMBER: Final = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")


@dataclasses.dataclass(frozen=True, eq=False)
class C3Options:
    """An options file of C3, in the terms of Task. nx, nu: entries of q_vector and r_vector.

    Q: (nx, nx), w_Q diag(q_vector), or (N, nx, nx) where gamma is not 1: gamma**k of it in stage k; P (nx, nx):
    gamma**N of it. R: the same of w_R and r_vector, (nu, nu) or (N, nu, nu). stages: N. dt: s.
    rate: publish_frequency, Hz; None where that is 0, as often as possible, or absent.
    u_lb, u_ub: (3,), of u_horizontal_limits, of the first two inputs, and u_vertical_limits; None without them.
    contacts: the options of marble.lcs.linearizer besides pairs. num_directions: twice num_friction_directions.
    ignored: the fields of the file that have no effect, and why.
    """

    stages: int
    dt: float
    rate: float | None
    Q: Array
    R: Array
    P: Array
    u_lb: Array | None
    u_ub: Array | None
    contacts: Mapping[str, Any]
    ignored: Mapping[str, str]

    def task(self, target: Target, *, pairs: Sequence[Sequence[Any]] | None = None, quaternions: Sequence[int] = (),
             rate: float | None = None, **changes: Any) -> Task:
        """A Task with these options.

        target: as of Task. pairs: the contacts, in the file's order, as of marble.lcs.linearizer; the file names
        bodies of Drake's model at best. It must be given where the file has friction coefficients that differ.
        quaternions: index of the first entry of each quaternion in q_vector: its four weights, which must be equal to
        w, become three of w/4, as a rotation by a small angle θ changes a unit quaternion by θ/2. rate: Hz; None: the
        file's. changes: other arguments of Task, instead of the file's. Raises InvalidArgument.
        """
        rate = self.rate if rate is None else rate
        if rate is None:
            raise InvalidArgument("rate", "is required: publish_frequency is 0 or absent")
        contacts = dict(self.contacts)
        if pairs is not None:
            contacts["pairs"] = pairs
        elif np.ndim(self.contacts.get("friction", 0.0)) > 0:
            raise InvalidArgument("pairs", "is required: friction of the file is one for each contact")
        made: dict[str, Any] = {
            "rate": rate, "stages": self.stages, "dt": self.dt, "Q": _of_rotations(self.Q, quaternions), "R": self.R,
            "P": _of_rotations(self.P, quaternions), "u_lb": self.u_lb, "u_ub": self.u_ub, "target": target,
            "contacts": contacts}
        return Task(**{**made, **changes})


def c3_options(path: str | os.PathLike[str], *, ignore: Iterable[str] = ()) -> C3Options:
    """Reads an options file of C3: YAML, of C3's controller with its sections, or flat as in dairlib.

    Required are N, dt, contact_model, w_Q, w_R, q_vector and r_vector, and, as the contact model has it, mu and
    num_friction_directions, for all contacts, per contact or in contact_pair_configs, or spring_stiffness. Options of
    ADMM have no effect; `ignored` lists them, also penalize_input_change.

    What would change a plan and is not supported is an error unless it is 0, false or empty: quaternion_weight,
    quaternion_regularizer_fraction, state_prediction_joints, use_robust_formulation, workspace_limits and
    workspace_margins. So are fields that are not known. ignore: the names of such fields to leave out.

    The file has at most 256 KiB, 8 levels, vectors of at most 1000 numbers and no aliases and tags. Raises
    InvalidArgument with the field and index; OSError if the file cannot be read; Unavailable without PyYAML.
    """
    left_out = _names(ignore)
    fields = _flat(_loaded(path))
    ignored: dict[str, str] = {}
    for name, (field, value) in fields.items():
        if name in left_out:
            ignored[field] = "the caller asked for it"
        elif name in _IGNORED:
            if not (name == "penalize_input_change" and value is False):
                ignored[field] = _WHY[_IGNORED[name]]
        elif name in _UNSUPPORTED:
            if value not in (None, False, 0, 0.0, "", []):
                raise InvalidArgument(field, f'is not supported; ignore=["{name}"] leaves it out')
            ignored[field] = "it is 0, false or empty"
        elif name not in _USED:
            raise InvalidArgument(field, f'is not a field of C3\'s options; ignore=["{name}"] leaves it out')
    if "penalize_input_change" not in fields:  # C3's default is true
        ignored["penalize_input_change"] = _WHY["change"]
    given = _Fields({name: entry for name, entry in fields.items() if name not in left_out})
    stages = given.whole("N", 1, MAX_STAGES_OF_C3)
    gamma = given.number("gamma", 1.0, least=0.0)
    with np.errstate(over="ignore"):  # refused below
        q, r = (given.number(f"w_{kind}", least=0.0) * given.vector(f"{kind.lower()}_vector", least=0.0)
                for kind in "QR")
    if gamma != 1.0 and stages * max(q.size, r.size) ** 2 > MAX_COST_ENTRIES:
        raise InvalidArgument(given.field("gamma"), f"must be 1 where N and q_vector make more than "
                              f"{MAX_COST_ENTRIES} entries of Q", value=gamma)
    frequency = given.number("publish_frequency", 0.0, least=0.0)
    u_lb, u_ub = given.input_limits(r.size)
    contacts = given.contacts(ignored)
    Q, R = np.diag(q), np.diag(r)
    with np.errstate(over="ignore", invalid="ignore"):
        factors = gamma ** np.arange(stages + 1.0)
        costs = np.concatenate([q, r]) * factors.max()
    if not np.isfinite(costs).all():
        raise InvalidArgument(given.field("gamma"), "must keep the costs of all stages finite", value=gamma)
    Q_all, R_all = (W if gamma == 1.0 else factors[:-1, None, None] * W for W in (Q, R))
    return C3Options(stages, given.number("dt", above=0.0), frequency or None, Q_all, R_all, factors[-1] * Q, u_lb,
                     u_ub, contacts, ignored)


class _Fields:
    """The fields of a file by name, each with its path in the file and its value."""

    def __init__(self, fields: Mapping[str, tuple[str, Any]]) -> None:
        self._fields = fields

    def field(self, name: str) -> str:
        return self._fields[name][0] if name in self._fields else name

    def value(self, name: str) -> Any:
        """None, C++'s std::nullopt, if it is absent."""
        return self._fields[name][1] if name in self._fields else None

    def required(self, name: str) -> Any:
        value = self.value(name)
        if value is None:
            raise InvalidArgument(self.field(name), "is missing in the file")
        return value

    def number(self, name: str, default: float | None = None, **bounds: float) -> float:
        value = self.value(name) if default is not None else self.required(name)
        if value is None and default is not None:
            return default
        return _number(value, self.field(name), **bounds)

    def whole(self, name: str, least: int, most: int) -> int:
        return _whole(self.required(name), self.field(name), least, most)

    def vector(self, name: str, **bounds: float) -> Array:
        made = np.array(_each(self.required(name), self.field(name), lambda value, field, index: _number(
            value, field, index, **bounds)))
        if made.size == 0:
            raise InvalidArgument(self.field(name), "must have at least 1 entry")
        return made

    def input_limits(self, nu: int) -> tuple[Array | None, Array | None]:
        """Of x and y, and of z: the inputs are a force in space."""
        names = [name for name in ("u_horizontal_limits", "u_vertical_limits") if self.value(name) is not None]
        made = np.array([[-np.inf] * 3, [np.inf] * 3])
        for name in names:
            limits = self.vector(name)
            if limits.size != 2 or limits[0] > limits[1]:
                raise InvalidArgument(self.field(name), "must be [lower, upper] with lower <= upper",
                                      value=limits[:2].tolist())
            if nu != 3:
                raise InvalidArgument(self.field(name), "must be absent unless r_vector has 3 entries, the force in x, "
                                      "y and z", value=f"with {nu} entries")
            made[:, slice(0, 2) if name == "u_horizontal_limits" else slice(2, 3)] = limits[:, None]
        return (made[0], made[1]) if names else (None, None)

    def contacts(self, ignored: dict[str, str]) -> dict[str, Any]:
        """Options of the linearizer."""
        name = self.required("contact_model")
        if not isinstance(name, str) or name not in _CONTACT_MODELS:
            raise InvalidArgument(self.field("contact_model"), f"must be one of {', '.join(_CONTACT_MODELS)}",
                                  value=_short(name))
        count = None if self.value("num_contacts") is None else self.whole("num_contacts", 0, MAX_ENTRIES)
        configs = self._pair_configs(ignored)
        made: dict[str, Any] = {"contact": _CONTACT_MODELS[name]}
        if made["contact"] == "soft":
            made["stiffness"] = self.number("spring_stiffness", above=0.0)
            return made
        if self.value("spring_stiffness") is not None:
            ignored[self.field("spring_stiffness")] = f"{name} has no springs"
        friction, field = self._per_contact("mu", configs, count, lambda value, of, index: _number(
            value, of, index, least=0.0))
        half, where = self._per_contact("num_friction_directions", configs, count, lambda value, of, index: _whole(
            value, of, 0, 500, index))
        different = sorted({int(value) for value in half if value > 0})
        if len(different) > 1:
            raise InvalidArgument(where, "must be the same for all contacts with friction", value=_short(different))
        if len(friction) > 1 and len(half) > 1 and len(friction) != len(half):
            raise InvalidArgument(field, f"must have {len(half)} entries, as {where} has", value=len(friction))
        size = max(len(friction), len(half))
        friction = np.where(np.resize(half, size) > 0, np.resize(friction, size), 0.0)
        same = bool((friction == friction[0]).all()) if size else True
        if not same and count not in (None, size):
            raise InvalidArgument(field, f"must have {count} entries, as num_contacts, where they differ",
                                  value=f"{size} entries")
        made["friction"] = (float(friction[0]) if size else 0.0) if same else friction
        made["num_directions"] = 2 * different[0] if different else 2
        return made

    def _per_contact(self, name: str, configs: list[Mapping[str, Any]], count: int | None,
                     read: Callable[[Any, str, int | None], float]) -> tuple[Array, str]:
        """Of all contacts, with one entry if it is one for all; and the field where it is."""
        each = f"{name}_per_contact" if self.value(f"{name}_per_contact") is not None else name
        if configs and not isinstance(self.value(each), list) and each == name:
            field = f"{self.field('contact_pair_configs')}.{name}"
            values = [_required(config, name, f"{self.field('contact_pair_configs')}[{index}]")
                      for index, config in enumerate(configs)]
            return np.array([read(value, field, index) for index, value in enumerate(values)], dtype=float), field
        value, field = self.required(each), self.field(each)
        if each == name and not isinstance(value, list):
            return np.array([read(value, field, None)], dtype=float), field
        made = np.array(_each(value, field, read), dtype=float)
        if count is not None and made.size != count:
            raise InvalidArgument(field, f"must have {count} entries, as num_contacts", value=f"{made.size} entries")
        return made, field

    def _pair_configs(self, ignored: dict[str, str]) -> list[Mapping[str, Any]]:
        value, field = self.value("contact_pair_configs"), self.field("contact_pair_configs")
        if value is None:
            return []
        if not isinstance(value, list) or len(value) > MAX_ENTRIES:
            raise InvalidArgument(field, f"must be a sequence of at most {MAX_ENTRIES}", value=_short(value))
        for index, config in enumerate(value):
            if not isinstance(config, Mapping):
                raise InvalidArgument(field, "must be a mapping", index=index, value=_short(config))
            for name in config:
                if name not in _OF_PAIRS:
                    raise InvalidArgument(f"{field}[{index}]", "must have fields of ContactPairConfig alone",
                                          value=_short(name))
                if _OF_PAIRS[name]:
                    ignored[f"{field}.{name}"] = _WHY[_OF_PAIRS[name]]
        return value


def _required(config: Mapping[str, Any], name: str, field: str) -> Any:
    if config.get(name) is None:
        raise InvalidArgument(f"{field}.{name}", "is missing in the file")
    return config[name]


def _names(ignore: Any) -> frozenset[str]:
    if isinstance(ignore, str) or not isinstance(ignore, Iterable):
        raise InvalidArgument("ignore", "must be a sequence of names", value=_short(ignore))
    names = list(ignore)
    for index, name in enumerate(names):
        if not isinstance(name, str) or name in _USED or name in _SECTIONS:
            raise InvalidArgument("ignore", "must be the name of a field that Marble does not use", index=index,
                                  value=_short(name))
    return frozenset(names)


def _flat(loaded: Any) -> dict[str, tuple[str, Any]]:
    """The fields of all sections by their names, each with its path and value."""
    made: dict[str, tuple[str, Any]] = {}
    for field, name, value in _entries(loaded, ""):
        if name in made:
            raise InvalidArgument(field, f"must not be there twice: {made[name][0]} is it too")
        made[name] = (field, value)
    return made


def _entries(mapping: Any, section: str) -> Iterator[tuple[str, str, Any]]:
    if not isinstance(mapping, Mapping):
        raise InvalidArgument(section or "path", "must be a mapping of fields", value=_short(mapping))
    for name, value in mapping.items():
        if not isinstance(name, str):
            raise InvalidArgument(section or "path", "must have texts as the names of fields", value=_short(name))
        if name in _SECTIONS and not section:
            yield from _entries(value, name)
        else:
            yield f"{section}.{name}" if section else name, name, value


def _loaded(path: str | os.PathLike[str]) -> Any:
    yaml = optional("yaml", "pyyaml", "c3_options")
    if not isinstance(path, str | os.PathLike):
        raise InvalidArgument("path", "must be a path", value=type(path).__name__)
    try:
        with open(path, "rb") as file:
            content = file.read(MAX_FILE_BYTES + 1)
    except ValueError as error:  # a null character
        raise InvalidArgument("path", f"must be a path: {error}") from None
    if len(content) > MAX_FILE_BYTES:
        raise InvalidArgument("path", f"must be a file of at most {MAX_FILE_BYTES} bytes")
    try:
        text = content.decode()
        _check_structure(yaml, text)
        loader = yaml.SafeLoader(text)
        node = loader.get_single_node()
        _check_keys(yaml, node)
        return None if node is None else loader.construct_document(node)
    except (yaml.YAMLError, ArithmeticError, LookupError, AttributeError, UnicodeError) as error:
        raise InvalidArgument("path", f"must be a YAML file: {' '.join(str(error).split())[:200]}") from None
    except InvalidArgument:
        raise
    except ValueError as error:  # such as the 99th of a month
        raise InvalidArgument("path", f"must have numbers and texts only: {str(error)[:200]}") from None


def _check_structure(yaml: Any, text: str) -> None:
    """Before anything is made of it: aliases could make a small file a large structure."""
    depth = 0
    for event in yaml.parse(text, Loader=yaml.SafeLoader):
        line = event.start_mark.line + 1
        if isinstance(event, yaml.AliasEvent):
            raise InvalidArgument("path", "must be a YAML file without aliases", value=f"with one in line {line}")
        if getattr(event, "tag", None) is not None:
            raise InvalidArgument("path", "must be a YAML file without tags", value=f"with one in line {line}")
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > MAX_DEPTH:
            raise InvalidArgument("path", f"must be a YAML file of at most {MAX_DEPTH} levels",
                                  value=f"with more in line {line}")


def _check_keys(yaml: Any, node: Any) -> None:
    """No name twice in a mapping: the last one would win."""
    if isinstance(node, yaml.MappingNode):
        seen: set[str] = set()
        for key, value in node.value:
            name = key.value if isinstance(key, yaml.ScalarNode) else None
            if name is None or name in seen or name == "<<":
                raise InvalidArgument("path", "must have each field once, by a text, but has another one in line "
                                      f"{key.start_mark.line + 1}", value=_short(name))
            seen.add(name)
            _check_keys(yaml, value)
    elif isinstance(node, yaml.SequenceNode):
        for value in node.value:
            _check_keys(yaml, value)


def _each(values: Any, field: str, read: Callable[[Any, str, int | None], float]) -> list[float]:
    if not isinstance(values, list) or len(values) > MAX_ENTRIES:
        raise InvalidArgument(field, f"must be a sequence of at most {MAX_ENTRIES} numbers", value=_short(values))
    return [read(value, field, index) for index, value in enumerate(values)]


def _number(value: Any, field: str, index: int | None = None, /, *, least: float = -math.inf,
            above: float = -math.inf) -> float:
    """A finite number. PyYAML reads 1e-3 as a text, Drake as a number."""
    if isinstance(value, str) and len(value) < 100 and _NUMBER.fullmatch(value):
        value = float(value)
    number = float(value) if is_number(value) else math.nan
    if not (math.isfinite(number) and number >= least and number > above):
        bound = f" and > {above:g}" if above > -math.inf else f" and >= {least:g}" if least > -math.inf else ""
        raise InvalidArgument(field, f"must be a finite number{bound}", index=index, value=_short(value))
    return number


def _whole(value: Any, field: str, least: int, most: int, index: int | None = None) -> int:
    if not is_whole(value, least, most):
        raise InvalidArgument(field, f"must be a whole number in [{least}, {most}]", index=index, value=_short(value))
    return int(value)


def _short(value: Any) -> str:
    """Of what a file has, which may be of any size."""
    if isinstance(value, list | dict):
        return f"a {'sequence' if isinstance(value, list) else 'mapping'} of {len(value)}"
    if isinstance(value, int) and value.bit_length() > 200:
        return "a number of many digits"
    return repr(value)[:60]


def _of_rotations(W: Array, quaternions: Any) -> Array:
    """Weights of configurations as those of their tangents."""
    if isinstance(quaternions, str) or not isinstance(quaternions, Sequence):
        raise InvalidArgument("quaternions", "must be a sequence of indices", value=_short(quaternions))
    keep, scale, last = np.ones(W.shape[-1], dtype=bool), np.ones(W.shape[-1]), -4
    for index, at in enumerate(quaternions):
        if not is_whole(at, last + 4, keep.size - 4):
            raise InvalidArgument("quaternions", f"must be in [{last + 4}, {keep.size - 4}], in ascending order",
                                  index=index, value=_short(at))
        weights = np.diagonal(W, axis1=-2, axis2=-1)[..., at:at + 4]
        if (weights != weights[..., :1]).any():
            raise InvalidArgument("q_vector", "must have four equal weights of a quaternion", index=int(at))
        keep[at], scale[at:at + 4], last = False, 0.25, int(at)
    made: Array = (W * scale)[..., keep, :][..., keep]
    return made
