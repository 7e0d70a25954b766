"""A controller in closed loop with MuJoCo's simulation, and its frames as an animation::

    with Controller(model, task, state=data) as controller, Recorder(model) as recorder:
        simulate(controller, model, data, 3.0, recorder=recorder)
        recorder.save("run.gif")
        print(controller.statistics)

Needs mujoco; a Recorder also pillow, for .gif, or imageio with ffmpeg, for .mp4.
"""

from __future__ import annotations

import contextlib
import math
import os
import pathlib
import warnings
from collections.abc import Callable, Iterator
from typing import Any, Final

import numpy as np

from marble.base.checks import is_number
from marble.errors import FailedPrecondition, InvalidArgument, Unavailable
from marble.lcs.controller import Controller, ControlStep
from marble.lcs.linearization import positive
from marble.model.optional import optional

_SAME_TIME: Final = 1e-6  # relative to a frame
_MAX_GIF_RATE: Final = 50.0  # frames of a GIF last whole hundredths of a second, and viewers slow shorter ones down


@contextlib.contextmanager
def _without_warnings() -> Iterator[None]:
    """Of GLFW, which MuJoCo tries first, where there is no display."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


class Recorder:
    """Renders frames of a MuJoCo simulation off screen; a context manager: leaving it frees the renderer.

    width, height: pixels, at most the model's offscreen buffer (640 × 480 unless <visual><global/> sets another).
    fps: frames a second of simulated time, in (0, 50]. camera: name or id, or a mujoco.MjvCamera; None: the free one.

    It uses the GL that MUJOCO_GL names; EGL if that is not set and there is no display. Unavailable where MuJoCo cannot
    render.
    """

    def __init__(self, model: Any, *, width: int = 480, height: int = 320, fps: float = 25.0,
                 camera: Any = None) -> None:
        mujoco = optional("mujoco", "mujoco", "a Recorder")
        for field, size, most in (("width", width, model.vis.global_.offwidth),
                                  ("height", height, model.vis.global_.offheight)):
            if isinstance(size, bool) or not isinstance(size, int | np.integer) or not 0 < size <= most:
                raise InvalidArgument(field, f"must be a whole number in [1, {most}], the model's off{field}",
                                      value=repr(size))
        if positive(fps, "fps", "Hz") > _MAX_GIF_RATE:
            raise InvalidArgument("fps", f"must be at most {_MAX_GIF_RATE:g} Hz", value=fps)
        self.fps: float = float(fps)
        self.frames: list[Any] = []
        """Arrays (height, width, 3) of bytes."""
        self._camera = -1 if camera is None else camera
        self._next_s = -math.inf
        self._context: Any = None
        try:
            if not os.environ.get("MUJOCO_GL") and not os.environ.get("DISPLAY"):
                self._context = optional("mujoco.egl", "mujoco", "a Recorder").GLContext(width, height)
                self._context.make_current()
            with _without_warnings():
                self._renderer: Any = mujoco.Renderer(model, height, width)
        except Exception as error:
            raise Unavailable(f"MuJoCo cannot render here: {error}. Set MUJOCO_GL to egl or osmesa, and install its "
                              "library (libegl1 or libosmesa6)") from error

    def capture(self, data: Any) -> bool:
        """Renders a frame, unless the last one is less than 1 / fps of simulated time old; whether it did."""
        if self._renderer is None:
            raise FailedPrecondition("the recorder is closed")
        if data.time < self._next_s - _SAME_TIME / self.fps and data.time >= self._next_s - 1 / self.fps:
            return False
        self._next_s = data.time + 1 / self.fps
        with _without_warnings():
            self._renderer.update_scene(data, camera=self._camera)
            self.frames.append(self._renderer.render().copy())
        return True

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the frames into a .gif or an .mp4."""
        suffix = pathlib.Path(path).suffix.lower()
        if suffix not in (".gif", ".mp4"):
            raise InvalidArgument("path", "must end in .gif or .mp4", value=repr(os.fspath(path)))
        if not self.frames:
            raise FailedPrecondition("there are no frames: capture comes first")
        if suffix == ".mp4":
            optional("imageio_ffmpeg", "imageio[ffmpeg]", "an .mp4")
            writer = optional("imageio.v2", "imageio[ffmpeg]", "an .mp4")
            writer.mimwrite(path, self.frames, fps=self.fps, macro_block_size=1)
            return
        image = optional("PIL.Image", "pillow", "a .gif")
        method = image.Quantize.FASTOCTREE  # keeps the colours of small bodies, unlike median cuts
        first, *rest = (image.fromarray(frame).quantize(method=method) for frame in self.frames)
        first.save(path, save_all=True, append_images=rest, duration=round(1000 / self.fps), loop=0)

    def close(self) -> None:
        """Frees the renderer; the frames stay."""
        renderer, self._renderer = self._renderer, None
        if renderer is not None:
            with _without_warnings():
                renderer.close()
            if self._context is not None:
                self._context.free()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def simulate(controller: Controller, model: Any, data: Any, seconds: float, *, prepare: bool = False,
             on_step: Callable[[ControlStep], object] | None = None, recorder: Recorder | None = None) -> None:
    """Runs MuJoCo's simulation for that many seconds under a controller; changes data.

    The simulation waits for the controller: a late step does no harm here, and is counted in controller.statistics.
    Between two steps the inputs are those of Controller.input. prepare: whether to call Controller.prepare after each
    step. on_step: receives each ControlStep once its inputs are in data.ctrl, before the simulation goes on; data is as
    it was measured. recorder: captures data as it goes on.

    The controller's period must be a whole number of the model's timesteps: else InvalidArgument of "rate".
    """
    mujoco = optional("mujoco", "mujoco", "simulate")
    if not (is_number(seconds) and math.isfinite(seconds) and seconds >= 0):
        raise InvalidArgument("seconds", "must be finite and ≥ 0", value=seconds)
    timestep = float(model.opt.timestep)
    substeps = controller.task.substeps(timestep, f"1 / {timestep:g} s, of the model's timestep,")
    if recorder is not None:  # places of bodies and cameras, which a new MjData lacks
        mujoco.mj_kinematics(model, data)
        mujoco.mj_camlight(model, data)
    for _ in range(round(seconds / controller.task.period_s)):
        step = controller.step(data)
        data.ctrl[:] = step.u
        if on_step is not None:
            on_step(step)
        if prepare:
            controller.prepare(data)
        for substep in range(substeps):
            if recorder is not None:
                recorder.capture(data)
            data.ctrl[:] = controller.input(data, substep * timestep)
            mujoco.mj_step(model, data)
    if recorder is not None:
        recorder.capture(data)
