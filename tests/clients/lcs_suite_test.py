"""Contact-implicit MPC in closed loop (loadtest/suite/lcs): one run from end to end, and that the peers are what they are
called."""

import csv
import dataclasses
import itertools
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import mujoco
import numpy as np

import marble
from marble.lcs import LCS, Controller, linearizer
from marble.lcs.simulation import simulate
from marble.model import problem_file

SUITE = pathlib.Path(__file__).resolve().parents[2] / "loadtest/suite/lcs"
sys.path.insert(0, str(SUITE))

import consensus  # noqa: E402
import controllers  # noqa: E402
import ilqr  # noqa: E402
import loop  # noqa: E402
from hops import Gait, Hops  # noqa: E402
from tasks import TASKS  # noqa: E402


def at_start(task):
    """A task's model, and what a controller sees at the start of its nominal scenario."""
    model, scenario = task.load(), task.of_seed(0)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = scenario.q, scenario.v
    mujoco.mj_forward(model, data)
    now = linearizer(model, data, dt=task.dt, **task.contacts)(data)
    return model, loop.View(data, now, loop.targets(task, scenario, now, data))


class ClosedLoop(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        run = subprocess.run([sys.executable, SUITE / "compare", "--tasks", "cart_pole_10", "--seeds", "1", "--csv",
                              cls.folder / "runs.csv", "--controllers", "none", "marble", "--steps",
                              cls.folder / "steps", "--above", "100"],
                             capture_output=True, text=True, check=True, env={**os.environ, "MARBLE_SERVER": ""})
        cls.printed = run.stdout
        with (cls.folder / "runs.csv").open(encoding="utf-8") as file:
            cls.runs = {row["controller"]: row for row in csv.DictReader(file)}

    def test_the_planner_does_what_no_control_does_not(self):
        self.assertEqual(self.runs["marble"]["done"], "True")
        self.assertEqual(self.runs["none"]["done"], "False")
        self.assertLess(float(self.runs["marble"]["cost"]), float(self.runs["none"]["cost"]))

    def test_every_plan_is_solved_complementary_and_not_above_its_roll_out(self):
        self.assertEqual(int(self.runs["marble"]["unsolved"]), 0)
        self.assertLess(float(self.runs["marble"]["complementarity_worst"]), 1e-9)
        self.assertLess(float(self.runs["marble"]["above_start_worst"]), 1e-6)
        self.assertIn("plans above their rolled-out start: 0", self.printed)

    def test_slow_steps_are_written_with_their_start(self):
        files = sorted(path for path in (self.folder / "steps/cart_pole_10_seed0").glob("*.json")
                       if "before" not in path.name)
        self.assertTrue(files)  # the first step is a cold solve
        for path in files:
            problem = problem_file.load(path)
            solution = marble.solve(problem)
            self.assertEqual(solution.status, marble.Status.SOLVED)
            if problem.z0 is not None:
                self.assertLess(np.abs(problem.A @ problem.z0 + problem.b).max(), 1e-9)
                self.assertLess(solution.objective, problem.objective(problem.z0) + 1e-6)


class TwoFingers(unittest.TestCase):
    def test_the_simulation_differs_from_what_controllers_know(self):
        task = TASKS["push_t"]
        model, scenario = task.load(), task.of_seed(2)
        plant = loop.simulated(model, scenario)
        self.assertNotEqual((scenario.mass, scenario.friction), (1, 1))
        np.testing.assert_allclose(plant.body_mass, scenario.mass * model.body_mass)
        np.testing.assert_allclose(plant.geom_friction[:, 0], scenario.friction * model.geom_friction[:, 0])
        np.testing.assert_array_equal(model.body_mass, task.load().body_mass)

    def test_nothing_happens_without_control_and_the_fingers_do_it(self):
        for name in ("push_t", "pivot"):
            with self.subTest(name):
                task = TASKS[name].lasting(3.0)
                runs = {controller: loop.run(task, 0, controller, controllers.controller(controller, task))
                        for controller in ("none", "marble")}
                self.assertEqual({controller: run.done for controller, run in runs.items()},
                                 {"none": False, "marble": True})
                self.assertEqual(sum(step.unsolved for step in runs["marble"].steps), 0)
                self.assertLess(runs["marble"].cost, runs["none"].cost)


class Hopping(unittest.TestCase):
    """The hopper that goes forward."""

    @classmethod
    def setUpClass(cls):
        cls.model = TASKS["hopper_walk"].load()
        cls.gait = Gait(0.3)
        cls.hops = Hops(cls.model, cls.gait)

    def outputs(self, q):
        """Place of the centre of mass (x, z) and of the foot (x, z), and the foot's pitch."""
        data = mujoco.MjData(self.model)
        data.qpos[:] = q
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)
        foot = self.model.geom("foot").id
        return np.array([*data.subtree_com[0][[0, 2]], *data.geom_xpos[foot][[0, 2]], q[2] - q[3:].sum()])

    def follows(self, time):
        """A simulation that is where the targets are without shifts."""
        data = mujoco.MjData(self.model)
        data.time = time
        data.qpos[:], data.qvel[:] = self.hops._nominal(time)
        return data

    def test_the_foot_rests_in_a_stance_and_is_a_step_further_in_the_next_one(self):
        gait = self.gait
        first = gait.pause + 2 * gait.period
        data = self.follows(first)
        for hop in range(3):
            middle = first + hop * gait.period
            made = [self.outputs(self.hops.target(data, middle + part)[0])
                    for part in (0.0, 0.04, gait.period / 2, gait.period - 0.04)]
            feet = np.array([one[2:] for one in made])
            np.testing.assert_allclose(feet[:2, 0], (2 + hop) * gait.speed * gait.period, atol=2e-3)
            np.testing.assert_allclose(feet[3, 0], (3 + hop) * gait.speed * gait.period, atol=2e-3)
            np.testing.assert_allclose(feet[[0, 1, 3], 1], 0.06, atol=1e-3)
            self.assertGreater(feet[2, 1], 0.06 + 0.9 * gait.clearance)
            np.testing.assert_allclose(feet[:, 2], 0, atol=1e-2)
            self.assertGreater(made[2][1], made[0][1] + 0.02)  # it falls freely from above

    def test_the_first_hops_are_shorter_if_speed_grows_over_them(self):
        hops = Hops(self.model, Gait(0.3, ramp=3))
        feet = []
        for hop in range(6):
            data = mujoco.MjData(self.model)
            data.time = self.gait.pause + hop * self.gait.period + 1e-6
            data.qpos[:], data.qvel[:] = hops._nominal(data.time)
            feet.append(self.outputs(hops.target(data, data.time)[0])[2])
        np.testing.assert_allclose(np.diff(feet), 0.09 * np.array([0.25, 0.5, 0.75, 1, 1]), atol=2e-3)

    def test_a_step_is_placed_further_if_the_hopper_is_too_fast_but_not_that_under_way(self):
        now = self.gait.pause + 2 * self.gait.period
        steps = {}
        for faster in (0.0, 0.1, 0.6, 9.0):
            data = self.follows(now)
            data.qvel[0] += faster
            steps[faster] = [self.hops.jacobian[2] @ self.hops.target(data, now + later)[0]  # the foot, as linear
                             for later in (0.0, self.gait.period)]
        here, there = np.array(list(steps.values())).T
        np.testing.assert_allclose(here, here[0], atol=2e-3)
        shifts = there - there[0]
        self.assertAlmostEqual(shifts[1], 0, delta=2e-3)  # 0.1 m/s is tolerated
        self.assertTrue(0.05 < shifts[2] < shifts[3] <= self.gait.reach + 1e-3)

    def test_what_the_hopper_cannot_reach_is_an_error(self):
        with self.assertRaisesRegex(ValueError, "the hopper cannot reach"):
            Hops(self.model, Gait(3.0))

    def test_it_hops_forward_along_its_plans_and_falls_without_control(self):
        task = TASKS["hopper_walk"].lasting(2.4)
        task = dataclasses.replace(task, done=lambda _, data: data.qpos[0] > 0.3 and abs(data.qpos[2]) < 0.7)
        runs = {name: loop.run(task, 2, name, controllers.controller(name, task)) for name in ("none", "marble")}
        self.assertEqual({name: run.done for name, run in runs.items()}, {"none": False, "marble": True})
        steps = runs["marble"].steps
        self.assertEqual((len(steps), sum(step.unsolved for step in steps)), (120, 0))
        self.assertLess(max(step.complementarity for step in steps), 1e-9)
        self.assertLessEqual(np.median([step.factorizations for step in steps]), 30)  # of two plans

    def test_a_controller_hops_too(self):
        task = TASKS["hopper_walk"]
        model, data = task.load(), mujoco.MjData(task.load())
        scenario = task.of_seed(0)
        feet = []
        with Controller(model, loop.as_controlled(task, scenario, data, np.inf), state=data,
                        server="local") as controller:
            simulate(controller, model, data, 1.6, on_step=lambda _: feet.append(
                data.geom_xpos[model.geom("foot").id].copy()), prepare=True)
        self.assertGreater(data.qpos[1], 0.9)
        feet = np.array(feet)
        self.assertGreater(feet[-1, 0], feet[20, 0] + 0.1)
        self.assertGreater(feet[30:, 2].max(), 0.075)  # it leaves the floor
        self.assertEqual((controller.statistics.infeasible, controller.statistics.errors), (0, 0))


class SharedServer(unittest.TestCase):
    def test_four_robots_share_one_server(self):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "robots.json"
            for switches in (["--unpaced"], ["--prepare"]):
                with self.subTest(switches):
                    run = subprocess.run([sys.executable, SUITE / "shared_server", "--seconds", "0.4", "--json", file,
                                          *switches], capture_output=True, text=True, check=True)
                    robots = json.loads(file.read_text(encoding="utf-8"))
                    self.assertEqual([robot["task"] for robot in robots],
                                     ["cart_pole_10", "push_box", "hopper_stand", "quadruped_push"])
                    for robot in robots:
                        self.assertIn(robot["task"], run.stdout)
                        self.assertEqual((robot["steps"], robot["errors"]), (20, 0))
                        self.assertTrue(0 < robot["solve_s"][0] <= robot["solve_s"][2] <= robot["wall_s"][2])
                        if "--unpaced" in switches:  # no deadline stops a solve
                            self.assertEqual((robot["fallbacks"], robot["unsolved"], robot["infeasible"]), (0, 0, 0),
                                             robot["detail"])

    def test_a_robot_that_cannot_begin_ends_all(self):
        run = subprocess.run([sys.executable, SUITE / "shared_server", "--tasks", "cart_pole_10", "wheels"],
                             capture_output=True, text=True)
        self.assertEqual(run.returncode, 2)
        self.assertIn("tasks: wheels must be one of cart_pole_10", run.stderr)
        run = subprocess.run([sys.executable, SUITE / "shared_server"], capture_output=True, text=True,
                             env={**os.environ, "MARBLE_SERVER_BINARY": "/bin/false"})
        self.assertEqual(run.returncode, 1)
        self.assertIn("/bin/false ended with 1", run.stderr)


class Peers(unittest.TestCase):
    def test_the_projection_of_c3_is_the_nearest_complementary_point(self):
        random = np.random.default_rng(1)
        n, m, k = 2, 2, 1
        F = random.normal(size=(m, m))
        lcs = LCS(np.eye(n), np.ones((n, k)), np.ones((n, m)), np.zeros(n), random.normal(size=(m, n)),
                  F @ F.T + np.eye(m), random.normal(size=(m, k)), random.normal(size=m))
        task = TASKS["cart_pole_10"]
        _, view = at_start(task)
        peer = consensus.Consensus(task, consensus.Options(plus=False, u_x=3.0, u_u=2.0), view)
        peer._n, peer._m, peer._k = n, m, k
        peer._U = np.array([3.0, 3, 1, 1, 2])
        faces = peer._faces(lcs)
        rows, offset, _ = faces
        points = random.normal(size=(40, n + m + k))
        near = peer._project(points, faces)
        lam, slack = np.split(near @ rows.T + offset, 2, axis=1)
        self.assertLess(np.abs(np.minimum(lam, slack)).max(), 1e-7)
        for point, found in zip(points, near, strict=True):
            best = min(self.nearest(point, peer._U, rows, offset, sides) for sides in
                       itertools.product((0, 1), repeat=m))
            self.assertAlmostEqual((found - point) ** 2 @ peer._U, best, delta=1e-5 * max(1, best))

    @staticmethod
    def nearest(point, weights, rows, offset, sides):
        """The squared distance to a branch's polyhedron: a QP by Marble."""
        m = len(sides)
        zero = [j + m * side for j, side in enumerate(sides)]
        solution = marble.solve(2 * np.diag(weights), -2 * weights * point, rows[zero], offset[zero], rows, offset)
        return solution.objective + weights @ point**2

    def test_the_projection_of_c3_plus_is_the_nearest_complementary_pair(self):
        task = TASKS["cart_pole_10"]
        _, view = at_start(task)
        peer = consensus.Consensus(task, consensus.Options(plus=True, u_eta=9.0), view)
        points = np.random.default_rng(2).normal(size=(50, peer._size))
        near = peer._project(points, None)
        lam, eta = near[:, peer._lam], near[:, peer._eta]
        self.assertEqual(np.abs(np.minimum(lam, eta)).max(), 0)
        a, b = points[:, peer._lam], points[:, peer._eta]
        best = np.minimum(np.minimum(a, 0) ** 2 + 9 * b**2, a**2 + 9 * np.minimum(b, 0) ** 2)
        self.assertLess(np.abs((lam - a) ** 2 + 9 * (eta - b) ** 2 - best).max(), 1e-12)

    def test_both_solvers_of_the_qps_agree_where_no_input_is_at_a_bound(self):
        task = TASKS["cart_pole_10"]
        _, view = at_start(task)
        view.now.u_min[:], view.now.u_max[:] = -1e3, 1e3
        for name in ("c3", "c3plus"):
            by_osqp, by_kkt = (controllers.controller(qp, task)(task, None, view).step(view)
                               for qp in (name, f"{name}_kkt"))
            self.assertLess(abs(by_osqp.u - by_kkt.u).max(), 0.05 * max(1, abs(by_kkt.u).max()))

    def test_ilqr_lowers_the_cost_of_its_plan_and_is_no_worse_with_more_iterations(self):
        task, costs = TASKS["cart_pole_10"], []
        model, view = at_start(task)
        for iterations in (1, 5, 20):
            peer = ilqr.Ilqr(task, ilqr.Options(first_iterations=iterations), model, view)
            start = (view.data.qpos.copy(), view.data.qvel.copy(), np.zeros(model.nv))
            nothing = peer._roll_out(start, peer._targets(view), np.zeros_like(peer._U))[1]
            peer.step(view)
            costs.append(peer._roll_out(start, peer._targets(view), peer._U)[1])
            self.assertLess(costs[-1], nothing)
        self.assertEqual(costs, sorted(costs, reverse=True))


if __name__ == "__main__":
    unittest.main()
