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
from marble.lcs import Task
from marble.lcs.drake_system import ControllerSystem

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


WALL = """<mujoco model="wall"><worldbody><geom name="wall" type="plane" zaxis="-1 0 0" pos=".1 0 0" size="1 1 .1"/>
  <body name="ball"><joint name="slide" type="slide" axis="1 0 0"/><geom name="ball" size=".05" mass="2"/></body>
  </worldbody><actuator><motor name="push" joint="slide"/></actuator></mujoco>"""


class Controllers(unittest.TestCase):
    def run_system(self, seconds, **changes):
        """The ball's place at the end, and the system that pushed it from −0.3 m; the wall is at 0.05 m."""
        model, model_diagram, *_ = made(WALL, "xml", 0.001)
        task = Task(**{"rate": 50, "dt": 0.02, "stages": 15, "Q": np.diag([100, 1]), "R": [[1e-3]], "deadline": np.inf,
                       "u_lb": -20, "u_ub": 20, "target": ([0.04], [0]),
                       "contacts": {"num_directions": 2, "max_gap": 1}, **changes})
        builder = DiagramBuilder()
        plant, _ = AddMultibodyPlantSceneGraph(builder, 0.001)
        Parser(plant).AddModelsFromString(WALL, "xml")
        plant.Finalize()
        system = builder.AddSystem(ControllerSystem(model, model_diagram, task, server="local"))
        self.addCleanup(system.controller.close)
        builder.Connect(plant.get_state_output_port(), system.get_input_port())
        builder.Connect(system.get_output_port(), plant.get_actuation_input_port())
        simulator = Simulator(builder.Build())
        own = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        plant.SetPositions(own, [-0.3])
        simulator.AdvanceTo(seconds)
        return plant.GetPositions(own)[0], system

    def test_a_system_of_a_diagram_pushes_a_ball_to_its_place_before_the_wall(self):
        for changes, steps in (({}, 75), ({"kp": 10.0, "kd": 1.0}, 75), ({"rate": 20}, 30)):
            with self.subTest(changes=changes):
                place, system = self.run_system(1.5, **changes)
                self.assertAlmostEqual(place, 0.04, delta=2e-3)
                self.assertEqual((system.statistics.steps, system.statistics.infeasible), (steps, 0))
                self.assertEqual(len(system.controller.pairs), 1)

    def test_a_ball_that_should_go_behind_the_wall_stays_at_it(self):
        place, _ = self.run_system(1.0, target=([0.08], [0]))
        self.assertAlmostEqual(place, 0.05, delta=2e-3)

    def test_a_linearization_elsewhere_leaves_the_context_as_it_was(self):
        plant, _, _, own = made(TABLE, "sdf", 1e-3, friction=0.5)
        plant.SetPositions(own, [1, 0, 0, 0, 0, 0, 0.1, 0])
        make = marble.lcs.linearizer(plant, own)
        before = plant.GetPositionsAndVelocities(own)
        q, v = np.array([0.8, 0, 0.6, 0, 0.1, 0, 0.3, 1]), np.arange(7.0)
        there = make.at(own, q, v)
        np.testing.assert_array_equal(plant.GetPositionsAndVelocities(own), before)
        np.testing.assert_array_equal(np.concatenate(make.measure(own)), before)
        plant.SetPositionsAndVelocities(own, np.concatenate([q, v]))
        for field in "ABDdEFHc":
            np.testing.assert_array_equal(getattr(make(own).lcs, field), getattr(there.lcs, field))
        with self.assertRaisesRegex(marble.InvalidArgument, "q is 1 entries"):
            make.at(own, [1], v)

    def test_a_diagram_without_the_plant_is_refused(self):
        model, *_ = made(WALL, "xml", 0.001)
        _, other, *_ = made(WALL, "xml", 0.001)
        task = Task(rate=50, dt=0.02, stages=5, Q=np.eye(2), R=[[1]], target=([0], [0]))
        with self.assertRaisesRegex(marble.InvalidArgument, "diagram: must contain the plant"):
            ControllerSystem(model, other, task)


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
