"""What a bag's sensors measured, as the readings of a robot at its control rate."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import cv2
import numpy as np

from navfw.errors import ConfigError, InputError
from navfw.numerics import Array, Image
from navfw.perceive import Undistortion, bag_calibration
from navfw.recording.bag_contents import BagContents, BagImage, driven_way
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Encoders, Frame, Inertial, SensorReading
from navfw.topomap import Passage, Place, TopoMap

_GAP = 0.5
"""Time [s] without a reading of the wheels from which on they are silent; between two that are
nearer, counts are interpolated: a drive has them one interval later."""
_SLACK = 1e-6
"""Rounding of times [s]."""
_DELAY = 1.0
"""Largest time [s] from the stamp of an image to its reception, on one clock."""
_LEG = 2.0
"""Distance [m] of the places along a way that was driven."""
_SHAPE = 0.01
"""Largest relative difference of the shapes of two images."""


class BagReadings:
    """The readings of ``robot`` in a bag; an iterable, which may be read again.

    ``robot`` has the field of view of the bag's camera_info where there is one, and images are then
    without distortion. With ``landmarks`` there are the larger frames of recognisers as well.

    Raises:
        InputError: the images have another shape than the camera's.

    """

    def __init__(self, contents: BagContents, robot: RobotModel) -> None:
        self.landmarks = False
        self._contents = contents
        self._straighten: Undistortion | None = None
        first = next(contents.each_image(), None) if contents.images else None
        self.robot = robot if first is None else self._as_calibrated(robot, first)
        self._wheels = contents.wheels(robot)
        self._per_way = robot.ticks_per_turn / (2.0 * math.pi * robot.wheel_radius)
        self.begin = float(self._wheels[0, 0]) if len(self._wheels) else 0.0
        silent = contents.bag.duration - (self._wheels[-1, 0] if len(self._wheels) else 0.0)
        if silent > _GAP:
            contents.notes.append(f"the wheels are silent for the last {silent:.1f} s")

    def __len__(self) -> int:
        span = self._contents.bag.duration - self.begin
        return max(int(span * self.robot.control_rate) + 1, 1)

    def __iter__(self) -> Iterator[SensorReading]:
        images = self._contents.each_image() if self._contents.images else iter(())
        ahead, next_landmarks = next(images, None), -math.inf
        last = -math.inf
        for tick in range(len(self)):
            now = self.begin + tick / self.robot.control_rate
            newest = None
            while ahead is not None and _due(ahead) <= now + _SLACK:
                newest, ahead = ahead, next(images, None)
            frame = None if newest is None else self._frame(newest, self.robot.camera)
            large = None
            if self.landmarks and newest is not None and now >= next_landmarks:
                next_landmarks = now + 1.0 / self.robot.landmark_camera.rate - _SLACK
                large = self._frame(newest, self.robot.landmark_view)
            yield SensorReading(now, self._inertial(last, now), self._encoders(now), frame, large)
            last = now

    def _inertial(self, last: float, now: float) -> Inertial:
        """The mean rates since ``last`` [s], or the last ones before."""
        gyro = self._contents.turning
        begin, end = np.searchsorted(gyro[:, 0], [last + _SLACK, now + _SLACK]).tolist()
        if end == 0:
            return Inertial(self.begin, math.nan, math.nan, math.nan)
        rates = gyro[min(begin, end - 1) : end, 1:].mean(axis=0)
        return Inertial(float(gyro[end - 1, 0]), *rates.tolist())

    def _encoders(self, now: float) -> Encoders:
        wheels = self._wheels
        after = int(np.searchsorted(wheels[:, 0], now + _SLACK))
        if after == 0:
            return Encoders(self.begin, 0, 0)
        time, ways = float(wheels[after - 1, 0]), wheels[after - 1, 1:]
        if after < len(wheels) and wheels[after, 0] - time <= _GAP:
            share = max(now - time, 0.0) / (wheels[after, 0] - time)
            time, ways = now, ways + share * (wheels[after, 1:] - ways)
        left, right = np.rint(self._per_way * ways).astype(int).tolist()
        return Encoders(min(time, now), left, right)

    def _frame(self, item: BagImage, camera: CameraModel) -> Frame | None:
        """The image as ``camera`` takes it; None, and a note, if it is damaged."""
        try:
            image = item.image()
        except InputError as error:
            self._contents.notes.append(f"an image is left out: {error}")
            return None
        if self._straighten is not None:
            image = self._straighten.apply(image)
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        size = camera.width, camera.height
        if grey.shape[::-1] != size:
            grey = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
        return Frame(item.time, np.asarray(grey, dtype=np.uint8))

    def _as_calibrated(self, robot: RobotModel, first: BagImage) -> RobotModel:
        image, camera = first.image(), robot.camera
        self._check_shape(image, camera)
        calibration = bag_calibration(self._contents)
        if calibration is None:
            return robot
        height, width = image.shape[:2]
        if calibration.coefficients.any():
            self._straighten = Undistortion(calibration, width, height)
            hfov = self._straighten.hfov
        else:
            full = width if calibration.size is None else calibration.size[0]
            hfov = 2.0 * math.atan(0.5 * full / float(calibration.matrix[0, 0]))
        if abs(hfov - camera.hfov) > math.radians(1.0):
            here, there = math.degrees(hfov), math.degrees(camera.hfov)
            self._contents.notes.append(
                f"camera_info gives {here:.1f} degrees across, the robot {there:.1f}:"
                " the former is used"
            )
            return robot.with_camera(camera.model_copy(update={"hfov": hfov}))
        return robot

    def _check_shape(self, image: Image, camera: CameraModel) -> None:
        height, width = image.shape[:2]
        if abs(width * camera.height / (height * camera.width) - 1.0) > _SHAPE:
            raise ConfigError(
                f"its images are {width} x {height}, of another shape than the robot's camera"
                f" ({camera.width} x {camera.height}); give width and height of camera in a robot"
                " file",
                file=self._contents.bag.file,
                key="--robot",
            )


def _due(item: BagImage) -> float:
    """When an image was delivered [s]: as received, if stamps are on the same clock."""
    return item.received if 0.0 <= item.received - item.time <= _DELAY else item.time


def driven_map(odometry: Array) -> TopoMap:
    """A map of the way that was driven, from its start at the origin, a place every two metres.

    ``odometry`` (n, 4) is as in ``BagContents``. Without a way it leads two metres ahead.
    """
    points = [(0.0, 0.0)]
    if len(odometry):
        c, s = math.cos(odometry[0, 3]), math.sin(odometry[0, 3])
        away = odometry[:, 1:3] - odometry[0, 1:3]
        local = np.column_stack([c * away[:, 0] + s * away[:, 1], c * away[:, 1] - s * away[:, 0]])
        way = np.abs(np.diff(driven_way(odometry), prepend=0.0)).cumsum()
        at = np.searchsorted(way, np.arange(_LEG, way[-1], _LEG)).tolist()
        for x, y in local[[*at, -1]].tolist():
            if math.hypot(x - points[-1][0], y - points[-1][1]) > 0.25 * _LEG:
                points.append((x, y))
    if len(points) < 2:
        points.append((_LEG, 0.0))
    places = [Place(f"driven-{number}", x, y) for number, (x, y) in enumerate(points)]
    legs = pairwise(places)
    passages = [Passage(a.name, b.name, a.distance(b.x, b.y)) for a, b in legs]
    return TopoMap("driven", places, passages)
