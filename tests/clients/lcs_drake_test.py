"""Linearizations of Drake's plants: against Drake's own discrete steps, and MuJoCo's linearization."""

import unittest

import mujoco
import numpy as np
from lcp import step
from adapter_page import example
from pydrake.geometry import HalfSpace
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

import marble
import marble.lcs

G = 9.81

ARM = """<mujoco model="arm"><option timestep=".01"/><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
  <body name="upper" pos="0 0 .5"><joint name="a" axis="0 1 0" damping=".3" range="-60 80"/>
  <geom name="upper" type="capsule" fromto="0 0 0 .3 0 -.2" size=".02"/><body name="lower" pos=".3 0 -.2">
  <joint name="b" axis="0 1 .3" armature=".02" range="-90 90"/>
  <geom name="lower" type="capsule" fromto="0 0 0 .2 .1 -.2" size=".02"/><geom name="tip" size=".04" pos=".2 .1 -.2"/>
  </body></body></worldbody><actuator><motor name="a" joint="a"/><motor name="b" joint="b"/></actuator></mujoco>"""

FOOT = """<collision name="foot{0}"><pose>{1} {2} -.08 0 0 0</pose><geometry><sphere><radius>.02</radius></sphere>
  </geometry><drake:proximity_properties><drake:mu_static>.8</drake:mu_static>
  <drake:mu_dynamic>.8</drake:mu_dynamic></drake:proximity_properties></collision>"""
TABLE = """<sdf version="1.7" xmlns:drake="drake.mit.edu"><model name="table"><link name="table"><inertial>
  <mass>1</mass><inertia><ixx>.0082</ixx><iyy>.0067</iyy><izz>.0082</izz></inertia></inertial>""" + "".join(
    FOOT.format(i, *at) for i, at in enumerate([(-.1, -.12), (-.1, .12), (.1, -.12), (.1, .12)])) + """</link>
  <link name="weight"><inertial><mass>.01</mass><inertia><ixx>1e-5</ixx><iyy>1e-5</iyy><izz>1e-5</izz></inertia>
  </inertial></link><joint name="wheel" type="revolute"><parent>table</parent><child>weight</child>
  <axis><xyz>0 0 1</xyz></axis></joint></model></sdf>"""


def made(text, kind, timestep, friction=None):
    """A plant on a floor, its diagram, and both contexts."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, timestep)
    Parser(plant).AddModelsFromString(text, kind)
    if friction is not None:
        plant.RegisterCollisionGeometry(plant.world_body(), RigidTransform(), HalfSpace(), "floor",
                                        CoulombFriction(friction, friction))
    plant.Finalize()
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    plant.get_actuation_input_port().FixValue(own, np.zeros(plant.num_actuators()))
    return plant, diagram, context, own


class Steps(unittest.TestCase):
    def test_an_arm_has_the_system_that_it_has_in_mujoco(self):
        theirs = mujoco.MjModel.from_xml_string(ARM)
        data = mujoco.MjData(theirs)
        plant, _, _, own = made(ARM, "xml", 0.01)
        for contact in ("anitescu", "stewart_trinkle", "soft"):
            for q, v, u in (([0.5, 0.2], [1, -2], [3, 1]), ([-0.3, 1.2], [-2, 0.5], [0, -1])):
                data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, u
                plant.SetPositions(own, q)
                plant.SetVelocities(own, v)
                options = {"dt": 0.03, "contact": contact, "stiffness": 1e3, "friction": 0.7, "joint_limits": True,
                           "pairs": [("floor", "tip")]}
                other = marble.lcs.linearize(theirs, data, **options)
                here = marble.lcs.linearize(plant, own, u=u, **options)
                for field in "ABDdEFHc":
                    ours, expected = getattr(here.lcs, field), getattr(other.lcs, field)
                    np.testing.assert_allclose(ours, expected, atol=1e-6, rtol=1e-6)
                self.assertEqual(here.lcs.names["states"], other.lcs.names["states"])

    def test_a_body_that_spins_makes_drakes_step(self):
        for h, allowed in ((1e-2, 2e-2), (1e-3, 2e-4)):  # Drake's quaternion is of first order in h
            plant, diagram, context, own = made(TABLE, "sdf", h, friction=0.5)
            q = np.array([0.6, 0.2, -0.3, 0.7, 0, 0, 3, 0.1])
            q[:4] /= np.linalg.norm(q[:4])
            plant.SetPositions(own, q)
            plant.SetVelocities(own, [9, -7, 8, 0.3, -0.2, 0.4, 2])
            here = marble.lcs.linearize(plant, own, max_gap=9)
            x0 = here.x0 + h * np.array([1, -1, 2, 1, 1, -1, 3, 1, -1, 1, 2, 1, 1, -1])
            for start in (here.x0, x0):
                q, v = here.configuration(start)
                np.testing.assert_allclose(here.state(q, v), start, atol=1e-12)
                plant.SetPositions(own, q)
                plant.SetVelocities(own, v)
                context.SetTime(0)
                simulator = Simulator(diagram, context)
                simulator.Initialize()
                simulator.AdvanceTo(h)
                x, _ = step(here.lcs, start, here.u)
                after = here.state(plant.GetPositions(own), plant.GetVelocities(own))
                np.testing.assert_allclose(x, after, atol=allowed)

    def test_sliding_to_rest_goes_the_same_way_as_in_drake(self):
        mu, speed = 2 * 0.5 * 0.8 / (0.5 + 0.8), 0.6  # as Drake combines coefficients
        plant, diagram, context, own = made(TABLE, "sdf", 1e-4, friction=0.5)
        start = ([1, 0, 0, 0, 0, 0, 0.1, 0], [0, 0, 0, speed, 0, 0, 0])
        plant.SetPositions(own, start[0])
        plant.SetVelocities(own, start[1])
        simulator = Simulator(diagram, context)
        simulator.Initialize()
        simulator.AdvanceTo(0.2)
        theirs = plant.GetPositions(own).copy()
        for contact in ("anitescu", "stewart_trinkle"):
            plant.SetPositions(own, start[0])
            plant.SetVelocities(own, start[1])
            make = marble.lcs.linearizer(plant, own, contact=contact, dt=2e-3)
            self.assertEqual(len(make.pairs), 4)
            for _ in range(100):
                here = make(own)
                q, v = here.configuration(step(here.lcs, here.x0, here.u)[0])
                plant.SetPositions(own, q)
                plant.SetVelocities(own, v)
            self.assertAlmostEqual(q[4], theirs[4], delta=1e-3)
            self.assertAlmostEqual(q[4], speed**2 / (2 * mu * G), delta=1e-3)
            np.testing.assert_allclose(v, 0, atol=1e-6)


class Errors(unittest.TestCase):
    def test_every_argument_is_named(self):
        plant, _, context, own = made(TABLE, "sdf", 1e-3, friction=0.5)
        plant.SetPositions(own, [1, 0, 0, 0, 0, 0, 0.1, 0])
        for said, options in {"contact is 'hard'": {"contact": "hard"}, "u is 2 entries": {"u": [1, 2]},
                              r"pairs\[0\] is 'roof'": {"pairs": [("roof", "foot1")]},
                              "dt is -1": {"dt": -1}}.items():
            with self.assertRaisesRegex(marble.InvalidArgument, said):
                marble.lcs.linearize(plant, own, **options)
        with self.assertRaisesRegex(marble.InvalidArgument, "context: must be the plant's"):
            marble.lcs.linearize(plant, context)
        continuous, *_, own = made(TABLE, "sdf", 0.0, friction=0.5)
        with self.assertRaisesRegex(marble.InvalidArgument, "dt: is required"):
            marble.lcs.linearize(continuous, own)
        other = DiagramBuilder()
        still, _ = AddMultibodyPlantSceneGraph(other, 1e-3)
        still.AddRigidBody("still", SpatialInertia.SolidSphereWithMass(1, 0.1))
        still.Finalize()
        with self.assertRaisesRegex(marble.InvalidArgument, r"model.num_actuators\(\): must be ≥ 1"):
            marble.lcs.linearize(still, still.CreateDefaultContext())

    def test_without_a_scene_there_are_no_contacts(self):
        plant, *_ = made(TABLE, "sdf", 1e-3, friction=0.5)
        self.assertEqual(marble.lcs.linearize(plant, plant.CreateDefaultContext()).lcs.nl, 0)

    def test_the_page_s_example_prints_what_it_says(self):
        self.assertEqual(*example("Drake plants"))


if __name__ == "__main__":
    unittest.main()
