"""The robot's eyes: its camera, what a wide lens shows beside it, and the frames for landmarks."""

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
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, Frame, Image
from navfw.sim.camera import Camera, DepthImage
from navfw.sim.injected_faults import InjectedFaults
from navfw.sim.robot_body import BodyState
from navfw.sim.scenery import Scenery
from navfw.sim.sensor_models import SensorParams
from navfw.sim.worldspec import LightSpec

__all__ = ["CameraRig", "Dice", "Timings"]

_REMEMBERED_VIEWS = 64


@dataclass(slots=True)
class Timings:
    """Wall time [s] spent so far, and how often: what the loop cannot do without, and the rest."""

    render: float = 0.0
    physics: float = 0.0
    sensors: float = 0.0
    landmarks: float = 0.0
    frames: int = 0
    steps: int = 0


class Dice(NamedTuple):
    """A generator for each: the camera's noise, that of landmark frames, and the latter's faults.

    More draws of one never shift another's.
    """

    camera: np.random.Generator
    landmarks: np.random.Generator
    landmark_faults: np.random.Generator


class CameraRig:
    """Takes frames at the camera's rate, with side views, and landmark frames at theirs.

    ``faults`` are those of the run; what befalls frames befalls those for landmarks as well.
    """

    def __init__(
        self,
        robot: RobotModel,
        light: LightSpec,
        scenery: Scenery,
        sensors: SensorParams,
        dice: Dice,
        faults: InjectedFaults,
        timings: Timings,
        landmark_frames: bool,
    ) -> None:
        noise, fine = sensors.image_noise, sensors.supersample
        self.camera = Camera(robot.camera, light, scenery, dice.camera, noise, fine)
        # one sensor takes them together with the camera's image, and adds the noise to all
        self._sides = tuple(
            Camera(side, light, scenery, dice.camera, 0.0, fine) for side in robot.side_cameras
        )
        self._for_landmarks: Camera | None = None
        if landmark_frames:
            view = robot.landmark_view
            self._for_landmarks = Camera(view, light, scenery, dice.landmarks, noise, fine)
        self._faults = faults
        self.landmark_faults = InjectedFaults(dice.landmark_faults)
        self._timings = timings
        self._frames = 0
        self._landmark_frames = 0
        # where the body truly was when frames were taken: (time, state)
        self._taken: deque[tuple[float, BodyState]] = deque(maxlen=_REMEMBERED_VIEWS)
        self._raw_depth: npt.NDArray[np.float32] | None = None

    def adjust(self) -> None:
        """Let the faults of light and lens take hold."""
        for camera in (self.camera, *self._sides, self._for_landmarks):
            if camera is not None:
                camera.adjust(self._faults.light, self._faults.hfov_error)

    def is_due(self, time: float) -> bool:
        """Whether a frame is to be taken at ``time`` [s] (the first at time 0)."""
        return time * self.camera.model.rate >= self._frames - 1e-6

    def take(self, time: float, body: BodyState) -> Frame:
        """The frame of ``time`` [s], from a robot whose body is there."""
        begun = wall.perf_counter()
        clean, self._raw_depth = self.camera.render(*body)
        self._taken.append((time, body))
        parts = [clean, *(side.render(*body)[0] for side in self._sides)]
        rendered = wall.perf_counter()
        whole = np.concatenate(parts, axis=1) if self._sides else clean
        exposed = self.camera.expose(self._faults.through_lens(whole))
        image, *sides = _parted(self._faults.from_sensor(exposed), parts)
        self._frames = math.floor(time * self.camera.model.rate + 1e-6) + 1
        self._timings.frames += 1
        self._timings.render += rendered - begun
        self._timings.sensors += wall.perf_counter() - rendered
        return Frame(time, image, tuple(sides))

    def take_for_landmarks(self, time: float, body: BodyState | None) -> Frame | None:
        """A landmark frame, if somebody wants them and the next is due.

        It is taken beside a usual frame: without one, ``body`` is None.
        """
        camera = self._for_landmarks
        if camera is None:
            return None
        frame = None
        if body is not None and time * camera.model.rate >= self._landmark_frames - 1e-6:
            begun = wall.perf_counter()
            clean, _ = camera.render(*body)
            finer = camera.model.focal / self.camera.model.focal
            self._timings.landmarks += wall.perf_counter() - begun
            exposed = camera.expose(self.landmark_faults.through_lens(clean, finer))
            frame = Frame(time, self.landmark_faults.from_sensor(exposed))
            self._landmark_frames = math.floor(time * camera.model.rate + 1e-6) + 1
        return self.landmark_faults.transport(time, frame)

    # --- the truth, for metrics and tests -----------------------------------------------------

    def true_depth(self) -> DepthImage:
        """Depth (height, width) [m] of the last frame's view, inf where there is nothing."""
        if self._raw_depth is None:
            raise SimulationError("no frame has been taken yet")
        return self.camera.depth(self._raw_depth)

    def true_motion(self, past: Frame, now: Frame) -> CameraMotion:
        """How the camera truly moved between two of the last frames, pitch and roll included.

        Raises:
            SimulationError: one of the frames is not, or too old to be remembered.

        """
        bodies = dict(self._taken)
        if past.time not in bodies or now.time not in bodies:
            raise SimulationError(f"no view of {past.time:.3f} s or {now.time:.3f} s is remembered")
        from_position, from_axes = self.camera.placed(*bodies[past.time])
        to_position, to_axes = self.camera.placed(*bodies[now.time])
        return CameraMotion(
            rotation=to_axes.T @ from_axes,
            translation=to_axes.T @ (to_position - from_position),
            dt=now.time - past.time,
        )


def _parted(whole: Image, parts: Sequence[Image]) -> list[Image]:
    """``whole`` (height, sum of widths) cut into images as wide as ``parts``."""
    ends = list(accumulate(part.shape[1] for part in parts))
    begins = [0, *ends[:-1]]
    return [np.ascontiguousarray(whole[:, a:b]) for a, b in zip(begins, ends, strict=True)]
