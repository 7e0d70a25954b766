"""C3's options files as tasks: what they become, and files that are broken or hostile."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from marble.errors import InvalidArgument, Unavailable
from marble.lcs import Task, c3, c3_options

pytest.importorskip("yaml")

CONTROLLER = """
projection_type: "C3+"
solve_time_filter_alpha: 0.0
publish_frequency: 100
state_prediction_joints: []
quaternion_weight: 0.0
quaternion_regularizer_fraction: 0.0
lcs_factory_options:
  contact_model: "stewart_and_trinkle"
  num_contacts: 2
  N: 4
  dt: 0.02
  contact_pair_configs:
    - {body_A: cube, body_B: finger, mu: 0.5, num_friction_directions: 1, planar_normal_direction: [0, 1, 0]}
    - {body_A: cube, body_B: floor, mu: 0.25, num_friction_directions: 1, planar_normal_direction: [0, 1, 0]}
c3_options:
  warm_start: false
  penalize_input_change: false
  admm_iter: 5
  rho_scale: 1.1
  gamma: 0.5
  w_Q: 10
  w_R: 1e-3
  w_G: 0.02
  q_vector: [1, 2, 3, 4]
  r_vector: [1, 2]
  g_lambda: []
  u_x: [1000, 1000, 1000, 1000]
"""
FLAT = """
admm_iter: 3
rho: 0
num_threads: 5
projection_type: 'MIQP'
contact_model: 'anitescu'
mu: [0.4, 0.4, 0.4]
num_friction_directions: 2
num_contacts: 3
dt: 0.1
solve_dt: 0.1
N: 5
w_Q: 50
w_R: 25
q_vector: [1, 1, 1, 8, 8, 8, 8, 2, 2, 2, 1, 1, 1]
r_vector: [1, 1, 1]
u_horizontal_limits: [-10, 12]
u_vertical_limits: [-3, 4]
publish_frequency: 0
"""


@pytest.fixture
def read(tmp_path):
    def of(text: str | bytes, **options):
        path = tmp_path / "options.yaml"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return c3_options(path, **options)

    return of


def test_a_controllers_file_becomes_a_task(read):
    options = read(CONTROLLER)
    assert (options.stages, options.dt, options.rate) == (4, 0.02, 100.0)
    Q, R = 10 * np.diag([1.0, 2, 3, 4]), 1e-3 * np.diag([1.0, 2])
    np.testing.assert_allclose(options.Q, [0.5**k * Q for k in range(4)], rtol=1e-15)
    np.testing.assert_allclose(options.R, [0.5**k * R for k in range(4)], rtol=1e-15)
    np.testing.assert_allclose(options.P, 0.5**4 * Q, rtol=1e-15)
    assert options.u_lb is None and options.u_ub is None
    np.testing.assert_array_equal(options.contacts["friction"], [0.5, 0.25])
    assert {**options.contacts, "friction": 0} == {"contact": "stewart_trinkle", "num_directions": 2, "friction": 0}
    task = options.task(([0, 0], [0, 0]), pairs=[("cube", "finger"), ("cube", "floor")], shift=1)
    assert isinstance(task, Task) and (task.rate, task.dt, task.stages, task.shift) == (100, 0.02, 4, 1)
    assert task.contacts["pairs"] == [("cube", "finger"), ("cube", "floor")]
    with pytest.raises(InvalidArgument, match="pairs: is required: friction of the file is one for each contact"):
        options.task(([0, 0], [0, 0]))


def test_a_flat_file_has_bounds_and_quaternions(read):
    options = read(FLAT)
    np.testing.assert_array_equal([options.u_lb, options.u_ub], [[-10, -10, -3], [12, 12, 4]])
    assert options.contacts == {"contact": "anitescu", "num_directions": 4, "friction": 0.4}
    with pytest.raises(InvalidArgument, match="rate: is required: publish_frequency is 0 or absent"):
        options.task(([0], [0]))
    task = options.task(([0], [0]), rate=20, quaternions=[3], u_ub=5.0)
    np.testing.assert_array_equal(np.diag(task.Q), 50 * np.array([1, 1, 1, 2, 2, 2, 2, 2, 2, 1, 1, 1]))
    np.testing.assert_array_equal(task.P, task.Q)
    assert task.u_ub == 5.0 and task.rate == 20 and "pairs" not in task.contacts
    for bad in ([10], [-1], [3, 5], [True], "3", [2.0]):
        with pytest.raises(InvalidArgument, match="quaternions"):
            options.task(([0], [0]), rate=20, quaternions=bad)
    with pytest.raises(InvalidArgument, match=r"q_vector\[2\]: must have four equal weights"):
        options.task(([0], [0]), rate=20, quaternions=[2])


def test_a_small_rotation_costs_what_its_quaternion_does(read):
    task = read(FLAT).task(([0], [0]), rate=20, quaternions=[3])
    angle = 1e-4 * np.array([1.0, -2, 0.5])
    size = np.linalg.norm(angle)
    change = np.concatenate([[np.cos(size / 2) - 1], np.sin(size / 2) * angle / size])
    assert np.diag(task.Q)[3:6] @ angle**2 == pytest.approx(50 * 8 * change @ change, rel=1e-6)


def test_springs_have_a_stiffness_and_no_friction(read):
    options = read(FLAT.replace("'anitescu'", "frictionless_spring") + "spring_stiffness: 150\n")
    assert options.contacts == {"contact": "soft", "stiffness": 150.0}
    with pytest.raises(InvalidArgument, match="spring_stiffness is 0: must be a finite number and > 0"):
        read(FLAT.replace("'anitescu'", "frictionless_spring") + "spring_stiffness: 0\n")


def test_contacts_without_friction_directions_do_not_rub(read):
    text = FLAT.replace("num_friction_directions: 2", "num_friction_directions_per_contact: [2, 0, 2]")
    np.testing.assert_array_equal(read(text).contacts["friction"], [0.4, 0, 0.4])
    with pytest.raises(InvalidArgument, match="must be the same for all contacts with friction"):
        read(text.replace("[2, 0, 2]", "[2, 1, 2]"))


def test_what_has_no_effect_is_listed_with_a_reason(read):
    ignored = read(CONTROLLER).ignored
    assert {"projection_type", "solve_time_filter_alpha", "c3_options.admm_iter", "c3_options.u_x", "c3_options.w_G",
            "lcs_factory_options.contact_pair_configs.body_A", "quaternion_weight"} <= set(ignored)
    assert all(ignored.values())
    assert not {name.rpartition(".")[2] for name in ignored} & {"N", "dt", "q_vector", "mu", "penalize_input_change"}
    assert "R_change" in read(FLAT).ignored["penalize_input_change"]  # C3's default is true
    assert "R_change" in read(FLAT + "penalize_input_change: true\n").ignored["penalize_input_change"]


@pytest.mark.parametrize(("line", "field"), [
    ("quaternion_weight: 1000", "quaternion_weight"), ("workspace_limits: [[1, 0, 0, 0.4, 0.6]]", "workspace_limits"),
    ("state_prediction_joints: [{name: a, max_acceleration: 1}]", "state_prediction_joints"),
    ("use_robust_formulation: true", "use_robust_formulation"), ("sampling_radius: 1", "sampling_radius")])
def test_what_is_not_supported_is_an_error_unless_the_caller_leaves_it_out(read, line, field):
    with pytest.raises(InvalidArgument) as raised:
        read(f"{FLAT}{line}\n")
    assert raised.value.field == field and f'ignore=["{field}"]' in str(raised.value)
    assert read(f"{FLAT}{line}\n", ignore=[field]).ignored[field] == "the caller asked for it"


@pytest.mark.parametrize(("old", "new", "field", "words"), [
    ("N: 5", "", "N", "is missing"), ("N: 5", "N: 5.0", "N", "whole number in [1, 10000]"),
    ("N: 5", "N: 0", "N", "whole"), ("N: 5", "N: 1000000000", "N", "whole"), ("N: 5", "N: true", "N", "whole"),
    ("N: 5", f"N: {'9' * 4000}", "N", "many digits"),
    ("dt: 0.1", "dt: 0", "dt", "> 0"), ("dt: 0.1", "dt: .nan", "dt", "finite"), ("dt: 0.1", "dt: -.inf", "dt", "fin"),
    ("dt: 0.1", "dt: soon", "dt", "finite number"), ("dt: 0.1", "dt: null", "dt", "is missing"),
    ("dt: 0.1", f"dt: {'9' * 400}", "dt", "finite"),
    ("r_vector: [1, 1, 1]", "r_vector: [1, 1]", "u_horizontal_limits", "3 entries"),
    ("r_vector: [1, 1, 1]", "r_vector: []", "r_vector", "at least 1"),
    ("r_vector: [1, 1, 1]", "r_vector: [1, -1, 1]", "r_vector[1]", ">= 0"),
    ("r_vector: [1, 1, 1]", "r_vector: [1, [1], 1]", "r_vector[1]", "a sequence of 1"),
    ("r_vector: [1, 1, 1]", "r_vector: 7", "r_vector", "must be a sequence"),
    ("r_vector: [1, 1, 1]", f"r_vector: [{'1,' * 1001}]", "r_vector", "at most 1000"),
    ("w_Q: 50", "w_Q: -1", "w_Q", ">= 0"), ("w_Q: 50", "w_Q: yes", "w_Q", "finite number"),
    ("w_Q: 50", "w_Q: 1.0e+308", "gamma", "finite"), ("w_Q: 50", "w_Q: 50\ngamma: 1.0e+200", "gamma", "finite"),
    ("N: 5", "N: 10000\ngamma: 0.5\n", "", ""),
    ("'anitescu'", "'coulomb'", "contact_model", "stewart_and_trinkle, anitescu, frictionless_spring"),
    ("'anitescu'", "[anitescu]", "contact_model", "a sequence of 1"),
    ("mu: [0.4, 0.4, 0.4]", "mu: [0.4, 0.4]", "mu", "3 entries, as num_contacts"),
    ("mu: [0.4, 0.4, 0.4]", "mu: [0.4, .nan, 0.4]", "mu[1]", "finite"),
    ("mu: [0.4, 0.4, 0.4]", "", "mu", "is missing"),
    ("mu: [0.4, 0.4, 0.4]", "contact_pair_configs: [7]", "contact_pair_configs[0]", "must be a mapping"),
    ("mu: [0.4, 0.4, 0.4]", "contact_pair_configs: [{mu: 1, wheels: 3}]", "contact_pair_configs[0]", "wheels"),
    ("mu: [0.4, 0.4, 0.4]", "contact_pair_configs: [{num_friction_directions: 1}]", "contact_pair_configs[0].mu",
     "is missing"),
    ("num_contacts: 3", "num_contacts: -1", "num_contacts", "whole"),
    ("num_friction_directions: 2", "num_friction_directions: 501", "num_friction_directions", "[0, 500]"),
    ("[-10, 12]", "[12, -10]", "u_horizontal_limits", "lower <= upper"),
    ("[-10, 12]", "[-10]", "u_horizontal_limits", "lower <= upper"),
    ("publish_frequency: 0", "publish_frequency: -3", "publish_frequency", ">= 0"),
])
def test_a_bad_field_is_named(read, old, new, field, words):
    assert old in FLAT
    if not field:
        assert read(FLAT.replace(old, new)).Q.shape == (10000, 13, 13)
        return
    with pytest.raises(InvalidArgument) as raised:
        read(FLAT.replace(old, new))
    place = raised.value.field + ("" if raised.value.index is None else f"[{raised.value.index}]")
    assert place == field and words in str(raised.value) and len(str(raised.value)) < 500


MERGES = "".join(f"m{i}: &m{i} {{<<: [{', '.join([f'*m{i - 1}'] * 9)}]}}\n" for i in range(1, 30))


@pytest.mark.parametrize(("content", "words"), [
    ("", "must be a mapping"), ("[1, 2]", "must be a mapping"), ("just text", "must be a mapping"),
    ("3: 4", "texts as the names"), ("null", "must be a mapping"),
    ("c3_options: 7", "c3_options is 7: must be a mapping"),
    ("a: 1\na: 2", "each field once"), ("{<<: {a: 1}}", "each field once"), ("? [a]\n: 1", "each field once"),
    ("c3_options: {N: 1}\nN: 2", "must not be there twice"),
    ("a: [", "YAML file"), ("a: 'b", "YAML file"), ("\t- a", "YAML file"), ("a: 1\n---\nb: 2", "YAML file"),
    (b"\xff\xfe\x00", "YAML file"), (b"a: \x00", "YAML file"), (b"a: \xc3\x28", "YAML file"),
    ("a: 2001-99-99", "numbers and texts"), ("a: 0b_", "numbers and texts"), ("a: =", "YAML file"),
    ("a: &x 1\nb: *x", "without aliases.*|line 2"), (f"m0: &m0 {{k: 1}}\n{MERGES}", "without aliases"),
    ("a: !!python/object/apply:os.system ['true']", "without tags"), ("a: !!int ''", "without tags"),
    ("a: " + "[" * 9 + "]" * 9, "at most 8 levels"), ("a: " + "[" * 100_000, "at most 8 levels"),
    ("a: " + "{b: " * 50_000, "at most 8 levels"), ("- " * 50_000, "at most 8 levels"),
    ("a: " + "1" * 300_000, "at most 262144 bytes"),
])
def test_a_hostile_file_is_refused(read, content, words):
    with pytest.raises(InvalidArgument, match=words) as raised:
        read(content)
    assert len(str(raised.value)) < 500


def test_arguments_are_checked(read, tmp_path, monkeypatch):
    for bad in (7, None, b"bytes"):
        with pytest.raises(InvalidArgument, match="path"):
            c3_options(bad)
    with pytest.raises(InvalidArgument, match="path"):
        c3_options("a\0b")
    for error, path in ((FileNotFoundError, tmp_path / "none.yaml"), (IsADirectoryError, tmp_path)):
        with pytest.raises(error):
            c3_options(path)
    for bad in ("N", ["N"], ["q_vector"], [7], 7, ["c3_options"]):
        with pytest.raises(InvalidArgument, match="ignore"):
            read(FLAT, ignore=bad)
    monkeypatch.setattr(c3, "MAX_COST_ENTRIES", 100)
    with pytest.raises(InvalidArgument, match=r"gamma is 0\.5: must be 1 where"):
        read(FLAT + "gamma: 0.5\n")
    monkeypatch.setitem(sys.modules, "yaml", None)
    with pytest.raises(Unavailable, match="c3_options needs yaml: pip install pyyaml"):
        read(FLAT)
