"""Linearizations of MuJoCo models: one step of the LCS against one step of MuJoCo, and as the step gets shorter."""

import pathlib
import re
import subprocess
import sys
import unittest

import mujoco
import numpy as np
from lcp import step
from adapter_page import ROOT, example

import marble
import marble.lcs

G = 9.81


def box(timestep=1e-3, friction=0.5, contact="", extra=""):
    """A box of 1 kg on a floor, with a motor along x."""
    return mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="{timestep}" cone="elliptic"/>
      <default><geom friction="{friction}" solimp=".9999 .9999 .001" {contact}/></default>
      <worldbody><geom name="floor" type="plane" size="5 5 .1"/>
        <body name="box" pos="0 0 .1"><freejoint name="free"/><geom name="box" type="box" size=".1 .12 .1" mass="1"/>
          <site name="centre"/></body>{extra}</worldbody>
      <actuator><motor site="centre" gear="1 0 0 0 0 0" ctrlrange="-20 20" ctrllimited="true"/></actuator></mujoco>""")


PUSH = """<mujoco><option timestep="1e-4" cone="elliptic"/>
  <default><geom friction=".4" solref="2e-3 1" solimp=".999 .999 .001"/></default>
  <worldbody><geom name="floor" type="plane" size="5 5 .1"/>
    <body name="box" pos="0 0 .1"><joint name="bx" type="slide" axis="1 0 0"/>
      <joint name="bz" type="slide" axis="0 0 1"/><joint name="bp" axis="0 1 0"/>
      <geom name="box" type="box" size=".1 .1 .1" mass="1"/></body>
    <body name="ball" pos="-.14 0 .1" gravcomp="1"><joint name="px" type="slide" axis="1 0 0" damping="1"/>
      <joint name="pz" type="slide" axis="0 0 1" damping="1"/><geom name="ball" type="sphere" size=".03" mass=".5"/>
    </body></worldbody>
  <actuator><motor joint="px"/></actuator></mujoco>"""

PENDULUM = """<mujoco><option timestep="{h}"/><worldbody><body pos="0 0 1">
  <joint name="hinge" axis="0 1 0" damping=".1" armature=".01" limited="true" range="-40 30" margin=".01"
    solreflimit="-1 -{b}" solimplimit=".9999 .9999 .001"/>
  <geom type="capsule" fromto="0 0 0 0 0 -.5" size=".02" mass="1" contype="0" conaffinity="0"/></body></worldbody>
  <actuator><position joint="hinge" kp="3" kv=".2"/></actuator></mujoco>"""

CHAIN = """<mujoco><option timestep=".001"/><worldbody><body pos="0 0 1"><joint name="a" axis="0 1 0" damping=".1"/>
  <geom type="capsule" fromto="0 0 0 .3 0 -.2" size=".02"/><body pos=".3 0 -.2">
  <joint name="b" axis="0 1 .3" stiffness="2" armature=".02"/><geom type="capsule" fromto="0 0 0 .3 .1 0" size=".02"/>
  </body></body></worldbody><actuator><motor joint="a" gear="3"/><velocity joint="b" kv=".5"/></actuator></mujoco>"""


def moved(model, q=None, v=None, u=None):
    data = mujoco.MjData(model)
    for values, new in ((data.qpos, q), (data.qvel, v), (data.ctrl, u)):
        if new is not None:
            values[:] = new
    mujoco.mj_forward(model, data)
    return data


def pressed(data):
    """The same a little lower: at a gap of exactly 0 MuJoCo has no contact."""
    data.qpos[2] -= 1e-8
    return data


def both_steps(model, data, **options):
    """The configuration and velocity after one step of the LCS, and of MuJoCo; and the forces."""
    here = marble.lcs.linearize(model, data, **options)
    x, force = step(here.lcs, here.x0, here.u)
    mujoco.mj_step(model, data)
    return here.configuration(x), (data.qpos.copy(), data.qvel.copy()), force


class SmoothSteps(unittest.TestCase):
    def test_a_free_body_that_spins_makes_the_same_step(self):
        model = box()
        data = moved(model, [0, 0, 1, 0.6, 0.2, -0.3, 0.7], [1, 2, 3, -4, 5, 6], [2])
        ours, theirs, _ = both_steps(model, data, max_gap=2)
        np.testing.assert_allclose(ours[0], theirs[0], atol=1e-12)
        np.testing.assert_allclose(ours[1], theirs[1], atol=1e-12)

    def test_a_step_from_another_state_errs_by_the_square_of_the_distance(self):
        spin = [0.3, -0.2, 0.4, 9, -7, 8]
        errors = []
        for scale in (1e-2, 1e-3):
            model = box(timestep=0.02)
            data = moved(model, [0, 0, 1, 0.6, 0.2, -0.3, 0.7], spin, [2])
            here = marble.lcs.linearize(model, data, max_gap=2)
            tangent = scale * np.array([1, -2, 1, 2, 1, -1, 1, 1, -1, 2, 1, 1.0])
            q, v = here.configuration(here.x0 + tangent)
            np.testing.assert_allclose(here.state(q, v), here.x0 + tangent, atol=1e-12)
            x, _ = step(here.lcs, here.x0 + tangent, here.u)
            data.qpos[:], data.qvel[:] = q, v
            mujoco.mj_step(model, data)
            errors.append(np.abs(here.state(data.qpos, data.qvel) - x).max())
        self.assertLess(errors[0], 5e-3)
        self.assertLess(errors[1], 2e-2 * errors[0])

    def test_the_derivatives_are_those_of_mujoco(self):
        model = mujoco.MjModel.from_xml_string(CHAIN)
        model.opt.timestep, model.opt.integrator = 0.02, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        data = moved(model, [0.4, -0.7], [1.5, -2], [0.3, -0.1])
        here = marble.lcs.linearize(model, data)
        A, B = np.zeros((4, 4)), np.zeros((4, 2))
        mujoco.mjd_transitionFD(model, data, 1e-6, True, A, B, None, None)
        np.testing.assert_allclose(here.lcs.A, A, atol=1e-6)
        np.testing.assert_allclose(here.lcs.B, B, atol=1e-8)
        data.qacc[:] = here.smooth.acceleration
        by_q, by_v, mass = np.zeros((3, 2, 2))
        mujoco.mjd_inverseFD(model, data, 1e-6, True, by_q, by_v, mass, None, None, None, None)
        np.testing.assert_allclose(here.smooth.mass, mass.T, atol=1e-6)
        np.testing.assert_allclose(here.smooth.f_q, -by_q.T, atol=1e-4)
        np.testing.assert_allclose(here.smooth.f_v, -by_v.T, atol=1e-4)

    def test_servos_and_damping_are_stable_in_long_steps(self):
        model = mujoco.MjModel.from_xml_string(
            CHAIN.replace('kv=".5"', 'kv="50"').replace('damping=".1"', 'damping="30"'))
        here = marble.lcs.linearize(model, moved(model, [0.4, -0.7]), dt=0.05)
        self.assertLessEqual(np.abs(np.linalg.eigvals(here.lcs.A)).max(), 1.05)
        np.testing.assert_allclose(here.u_max, np.inf)

    def test_forces_on_bodies_and_joints_count(self):
        model = box()
        data = moved(model, [0, 0, 1, 1, 0, 0, 0])
        data.xfrc_applied[1, :3], data.qfrc_applied[:3] = [3, 0, 0], [0, 4, 0]
        ours, theirs, _ = both_steps(model, data, max_gap=2)
        np.testing.assert_allclose(ours[1], theirs[1], atol=1e-12)
        self.assertAlmostEqual(ours[1][0], 3e-3)
        self.assertAlmostEqual(ours[1][1], 4e-3)


class ContactSteps(unittest.TestCase):
    def test_friction_has_the_step_of_mujoco_or_of_coulomb(self):
        """MuJoCo's step is Anitescu's as its contacts get stiffer: what slides also rises."""
        h, mu = 1e-4, 0.5
        model = box(timestep=h, contact=f'solref="-1 -{1 / h}"')
        for speed, push in ((1, 0), (-0.5, 0), (0, 0.49 * G), (0, 0.51 * G), (0, -2 * G), (0.2, -2 * G)):
            with self.subTest(speed=speed, push=push):
                free = speed + h * push
                across = np.sign(free) * max(abs(free) - mu * G * h, 0)
                for contact, directions in (("anitescu", 4), ("stewart_trinkle", 4), ("stewart_trinkle", 8)):
                    data = pressed(moved(model, v=[speed, 0, 0, 0, 0, 0], u=[push]))
                    ours, theirs, force = both_steps(model, data, contact=contact, num_directions=directions)
                    self.assertGreater(force.max(), 1)
                    if contact == "anitescu":
                        np.testing.assert_allclose(ours[1][:3], theirs[1][:3], atol=2e-4 * (abs(speed) + G * h))
                        self.assertAlmostEqual(ours[1][0], across / (1 + mu**2), delta=1e-9)
                    else:
                        np.testing.assert_allclose(ours[1], [across, 0, 0, 0, 0, 0], atol=1e-9)

    def test_sliding_to_rest_goes_the_same_way_as_the_step_gets_shorter(self):
        for contact in ("stewart_trinkle", "anitescu"):
            errors = []
            for h in (4e-3, 1e-3):
                model = box(timestep=h)
                data = moved(model, v=[0.6, 0, 0, 0, 0, 0])
                make = marble.lcs.linearizer(model, data, contact=contact)
                for _ in range(round(0.2 / h)):
                    here = make(data)
                    data.qpos[:], data.qvel[:] = here.configuration(step(here.lcs, here.x0, here.u)[0])
                errors.append(abs(data.qpos[0] - 0.6**2 / (2 * 0.5 * G)))
                self.assertAlmostEqual(data.qvel[0], 0, delta=1e-9)
            self.assertLess(errors[0], 4e-3, contact)
            self.assertLess(errors[1], 0.4 * errors[0], contact)

    def test_an_impact_is_inelastic(self):
        h = 1e-3
        model = box(timestep=h, contact=f'solref="-1 -{1 / h}"')
        for contact in ("stewart_trinkle", "anitescu"):
            ours, theirs, _ = both_steps(model, pressed(moved(model, v=[0, 0, -1, 0, 0, 0])), contact=contact)
            np.testing.assert_allclose(ours[1], theirs[1], atol=1e-3)
            np.testing.assert_allclose(ours[1], 0, atol=1e-9)

    def test_a_ball_pushes_a_box_as_mujoco_has_it_as_the_step_gets_shorter(self):
        fine = mujoco.MjModel.from_xml_string(PUSH)
        theirs = moved(fine, u=[9])
        while theirs.time < 0.4 - 1e-9:
            mujoco.mj_step(fine, theirs)
        self.assertGreater(theirs.qpos[0], 0.25)
        for contact in ("stewart_trinkle", "anitescu"):
            for h, allowed in ((4e-3, 4e-3), (1e-3, 1e-3)):
                ours = moved(fine, u=[9])
                make = marble.lcs.linearizer(fine, ours, dt=h, contact=contact, num_directions=2, max_gap=0.05)
                self.assertEqual([pair.feature for pair in make.pairs], ["corner0", "corner4", "nearest"])
                for _ in range(round(0.4 / h)):
                    here = make(ours)
                    ours.qpos[:], ours.qvel[:] = here.configuration(step(here.lcs, here.x0, here.u)[0])
                np.testing.assert_allclose(ours.qpos[[0, 3]], theirs.qpos[[0, 3]], atol=allowed)
                np.testing.assert_allclose(ours.qpos[[1, 2, 4]], 0, atol=allowed)

    def test_a_pendulum_stops_at_its_limits(self):
        h = 1e-4
        model = mujoco.MjModel.from_xml_string(PENDULUM.format(h=h, b=1 / h))
        for angle, speed in ((np.radians(30) - 0.00999, 2.0), (np.radians(-40) + 0.00999, -2.0), (0.1, 2.0)):
            data = moved(model, [angle], [speed], [0.2])
            ours, theirs, force = both_steps(model, data, joint_limits=True)
            self.assertEqual(force.max() > 1, angle != 0.1)
            np.testing.assert_allclose(ours[1], theirs[1], atol=1e-3)
            np.testing.assert_allclose(ours[0], theirs[0], atol=1e-6)
        self.assertEqual(marble.lcs.linearize(model, data).lcs.nl, 0)

    def test_limits_of_joints_are_bounds_in_coordinates_of_the_linearization(self):
        h = 1e-2
        model = mujoco.MjModel.from_xml_string(PENDULUM.format(h=h, b=1 / h))
        data = moved(model, [0.1], [0.0], [0.2])
        here = marble.lcs.linearize(model, data, joint_limits="bounds")
        self.assertEqual(here.lcs.nl, 0)
        low, high = model.jnt_range[0] + model.jnt_margin[0] * np.array([1, -1]) - 0.1
        np.testing.assert_allclose(np.ravel(here.joint_limits), [low, high])
        np.testing.assert_allclose(here.joint_bounds(here.x0, 2), [[[low]] * 2, [[high]] * 2])
        self.assertIsNone(marble.lcs.linearize(model, data, joint_limits="pairs").joint_limits)
        self.assertIsNone(marble.lcs.linearize(model, data).joint_bounds(np.zeros(2), 2))

    def test_the_limit_of_a_ball_joint_is_a_cone(self):
        h = 1e-4
        model = mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="{h}" gravity="0 0 0"/><worldbody>
          <body><joint name="ball" type="ball" limited="true" range="0 60" solreflimit="-1 -{1 / h}"
            solimplimit=".9999 .9999 .001"/><geom size=".1"/></body></worldbody>
          <actuator><motor joint="ball" gear="1 0 0"/></actuator></mujoco>""")
        axis, half = np.array([0.6, 0, 0.8]), np.radians(30.00001)
        data = moved(model, [np.cos(half), *(np.sin(half) * axis)], [1, 2, 3], [0])
        with self.assertRaisesRegex(marble.InvalidArgument, r"model.jnt_limited\[0\] is 1: must be 0 for a ball joint"):
            marble.lcs.linearize(model, data, joint_limits="bounds")
        ours, theirs, force = both_steps(model, data, joint_limits=True)
        self.assertGreater(force[0], 0)
        np.testing.assert_allclose(ours[1], theirs[1], atol=1e-3)
        self.assertAlmostEqual(float(axis @ ours[1]), 0, delta=1e-9)

    def test_a_soft_contact_is_a_spring(self):
        stiffness, speed, deepest = 4000.0, 0.5, []
        for h in (1e-3, 1e-4):
            model = mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="{h}" gravity="0 0 0"/><worldbody>
              <geom name="wall" type="plane" size="1 1 .1" zaxis="-1 0 0" pos=".1 0 0"/><body>
              <joint name="x" type="slide" axis="1 0 0"/><geom name="ball" size=".05" mass="2"/></body></worldbody>
              <actuator><motor joint="x"/></actuator></mujoco>""")
            data = moved(model, v=[speed])
            make = marble.lcs.linearizer(model, data, contact="soft", stiffness=stiffness)
            reached = 0.0
            for _ in range(round(0.2 / h)):
                here = make(data)
                x, force = step(here.lcs, here.x0, here.u)
                data.qpos[:], data.qvel[:] = here.configuration(x)
                reached = max(reached, force.max())
            deepest.append(reached / stiffness)
        expected = speed * np.sqrt(2 / stiffness)
        self.assertLess(abs(deepest[1] - expected), 0.2 * abs(deepest[0] - expected))
        self.assertAlmostEqual(deepest[1], expected, delta=1e-2 * expected)

    def test_the_hopper_of_gymnasium_stands_by_the_same_forces(self):
        try:
            import gymnasium
        except ImportError:
            self.skipTest("gymnasium is not installed")
        folder = pathlib.Path(gymnasium.__file__).parent / "envs/mujoco/assets"
        model = mujoco.MjModel.from_xml_path(str(folder / "hopper.xml"))
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
        data = moved(model, [0, 1.25, 0, 0, 0, 0])
        for _ in range(250):  # servos hold it upright until the contacts have settled
            data.ctrl[:] = -(20 * data.qpos[3:] + data.qvel[3:]) / 200
            mujoco.mj_step(model, data)
        self.assertGreaterEqual(data.ncon, 2)
        for contact in ("anitescu", "stewart_trinkle"):
            again = moved(model, data.qpos, data.qvel, data.ctrl)
            theirs = again.qfrc_constraint.copy()
            here = marble.lcs.linearize(model, again, contact=contact, num_directions=2,
                                        pairs=[("floor", "foot_geom")])
            _, force = step(here.lcs, here.x0, here.u)
            ours = here.smooth.mass @ (here.lcs.D @ force)[6:] / here.lcs.dt
            self.assertAlmostEqual(ours[1], theirs[1], delta=0.1 * theirs[1])
            self.assertGreater(theirs[1], 20)


class Contacts(unittest.TestCase):
    def test_a_body_rests_at_its_margin(self):
        model = box(contact='margin=".01"')
        data = moved(model)
        rule = data.contact[0].includemargin
        data.qpos[2] += rule
        here = marble.lcs.linearize(model, data)
        np.testing.assert_allclose(here.gaps, 0, atol=1e-12)
        self.assertEqual(here.lcs.nl, 16)
        x, _ = step(here.lcs, here.x0, here.u)
        np.testing.assert_allclose(x, 0, atol=1e-9)

    def test_penetration_is_not_undone_at_once(self):
        model = box()
        data = moved(model)
        data.qpos[2] -= 0.01
        for contact in ("anitescu", "stewart_trinkle"):
            here = marble.lcs.linearize(model, data, contact=contact)
            np.testing.assert_allclose(here.gaps, -0.01, atol=1e-12)
            np.testing.assert_allclose(step(here.lcs, here.x0, here.u)[0], 0, atol=1e-9)

    def test_the_pairs_are_the_same_at_every_state(self):
        model = box()
        data = moved(model)
        make = marble.lcs.linearizer(model, data)
        here = make(data)
        self.assertEqual([pair.feature for pair in here.pairs], [f"corner{i}" for i in (0, 2, 4, 6)])
        data.qpos[:] = [0.3, 0, 1, 0.6, 0.2, -0.3, 0.7]
        far = make(data)
        self.assertEqual(far.lcs.names, here.lcs.names)
        self.assertGreater(far.gaps.min(), 0.5)
        data.qpos[:] = moved(model).qpos
        again = make(data)
        for field in "ABDdEFHc":
            np.testing.assert_array_equal(getattr(again.lcs, field), getattr(here.lcs, field))
        chosen = marble.lcs.linearize(model, data, pairs=here.pairs[1:3], friction=[0, 0.3])
        self.assertEqual(chosen.lcs.nl, 5)
        self.assertEqual(marble.lcs.linearize(model, data, pairs=[("floor", "box", "corner6")]).lcs.nl, 4)

    def test_gaps_are_mujocos_distances(self):
        shapes = {"sphere": ".06", "capsule": ".05 .1", "cylinder": ".06 .09", "box": ".05 .08 .1",
                  "ellipsoid": ".05 .08 .1"}
        random = np.random.default_rng(1)
        for first in ("plane", *shapes):
            for second in shapes:
                model = mujoco.MjModel.from_xml_string(f"""<mujoco><worldbody>
                  <body name="first"><geom name="first" type="{first}" size="{shapes.get(first, '1 1 .1')}"/>
                  </body><body name="second"><freejoint/><geom name="second" type="{second}" size="{shapes[second]}"/>
                  <site name="s"/></body></worldbody>
                  <actuator><motor site="s" gear="1 0 0 0 0 0"/></actuator></mujoco>""")
                for _ in range(5):
                    turn = random.normal(size=4)
                    turn *= np.sign(turn[0]) / np.linalg.norm(turn)
                    data = moved(model, [*(random.normal(size=3) * 0.1 + [0, 0, 0.4]), *turn])
                    make = marble.lcs.linearizer(model, data, pairs=[("first", "second")])
                    expected = mujoco.mj_geomDistance(model, data, 0, 1, 10, None)
                    with self.subTest(first=first, second=second):
                        self.assertAlmostEqual(make(data).gaps.min(), expected, delta=2e-5)
                        self._check_normals(make, data)

    def _check_normals(self, make, data):
        """The rows are the derivatives of the gaps, wherever the features do not jump."""
        here = make(data)
        smooth = [i for i, pair in enumerate(here.pairs) if not pair.feature.startswith("rim")]
        rows = self._normal_rows(make, data)[smooth]
        q = data.qpos.copy()
        for j in range(6):
            gaps = []
            for sign in (1, -1):
                data.qpos[:] = q
                mujoco.mj_integratePos(make._model, data.qpos, np.eye(6)[j], sign * 1e-4)
                gaps.append(make(data).gaps[smooth])
            data.qpos[:] = q
            if rows.size:
                np.testing.assert_allclose((gaps[0] - gaps[1]) / 2e-4, rows[:, j], atol=3e-3)

    @staticmethod
    def _normal_rows(make, data):
        soft = marble.lcs.linearize(make._model, data, pairs=make.pairs, contact="soft", stiffness=1.0, dt=1.0)
        return soft.lcs.D[6:].T @ soft.smooth.mass

    def test_touching_shapes_have_a_normal(self):
        for gap in (-1e-9, 0, 1e-9, 1e-6):
            model = box(extra=f"""<body name="top" pos="0 0 {0.25 + gap}"><freejoint/>
              <geom name="top" type="cylinder" size=".1 .05" pos=".15 0 0"/></body>""")
            here = marble.lcs.linearize(model, moved(model), pairs=[("box", "top", "nearest")], friction=0)
            x, _ = step(here.lcs, here.x0, here.u)
            self.assertAlmostEqual(here.gaps[0], gap, delta=1e-6)
            row = here.lcs.D[12:].T @ here.smooth.mass / here.lcs.dt
            np.testing.assert_allclose(row[0, :3], [0, 0, -1], atol=1e-5)
            np.testing.assert_allclose(row[0, 6:9], [0, 0, 1], atol=1e-5)
            self.assertAlmostEqual(x[12 + 2], -G * 1e-3)  # nothing holds the lower one, and both fall together

    def test_the_filter_of_contacts_is_mujocos(self):
        model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><geom name="floor" type="plane" size="1 1 .1"/>
          <body name="a" pos="0 0 .1"><freejoint/><geom name="a1" size=".1"/><geom name="a2" size=".05" pos=".1 0 0"/>
            <body name="b" pos="0 0 .1"><joint name="j"/><geom name="b" size=".1"/>
              <body name="c" pos="0 0 .1"><joint/><geom name="c" size=".1"/></body></body></body>
          <body name="d" pos="0 0 .2"><freejoint/><geom name="d" size=".1" contype="2" conaffinity="4"/></body>
          <body name="e" pos=".1 0 .2"><freejoint/><geom name="e" size=".1"/></body></worldbody>
          <contact><exclude body1="a" body2="e"/><pair geom1="d" geom2="floor" margin=".2"/></contact>
          <actuator><motor joint="j"/></actuator></mujoco>""")
        data = moved(model)
        theirs = {tuple(sorted(one.geom.tolist())) for one in data.contact}
        ours = {tuple(sorted(pair[:2])) for pair in marble.lcs.linearizer(model, data, max_gap=0).pairs}
        self.assertEqual(ours, theirs)
        self.assertEqual(len(ours), 4)


class Errors(unittest.TestCase):
    def check(self, said, model=None, data=None, **options):
        model = model or box()
        with self.assertRaisesRegex(marble.InvalidArgument, said):
            marble.lcs.linearize(model, data or moved(model), **options)

    def test_every_argument_is_named(self):
        self.check("contact is 'hard': must be one of anitescu, stewart_trinkle, soft", contact="hard")
        self.check("dt is 0: must be finite and > 0 s", dt=0)
        self.check("num_directions is 3: must be 2", num_directions=3)
        self.check("max_gap is -1: must be ≥ 0 m", max_gap=-1)
        self.check("stiffness: is required", contact="soft")
        self.check("stiffness is -2", contact="soft", stiffness=-2)
        self.check(r"friction\[1\] is -1.0: must be ≥ 0", friction=[0, -1, 0, 0])
        self.check("friction is 2 entries: must be a number, or one for each of the 4 contacts", friction=[1, 1])
        self.check(r"pairs\[0\] is 'roof': must be names or ids of geoms", pairs=[("floor", "roof")])
        self.check(r"pairs\[0\] is 9: must be names or ids of geoms, ids in \[0, 2\)", pairs=[(0, 9)])
        self.check(r"pairs\[1\] is 'end0': must have a feature of corner0", pairs=[(0, 1, "corner0"), (0, 1, "end0")])
        self.check(r"pairs\[0\] is .*: cannot touch", pairs=[("box", "box")])
        self.check(r"pairs\[1\] is .*: must not occur twice", pairs=[(0, 1, "corner1"), ("floor", "box", "corner1")])
        self.check(r"pairs\[0\] is 'floor'", pairs=["floor"])
        self.check("pairs is 'floor'", pairs="floor")
        self.check(r"u is 2 entries: must have 1 entries", u=[1, 2])
        self.check(r"ignore\[0\] is 'all'", ignore=["all"])
        self.check("joint_limits is 'soft': must be False, True, \"pairs\" or \"bounds\"", joint_limits="soft")
        self.check("joint_limits is 2: must be True or False", joint_limits=2)
        self.check("data is str: must be a mujoco.MjData", data="data")
        self.check(r"data.qpos is 2 entries: must have 7",
                   data=moved(mujoco.MjModel.from_xml_string(CHAIN)))
        data = moved(box())
        data.qvel[2] = np.nan
        self.check(r"data.qvel\[2\] is nan: must be finite", data=data)
        with self.assertRaisesRegex(marble.InvalidArgument, "model is builtins.str: must be a mujoco.MjModel"):
            marble.lcs.linearize("model", None)

    def test_what_is_too_far_is_reported_with_its_gap(self):
        model = box()
        self.check(r"max_gap is 0.1: must be ≥ 0.4 m, the gap of the nearest pair \(0, 1, 'corner0'\)", model,
                   moved(model, [0, 0, 0.5, 1, 0, 0, 0]))

    def test_parts_that_an_lcs_lacks_are_errors_unless_ignored(self):
        def chain(old, new):
            return mujoco.MjModel.from_xml_string(CHAIN.replace(old, new))

        dry = chain('damping=".1"', 'frictionloss=".1"')
        self.check(r'model.dof_frictionloss\[0\]: is not supported; ignore=\["frictionloss"\]', dry)
        marble.lcs.linearize(dry, moved(dry), ignore=["frictionloss"])
        self.check("model.eq_active0",
                   chain("<actuator>", '<equality><joint joint1="a" joint2="b"/></equality><actuator>'))
        self.check("model.tendon_limited", chain("<actuator>", """<tendon><fixed limited="true" range="0 1">
          <joint joint="a" coef="1"/></fixed></tendon><actuator>"""))
        self.check("model.na is 1",
                   chain('<motor joint="a" gear="3"/>', '<intvelocity joint="a" kp="1" actrange="-1 1"/>'))
        self.check("model.nu is 0", mujoco.MjModel.from_xml_string(
            "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"))


class Random(unittest.TestCase):
    def test_random_options_end_with_a_linearization_or_an_error_that_names_one(self):
        run = subprocess.run([sys.executable, ROOT / "client/python/tests/lcs_random.py", "--target", "mujoco", "--runs",
                              "300"], capture_output=True, text=True)
        self.assertEqual(run.returncode, 0, run.stdout + run.stderr)
        counts = dict(re.findall(r"mujoco +(accepted|refused) +(\d+)", run.stdout))
        self.assertEqual(sum(map(int, counts.values())), 300)


class Page(unittest.TestCase):
    def test_the_page_s_example_prints_what_it_says(self):
        self.assertEqual(*example("MuJoCo models"))


if __name__ == "__main__":
    unittest.main()
