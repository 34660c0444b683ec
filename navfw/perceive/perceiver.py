"""OFFIS on an image sequence: pairs of images to percepts, with times to contact."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from navfw.errors import InputError
from navfw.flow.derotation import derotate
from navfw.interfaces import FlowProcessor
from navfw.offis.offis import Offis
from navfw.perceive.image_sources import ImageSource, SourceImage
from navfw.perceive.pair_motion import (
    assumed_motion,
    estimate_rotation,
    expansion_focus,
    forward_share,
)
from navfw.perceive.pair_result import PairResult
from navfw.perceive.perceiver_options import LONGEST, PerceiverOptions
from navfw.perceive.scale import Scale, ScaleEstimator, floor_ratio
from navfw.perceive.working_size import WorkingSize
from navfw.plugins import Registry
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Array, CameraMotion, FlowField, Frame, FramePair, Label, Percept, Twist

__all__ = ["Perceiver"]

LEAST_MOTION = 0.25
"""Least length of the 90th percentile of the flow [px] for motion to be detected."""
LEAST_CONFIDENCE = 0.08
"""Least confidence of a known result."""
LEAST_TEXTURE = 0.08
"""Least share of cells with flow."""
LEAST_AGREEMENT = 0.6
"""Least share of the flow that agrees with the assumed motion."""
USEFUL_FLOW = (2.0, 5.0)
"""Range of the 90th percentile of the derotated flow [px] that the stride aims at."""
LARGEST_FLOW = 6.5
"""Largest 90th percentile of the flow, rotation included [px]: within the search range."""
BASELINE = 0.08
"""Desired distance between the first images of a pair [m], if the speed is known."""
TEXTURELESS = "too little texture to measure motion"
MOTIONLESS = "no motion between the images"
BACKWARD = "the camera moves backward"


@dataclass(frozen=True, slots=True)
class _Prepared:
    """A working image as a frame, with the name of its source."""

    name: str
    frame: Frame


@dataclass(frozen=True, slots=True)
class _Analysis:
    """Intermediate results of a pair; ``problems`` are the reasons for an unknown result."""

    flow: FlowField
    percept: Percept
    scale: Scale
    turn_source: str
    notes: list[str]
    problems: list[str]


class Perceiver:
    """Processes the images of one source in their order; one instance per sequence.

    Raises:
        InputError: the flow plugin is unknown, needs more than images, or has no rows and columns.

    """

    def __init__(self, options: PerceiverOptions, source: ImageSource, registry: Registry) -> None:
        self.options = options
        self._source = source
        self._plugin = _flow_plugin(options, registry)
        self._scales = ScaleEstimator(options.speed or None, options.height)
        self._stride = options.stride or self._first_stride()
        self.size: WorkingSize | None = None

    def results(self) -> Iterator[tuple[SourceImage, PairResult]]:
        """Each image but the first, with the result of its pair with an earlier image.

        Raises:
            InputError: the images cannot be read, differ in size, or are too small.

        """
        earlier: deque[_Prepared] = deque(maxlen=LONGEST)
        for item in self._source:
            size = self.size or self._start(item)
            if item.after_gap:
                earlier.clear()
            now = _Prepared(item.name, Frame(item.time, size.prepare(item.image)))
            if earlier:
                past = earlier[-min(self._stride, len(earlier))]
                self._number += 1
                yield item, self._result(past, now, self._analyse(past.frame, now.frame), size)
            earlier.append(now)

    def _start(self, first: SourceImage) -> WorkingSize:
        """Prepare camera and flow processor for the size of the ``first`` image."""
        height, width = first.image.shape[:2]
        o = self.options
        rows, cols = o.grid_for(width, height)
        self.size = size = WorkingSize.of(width, height, rows, cols)
        rate = min(max(self._source.rate, 0.01), 1e4)
        hfov = o.angle_of_view(width, height, self._source.hfov)
        self._camera = size.camera(hfov, 1.0, math.radians(o.pitch or 0.0), rate)
        self._processor = self._plugin(RobotModel(camera=self._camera), rows, cols)
        self._offis: dict[float, Offis] = {}
        self._number = 0
        self._rate = np.zeros(3)
        return size

    def _analyse(self, past: Frame, now: Frame) -> _Analysis:
        """Flow, rotation, scale and percept of a pair."""
        dt = now.time - past.time
        rotation_vector, measured, notes = self._predicted_rotation(past.time, now.time)

        def assume(way: float) -> CameraMotion:
            # only the direction matters here: the length follows once the scale is known
            return assumed_motion(self._camera, way, dt, rotation_vector, bool(measured))

        raw = self._processor.compute(FramePair(past, now, assume(1.0)))
        flow, problems = self._without_rotation(raw, measured)
        if problems == [TEXTURELESS] and _alike(past, now):
            problems = [MOTIONLESS]
        if problems == [BACKWARD]:
            flow, problems = self._without_rotation(replace(raw, motion=assume(-1.0)), measured)
            notes += [] if problems else [BACKWARD]
        self._choose_stride(raw, flow)
        self._rate = _rotation_vector(flow.motion, self._camera) / dt
        ratio = None if problems else floor_ratio(flow, self._camera)
        self._scales.speed = self.options.speed_between(past.time, now.time)
        scale = self._scales.update(None if ratio is None else ratio / dt)
        flow = _scaled(flow, scale.speed * dt)
        percept = self._perceive(flow, scale, unknown=bool(problems))
        if not problems and _confidence(percept) < LEAST_CONFIDENCE:
            problems = ["too little of the flow is reliable"]
            percept = self._perceive(flow, scale, unknown=True)
        gyro = self.options.gyro
        source = gyro.source if gyro is not None and measured else "flow"
        return _Analysis(flow, percept, scale, source, notes, problems)

    def _perceive(self, flow: FlowField, scale: Scale, *, unknown: bool) -> Percept:
        """The percept of ``flow``; if ``unknown``, that of a flow without confidence."""
        if unknown:
            flow = replace(flow, confidence=np.zeros(flow.shape))
        ahead = math.copysign(scale.speed, flow.motion.translation[2])
        return self._offis_at(scale.height).perceive(flow, Twist(ahead, 0.0))

    def _predicted_rotation(
        self, begin: float, end: float
    ) -> tuple[Array, frozenset[str], list[str]]:
        """Rotation vector (3,) [rad] between two times, names of the measured rates, and notes."""
        extrapolated = self._rate * (end - begin)
        gyro = self.options.gyro
        if gyro is None:
            return extrapolated, frozenset(), []
        rotation_vector = gyro.rotation_between(begin, end)
        if rotation_vector is None:
            return (
                extrapolated,
                frozenset(),
                [f"gap in the {gyro.source} record: rotation from the flow"],
            )
        return rotation_vector, gyro.measured, []

    def _without_rotation(
        self, raw: FlowField, measured: frozenset[str]
    ) -> tuple[FlowField, list[str]]:
        """The derotated flow, and the reason if it carries no information about the scene."""
        camera = self._camera
        if float((raw.confidence > 0.0).mean()) < LEAST_TEXTURE:
            return derotate(raw, camera), [TEXTURELESS]
        if _fastest(raw) < LEAST_MOTION:
            return derotate(raw, camera), [MOTIONLESS]
        refinement = estimate_rotation(raw, camera, measured)
        flow = refinement.apply(raw, camera)
        before, after = float(raw.confidence.sum()), float(flow.confidence.sum())
        if _fastest(flow) < LEAST_MOTION:
            return flow, ["the camera only rotates: distances are not observable"]
        forward = forward_share(flow, camera.focal)
        if forward < 1.0 - LEAST_AGREEMENT:
            return flow, [BACKWARD]
        if forward < LEAST_AGREEMENT or after < 0.5 * LEAST_AGREEMENT * before:
            return flow, ["the flow is inconsistent with straight motion of the camera"]
        return flow, []

    def _result(
        self, past: _Prepared, now: _Prepared, found: _Analysis, size: WorkingSize
    ) -> PairResult:
        flow, percept, scale = found.flow, found.percept, found.scale
        known = not found.problems
        focus = expansion_focus(flow) if known else None
        place: tuple[float, float] | None = None
        if focus is not None and focus.sigma < 0.25 * self._camera.width:
            x, y = size.to_image(np.array([focus.x, focus.y])).tolist()
            place = x, y
        regions = percept.explanation["regions"]
        # while the camera moves backward nothing approaches
        closing = max(math.copysign(scale.speed, flow.motion.translation[2]), 0.0)
        return PairResult(
            number=self._number,
            past=past.name,
            now=now.name,
            time=now.frame.time,
            dt=now.frame.time - past.frame.time,
            scale=scale,
            flow=flow,
            percept=percept,
            rotation_vector=_rotation_vector(flow.motion, self._camera),
            turn_source=found.turn_source,
            focus=place,
            contact=_inverse(closing * _nearness_ahead(percept, flow, self._camera)),
            quadrant_contact={
                name: _inverse(closing * regions[name]["nearest"]) for name in percept.quadrants
            },
            confidence=_confidence(percept) if known else 0.0,
            known=known,
            notes=(*found.notes, *found.problems),
        )

    def _offis_at(self, height: float) -> Offis:
        """OFFIS for a camera at ``height`` [m], in steps of 3 %: estimated heights vary."""
        step = round(math.log(height) / 0.03)
        if step not in self._offis:
            camera = self._camera.model_copy(update={"mount_height": height})
            robot = RobotModel(camera=camera, height=max(0.4, height + 0.05))
            walls = max(2.2, height + 0.8) if height < 10.0 else 1e6
            # the higher the camera, the farther away the visible floor begins
            path = max(2.0, 3.5 * height) if height < 10.0 else 2.0
            self._offis.clear()
            self._offis[step] = Offis(robot, Offis.Params(wall_height=walls, path_length=path))
        return self._offis[step]

    def _first_stride(self) -> int:
        speed = self.options.speed
        if not speed:
            return 1
        return min(max(round(BASELINE * self._source.rate / speed), 1), LONGEST)

    def _choose_stride(self, raw: FlowField, flow: FlowField) -> None:
        """Increase the stride for slow flow, decrease it for fast flow (METHOD 2.7).

        The derotated flow decides, as long as the ``raw`` flow stays within the search range.
        """
        if self.options.stride is not None:
            return
        low, high = USEFUL_FLOW
        useful, whole = max(_fastest(flow), 0.25), max(_fastest(raw), 0.25)
        if low <= useful <= high and whole <= LARGEST_FLOW:
            return
        wanted = self._stride * min(0.5 * (low + high) / useful, LARGEST_FLOW / whole, 2.0)
        self._stride = min(max(round(wanted), 1), LONGEST)


def _flow_plugin(
    options: PerceiverOptions, registry: Registry
) -> Callable[[RobotModel, int, int], FlowProcessor]:
    """A factory of the flow processor: from the robot, the rows and columns of the grid."""
    plugin = registry.get("flow", options.flow)
    if getattr(plugin, "oracle", False):
        raise InputError(
            f"{options.flow!r} needs the true depth, which images do not contain", key="--flow"
        )
    if not {"rows", "cols"} <= plugin.Params.model_fields.keys():
        raise InputError(f"{options.flow!r} has no parameters rows and cols", key="--flow")

    def processor(robot: RobotModel, rows: int, cols: int) -> FlowProcessor:
        params = plugin.Params.model_validate({"rows": rows, "cols": cols})
        return cast(FlowProcessor, plugin(robot, params))

    return processor


def _fastest(flow: FlowField) -> float:
    """90th percentile of the length [px] of vectors with confidence; 0 if there are none."""
    known = flow.confidence > 0.0
    if not known.any():
        return 0.0
    length = np.hypot(flow.vectors[..., 0], flow.vectors[..., 1])
    return float(np.quantile(length[known], 0.9))


def _alike(past: Frame, now: Frame) -> bool:
    """Whether two images with texture differ by no more than noise."""
    change = np.abs(now.image.astype(np.int16) - past.image).mean()
    return bool(change < 0.1 * now.image.std() and now.image.std() > 4.0)


def _scaled(flow: FlowField, way: float) -> FlowField:
    """``flow`` with its motion's translation scaled to a length of ``way`` [m]."""
    motion = flow.motion
    factor = way / max(motion.baseline, 1e-12)
    return replace(
        flow,
        motion=replace(
            motion,
            translation=motion.translation * factor,
            translation_sigma=motion.translation_sigma * factor,
        ),
    )


def _nearness_ahead(percept: Percept, flow: FlowField, camera: CameraModel) -> float:
    """Nearness [1/m] straight ahead: the weighted median over the middle of the image."""
    shift = flow.motion.translation
    away = np.abs(percept.points - camera.focal * shift[:2] / shift[2])
    middle = (away[..., 0] <= 0.25 * camera.width) & (away[..., 1] <= 0.25 * camera.height)
    weight = percept.confidence / np.maximum(percept.sigma, 1e-3) ** 2
    weight = np.where(middle & (percept.label != Label.FLOOR), weight, 0.0).ravel()
    if weight.sum() <= 0.0:
        return 0.0
    order = np.argsort(percept.nearness.ravel())
    half = int(np.searchsorted(np.cumsum(weight[order]), 0.5 * weight.sum()))
    return float(percept.nearness.ravel()[order[half]])


def _inverse(value: float) -> float:
    return 1.0 / value if value > 1e-6 else math.inf


def _confidence(percept: Percept) -> float:
    """Confidence of a percept in [0, 1], from the mean over its cells."""
    return float(np.clip(percept.confidence.mean() / 0.7, 0.0, 1.0))


def _rotation_vector(motion: CameraMotion, camera: CameraModel) -> Array:
    """Rotation vector (3,) [rad] of ``motion`` about base_link's x, y, z."""
    base = camera.base_from_camera
    r = base @ motion.rotation.T @ base.T
    axis = 0.5 * np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    sine = float(np.linalg.norm(axis))
    return np.asarray(axis if sine < 1e-9 else axis * (math.asin(min(sine, 1.0)) / sine))
