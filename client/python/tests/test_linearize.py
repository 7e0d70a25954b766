"""What the linearizers of all robot libraries share: shapes, rotations, and time steps of contacts."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import marble
import marble.lcs
from marble.lcs import geometry, rotation
from marble.lcs.geometry import Placed, Shape
from marble.lcs.time_stepping import Contact, SmoothDynamics, matrices, multipliers, tangent_directions

SHAPES = {"plane": Shape("plane"), "sphere": Shape("sphere", (0.3,)), "capsule": Shape("capsule", (0.2, 0.5)),
          "box": Shape("box", (0.3, 0.4, 0.5)), "cylinder": Shape("cylinder", (0.3, 0.4)),
          "ellipsoid": Shape("ellipsoid", (0.3, 0.4, 0.5))}


def surface(shape, count=25):
    """Points of the surface in the shape's own frame."""
    angles = np.linspace(0, 2 * np.pi, 4 * count)
    heights = np.linspace(-1, 1, 2 * count + 1)
    z, a = (grid.ravel() for grid in np.meshgrid(heights, angles))
    ball = np.stack([np.sqrt(1 - z**2) * np.cos(a), np.sqrt(1 - z**2) * np.sin(a), z], axis=1)
    kind, size = shape
    if kind == "box":
        return np.array(size) * ball / np.abs(ball).max(axis=1)[:, None]
    if kind == "capsule":
        along = np.concatenate([size[0] * ball + [0, 0, end * size[1]] for end in heights])
        return along
    if kind == "cylinder":
        disc = np.stack([np.cos(a), np.sin(a), z], axis=1) * [size[0], size[0], size[1]]
        return disc
    return np.array(size if kind == "ellipsoid" else 3 * size) * ball


def unexpected():
    raise AssertionError("there is a formula for these shapes")


@pytest.mark.parametrize("first", SHAPES)
@pytest.mark.parametrize("second", SHAPES)
def test_distances_are_the_same_in_both_orders(first, second):
    random = np.random.default_rng(0)
    for _ in range(5):
        one, other = (Placed(SHAPES[kind], Rotation.random(random_state=random).as_matrix(), random.normal(size=3))
                      for kind in (first, second))
        names = geometry.features(one.shape, other.shape)
        swapped = geometry.features(other.shape, one.shape)
        assert len(names) == len(swapped)
        for name, back in zip(names, swapped, strict=True):
            if first == second and "." in name:
                which, _, corner = name.partition(".")
                back = f"{'first' if which == 'second' else 'second'}.{corner}"
            asked = []

            def nearest(asked=asked):
                asked.append(True)
                return geometry.Witness(0.0, np.array([0, 0, 1.0]), np.zeros(3), np.ones(3))

            a = geometry.witness(one, other, name, nearest)
            b = geometry.witness(other, one, back, lambda nearest=nearest: nearest().reversed())
            assert a.gap == pytest.approx(b.gap, abs=1e-12)
            assert len(asked) in (0, 2)
            if not (first == second == "capsule"):  # of those the nearest points may be others
                np.testing.assert_allclose(a.normal, -b.normal, atol=1e-9)
                np.testing.assert_allclose(a.first, b.second, atol=1e-9)
            if not asked:
                assert np.linalg.norm(a.normal) == pytest.approx(1)
                np.testing.assert_allclose(a.second - a.first, a.gap * a.normal, atol=1e-9)


@pytest.mark.parametrize(("first", "second"), [("plane", "sphere"), ("plane", "capsule"), ("plane", "box"),
                                               ("plane", "cylinder"), ("plane", "ellipsoid"), ("sphere", "sphere"),
                                               ("sphere", "capsule"), ("sphere", "box")])
def test_the_least_distance_is_that_of_the_surfaces(first, second):
    random = np.random.default_rng(1)
    for _ in range(10):
        turn, offset = Rotation.random(random_state=random).as_matrix(), random.normal(size=3)
        one = Placed(SHAPES[first], np.eye(3), np.zeros(3))
        other = Placed(SHAPES[second], turn, offset + np.array([0, 0, 2.0]))
        gap = min(geometry.witness(one, other, name, unexpected).gap for name in geometry.features(*(one[0], other[0])))
        points = surface(other.shape) @ turn.T + other.position
        if first == "plane":
            sampled = points[:, 2].min()
        else:
            sampled = np.linalg.norm(points, axis=1).min() - 0.3
        assert gap <= sampled + 1e-9
        assert gap == pytest.approx(sampled, abs=0.04)


def test_segments_are_as_near_as_their_points():
    random = np.random.default_rng(2)
    steps = np.linspace(-0.5, 0.5, 201)
    for k in range(40):
        turns = [Rotation.random(random_state=random).as_matrix() for _ in range(2)]
        if k % 4 == 0:
            turns[1] = turns[0]  # parallel
        a, b = (Placed(SHAPES["capsule"], turn, random.normal(size=3)) for turn in turns)
        found = geometry.witness(a, b, "nearest", unexpected)
        points = [placed.position + steps[:, None] * placed.rotation[:, 2] for placed in (a, b)]
        sampled = np.linalg.norm(points[0][:, None] - points[1][None], axis=2).min() - 0.4
        assert found.gap == pytest.approx(sampled, abs=2e-4)
        assert found.gap <= sampled + 1e-12


def test_inside_a_box_the_nearest_side_counts():
    box = Placed(SHAPES["box"], np.eye(3), np.zeros(3))
    ball = Placed(Shape("sphere", (0.1,)), np.eye(3), np.array([0.25, 0, 0]))
    found = geometry.witness(box, ball, "nearest", unexpected)
    assert found.gap == pytest.approx(-0.15)
    np.testing.assert_allclose(found.normal, [1, 0, 0])


def test_the_transport_of_rotations_is_a_derivative():
    for w in ([0.3, -0.2, 0.5], [1e-6, 0, 2e-6], [0, 0, 0], [2, -1, 1.0]):
        def moved(delta, w=w):
            return (Rotation.from_rotvec(delta) * Rotation.from_rotvec(w)).as_rotvec()

        columns = [(moved(1e-6 * unit) - moved(-1e-6 * unit)) / 2e-6 for unit in np.eye(3)]
        np.testing.assert_allclose(rotation.transport(np.array(w, dtype=float)), np.stack(columns, axis=1), atol=1e-8)


def test_directions_of_friction_are_tangents_in_opposite_pairs():
    for count, normal in itertools.product((4, 6, 8), ([0, 0, 1.0], [0.6, 0, 0.8], [1.0, 0, 0])):
        made = tangent_directions(np.array(normal), np.eye(3), count)
        np.testing.assert_allclose(np.linalg.norm(made, axis=1), 1)
        np.testing.assert_allclose(made @ normal, 0, atol=1e-12)
        np.testing.assert_allclose(made[:count // 2], -made[count // 2:])
        assert np.linalg.matrix_rank(made) == 2
    planar = np.array([[1.0, 0], [0, 0], [0, 1]])  # moves in x and z
    for angle in np.linspace(0, 2 * np.pi, 9):
        normal = np.array([np.sin(angle), 0, np.cos(angle)])
        made = tangent_directions(normal, planar, 2)
        np.testing.assert_allclose(made, [[normal[2], 0, -normal[0]], [-normal[2], 0, normal[0]]], atol=1e-9)


def sled(v, push, damping=0.0):
    """2 kg in x and z, falling."""
    mass = 2 * np.eye(2)
    force = np.array([push - damping * v[0], -2 * 9.81])
    h_damping = np.diag([damping, 0.0])
    return lambda h: SmoothDynamics(mass, h_damping, np.linalg.solve(mass + h * h_damping, force), np.zeros((2, 2)),
                                    -h_damping, np.array([[1.0], [0]]), np.array(v, dtype=float), np.array([push]),
                                    np.eye(2))


def solved(system, x, u):
    """x₊ by trying all choices of sides; of several solutions the one with the least forces."""
    q = system["E"] @ x + system["H"] @ u + system["c"]
    F, nl, best = system["F"], len(q), None
    for sides in itertools.product((False, True), repeat=nl):
        active = np.flatnonzero(sides)
        force = np.zeros(nl)
        if active.size:
            force[active] = np.linalg.lstsq(F[np.ix_(active, active)], -q[active], rcond=None)[0]
        slack = F @ force + q
        fits = min(force.min(initial=0), slack.min(initial=0)) >= -1e-9 and np.abs(force * slack).max(initial=0) < 1e-9
        if fits and (best is None or force.sum() < best.sum()):
            best = force
    assert best is not None
    return system["A"] @ x + system["B"] @ u + system["D"] @ best + system["d"]


@pytest.mark.parametrize(("v", "push"), [(0, 5), (0, 12), (1, 0), (0.001, 0), (-1, 20)])
def test_sleds_slide_as_coulomb_says(v, push):
    h, mu = 0.01, 0.5
    smooth = sled([v, 0], push)(h)
    touch = Contact(0.0, np.array([0, 1.0]), np.array([[1.0, 0], [-1, 0]]), mu, True)
    x0, u = np.array([0, 0, v, 0.0]), np.array([push])
    free = v + h * push / 2
    expected = np.sign(free) * max(abs(free) - mu * h * 9.81, 0)
    after = solved(matrices(smooth, [touch], h, "stewart_trinkle", np.inf), x0, u)
    np.testing.assert_allclose(after, [h * expected, 0, expected, 0], atol=1e-9)
    after = solved(matrices(smooth, [touch], h, "anitescu", np.inf), x0, u)
    assert after[3] == pytest.approx(mu * abs(after[2]), abs=1e-9)  # what slides rises
    assert after[2] == pytest.approx(expected / (1 + mu**2), abs=1e-9)


def test_gaps_close_and_penetration_is_kept():
    h, u = 0.01, np.zeros(1)
    smooth = sled([0, -1], 0)(h)
    for gap, speed in ((0.0, 0.0), (0.005, -0.5), (0.5, -1 - h * 9.81), (-0.02, 0.0)):
        touch = Contact(gap, np.array([0, 1.0]), np.zeros((0, 2)), 0.0, True)
        for contact in ("anitescu", "stewart_trinkle"):
            after = solved(matrices(smooth, [touch], h, contact, np.inf), np.array([0, 0, 0, -1.0]), u)
            assert after[3] == pytest.approx(speed)
    spring = Contact(-0.02, np.array([0, 1.0]), np.zeros((0, 2)), 0.0, True)
    after = solved(matrices(smooth, [spring], h, "soft", 3000.0), np.array([0, 0, 0, -1.0]), u)
    force = 2 * (after[3] + 1 + h * 9.81) / h
    assert force == pytest.approx(3000 * (0.02 - h * after[3]))  # of the spring at the step's end


def test_damping_is_implicit():
    h, u = 0.5, np.zeros(1)
    after = solved(matrices(sled([3, 0], 0, damping=400.0)(h), [], h, "anitescu", np.inf), np.array([0, 0, 3.0, 0]), u)
    assert after[2] == pytest.approx(3 / (1 + h * 400 / 2))


def test_multipliers_have_names_in_the_order_of_the_matrices():
    assert multipliers(4, "anitescu", True) == ("edge0", "edge1", "edge2", "edge3")
    assert multipliers(2, "stewart_trinkle", True) == ("slip", "normal", "friction0", "friction1")
    assert multipliers(0, "stewart_trinkle", False) == multipliers(0, "soft", True) == ("normal",)


def test_models_of_other_libraries_are_refused():
    with pytest.raises(marble.InvalidArgument, match=r"model is builtins\.dict: must be a mujoco\.MjModel"):
        marble.lcs.linearize({}, None)
    with pytest.raises(marble.InvalidArgument, match="model is builtins"):
        marble.lcs.linearizer(3, None)
