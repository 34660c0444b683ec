"""From images to what OFFIS makes of them: one result a pair of images."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from navfw.errors import InputError
from navfw.flow.derotation import derotate
from navfw.interfaces import FlowProcessor
from navfw.offis.offis import Offis
from navfw.perceive.gyro_record import GyroRecord
from navfw.perceive.image_sources import ImageSource, SourceImage
from navfw.perceive.pair_motion import (
    assumed_motion,
    estimate_rotation,
    expansion_focus,
    forward_share,
)
from navfw.perceive.scale import Scale, ScaleEstimator, floor_ratio
from navfw.perceive.working_size import HFOV, WorkingSize
from navfw.plugins import Registry
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Array, CameraMotion, FlowField, Frame, FramePair, Label, Percept, Twist

__all__ = ["PairResult", "Perceiver", "PerceiverOptions"]

LEAST_MOTION = 0.25
"""Where the fastest tenth of the flow is slower than this, nothing moves [px]."""
LEAST_CONFIDENCE = 0.08
"""Below this confidence a result says nothing."""
LEAST_TEXTURE = 0.08
"""Share of the cells that must have a flow at all."""
LEAST_AGREEMENT = 0.6
"""Share of the flow that must agree with the motion for the result to say anything."""
USEFUL_FLOW = (2.0, 5.0)
"""The fastest tenth of the flow is sought between these, by the choice of the pair [px]."""
TEXTURELESS = "too little texture to see any motion"
MOTIONLESS = "nothing moves between the images"
BACKWARD = "the camera moves backward"
LARGEST_FLOW = 6.5
"""The fastest tenth of the flow, rotation included, is kept below this [px]."""
LONGEST = 15
"""Most images from the first of a pair to the second."""
BASELINE = 0.08
"""Way between the images of a pair that is sought at first, where the speed is known [m]."""


@dataclass(frozen=True, slots=True)
class PerceiverOptions:
    """What is known about the camera and its motion.

    ``hfov`` [deg] of the images as they come; ``speed`` [m/s] ahead, None or 0 when unknown;
    ``height`` [m] of the camera above the floor, None when unknown; ``pitch`` [deg] nose down;
    ``flow`` the plugin, on a grid of ``rows`` x ``cols``; ``stride``: from the first to the second
    image of a pair, None to choose it by the flow.

    Raises:
        InputError: a value is out of its range.

    """

    hfov: float = 65.0
    speed: float | None = None
    height: float | None = None
    pitch: float = 0.0
    flow: str = "block_matching"
    rows: int = 12
    cols: int = 16
    stride: int | None = None
    gyro: GyroRecord | None = None

    def __post_init__(self) -> None:
        for option, value, low, high, unit in (
            ("--hfov", self.hfov, *HFOV, "deg"),
            ("--speed", self.speed, 0.0, 100.0, "m/s"),
            ("--height", self.height, 0.05, 20.0, "m"),
            ("--pitch", self.pitch, -45.0, 45.0, "deg"),
            ("--grid rows", self.rows, 4, 60, "cells"),
            ("--grid columns", self.cols, 4, 80, "cells"),
            ("--stride", self.stride, 1, LONGEST, "images"),
        ):
            if value is not None and not low <= value <= high:
                raise InputError(
                    f"must be between {low:g} and {high:g} {unit}, got {value:g}", key=option
                )


@dataclass(frozen=True, slots=True)
class PairResult:
    """Everything computed from one pair of images.

    ``flow`` is derotated and refers to the working image. ``focus`` (x, y) is the focus of
    expansion [px from the top left of the original image], None where it is unknown.
    ``rotation_vector`` (3,) [rad] is the camera's rotation about base_link's x, y, z (roll, pitch,
    yaw); ``turn_source`` tells whether "gyro" or "flow" measured it. ``contact`` [s] is the time to
    contact with the surface straight ahead, ``quadrant_contact`` [s] that of the nearest part of
    each quadrant; both are inf where nothing approaches. ``confidence`` is in [0, 1]. If ``known``
    is false, the percept is "unknown" and ``notes`` give the reason.
    """

    number: int
    past: str
    now: str
    time: float
    dt: float
    scale: Scale
    flow: FlowField
    percept: Percept
    rotation_vector: Array
    turn_source: str
    focus: tuple[float, float] | None
    contact: float
    quadrant_contact: dict[str, float]
    confidence: float
    known: bool
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Prepared:
    name: str
    frame: Frame


class Perceiver:
    """Looks at images one after the other. Construct one for each sequence.

    Raises:
        InputError: the flow plugin is unknown, needs more than images, or has another grid.

    """

    def __init__(self, options: PerceiverOptions, source: ImageSource, registry: Registry) -> None:
        self.options = options
        self._source = source
        self._plugin = _flow_plugin(options, registry)
        self._memory = ScaleEstimator(options.speed or None, options.height)
        self._stride = options.stride or self._first_stride()
        self.size: WorkingSize | None = None

    def results(self) -> Iterator[tuple[SourceImage, PairResult]]:
        """Every image but the first, with what it and an earlier one show together.

        Raises:
            InputError: the images cannot be read, do not fit together, or are too small.

        """
        earlier: deque[_Prepared] = deque(maxlen=LONGEST)
        for item in self._source:
            if self.size is None:
                self._look_at_first(item)
            assert self.size is not None  # noqa: S101 - set above
            prepared = _Prepared(item.name, Frame(item.time, self.size.prepare(item.image)))
            if earlier:
                past = earlier[-min(self._stride, len(earlier))]
                result = self._look(item, past, prepared)
                yield item, result
            earlier.append(prepared)

    def _look_at_first(self, item: SourceImage) -> None:
        height, width = item.image.shape[:2]
        o = self.options
        self.size = size = WorkingSize.of(width, height, o.rows, o.cols)
        rate = min(max(self._source.rate, 0.01), 1e4)
        self._camera = size.camera(math.radians(o.hfov), 1.0, math.radians(o.pitch), rate)
        self._processor = self._plugin(RobotModel(camera=self._camera))
        self._offis: dict[float, Offis] = {}
        self._number = 0
        self._rate = np.zeros(3)

    def _look(self, item: SourceImage, past: _Prepared, now: _Prepared) -> PairResult:
        """Flow, its rotation, its scale, and what OFFIS makes of it."""
        self._number += 1
        begin, end = past.frame.time, now.frame.time
        rotation_vector, measured, notes = self._predicted_rotation(begin, end)

        def assume(way: float) -> CameraMotion:
            # the way only says in which direction; its length follows when the scale is known
            return assumed_motion(self._camera, way, end - begin, rotation_vector, bool(measured))

        raw = self._processor.compute(FramePair(past.frame, now.frame, assume(1.0)))
        flow, doubts = self._without_rotation(raw, measured)
        if doubts == [TEXTURELESS] and _alike(past.frame, now.frame):
            doubts = [MOTIONLESS]
        if doubts == [BACKWARD]:
            flow, doubts = self._without_rotation(replace(raw, motion=assume(-1.0)), measured)
            notes += [] if doubts else [BACKWARD]
        self._choose_stride(raw, flow)
        self._rate = _rotation_vector(flow.motion, self._camera) / (end - begin)
        ratio = None if doubts else floor_ratio(flow, self._camera)
        scale = self._memory.update(None if ratio is None else ratio / (end - begin))
        flow = _scaled(flow, scale.speed * (end - begin))
        percept = self._interpret(flow, scale, silent=bool(doubts))
        if not doubts and _confidence(percept) < LEAST_CONFIDENCE:
            doubts = ["too little of the flow can be trusted"]
            percept = self._interpret(flow, scale, silent=True)
        return self._result(past, now, scale, flow, percept, notes, doubts, bool(measured))

    def _interpret(self, flow: FlowField, scale: Scale, *, silent: bool) -> Percept:
        """What OFFIS makes of ``flow``; ``silent``: of nothing at all, which it calls unknown."""
        if silent:
            flow = replace(flow, confidence=np.zeros(flow.shape))
        ahead = math.copysign(scale.speed, flow.motion.translation[2])
        return self._offis_at(scale.height).perceive(flow, Twist(ahead, 0.0))

    def _predicted_rotation(
        self, begin: float, end: float
    ) -> tuple[Array, frozenset[str], list[str]]:
        """The turn [rad] between two times, the names of the rates that are measured, and notes."""
        guess = self._rate * (end - begin)
        gyro = self.options.gyro
        if gyro is None:
            return guess, frozenset(), []
        rotation_vector = gyro.rotation_between(begin, end)
        if rotation_vector is None:
            return guess, frozenset(), ["the gyro's record has a gap: turn taken from the flow"]
        return rotation_vector, gyro.measured, []

    def _without_rotation(
        self, raw: FlowField, measured: frozenset[str]
    ) -> tuple[FlowField, list[str]]:
        """The derotated flow, and why it says nothing about the scene, if so."""
        camera = self._camera
        if float((raw.confidence > 0.0).mean()) < LEAST_TEXTURE:
            return derotate(raw, camera), [TEXTURELESS]
        if _fastest(raw) < LEAST_MOTION:
            return derotate(raw, camera), [MOTIONLESS]
        refinement = estimate_rotation(raw, camera, measured)
        flow = refinement.apply(raw, camera)
        before, after = float(raw.confidence.sum()), float(flow.confidence.sum())
        if _fastest(flow) < LEAST_MOTION:
            return flow, ["the camera only turns: no distance can be seen"]
        forward = forward_share(flow, camera.focal)
        if forward < 1.0 - LEAST_AGREEMENT:
            return flow, [BACKWARD]
        if forward < LEAST_AGREEMENT or after < 0.5 * LEAST_AGREEMENT * before:
            return flow, ["the flow does not fit a camera that moves straight"]
        return flow, []

    def _result(
        self,
        past: _Prepared,
        now: _Prepared,
        scale: Scale,
        flow: FlowField,
        percept: Percept,
        notes: list[str],
        doubts: list[str],
        measured: bool,
    ) -> PairResult:
        assert self.size is not None  # noqa: S101 - a result needs two images
        known = not doubts
        focus = expansion_focus(flow) if known else None
        place: tuple[float, float] | None = None
        if focus is not None and focus.sigma < 0.25 * self._camera.width:
            x, y = self.size.to_image(np.array([focus.x, focus.y])).tolist()
            place = x, y
        regions = percept.explanation["regions"]
        # backing out, nothing comes nearer
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
            turn_source="gyro" if measured else "flow",
            focus=place,
            contact=_over(1.0, closing * _nearness_ahead(percept, flow, self._camera)),
            quadrant_contact={
                name: _over(1.0, closing * regions[name]["nearest"]) for name in percept.quadrants
            },
            confidence=_confidence(percept) if known else 0.0,
            known=known,
            notes=(*notes, *doubts),
        )

    def _offis_at(self, height: float) -> Offis:
        """OFFIS for a camera at ``height`` [m]; heights from the floor vary, so in steps of 3 %."""
        step = round(math.log(height) / 0.03)
        if step not in self._offis:
            camera = self._camera.model_copy(update={"mount_height": height})
            robot = RobotModel(camera=camera, height=max(0.4, height + 0.05))
            walls = max(2.2, height + 0.8) if height < 10.0 else 1e6
            # from higher up, the floor comes into view farther away
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
        """Farther apart when the flow is slow, nearer when it is fast (METHOD 2.7).

        What counts is the flow without rotation, as long as the whole stays within the search.
        """
        if self.options.stride is not None:
            return
        low, high = USEFUL_FLOW
        useful, whole = max(_fastest(flow), 0.25), max(_fastest(raw), 0.25)
        if low <= useful <= high and whole <= LARGEST_FLOW:
            return
        wanted = self._stride * min(0.5 * (low + high) / useful, LARGEST_FLOW / whole, 2.0)
        self._stride = min(max(round(wanted), 1), LONGEST)


def _flow_plugin(options: PerceiverOptions, registry: Registry) -> Any:
    """A factory of the flow processor, with the grid that is wanted."""
    plugin = registry.get("flow", options.flow)
    if getattr(plugin, "oracle", False):
        raise InputError(
            f"{options.flow!r} needs the true depth, which images do not have", key="--flow"
        )
    grid = {"rows": options.rows, "cols": options.cols}
    if not grid.keys() <= plugin.Params.model_fields.keys():
        raise InputError(f"{options.flow!r} has no rows and cols to set", key="--flow")
    params = plugin.Params.model_validate(grid)
    return lambda robot: cast(FlowProcessor, plugin(robot, params))


def _fastest(flow: FlowField) -> float:
    """Length [px] that a tenth of the trusted vectors exceed; 0 when none is trusted."""
    trusted = flow.confidence > 0.0
    if not trusted.any():
        return 0.0
    length = np.hypot(flow.vectors[..., 0], flow.vectors[..., 1])
    return float(np.quantile(length[trusted], 0.9))


def _alike(past: Frame, now: Frame) -> bool:
    """Whether two images differ by noise at most, though there is something to see in them."""
    change = np.abs(now.image.astype(np.int16) - past.image).mean()
    return bool(change < 0.1 * now.image.std() and now.image.std() > 4.0)


def _scaled(flow: FlowField, way: float) -> FlowField:
    """``flow`` with a translation of ``way`` [m] in the direction that its motion has."""
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
    """Nearness [1/m] of what is straight ahead: the weighted median over the image's middle."""
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


def _over(one: float, other: float) -> float:
    return one / other if other > 1e-6 else math.inf


def _confidence(percept: Percept) -> float:
    """How much of the image is understood, in [0, 1]."""
    return float(np.clip(percept.confidence.mean() / 0.7, 0.0, 1.0))


def _rotation_vector(motion: CameraMotion, camera: CameraModel) -> Array:
    """The turn (3,) [rad] about base_link's x, y, z that ``motion`` has."""
    base = camera.base_from_camera
    r = base @ motion.rotation.T @ base.T
    axis = 0.5 * np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    sine = float(np.linalg.norm(axis))
    return np.asarray(axis if sine < 1e-9 else axis * (math.asin(min(sine, 1.0)) / sine))
