"""The robot's cameras, with the effects that a real camera has on images, and their faults.

Main view, side views and the finer landmark view; shutter and motion blur, lens, exposure control,
JPEG. Only the main view is distorted, as the robot's calibration says. A frame delivered at time t
has its last row exposed until t and its first row until t minus the readout time, as cameras do
whose frames are stamped on arrival. The scene is rendered from several poses of that time, and each
row is a mean of those within its exposure, so that near and far surfaces move differently and edges
cover what they hide. Walkers are drawn where they are at t: blur comes only from the robot's own
motion.
"""

from __future__ import annotations

import math
import time as wall
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from navfw.errors import SimulationError
from navfw.numerics import Array, Image
from navfw.numerics.functions import arccos
from navfw.numerics.products import product
from navfw.robot import CameraEffects, CameraModel, RobotModel
from navfw.signals import CameraMotion, Frame
from navfw.sim.camera import Camera, DepthImage
from navfw.sim.event_actions import InjectedFaults
from navfw.sim.robot_body import BodyState
from navfw.sim.scenery import Scenery
from navfw.sim.sensor_models import SensorParams
from navfw.sim.worldspec import LightSpec

_MIN_EXPOSURE = 1.0 / 256.0
"""Shortest exposure that the control sets, as a share of the longest one."""
_DARKEST = 0.5
"""Mean grey value below which the exposure control treats an image as black."""


class ImageSensor:
    """The exposure control, and the effects of lens and sensor on images; no effects by default.

    Grey values are proportional to the light. The control's ``level`` is the amount of light
    relative to the longest exposure: below 1 the exposure is shorter, above 1 it is amplified. At
    the first frame the control has settled already, as if the camera had been on before.
    """

    def __init__(self, effects: CameraEffects) -> None:
        self._effects = effects
        self._control = effects.auto_exposure
        self._level = 1.0
        self._metered: float | None = None

    @property
    def exposure_time(self) -> float:
        """Time [s] for which every row of the next image is exposed."""
        return self._effects.exposure_time * min(1.0, self._level)

    @property
    def gain(self) -> float:
        """Amplification of the next image and its noise, at least 1."""
        return max(1.0, self._level)

    def settle(self, clean: Image, falloff: Array | None) -> None:
        """Set the exposure for the scene of the first image ``clean`` (height, width), once."""
        if self._control is None or self._metered is not None:
            return
        light = clean.astype(np.float32) if falloff is None else clean * falloff
        self._set(self._control.target / max(float(light.mean()), _DARKEST))

    def expose(self, clean: Image, falloff: Array | None) -> Image:
        """Expose the light ``clean`` to an image (height, width); ``falloff`` is the lens's."""
        if falloff is None and self._level == 1.0:
            return clean
        light = self._level * (clean if falloff is None else clean * falloff)
        return np.rint(np.minimum(light, 255.0)).astype(np.uint8)

    def meter(self, image: Image, time: float) -> None:
        """Adjust the next exposure to the image (height, width) delivered at ``time`` [s]."""
        if self._control is not None and self._metered is not None:
            follow = 1.0 - math.exp(-(time - self._metered) / self._control.time)
            mean = max(float(image.mean()), _DARKEST)
            self._set(self._level * (self._control.target / mean) ** follow)
        self._metered = time

    def _set(self, level: float) -> None:
        most = 1.0 if self._control is None else self._control.max_gain
        self._level = min(max(level, _MIN_EXPOSURE), most)

    def compress(self, image: Image) -> Image:
        """Return the image (height, width) after JPEG compression and decompression."""
        quality = self._effects.jpeg_quality
        if quality is None:
            return image
        _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
        decoded = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)
        return np.asarray(decoded, dtype=np.uint8)


def light_falloff(
    share: float, lens: Sequence[CameraModel], views: Sequence[CameraModel]
) -> Array | None:
    """Share of light, 0 to 1, at each pixel of ``views`` side by side (height, sum of widths).

    It is 1 - ``share`` (a / a_max)^2 at the angle a from the optical axis; a_max is the angle of
    the farthest corner of the images ``lens``, the first of which is about the optical axis. None
    if ``share`` is 0.
    """
    if share == 0.0:
        return None
    axis = lens[0].base_from_camera[:, 2]
    widest = max(float(_angles(view, axis).max()) for view in lens)
    angles = np.concatenate([_angles(view, axis) for view in views], axis=1)
    left: Array = np.maximum(1.0 - share * np.square(angles / widest), 0.0)
    return left.astype(np.float32)


def _angles(view: CameraModel, axis: Array) -> Array:
    """Angle [rad] of each pixel's ray (height, width) from the direction ``axis`` in base_link."""
    x = (np.arange(view.width) - 0.5 * (view.width - 1)) / view.focal
    y = (np.arange(view.height) - 0.5 * (view.height - 1)) / view.focal
    rays = np.stack([*np.meshgrid(x, y), np.ones((view.height, view.width))], axis=-1)
    along = product(rays, view.base_from_camera.T, axis) / np.linalg.norm(rays, axis=-1)
    return arccos(np.clip(along, -1.0, 1.0))


_MAX_POSES = 16
"""Largest number of poses rendered for one image."""
_NEAR = 0.5
"""Distance of near surfaces [m], whose motion in the image decides the number of poses."""
_NEGLIGIBLE = 0.1
"""Motion in the image [px] below which one pose is enough."""
_SAMPLES = 16
"""Number of moments within a row's exposure over which it is averaged."""


class Shutter:
    """Renders images over the times at which ``effects`` expose their rows.

    Call ``record`` at every control tick with the true state of the body.
    """

    def __init__(self, effects: CameraEffects) -> None:
        self._readout = effects.readout_time
        self._span = effects.shutter_time
        self._states: deque[tuple[float, BodyState]] = deque()

    def record(self, time: float, body: BodyState) -> None:
        """Keep the true state ``body`` at ``time`` [s]; times must ascend."""
        if self._span == 0.0:
            return
        self._states.append((time, body))
        while len(self._states) > 2 and self._states[1][0] <= time - self._span:
            self._states.popleft()

    def render(
        self, camera: Camera, time: float, body: BodyState, exposure: float
    ) -> tuple[Image, DepthImage]:
        """Render luminance (height, width) without noise, and raw depth, delivered at ``time`` [s].

        Every row is exposed for ``exposure`` [s]; ``body`` is the state at ``time``.
        """
        span = exposure + self._readout
        if span == 0.0:
            return camera.render(*body)
        motion = image_motion(camera, self._state_at(time - span), body)
        if motion < _NEGLIGIBLE:
            return camera.render(*body)
        count = min(1 + math.ceil(motion), _MAX_POSES)
        mean = np.zeros((camera.model.height, camera.model.width), np.float32)
        weights = row_weights(camera.model.height, count, exposure / span)
        for index, moment in enumerate(np.linspace(time - span, time, count).tolist()):
            state = body if index == count - 1 else self._state_at(moment)
            image, depth = camera.render(*state)
            mean += weights[:, index, None] * image
        return np.rint(mean).astype(np.uint8), depth

    def _state_at(self, time: float) -> BodyState:
        """The body's state at ``time`` [s], between recorded ones; at rest before the first."""
        later = next((i for i, (at, _) in enumerate(self._states) if at >= time), None)
        if later is None:
            return self._states[-1][1]
        if later == 0:
            return self._states[0][1]
        (begin, first), (end, second) = self._states[later - 1], self._states[later]
        return _between(first, second, (time - begin) / (end - begin))


def image_motion(camera: Camera, first: BodyState, second: BodyState) -> float:
    """Return the largest motion [px] of a near surface at the image's edge between two states."""
    way = math.dist(first[0], second[0])
    opposite = (-x for x in second[1])  # the same turn as ``second``
    apart = min(math.dist(first[1], second[1]), math.dist(first[1], tuple(opposite)))
    model = camera.model
    per_radian = model.focal * (1.0 + math.tan(0.5 * model.hfov) ** 2)
    return per_radian * 2.0 * apart + model.focal * way / _NEAR  # for turns below 1 rad


def row_weights(rows: int, poses: int, exposed: float) -> Array:
    """Weights (rows, poses) of the images from ``poses`` moments, evenly spaced over the shutter.

    The shutter begins with the first row's exposure and ends with the last row's; ``exposed`` is
    the share of it for which each row is exposed. Between two moments images are interpolated.

    >>> row_weights(2, 2, 0.0).tolist()
    [[1.0, 0.0], [0.0, 1.0]]
    """
    ends = exposed + (1.0 - exposed) * np.linspace(0.0, 1.0, rows)
    within = exposed * (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    moments = (ends[:, None] - within) * (poses - 1)
    distances = np.abs(moments[..., None] - np.arange(poses))
    weights: Array = np.maximum(1.0 - distances, 0.0).mean(axis=1)
    return weights.astype(np.float32)


def _between(first: BodyState, second: BodyState, share: float) -> BodyState:
    """Return the state at ``share`` of the small motion from ``first`` to ``second``."""
    place = (1.0 - share) * np.array(first[0]) + share * np.array(second[0])
    one, other = np.array(first[1]), np.array(second[1])
    turn = (1.0 - share) * one + share * (other if product(one, other) > 0.0 else -other)
    x, y, z = place.tolist()
    qx, qy, qz, qw = (turn / math.hypot(*turn)).tolist()
    return (x, y, z), (qx, qy, qz, qw)


_COARSE = 4  # pixels of an image to one of the true depth where no image is drawn
_KEPT_STATES = 64
"""Number of past frames whose true body states are kept."""


@dataclass(slots=True)
class Timings:
    """Wall time [s] of rendering, physics, sensors, landmark frames; numbers of frames, steps."""

    render: float = 0.0
    physics: float = 0.0
    sensors: float = 0.0
    landmarks: float = 0.0
    frames: int = 0
    steps: int = 0


class CameraRig:
    """Captures frames with side views at the camera's rate, landmark frames at their own rate.

    Landmark frames have their own noise and faults, so that they do not change the draws for main
    frames. Without ``landmark_rng`` none are captured. If not ``drawn``, images are noise without
    content, and true depth has a ``_COARSE``-th of the image's size.
    """

    def __init__(
        self,
        robot: RobotModel,
        light: LightSpec,
        scenery: Scenery,
        sensors: SensorParams,
        timings: Timings,
        rng: np.random.Generator,
        faults: InjectedFaults,
        landmark_rng: np.random.Generator | None,
        landmark_faults: InjectedFaults,
        drawn: bool = True,
    ) -> None:
        noise, fine = sensors.image_noise if drawn else 0.0, sensors.supersample
        self._noise: Image | None = None
        if not drawn:
            width, height = robot.camera.width, robot.camera.height
            size = {"width": width // _COARSE, "height": height // _COARSE}
            self._coarse = Camera(robot.camera.model_copy(update=size), light, scenery, rng)
            self._noise = rng.integers(256, size=(2 * height, width), dtype=np.uint8)
        self.camera = Camera(robot.camera, light, scenery, rng, noise, fine)
        # one sensor captures them together with the camera's image and adds the noise to all
        self._sides = tuple(
            Camera(side, light, scenery, rng, 0.0, fine) for side in robot.side_cameras
        )
        self._for_landmarks: Camera | None = None
        if landmark_rng is not None:
            view = robot.landmark_view
            self._for_landmarks = Camera(view, light, scenery, landmark_rng, noise, fine)
        self._lens = robot.camera.undistortion()
        effects = robot.camera_effects
        self._shutter, self._sensor = Shutter(effects), ImageSensor(effects)
        lens = (robot.camera, *robot.side_cameras)
        self._falloff = light_falloff(effects.vignetting, lens, lens)
        self._landmark_falloff = light_falloff(effects.vignetting, lens, (robot.landmark_view,))
        self._faults, self._landmark_faults = faults, landmark_faults
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
        """Capture the frame of ``time`` [s] at the true state ``body``."""
        begun = wall.perf_counter()
        self._captured.append((time, body))
        parts = self._scene(time, body) if self._noise is None else self._blind(self._noise)
        rendered = wall.perf_counter()
        whole = np.concatenate(parts, axis=1) if self._sides else parts[0]
        self._sensor.settle(whole, self._falloff)
        light = self._faults.apply_optics(self._sensor.expose(whole, self._falloff))
        exposed = self.camera.add_noise(light, self._sensor.gain)
        whole = self._sensor.compress(self._faults.apply_readout(exposed))
        ends = np.cumsum([part.shape[1] for part in parts])[:-1]
        image, *aside = map(np.ascontiguousarray, np.split(whole, ends, axis=1))
        self._sensor.meter(image, time)
        self._frames = math.floor(time * self.camera.model.rate + 1e-6) + 1
        self._timings.frames += 1
        self._timings.render += rendered - begun
        self._timings.sensors += wall.perf_counter() - rendered
        return Frame(time, image, tuple(aside))

    def _scene(self, time: float, body: BodyState) -> list[Image]:
        """Return the light on the sensor: the camera's image and the side views."""
        exposure = self._sensor.exposure_time
        clean, self._raw_depth = self._shutter.render(self.camera, time, body, exposure)
        if self._lens is not None:
            clean = self._lens.distort(clean)
        sides = (self._shutter.render(side, time, body, exposure)[0] for side in self._sides)
        return [clean, *sides]

    def _blind(self, noise: Image) -> list[Image]:
        """Return a part of ``noise`` that differs from the one before, and dark side views."""
        height, first = len(noise) // 2, 7 * self._frames % len(noise) // 2
        sides = (np.zeros((s.model.height, s.model.width), np.uint8) for s in self._sides)
        return [noise[first : first + height], *sides]

    def capture_landmarks(self, time: float, body: BodyState | None) -> Frame | None:
        """Return the landmark frame delivered at ``time`` [s]; None if there is none.

        It is captured together with a main frame; otherwise ``body`` is None.
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
            light = self._landmark_faults.apply_optics(light, scale)
            exposed = camera.add_noise(light, self._sensor.gain)
            readout = self._landmark_faults.apply_readout(exposed)
            frame = Frame(time, self._sensor.compress(readout))
            self._landmark_frames = math.floor(time * camera.model.rate + 1e-6) + 1
        return self._landmark_faults.transport(time, frame)

    # --- the truth, for metrics and tests -----------------------------------------------------

    def true_depth(self) -> DepthImage:
        """See ``Simulation.true_depth``."""
        if self._noise is not None:
            return self._coarse.depth(self._coarse.render(*self._captured[-1][1])[1])
        if self._raw_depth is None:
            raise SimulationError("no frame has been captured yet")
        return self.camera.depth(self._raw_depth)

    def true_motion(self, past: Frame, now: Frame) -> CameraMotion:
        """See ``Simulation.true_motion``."""
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
