"""Controllers in MuJoCo's simulation and in gymnasium's environments, their animations, and the tutorial."""

import contextlib
import io
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
from unittest import mock

import gymnasium
import imageio.v2
import mujoco
import numpy as np
from adapter_page import ROOT
from PIL import Image

import marble
from marble.lcs import Controller, Task
from marble.lcs.policy import Policy
from marble.lcs.simulation import Recorder, simulate

SLIDER = """<mujoco><option timestep="0.002"/><worldbody><light pos="0 0 3"/>
  <geom name="wall" type="plane" zaxis="-1 0 0" pos=".1 0 0" size="1 1 .1"/>
  <body><joint name="slide" type="slide" axis="1 0 0"/><geom name="ball" size=".05" mass="2"/></body></worldbody>
  <actuator><motor joint="slide" ctrlrange="-20 20" gear="2"/></actuator></mujoco>"""


def slider(**changes):
    """A ball on a rail before a wall, which it shall touch: its centre can come as far as 0.05 m."""
    model = mujoco.MjModel.from_xml_string(SLIDER)
    data = mujoco.MjData(model)
    data.qpos[0] = -0.2
    task = Task(**{"rate": 50, "dt": 0.02, "stages": 15, "Q": np.diag([100, 1]), "R": [[1e-3]], "deadline": np.inf,
                   "target": ([0.04], [0]), "contacts": {"num_directions": 2, "pairs": [("wall", "ball")]}, **changes})
    return model, data, task


HOPPER_Q = np.diag([1, 50, 20, 0.2, 0.2, 0.5, 5, 0.5, 0.5, 0.02, 0.02, 0.02])


def hopper(**changes):
    """Gymnasium's hopper, to stand."""
    return Task(**{"rate": 62.5, "dt": 0.03, "stages": 15, "Q": HOPPER_Q, "P": 5 * HOPPER_Q, "R": 0.02 * np.eye(3),
                   "regularization": 1e-6, "target": ([0, 1.2, 0, -0.3, -0.6, 0.3], np.zeros(6)), "deadline": np.inf,
                   "contacts": {"num_directions": 2, "pairs": [("floor", "foot_geom")]}, **changes})


class Simulations(unittest.TestCase):
    def test_a_ball_stops_before_a_wall_also_with_prepared_steps_and_feedback(self):
        for prepare, gains in ((False, {}), (True, {}), (True, {"kp": 50.0, "kd": 5.0})):
            with self.subTest(prepare=prepare, gains=gains):
                model, data, task = slider(**gains)
                seen = []
                with Controller(model, task, state=data, server="local") as controller:
                    simulate(controller, model, data, 1.5, prepare=prepare, on_step=lambda step: seen.append(
                        (data.time, float(data.ctrl[0]) - float(step.u[0]))))
                self.assertAlmostEqual(data.qpos[0], 0.04, delta=2e-3)
                np.testing.assert_allclose([time for time, _ in seen], 0.02 * np.arange(75), atol=1e-9)
                self.assertEqual(max(abs(error) for _, error in seen), 0)
                self.assertEqual(controller.statistics.infeasible, 0)
                self.assertAlmostEqual(data.time, 1.5)

    def test_feedback_between_the_plans_resists_a_push_that_no_plan_knows(self):
        worst = []
        for gains in ({}, {"kp": 2000.0, "kd": 100.0}):
            model, data, task = slider(rate=5, **gains)
            data.qpos[0] = 0.0
            task = Task(**{**vars(task), "target": ([0.0], [0])})
            with Controller(model, task, state=data, server="local") as controller:
                controller.step(data)
                for k in range(100):
                    data.qfrc_applied[0] = 5.0
                    data.ctrl[:] = controller.input(data, k * model.opt.timestep)
                    mujoco.mj_step(model, data)
            worst.append(abs(data.qpos[0]))
        self.assertLess(worst[1], 0.25 * worst[0])

    def test_a_linearization_may_be_elsewhere_than_the_data(self):
        model, data, task = slider()
        make = marble.lcs.linearizer(model, data, dt=0.02, **task.contacts)
        there = make.at(data, [0.01], [0.5], [3.0])
        self.assertEqual((float(data.qpos[0]), float(data.qvel[0])), (-0.2, 0.0))
        data.qpos[0], data.qvel[0] = 0.01, 0.5
        here = make(data, [3.0])
        for field in "ABDdEFHc":
            np.testing.assert_array_equal(getattr(here.lcs, field), getattr(there.lcs, field))
        np.testing.assert_array_equal(np.concatenate(make.measure(data)), [0.01, 0.5])
        with self.assertRaisesRegex(marble.InvalidArgument, "q is 2 entries"):
            make.at(data, [1, 2], [0])
        data.qvel[0] = np.inf
        with self.assertRaisesRegex(marble.InvalidArgument, r"data.qvel\[0\] is inf: must be finite"):
            make.measure(data)

    def test_bad_arguments_are_named(self):
        model, data, task = slider(rate=70)
        with Controller(model, task, server="local") as controller:
            with self.assertRaisesRegex(marble.InvalidArgument, r"rate is 70 Hz: must be 1 / 0.002 s, of the model's "):
                simulate(controller, model, data, 1.0)
            for seconds in (-1, np.nan, "long"):
                with self.assertRaisesRegex(marble.InvalidArgument, "seconds is .*must be finite and ≥ 0"):
                    simulate(controller, model, data, seconds)
            data.qpos[0] = np.nan
            with self.assertRaisesRegex(marble.InvalidArgument, r"data.qpos\[0\] is nan: must be finite"):
                controller.step(data)
            with self.assertRaisesRegex(marble.InvalidArgument, "data is tuple: must be a mujoco.MjData"):
                controller.step((0, 0))


class Animations(unittest.TestCase):
    def recorded(self, **options):
        model, data, task = slider()
        try:
            recorder = Recorder(model, **options)
        except marble.errors.Unavailable as error:
            self.skipTest(str(error))
        self.addCleanup(recorder.close)
        with Controller(model, task, state=data, server="local") as controller:
            simulate(controller, model, data, 0.4, recorder=recorder)
        return recorder

    def test_a_run_becomes_a_gif_or_an_mp4(self):
        recorder = self.recorded(width=160, height=120, fps=25)
        self.assertEqual(len(recorder.frames), 11)
        self.assertGreater(recorder.frames[0].max(), 20)  # its bodies are where they are from the beginning
        self.assertGreater(np.abs(recorder.frames[0].astype(float) - recorder.frames[-1]).max(), 20)  # it moves
        with tempfile.TemporaryDirectory() as folder:
            gif, mp4 = (pathlib.Path(folder) / name for name in ("run.gif", "run.mp4"))
            recorder.save(gif)
            with Image.open(gif) as movie:
                self.assertEqual((movie.n_frames, movie.size, movie.info["duration"]), (11, (160, 120), 40))
            recorder.save(mp4)
            self.assertEqual(imageio.v2.get_reader(mp4).count_frames(), 11)
            with self.assertRaisesRegex(marble.InvalidArgument, "path is .*must end in .gif or .mp4"):
                recorder.save(pathlib.Path(folder) / "run.avi")
            for module, package, name in (("PIL.Image", "pillow", "run.gif"),
                                          ("imageio_ffmpeg", r"imageio\[ffmpeg\]", "run.mp4")):
                with mock.patch.dict(sys.modules, {module: None}), self.assertRaisesRegex(
                        marble.errors.Unavailable, f"pip install {package}"):
                    recorder.save(pathlib.Path(folder) / name)

    def test_a_recorder_names_what_is_wrong(self):
        model, data, _ = slider()
        for said, options in {r"width is 641: must be a whole number in \[1, 640\], the model's offwidth":
                              {"width": 641}, "height is 0": {"height": 0}, "width is 20.5": {"width": 20.5},
                              "fps is 60: must be at most 50 Hz": {"fps": 60}, "fps is 0": {"fps": 0}}.items():
            with self.assertRaisesRegex(marble.InvalidArgument, said):
                Recorder(model, **options)
        recorder = self.recorded(width=32, height=32)
        recorder.frames.clear()
        with self.assertRaisesRegex(marble.errors.FailedPrecondition, "there are no frames"):
            recorder.save("run.gif")
        recorder.close()
        with self.assertRaisesRegex(marble.errors.FailedPrecondition, "the recorder is closed"):
            recorder.capture(data)

    def test_where_mujoco_cannot_render_the_error_names_what_to_set(self):
        model, *_ = slider()
        with mock.patch("mujoco.Renderer", side_effect=RuntimeError("no GL")), self.assertRaisesRegex(
                marble.errors.Unavailable, "cannot render here: no GL. Set MUJOCO_GL"):
            Recorder(model, width=32, height=32)


class Policies(unittest.TestCase):
    def steps(self, policy, env, count):
        """Actions and whether the episode goes on."""
        actions, terminated, observation = [], False, None
        while len(actions) < count and not terminated:
            actions.append(policy(observation))
            observation, _, terminated, *_ = env.step(actions[-1])
        return actions, not terminated

    def test_gymnasiums_hopper_stands_and_falls_without_control(self):
        with gymnasium.make("Hopper-v5") as env:
            env.reset(seed=0)
            actions, stands = self.steps(lambda _: np.zeros(3), env, 150)
            self.assertFalse(stands)
            env.reset(seed=0)
            with Policy(env, hopper(), server="local") as policy:
                actions, stands = self.steps(policy, env, 150)
                self.assertTrue(stands)
                self.assertTrue(all(env.action_space.contains(action) for action in actions))
                self.assertEqual(policy.statistics.steps, 75)  # every other one
                self.assertEqual(policy.statistics.infeasible, 0)

    def test_each_episode_begins_without_a_plan(self):
        with gymnasium.make("Hopper-v5") as env, Policy(env, hopper(), server="local") as policy:
            episodes = []
            for count in (1, 5, 5):
                env.reset(seed=3)
                episodes.append(np.array(self.steps(policy, env, count)[0]))
        np.testing.assert_array_equal(episodes[0], episodes[1][:1])
        np.testing.assert_array_equal(episodes[1], episodes[2])

    def test_other_environments_and_rates_are_refused(self):
        with gymnasium.make("CartPole-v1") as env, self.assertRaisesRegex(
                marble.InvalidArgument, "env is .*must be an environment whose unwrapped one has model, data and dt"):
            Policy(env, hopper())
        with gymnasium.make("Hopper-v5") as env:
            with self.assertRaisesRegex(marble.InvalidArgument, r"rate is 50 Hz: must be 125 Hz, of the environment"):
                Policy(env, hopper(rate=50))
            scaled = gymnasium.wrappers.RescaleAction(env, np.float32(-3), np.float32(3))
            with self.assertRaisesRegex(marble.InvalidArgument, r"env.action_space is Box\(-3.0, 3.0"):
                Policy(scaled, hopper())


class Pages(unittest.TestCase):
    def test_the_tutorial_prints_what_it_says(self):
        page = (ROOT / "client/python/CONTROLLER.md").read_text(encoding="utf-8")
        blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
        self.assertEqual(len(blocks), 8)
        printed = "".join(re.findall(r"```text\n(.*?)```", page, re.DOTALL))
        out, names, own = io.StringIO(), {}, os.getcwd()
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            try:
                with contextlib.redirect_stdout(out):
                    for number, code in enumerate(blocks):
                        exec(compile(code, f"CONTROLLER.md, block {number}", "exec"), names)
                pictures = sorted(path.name for path in pathlib.Path(folder).iterdir())
            finally:
                os.chdir(own)
        said = [line for line in out.getvalue().splitlines(keepends=True) if "cannot render" not in line]
        self.assertEqual("".join(said), printed)
        self.assertIn("plan.png", pictures)
        self.assertTrue("push.gif" in pictures or len(said) < len(out.getvalue().splitlines()))

    def run_example(self, name, *arguments):
        """The numbers in the last line that it prints."""
        environment = {**os.environ, "MARBLE_SERVER": "local"}
        run = subprocess.run([sys.executable, ROOT / "client/python/examples" / name, *map(str, arguments)],
                             env=environment, capture_output=True, text=True, timeout=250)
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIn(" 0 infeasible, 0 errors", run.stdout)
        return [float(number) for number in re.findall(r"-?\d+\.\d+", run.stdout.splitlines()[-1])]

    def test_the_box_is_pushed_to_its_goal(self):
        box, goal = self.run_example("push_box.py", 1.0)
        self.assertAlmostEqual(box, goal, delta=0.02)

    def test_the_cube_is_turned_onto_its_side(self):
        turn, place = self.run_example("pivot_cube.py", 2.4)
        self.assertAlmostEqual(turn, 90, delta=3)
        self.assertAlmostEqual(place, 0.2, delta=0.02)

    def test_the_pole_is_caught_by_the_wall(self):
        cart, pole = self.run_example("cart_pole_walls.py", 2.0)
        self.assertAlmostEqual(cart, 0, delta=0.05)
        self.assertAlmostEqual(pole, 0, delta=0.05)


if __name__ == "__main__":
    unittest.main()
