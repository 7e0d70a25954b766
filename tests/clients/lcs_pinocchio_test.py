"""Linearizations of Pinocchio models: against its own forward dynamics, Coulomb's law, and MuJoCo's linearization."""

import pathlib
import tempfile
import unittest

import coal
import mujoco
import numpy as np
import pinocchio as pin
from lcp import step
from adapter_page import example

import marble
import marble.lcs

G = 9.81

ARM = """<mujoco><option timestep=".01"/><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
  <body name="upper" pos="0 0 .5"><joint name="a" axis="0 1 0" damping=".3" range="-60 80"/>
  <geom name="upper" type="capsule" fromto="0 0 0 .3 0 -.2" size=".02"/><body name="lower" pos=".3 0 -.2">
  <joint name="b" axis="0 1 .3" armature=".02" range="-90 90"/>
  <geom name="lower" type="capsule" fromto="0 0 0 .2 .1 -.2" size=".02"/><geom name="tip" size=".04" pos=".2 .1 -.2"/>
  </body></body></worldbody><actuator><motor joint="a"/><motor joint="b"/></actuator></mujoco>"""


def arm():
    """The same arm for MuJoCo and Pinocchio, with a tip that may touch the floor."""
    theirs = mujoco.MjModel.from_xml_string(ARM)
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "arm.xml"
        file.write_text(ARM)
        model = pin.buildModelFromMJCF(str(file))
    shapes = pin.GeometryModel()
    floor = coal.Halfspace(np.array([0, 0, 1.0]), 0)
    shapes.addGeometryObject(pin.GeometryObject("floor", 0, pin.SE3.Identity(), floor))
    tip = pin.SE3(np.eye(3), np.array([0.2, 0.1, -0.2]))
    shapes.addGeometryObject(pin.GeometryObject("tip", 2, tip, coal.Sphere(0.04)))
    shapes.addAllCollisionPairs()
    return theirs, model, shapes


def box():
    """A box of 1 kg on the floor, whose three forces are inputs."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "free")
    model.appendBodyToJoint(joint, pin.Inertia.FromBox(1.0, 0.2, 0.24, 0.2), pin.SE3.Identity())
    shapes = pin.GeometryModel()
    floor = pin.SE3(pin.utils.rpyToMatrix(0.3, -0.2, 0.1), np.zeros(3))  # the normal is vertical all the same
    shapes.addGeometryObject(pin.GeometryObject("floor", 0, floor, coal.Halfspace(floor.rotation.T @ [0, 0, 1.0], 0)))
    shapes.addGeometryObject(pin.GeometryObject("box", joint, pin.SE3.Identity(), coal.Box(0.2, 0.24, 0.2)))
    shapes.addAllCollisionPairs()
    return model, shapes, np.eye(6)[:, :3]


class Smooth(unittest.TestCase):
    def test_a_step_without_contacts_is_that_of_aba(self):
        model, _, actuation = box()
        q = np.array([0, 0, 1, 0.2, -0.3, 0.7, 0.6])
        q[3:] /= np.linalg.norm(q[3:])
        v, u, h = np.array([0.3, -0.2, 0.4, 9, -7, 8]), np.array([1.0, 2, 3]), 0.02
        here = marble.lcs.linearize(model, (q, v), u=u, dt=h, actuation=actuation)
        data, errors = model.createData(), []
        for scale in (0.0, 1e-2, 1e-3):
            x0 = here.x0 + scale * np.array([1, -2, 1, 2, 1, -1, 1, 1, -1, 2, 1, 1.0])
            at_q, at_v = here.configuration(x0)
            np.testing.assert_allclose(here.state(at_q, at_v), x0, atol=1e-12)
            x, _ = step(here.lcs, x0, u)
            after = at_v + h * pin.aba(model, data, at_q, at_v, actuation @ u)
            errors.append(np.abs(x - here.state(pin.integrate(model, at_q, h * after), after)).max())
        self.assertLess(errors[0], 1e-12)
        self.assertLess(errors[1], 1e-2)
        self.assertLess(errors[2], 2e-2 * errors[1])

    def test_the_derivatives_are_those_of_aba(self):
        _, model, _ = arm()
        model.damping[:] = 0
        q, v, u, h = np.array([0.4, -0.7]), np.array([1.5, -2]), np.array([0.3, -0.1]), 0.02
        here = marble.lcs.linearize(model, (q, v), u=u, dt=h)
        data = model.createData()  # which owns what comes next
        by_q, by_v, by_u = pin.computeABADerivatives(model, data, q, v, u)
        np.testing.assert_allclose(here.lcs.A[2:], np.hstack([h * by_q, np.eye(2) + h * by_v]), atol=1e-12)
        np.testing.assert_allclose(here.lcs.B[2:], h * by_u, atol=1e-12)

    def test_an_arm_has_the_system_that_it_has_in_mujoco(self):
        theirs, model, shapes = arm()
        data = mujoco.MjData(theirs)
        for contact in ("anitescu", "stewart_trinkle", "soft"):
            for q, v, u in (([0.5, 0.2], [1, -2], [3, 1]), ([-0.3, 1.2], [-2, 0.5], [0, -1])):
                data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, u
                options = {"dt": 0.03, "contact": contact, "stiffness": 1e3, "friction": 0.7, "joint_limits": True}
                other = marble.lcs.linearize(theirs, data, pairs=[("floor", "tip")], **options)
                here = marble.lcs.linearize(model, (q, v), u=u, geometry_model=shapes, pairs=[("floor", "tip")],
                                            **options)
                for field in "ABDdEFHc":
                    ours, expected = getattr(here.lcs, field), getattr(other.lcs, field)
                    np.testing.assert_allclose(ours, expected, atol=2e-7, rtol=1e-7)
                self.assertEqual(here.lcs.names["pairs"], other.lcs.names["pairs"])
                np.testing.assert_allclose(here.gaps, other.gaps, atol=1e-12)


class Contacts(unittest.TestCase):
    def test_friction_saturates_at_the_edge_of_the_cone(self):
        model, shapes, actuation = box()
        q = np.array([0, 0, 0.1, 0, 0, np.sin(0.4), np.cos(0.4)])  # turned on the floor; v is in its frame
        h, mu = 1e-2, 0.5
        for angle in (0.0, 1.0):
            for push in (0.45 * G, 0.7 * G):
                u = push * np.array([np.cos(angle), np.sin(angle), 0])
                here = marble.lcs.linearize(model, (q, np.zeros(6)), u=u, dt=h, geometry_model=shapes, friction=mu,
                                            contact="stewart_trinkle", num_directions=16, actuation=actuation)
                self.assertEqual(len(here.pairs), 4)
                _, v = here.configuration(step(here.lcs, here.x0, u)[0])
                expected = h * max(push - mu * G, 0)
                self.assertAlmostEqual(np.linalg.norm(v[:2]), expected, delta=0.03 * h * mu * G if expected else 1e-9)
                np.testing.assert_allclose(v[2:], 0, atol=1e-9)

    def test_a_box_lands_on_its_corner_and_turns(self):
        model, shapes, actuation = box()
        turned = pin.Quaternion(pin.utils.rpyToMatrix(0.2, 0.3, 0)).coeffs()
        q, v = np.array([0, 0, 0.3, *turned]), np.array([0, 0, -1.0, 0, 0, 0])
        make = marble.lcs.linearizer(model, (q, v), dt=2e-3, geometry_model=shapes, friction=0.5, max_gap=1,
                                     actuation=actuation)
        self.assertEqual(len(make.pairs), 8)
        lowest = 0.0
        for _ in range(400):
            here = make((q, v))
            q, v = here.configuration(step(here.lcs, here.x0, here.u)[0])
            lowest = min(lowest, here.gaps.min())
        self.assertGreater(lowest, -2e-3)
        self.assertAlmostEqual(q[2], 0.1, delta=2e-3)
        np.testing.assert_allclose(v, 0, atol=1e-3)

    def test_unknown_shapes_have_coals_nearest_points(self):
        model, shapes, actuation = box()
        points = coal.StdVec_Vec3s()
        for corner in np.array([[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1.0]]):
            points.append(0.1 * corner)
        mesh = coal.Convex.convexHull(points, True, "Qt")
        shapes.addGeometryObject(pin.GeometryObject("mesh", 0, pin.SE3(np.eye(3), np.array([0.5, 0, 0.1])), mesh))
        q, other = np.array([0, 0.02, 0.11, 0, 0, 0, 1]), []
        make = marble.lcs.linearizer(model, (q, np.zeros(6)), dt=1.0, geometry_model=shapes, pairs=[("mesh", "box")],
                                     contact="soft", stiffness=1.0, actuation=actuation)
        here = make((q, np.zeros(6)))
        row = here.lcs.D[6:].T @ here.smooth.mass
        for j in range(6):
            gaps = [make((pin.integrate(model, q, sign * 1e-5 * np.eye(6)[j]), np.zeros(6))).gaps[0]
                    for sign in (1, -1)]
            other.append((gaps[0] - gaps[1]) / 2e-5)
        self.assertAlmostEqual(here.gaps[0], 0.3, delta=0.05)
        np.testing.assert_allclose(row[0][:3], other[:3], atol=1e-3)


class Controllers(unittest.TestCase):
    def test_an_arm_reaches_its_target_by_the_inputs_that_it_has_in_mujoco(self):
        theirs, model, shapes = arm()
        data = mujoco.MjData(theirs)
        state = np.array([-0.6, 0.1]), np.zeros(2)
        contacts = {"pairs": [("floor", "tip")], "friction": 0.7}
        data.qpos[:], data.qvel[:] = state

        def task(**more):
            return marble.lcs.Task(rate=50, dt=0.02, stages=10, Q=np.diag([50, 50, 1, 1]), R=1e-3 * np.eye(2), P=500 *
                                   np.eye(4), u_lb=-30, u_ub=30, target=([-0.1, 0.3], [0, 0]), deadline=np.inf,
                                   contacts={**contacts, **more})

        with marble.lcs.Controller(model, task(geometry_model=shapes), state=state, server="local") as controller, \
                marble.lcs.Controller(theirs, task(), state=data, server="local") as other:
            for k in range(60):
                step_here = controller.step(state)
                data.qpos[:], data.qvel[:] = state
                np.testing.assert_allclose(step_here.u, other.step(data).u, atol=1e-3)
                if k % 2:
                    controller.prepare(state)
                    other.prepare(data)
                here = step_here.linearization
                state = here.configuration(step(here.lcs, here.state(*state), step_here.u)[0])
            self.assertEqual(controller.statistics.infeasible, 0)
        np.testing.assert_allclose(state[0], [-0.1, 0.3], atol=0.02)


class Errors(unittest.TestCase):
    def check(self, said, *, state=None, **options):
        model, shapes, actuation = box()
        given = {"dt": 0.01, "geometry_model": shapes, "actuation": actuation, "friction": 1.0, **options}
        with self.assertRaisesRegex(marble.InvalidArgument, said):
            marble.lcs.linearize(model, state or (pin.neutral(model), np.zeros(6)), **given)

    def test_every_argument_is_named(self):
        self.check("dt: is required", dt=None)
        self.check("friction: is required", friction=None)
        self.check("actuation: is required", actuation=None)
        self.check(r"actuation is of shape \(2, 2\): must be finite and of shape \(6, nu\)", actuation=np.eye(2))
        self.check("state is 3: must be", state=3)
        self.check("q is 2 entries: must have 7 entries", state=([1, 2], np.zeros(6)))
        self.check("q: must have quaternions", state=(np.ones(7), np.zeros(6)))
        self.check(r"v\[1\] is nan", state=([0, 0, 1, 0, 0, 0, 1], [0, np.nan, 0, 0, 0, 0]))
        self.check("u is 1 entries: must have 3", u=[1])
        self.check(r"pairs\[0\] is 'roof': must be names or indices of geometry objects", pairs=[("roof", "box")])
        self.check("max_gap is 0.1: must be ≥ 0.9 m", state=([0, 0, 1, 0, 0, 0, 1], np.zeros(6)))

    def test_limits_of_inputs_are_the_models(self):
        _, model, _ = arm()
        model.upperEffortLimit[:], model.lowerEffortLimit[:] = [4, 5], [-3, -np.inf]
        here = marble.lcs.linearize(model, ([0, 0], [0, 0]), dt=0.1)
        np.testing.assert_array_equal(here.u_max, [4, 5])
        np.testing.assert_array_equal(here.u_min, [-3, -np.inf])
        self.assertEqual(here.lcs.nl, 0)

    def test_the_page_s_example_prints_what_it_says(self):
        self.assertEqual(*example("Pinocchio models"))


if __name__ == "__main__":
    unittest.main()
