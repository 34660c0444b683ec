"""Run OFFIS on an image sequence: pairs of images to percepts, with times to contact."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from navfw.assumption import Assumption
from navfw.camera_geometry.rotations import derotate
from navfw.egomotion.flow_egomotion import MotionKind
from navfw.egomotion.refinement import RefinementParams, refine
from navfw.errors import InputError
from navfw.interfaces import FlowProcessor
from navfw.offis.offis import Offis
from navfw.perceive.floor_motion import FloorFinder, FloorMotion
from navfw.perceive.image_sources import ImageSource, SourceImage
from navfw.perceive.pair_motion import (
    SURE_HEADING,
    PairMotion,
    PairMotionEstimator,
    Scale,
    ScaleEstimator,
    TrackImage,
    rotation_vector,
)
from navfw.perceive.pair_result import PairResult
from navfw.perceive.perceiver_options import (
    MAX_STRIDE,
    PerceiverOptions,
    WorkingSize,
    are_alike,
    has_texture,
)
from navfw.perceive.sentence_evidence import HeldWords, front_probabilities, with_nearest
from navfw.perceive.small_things import SmallThings, without_feet
from navfw.plugins import Registry
from navfw.robot import CameraModel, RobotModel
from navfw.robot.camera_models import RATES
from navfw.signals import FlowField, Frame, FramePair, Label, Percept, Twist

MIN_PARALLAX = 1.0
"""Least 90th percentile of the derotated flow [px] from which distances count as known."""
_MIN_AHEAD = 0.17
"""Least share of the translation along the optical axis with which a focus of expansion and times
to contact are given: 80 deg off the axis."""
MIN_CONFIDENCE = 0.04
"""Least confidence of a result that counts as known."""
_MIN_TEXTURE = 0.08
"""Least share of cells with flow."""
_MIN_AGREEMENT = 0.3
"""Least share of the flow's confidence in vectors that agree with the egomotion."""
_USEFUL_FLOW = (2.0, 5.0)
"""Range of the 90th percentile of the derotated flow [px] that the stride aims at."""
_MAX_SHIFT = 0.2
"""Largest 90th percentile of the flow, rotation included, as a share of the image's width."""
_BASELINE = 0.08
"""Desired distance between the first images of a pair [m], if the speed is known."""
_OBSTACLE_SHARE, _DROP_SHARE = 0.2, 0.35
"""Least height of an obstacle and depth of a drop, as shares of the camera's height: for a low
camera, or an unknown scale, those of a robot would be too coarse."""
MAX_DISTANCE, MAX_TIME, MAX_HEIGHTS = 10.0, 5.0, 10.0
"""An object counts as in sight up to the largest of a distance [m], a time to contact [s], and a
number of camera heights."""
_TEXTURELESS = "too little texture to measure motion"
_UNRELATED = "the images have nothing in common: another scene, or one too far on"
_MOTIONLESS = "no motion between the images"
_ROTATING = "the camera only rotates: distances are not observable"
_UNDECIDED = "the direction of travel cannot be told from the flow"
SMALL = "the camera moves too little between the images"
NO_FLOOR = "the floor of the images before is not found again: what is below the horizon is unknown"
_INCONSISTENT = "the flow is inconsistent with one motion of the camera"
DIRECTIONS = {
    MotionKind.BACKWARD: "the camera moves backward",
    MotionKind.SIDEWAYS: "the camera moves sideways",
}
"""Remarks on motions that are not forward."""


@dataclass(frozen=True, slots=True)
class _Prepared:
    """A working image as a frame, with its track image and the name of its source image."""

    name: str
    frame: Frame
    track: TrackImage
    full: Frame


class Perceiver:
    """Processes the images of ``source`` in their order; one instance per sequence.

    Raises:
        InputError: the flow plugin is unknown, needs more than images, or has no rows and columns.

    """

    def __init__(self, options: PerceiverOptions, source: ImageSource, registry: Registry) -> None:
        self.options = options
        self.source = source
        self._plugin = _flow_plugin(options, registry)
        self._scales = ScaleEstimator(options.speed or None, options.height)
        apart = round(_BASELINE * source.rate / options.speed) if options.speed else 1
        self._stride = options.stride or min(max(apart, 1), MAX_STRIDE)
        self.size: WorkingSize | None = None

    def results(self) -> Iterator[tuple[SourceImage, PairResult]]:
        """Yield each image but the first, with the result of its pair with an earlier image.

        Raises:
            InputError: the images cannot be read, differ in size, or are too small.

        """
        earlier: deque[_Prepared] = deque(maxlen=MAX_STRIDE)
        for item in self.source:
            size = self.size or self._start(item)
            if item.after_gap:
                earlier.clear()
                self._motions.interrupt()
                self._words.interrupt()
            frame = Frame(item.time, size.prepare(item.image))
            track = TrackImage.of(item.image)
            now = _Prepared(item.name, frame, track, Frame(item.time, track.grey))
            if earlier:
                past = earlier[-min(self._stride, len(earlier))]
                self._number += 1
                yield item, self._result(past, now, size)
            earlier.append(now)

    def assumed(self, known: Sequence[Assumption]) -> list[Assumption]:
        """Return what is assumed from the first image on, after what was ``known`` before it."""
        assert self.size is not None  # noqa: S101 - known from the first image on
        others = self.options.assumptions(self.source, self.size)
        said = {one.what for one in others}
        return [*(one for one in known if one.what not in said), *others]

    def _start(self, first: SourceImage) -> WorkingSize:
        height, width = first.image.shape[:2]
        o = self.options
        rows, cols = o.grid_for(width, height)
        self.size = size = WorkingSize.of(width, height, rows, cols)
        rate = min(max(self.source.rate, RATES[0]), RATES[1])  # pairs have times of their own
        hfov = o.angle_of_view(width, height, self.source.hfov)
        self._camera = size.camera(hfov, 1.0, math.radians(o.pitch or 0.0), rate)
        params = self._plugin.Params.model_validate({"rows": rows, "cols": cols})
        self._processor = self._plugin(RobotModel(camera=self._camera), params)
        self._offis: dict[tuple[int, int, float], Offis] = {}
        self._motions = PairMotionEstimator(self._camera, size, o.gyro)
        pitch = None if o.pitch is None else math.radians(o.pitch)
        self._floors = FloorFinder(self._camera, (rows, cols), pitch)
        self._words = HeldWords()
        self._small = SmallThings(self._camera.focal / (size.scale * width))
        self._number = 0
        return size

    def _result(self, past: _Prepared, now: _Prepared, size: WorkingSize) -> PairResult:
        motion = self._motions.estimate(past.track, now.track, past.frame.time, now.frame.time)
        pair = FramePair(past.frame, now.frame, motion.camera_motion(1.0))
        raw = self._processor.compute(pair)
        derotated, problems = self._without_rotation(pair, raw, motion)
        notes, floor, lost = motion.notes, None, False
        if not problems:
            floor = self._floors.find(now.frame.image, past.frame.image, derotated.motion)
            lost = self._floors.lost
        flow = self._with_floor(derotated, floor, lost=lost)
        if lost:
            notes += (NO_FLOOR,)
        self._choose_stride(raw, flow, motion)
        self._scales.speed = self.options.speed_between(past.frame.time, now.frame.time)
        scale = self._scales.update(None if floor is None else floor.ratio / motion.dt)
        way = scale.speed * motion.dt
        flow = _scaled(flow, way)
        if not problems:
            # without the floor, anything may be below the horizon
            others = [_unknown(flow)] if lost else self._others(derotated, floor, motion, way)
            percept = self._perceive(flow, scale, others)
            if _confidence(percept) < MIN_CONFIDENCE:
                problems = ["too little of the flow is reliable"]
        if problems:
            percept = self._perceive(_unknown(flow), scale)
        pitch = self._floors.pitch or 0.0
        front = {} if problems else front_probabilities(percept, self._camera, scale.height, pitch)
        if not problems and motion.egomotion.kind in DIRECTIONS:
            notes += (DIRECTIONS[motion.egomotion.kind],)
        regions = percept.explanation["regions"]
        closing = max(float(flow.motion.translation[2]) / motion.dt, 0.0)  # nothing if backward
        contact = _inverse(closing * nearness_ahead(percept, flow, self._camera))
        small = self._small.find(now.full, past.full, derotated.motion, None if problems else floor)
        small = without_feet(small, percept, self._camera, scale.height, pitch)
        said = self._words.hold(percept, front, contact, known=not problems)
        percept, statements = with_nearest(said, small or ())
        return PairResult(
            number=self._number,
            past=past.name,
            now=now.name,
            time=now.frame.time,
            motion=motion,
            scale=scale,
            flow=flow,
            percept=percept,
            front=front,
            small=small,
            statements=statements,
            rotation_vector=rotation_vector(flow.motion.rotation, self._camera),
            focus=self._focus(motion, size),
            focal=self._camera.focal / size.scale,
            contact=contact,
            quadrant_contact={
                name: _inverse(closing * regions[name]["nearest"]) for name in percept.quadrants
            },
            confidence=0.0 if problems else _confidence(percept),
            known=not problems,
            notes=(*notes, *problems),
        )

    def _with_floor(self, flow: FlowField, floor: FloorMotion | None, *, lost: bool) -> FlowField:
        """Return ``flow`` (derotated) with the floor's vectors, or none where a lost one may be."""
        if floor is not None:
            return floor.apply(flow, self._camera)
        return self._floors.without_floor(flow) if lost else flow

    def _others(
        self, flow: FlowField, floor: FloorMotion | None, motion: PairMotion, way: float
    ) -> list[FlowField]:
        """Return ``flow`` (derotated) with the floor's, by other motions over ``way`` [m].

        These are as far off as the camera's motion is uncertain.
        """
        return [
            _scaled(self._with_floor(other, floor, lost=False), way)
            for other in motion.alternatives(flow, self._camera.focal)
        ]

    def _perceive(self, flow: FlowField, scale: Scale, others: Sequence[FlowField] = ()) -> Percept:
        """Return the percept of ``flow``; the nearest object is named if ``others`` show it."""
        ahead = scale.speed * float(flow.motion.translation[2]) / max(flow.motion.baseline, 1e-12)
        return self._offis_at(scale).perceive(flow, Twist(ahead, 0.0), others)

    def _without_rotation(
        self, pair: FramePair, raw: FlowField, motion: PairMotion
    ) -> tuple[FlowField, list[str]]:
        """Return the derotated flow, and reasons why it has no information about the scene."""
        camera = self._camera
        kind = motion.egomotion.kind
        if float((raw.confidence > 0.0).mean()) < _MIN_TEXTURE:
            past, now, why = pair.past.image, pair.now.image, _TEXTURELESS
            if are_alike(past, now):
                why = _MOTIONLESS
            elif has_texture(now, raw.shape):
                why = _UNRELATED
                self._words.interrupt()
            return derotate(raw, camera), [why]
        if kind is MotionKind.STILL:
            return derotate(raw, camera), [_MOTIONLESS]
        if kind is MotionKind.ROTATION:
            return derotate(raw, camera), [_ROTATING]
        if not motion.translates:
            return derotate(raw, camera), [_UNDECIDED]
        sigma = min(motion.egomotion.heading_sigma, SURE_HEADING)
        params = RefinementParams(direction_sigma=sigma)
        flow = refine(raw, camera, params).apply(raw, camera)
        before, after = float(raw.confidence.sum()), float(flow.confidence.sum())
        if after < _MIN_AGREEMENT * before:
            return flow, [_INCONSISTENT]
        return flow, [SMALL] if _fastest(flow) < MIN_PARALLAX else []

    def _focus(self, motion: PairMotion, size: WorkingSize) -> tuple[float, float] | None:
        """Return the focus of expansion [px of the original]; None if unknown or far outside."""
        direction = motion.egomotion.direction
        if not motion.has_heading or abs(direction[2]) < _MIN_AHEAD:
            return None
        x, y = size.to_image(self._camera.focal * direction[:2] / direction[2]).tolist()
        return x, y

    def _offis_at(self, scale: Scale) -> Offis:
        """Return OFFIS for a camera's height and speed, in steps of 3 %: estimates vary."""
        height, speed = scale.height, scale.speed
        pitch = self._floors.pitch or 0.0
        step = round(math.log(height) / 0.03), round(math.log(max(speed, 0.01)) / 0.03), pitch
        if step not in self._offis:
            camera = self._camera.model_copy(update={"mount_height": height, "pitch": pitch})
            robot = RobotModel(camera=camera, height=max(0.4, height + 0.05))
            walls = max(2.2, height + 0.8) if height < 10.0 else 1e6
            # the higher the camera, the farther away the visible floor begins
            path = max(2.0, 3.5 * height) if height < 10.0 else 2.0
            self._offis.clear()
            self._offis[step] = Offis(
                robot,
                Offis.Params(
                    wall_height=walls,
                    path_length=path,
                    obstacle_height=min(0.05, _OBSTACLE_SHARE * height),
                    drop_depth=min(0.08, _DROP_SHARE * height),
                    farthest=max(MAX_DISTANCE, MAX_TIME * speed, MAX_HEIGHTS * height),
                ),
            )
        return self._offis[step]

    def _choose_stride(self, raw: FlowField, flow: FlowField, motion: PairMotion) -> None:
        """Increase the stride for slow flow, decrease it for fast flow (METHOD 2.7).

        The derotated flow decides, as long as the images overlap by most of their width. If the
        motion is not found, the images may be too far apart: the stride is halved.
        """
        if self.options.stride is not None:
            return
        if motion.egomotion.kind is MotionKind.UNKNOWN:
            self._stride = max(self._stride // 2, 1)
            return
        low, high = _USEFUL_FLOW
        useful, whole = max(_fastest(flow), 0.25), max(_fastest(raw), 0.25)
        largest = _MAX_SHIFT * self._camera.width
        if low <= useful <= high and whole <= largest:
            return
        wanted = self._stride * min(0.5 * (low + high) / useful, largest / whole, 2.0)
        self._stride = min(max(round(wanted), 1), MAX_STRIDE)


def _flow_plugin(options: PerceiverOptions, registry: Registry) -> type[FlowProcessor]:
    """Return the flow processor's class; its parameters must include rows and columns."""
    plugin = cast(type[FlowProcessor], registry.get("flow", options.flow))
    if getattr(plugin, "oracle", False):
        raise InputError(
            f"{options.flow!r} needs the true depth, which images do not contain", key="--flow"
        )
    if not {"rows", "cols"} <= plugin.Params.model_fields.keys():
        raise InputError(f"{options.flow!r} has no parameters rows and cols", key="--flow")
    return plugin


def _fastest(flow: FlowField) -> float:
    """Return the 90th percentile of the length [px] of confident vectors; 0 if there are none."""
    measured = flow.confidence > 0.0
    if not measured.any():
        return 0.0
    length = np.hypot(flow.vectors[..., 0], flow.vectors[..., 1])
    return float(np.quantile(length[measured], 0.9))


def _unknown(flow: FlowField) -> FlowField:
    return replace(flow, confidence=np.zeros(flow.shape))


def _scaled(flow: FlowField, way: float) -> FlowField:
    """Return ``flow`` with its motion's translation scaled to a length of ``way`` [m]."""
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


def nearness_ahead(percept: Percept, flow: FlowField, camera: CameraModel) -> float:
    """Return the nearness [1/m] ahead: the weighted median in the middle; 0 if it is unknown."""
    shift = flow.motion.translation
    if abs(shift[2]) < _MIN_AHEAD * flow.motion.baseline:
        return 0.0
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
    """Return the confidence of a percept in [0, 1], from the mean over its cells."""
    return float(np.clip(percept.confidence.mean() / 0.7, 0.0, 1.0))
