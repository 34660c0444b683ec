"""The robot's cameras: main view, side views and the finer landmark view, with their faults."""

from __future__ import annotations

import math
import time as wall
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from navfw.errors import SimulationError
from navfw.numerics import Image
from navfw.numerics.products import product
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, Frame
from navfw.sim.camera import Camera, DepthImage
from navfw.sim.injected_faults import InjectedFaults
from navfw.sim.robot_body import BodyState
from navfw.sim.scenery import Scenery
from navfw.sim.sensor_models import SensorParams
from navfw.sim.shutter import ImageSensor, Shutter, light_falloff
from navfw.sim.worldspec import LightSpec

_KEPT_STATES = 64
"""Number of past frames whose true body state is kept."""


@dataclass(slots=True)
class Timings:
    """Wall time [s] spent on rendering, physics, sensors and landmark frames; their counts."""

    render: float = 0.0
    physics: float = 0.0
    sensors: float = 0.0
    landmarks: float = 0.0
    frames: int = 0
    steps: int = 0


class NoiseGenerators(NamedTuple):
    """Generators for the camera's noise, that of landmark frames, and faults of landmark frames.

    They are independent: more draws from one do not change the draws from another.
    """

    camera: np.random.Generator
    landmarks: np.random.Generator
    landmark_faults: np.random.Generator


class CameraRig:
    """Captures frames with side views at the camera's rate, landmark frames at their own rate.

    ``faults`` are those of the run; faults of the camera apply to landmark frames as well.
    """

    def __init__(
        self,
        robot: RobotModel,
        light: LightSpec,
        scenery: Scenery,
        sensors: SensorParams,
        generators: NoiseGenerators,
        faults: InjectedFaults,
        timings: Timings,
        landmark_frames: bool,
    ) -> None:
        noise, fine = sensors.image_noise, sensors.supersample
        self.camera = Camera(robot.camera, light, scenery, generators.camera, noise, fine)
        # one sensor captures them together with the camera's image and adds the noise to all
        self._sides = tuple(
            Camera(side, light, scenery, generators.camera, 0.0, fine)
            for side in robot.side_cameras
        )
        self._for_landmarks: Camera | None = None
        if landmark_frames:
            view = robot.landmark_view
            self._for_landmarks = Camera(view, light, scenery, generators.landmarks, noise, fine)
        effects = robot.camera_effects
        self._shutter, self._sensor = Shutter(effects), ImageSensor(effects)
        lens = (robot.camera, *robot.side_cameras)
        self._falloff = light_falloff(effects.vignetting, lens, lens)
        self._landmark_falloff = light_falloff(effects.vignetting, lens, (robot.landmark_view,))
        self._faults = faults
        self.landmark_faults = InjectedFaults(generators.landmark_faults)
        self._timings = timings
        self._frames = 0
        self._landmark_frames = 0
        # the true body state at the capture of each frame: (time, state)
        self._captured: deque[tuple[float, BodyState]] = deque(maxlen=_KEPT_STATES)
        self._raw_depth: npt.NDArray[np.float32] | None = None

    def update_optics(self) -> None:
        """Apply the active faults of light and field of view to all cameras."""
        for camera in (self.camera, *self._sides, self._for_landmarks):
            if camera is not None:
                camera.set_optics(self._faults.light, self._faults.hfov_error)

    def is_due(self, time: float) -> bool:
        """Whether a frame is due at ``time`` [s] (the first at time 0)."""
        return time * self.camera.model.rate >= self._frames - 1e-6

    def record(self, time: float, body: BodyState) -> None:
        """Keep the true state ``body`` at ``time`` [s], for images of a robot in motion."""
        self._shutter.record(time, body)

    def capture(self, time: float, body: BodyState) -> Frame:
        """The frame of ``time`` [s] at the true state ``body``."""
        begun = wall.perf_counter()
        exposure = self._sensor.exposure_time
        clean, self._raw_depth = self._shutter.render(self.camera, time, body, exposure)
        self._captured.append((time, body))
        sides = (self._shutter.render(side, time, body, exposure)[0] for side in self._sides)
        parts = [clean, *sides]
        rendered = wall.perf_counter()
        whole = np.concatenate(parts, axis=1) if self._sides else clean
        self._sensor.settle(whole, self._falloff)
        light = self._faults.apply_optics(self._sensor.expose(whole, self._falloff))
        exposed = self.camera.add_noise(light, self._sensor.gain)
        image, *aside = _parted(self._sensor.compress(self._faults.apply_readout(exposed)), parts)
        self._sensor.meter(image, time)
        self._frames = math.floor(time * self.camera.model.rate + 1e-6) + 1
        self._timings.frames += 1
        self._timings.render += rendered - begun
        self._timings.sensors += wall.perf_counter() - rendered
        return Frame(time, image, tuple(aside))

    def capture_landmarks(self, time: float, body: BodyState | None) -> Frame | None:
        """The landmark frame delivered at ``time`` [s], if any.

        It is captured together with a main frame; ``body`` is None when there is none.
        """
        camera = self._for_landmarks
        if camera is None:
            return None
        frame = None
        if body is not None and time * camera.model.rate >= self._landmark_frames - 1e-6:
            begun = wall.perf_counter()
            exposure = self._sensor.exposure_time
            clean, _ = self._shutter.render(camera, time, body, exposure)
            scale = camera.model.focal / self.camera.model.focal
            self._timings.landmarks += wall.perf_counter() - begun
            light = self._sensor.expose(clean, self._landmark_falloff)
            light = self.landmark_faults.apply_optics(light, scale)
            exposed = camera.add_noise(light, self._sensor.gain)
            readout = self.landmark_faults.apply_readout(exposed)
            frame = Frame(time, self._sensor.compress(readout))
            self._landmark_frames = math.floor(time * camera.model.rate + 1e-6) + 1
        return self.landmark_faults.transport(time, frame)

    # --- the truth, for metrics and tests -----------------------------------------------------

    def true_depth(self) -> DepthImage:
        """True depth (height, width) [m] of the last frame; inf where no surface is visible."""
        if self._raw_depth is None:
            raise SimulationError("no frame has been captured yet")
        return self.camera.depth(self._raw_depth)

    def true_motion(self, past: Frame, now: Frame) -> CameraMotion:
        """The true motion of the camera between two recent frames, pitch and roll included.

        Raises:
            SimulationError: one of the frames is not from this simulation, or too old.

        """
        bodies = dict(self._captured)
        if past.time not in bodies or now.time not in bodies:
            raise SimulationError(f"no frame of {past.time:.3f} s or {now.time:.3f} s is kept")
        from_position, from_axes = self.camera.camera_pose(*bodies[past.time])
        to_position, to_axes = self.camera.camera_pose(*bodies[now.time])
        return CameraMotion(
            rotation=product(to_axes.T, from_axes),
            translation=product(to_axes.T, to_position - from_position),
            dt=now.time - past.time,
        )


def _parted(whole: Image, parts: Sequence[Image]) -> list[Image]:
    """``whole`` (height, sum of widths) cut into images as wide as ``parts``."""
    ends = list(accumulate(image.shape[1] for image in parts))
    begins = [0, *ends[:-1]]
    return [np.ascontiguousarray(whole[:, a:b]) for a, b in zip(begins, ends, strict=True)]
