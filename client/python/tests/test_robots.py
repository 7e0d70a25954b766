"""Robots whose formulas bend: planned from an LCQP's answer, and judged by physics that is written here anew."""

from __future__ import annotations

import functools
import importlib.util
import sys

import numpy as np
import pytest
import scipy.sparse as sp

import marble
from marble import flights, robots
from marble.__main__ import main

pytest.importorskip("marble._core")
needs_casadi = pytest.mark.skipif(importlib.util.find_spec("casadi") is None,
                                  reason="casadi is not installed (it is not in Debian)")

# LCQPs after the first one, and the objective, as measured; the work may change a little with the solver.
KNOWN = {"rocket": (10, 432.8273), "quadrotor": (10, 217.2355), "hopper": (20, 76.30069), "pusher": (50, 3.077946)}


@functools.lru_cache
def planned(name):
    return robots.solve(robots.ROBOTS[name]().robot(), server="local")


@needs_casadi
@pytest.mark.parametrize("name", robots.ROBOTS)
def test_a_plan_from_the_lcqps_answer_is_b_stationary_and_as_good_as_known(name):
    plan, (most_lcqps, objective) = planned(name), KNOWN[name]
    assert plan.start.solved
    assert plan.answer.status is marble.Status.SOLVED and plan.answer.b_stationary, plan.answer.detail
    assert plan.answer.objective == pytest.approx(objective, rel=1e-6)
    assert plan.answer.ticks <= most_lcqps
    assert plan.robot.violation(plan.answer.x) <= 1e-6
    assert plan.robot.violation(plan.start.z) > 1e-3  # of the LCQP's own answer: the formulas do bend


@needs_casadi
def test_what_is_linearised_agrees_with_the_formulas_at_the_guess():
    robot = robots.Pusher(steps=6).robot()
    lcqp, at = robot.linearised(), robot.guess
    casadi = pytest.importorskip("casadi")
    parts = [robot.problem[name] for name in ("f", "g", "G", "H")]
    f, g, G, H = (np.asarray(part).ravel() for part in casadi.Function("at", [robot.problem["x"]], parts)(at))
    Q = lcqp.Q + sp.triu(lcqp.Q, 1).T
    assert 0.5 * at @ (Q @ at) + lcqp.g @ at + lcqp.c0 == pytest.approx(f[0])
    assert np.allclose(lcqp.A @ at + lcqp.b, g)
    assert np.allclose(lcqp.L @ at + lcqp.l, G) and np.allclose(lcqp.R @ at + lcqp.r, H)


@needs_casadi
def test_the_rocket_obeys_newton_and_keeps_off_the_tower():
    p, tables = robots.Rocket(), planned("rocket").tables
    x, y, angle, vx, vy, rate, gimbal = tables["state"].T
    thrust = tables["inputs"][:, 0]
    lean = np.array([angle[:-1] + gimbal[:-1], angle[1:] + gimbal[1:]])
    assert np.allclose(np.diff(vx), -p.step_s * thrust / p.mass * np.sin(lean).mean(axis=0), atol=1e-6)
    assert np.allclose(np.diff(vy), p.step_s * (thrust / p.mass * np.cos(lean).mean(axis=0) - p.gravity), atol=1e-6)
    assert np.allclose(np.diff(x), p.step_s * (vx[:-1] + vx[1:]) / 2, atol=1e-6)
    assert np.allclose(np.diff(angle), p.step_s * (rate[:-1] + rate[1:]) / 2, atol=1e-6)
    low = y < p.trigger_altitude - 1e-6
    assert 5 < low.sum() < p.steps
    for end in (-1, 1):
        assert np.all((x + end * p.half_length * np.sin(angle))[low] >= -1e-6)
    assert np.any((x - p.half_length * np.sin(np.abs(angle)) < 0) | (np.sin(angle + gimbal) < 0))  # above: it need not
    assert np.allclose([x[-1], y[-1], vx[-1], vy[-1]], [*p.catch, 0, 0], atol=1e-6)


@needs_casadi
def test_the_quadrotor_passes_the_gates_in_their_order():
    p, tables = robots.Quadrotor(), planned("quadrotor").tables
    assert p.gates == flights.GATES
    state, thrust = tables["state"], p.gravity + tables["inputs"][:, 0]
    rise = np.array([thrust * np.cos(side[:, 6]) * np.cos(side[:, 7]) for side in (state[:-1], state[1:])])
    assert np.allclose(np.diff(state[:, 5]), p.step_s * (rise.mean(axis=0) - p.gravity), atol=1e-6)
    when = []
    for gate, (centre, yaw) in enumerate(p.gates):
        away = state[:, :3] - centre
        across = np.stack([np.cos(yaw) * away[:, 0] + np.sin(yaw) * away[:, 1],
                           np.cos(yaw) * away[:, 1] - np.sin(yaw) * away[:, 0], away[:, 2]], axis=1)
        inside = np.all(np.abs(across) <= np.array(p.half_extent) + 1e-5, axis=1)
        gained = np.diff(tables["progress"][:, gate], prepend=0.0) > 1e-5
        assert gained.any() and np.all(inside[gained])
        when.append(np.flatnonzero(inside)[0])
    assert when == sorted(when)
    assert np.abs(state[:, 6:8]).max() > 0.3  # where a sine is not its tangent


@needs_casadi
def test_the_hoppers_contact_is_physical_in_stance_flight_and_slip():
    p, tables = robots.Hopper(), planned("hopper").tables
    place, speed, leg = tables["place"], tables["speed"], tables["leg"]
    normal, along, against = tables["contact"].T
    friction, height, slip = along - against, place[1:, 3], speed[1:, 2]
    assert height.min() >= -1e-6 and normal.min() >= -1e-6
    assert np.abs(np.minimum(height, normal)).max() <= 1e-6
    assert np.all(np.abs(friction) <= p.friction * normal + 1e-6)
    slipping = np.abs(slip) > 1e-4
    assert np.allclose(friction[slipping], -np.sign(slip[slipping]) * p.friction * normal[slipping], atol=1e-5)
    flight, sticking = height > 1e-3, ~slipping & (normal > 1e-3)
    assert flight.sum() >= 2 and sticking.sum() >= 5 and (slipping & (normal > 1e-3)).sum() >= 2
    assert np.allclose(place[:, :2] - place[:, 2:], leg[:, 1:] * np.c_[np.sin(leg[:, 0]), np.cos(leg[:, 0])], atol=1e-6)
    momentum = np.diff(speed[:, [0, 2]] @ p.masses), np.diff(speed[:, [1, 3]] @ p.masses)
    assert np.allclose(momentum[0], p.step_s * friction, atol=1e-6)
    assert np.allclose(momentum[1], p.step_s * (normal - p.gravity * sum(p.masses)), atol=1e-6)
    assert np.ptp(leg[:, 0]) > 0.5  # the leg turns by more than a tangent holds for


@needs_casadi
def test_the_pusher_sticks_and_slides_and_the_box_goes_where_friction_lets_it():
    p, tables = robots.Pusher(), planned("pusher").tables
    state, (ahead, across) = tables["state"], tables["force"].T
    slide = np.diff(state[:, 3]) / p.step_s
    assert ahead.min() >= -1e-6 and np.all(np.abs(across) <= p.friction * ahead + 1e-6)
    up, down = slide > 1e-3, slide < -1e-3
    assert up.sum() >= 2 and down.sum() >= 1 and (~up & ~down).sum() >= 10
    assert np.allclose(across[up], p.friction * ahead[up], atol=1e-5)
    assert np.allclose(across[down], -p.friction * ahead[down], atol=1e-5)
    middle, contact = (state[:-1, 2] + state[1:, 2]) / 2, (state[:-1, 3] + state[1:, 3]) / 2
    assert np.allclose(np.diff(state[:, 0]), p.step_s * (np.cos(middle) * ahead - np.sin(middle) * across), atol=1e-6)
    assert np.allclose(np.diff(state[:, 1]), p.step_s * (np.sin(middle) * ahead + np.cos(middle) * across), atol=1e-6)
    turn = -(p.half * across + contact * ahead) / p.reach**2
    assert np.allclose(np.diff(state[:, 2]), p.step_s * turn, atol=1e-6)
    assert np.allclose(state[-1, :3], p.goal, atol=1e-6)


@needs_casadi
def test_on_a_server_a_plan_has_the_same_bits(client):
    there = robots.solve(robots.Pusher().robot(), server=client)
    assert there.answer.x.tobytes() == planned("pusher").answer.x.tobytes()


@needs_casadi
def test_a_demo_draws_a_picture_and_a_moving_one(tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib")
    image = pytest.importorskip("PIL.Image")
    monkeypatch.chdir(tmp_path)
    assert main(["--server", "local", "demo", "nonlinear-pusher"]) == 0
    printed = capsys.readouterr().out
    assert "pusher: solved" in printed and "drawn in nonlinear-pusher.png and nonlinear-pusher.gif" in printed
    with image.open("nonlinear-pusher.gif") as movie:
        assert movie.n_frames == robots.Pusher().steps + 1
    assert (tmp_path / "nonlinear-pusher.png").stat().st_size > 10_000


def test_without_casadi_and_of_no_such_robot_the_demo_says_so(monkeypatch, capsys):
    assert main(["--server", "local", "demo", "nonlinear-submarine"]) == 2
    assert "nonlinear-quadrotor" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "casadi", None)
    assert main(["--server", "local", "demo", "nonlinear-hopper"]) == 3
    assert "pip install casadi" in capsys.readouterr().err
