"""Drives along exact tracks with noisy sensors, and a simulated recogniser of landmarks."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import networkx as nx
import numpy as np
import numpy.typing as npt

from navfw.egomotion import Odometer
from navfw.interfaces import Localizer
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import LandmarkDetection, Odometry, Pose, Twist, wrap_angle
from navfw.sim import SensorParams
from navfw.sim.sensor_models import GyroModel, WheelEncoderModel
from navfw.topomap import Landmark, Passage, Place, TopoMap

RATE = 60
FRAME = 6
SPEED = 0.4
TURN = 0.8


@dataclass(frozen=True)
class Moment:
    """One camera frame of a drive."""

    time: float
    true: Pose
    odometry: Odometry
    driven: float


def straight_drive(points: Sequence[tuple[float, float]]) -> Iterator[Twist]:
    """Twists per control tick from point to point, turning on the spot at each; 2 s rest first."""
    yield from [Twist(0.0, 0.0)] * (2 * RATE)
    heading: float | None = None
    for (ax, ay), (bx, by) in pairwise(points):
        wanted = math.atan2(by - ay, bx - ax)
        turn = 0.0 if heading is None else wrap_angle(wanted - heading)
        ticks = max(1, math.ceil(abs(turn) / TURN * RATE))
        yield from [Twist(0.0, turn / ticks * RATE)] * ticks
        way = math.hypot(bx - ax, by - ay)
        ticks = max(1, math.ceil(way / SPEED * RATE))
        yield from [Twist(way / ticks * RATE, 0.0)] * ticks
        heading = wanted


def turn_round() -> list[Twist]:
    """Twists for one turn on the spot."""
    ticks = round(2.0 * math.pi / TURN * RATE)
    return [Twist(0.0, 2.0 * math.pi / ticks * RATE)] * ticks


def drive(
    start: Pose,
    twists: Iterable[Twist],
    rng: np.random.Generator,
    sensors: SensorParams | None = None,
) -> Iterator[Moment]:
    """The camera frames of a drive with noisy gyro and encoders; the drive itself is exact."""
    robot, sensors = RobotModel(), sensors or SensorParams()
    gyro, wheels = GyroModel(sensors, rng), WheelEncoderModel(sensors, robot, rng)
    odometer = Odometer(robot)
    true, angles, driven, dt = start, [0.0, 0.0], 0.0, 1.0 / RATE
    twist = Twist(0.0, 0.0)
    for tick, following in enumerate(twists):
        time = tick * dt
        inertial = gyro.read(time, dt if tick else 0.0, (0.0, 0.0, twist.w))
        encoders = wheels.read(time, dt, (angles[0], angles[1]))
        odometry = odometer.update(inertial, encoders, twist)
        if tick % FRAME == 0:
            yield Moment(time, true, odometry, driven)
        twist = following
        true = true.compose(step(twist.v, twist.w, dt))
        for side, speed in enumerate(robot.wheel_speeds(twist)):
            angles[side] += speed * dt
        driven += abs(twist.v) * dt


def step(v: float, w: float, dt: float = 0.1) -> Pose:
    """The motion in ``dt`` [s]."""
    return Pose(v * dt * math.cos(0.5 * w * dt), v * dt * math.sin(0.5 * w * dt), w * dt)


def odometry(pose: Pose, time: float = 0.0, v: float = 0.0, *, still: bool = False) -> Odometry:
    """Odometry of a robot that drives straight on with ``v`` [m/s]."""
    return Odometry(time, pose, Twist(v, 0.0), yaw_bias=0.0, still=still)


def detection(mark: Landmark, at: Pose, time: float) -> LandmarkDetection:
    """What a robot at the pose ``at`` detects of ``mark``: the truth, with sigmas."""
    x, y = at.to_local(mark.x, mark.y)
    noise = np.diag((0.01**2, 0.05**2))
    return LandmarkDetection(time, mark.identity, math.atan2(y, x), math.hypot(x, y), noise)


@dataclass
class FakeRecognizer:
    """Detects landmarks within 4 m, in the field of view and from their front, with noise.

    ``confused`` is the share of wrong identities; a fifth of the landmarks is missed.
    """

    landmarks: Sequence[Landmark]
    rng: np.random.Generator
    confused: float = 0.002
    frames: int = 0

    def __call__(self, time: float, true: Pose) -> list[LandmarkDetection]:
        """The detections of every second frame."""
        self.frames += 1
        return [] if self.frames % 2 else list(self._detections(time, true))

    def _detections(self, time: float, true: Pose) -> Iterator[LandmarkDetection]:
        for mark in self.landmarks:
            x, y = true.to_local(mark.x, mark.y)
            distance, bearing = math.hypot(x, y), math.atan2(y, x)
            facing = wrap_angle(math.atan2(true.y - mark.y, true.x - mark.x) - mark.yaw)
            hidden = distance > 4.0 or distance < 0.4
            if hidden or abs(bearing) > math.radians(42.0) or abs(facing) > math.radians(65.0):
                continue
            if self.rng.random() < 0.2:
                continue
            identity = mark.identity
            if self.rng.random() < self.confused:
                identity = self.landmarks[int(self.rng.integers(len(self.landmarks)))].identity
            sigma = 0.03 * distance
            yield LandmarkDetection(
                time,
                identity,
                bearing + 0.01 * float(self.rng.standard_normal()),
                distance + sigma * float(self.rng.standard_normal()),
                np.diag((0.01**2, sigma**2)),
            )


def displaced(
    landmarks: Sequence[Landmark], share: float, rng: np.random.Generator
) -> list[Landmark]:
    """The landmarks of the world: this share is displaced or, every third of them, missing."""
    wrong = rng.permutation(len(landmarks))[: max(1, round(share * len(landmarks)))]
    real = list(landmarks)
    gone = []
    for number, index in enumerate(wrong.tolist()):
        mark, angle = real[index], float(rng.uniform(-math.pi, math.pi))
        away = 2.0 * float(rng.uniform(0.3, 1.5))
        x, y = mark.x + away * math.cos(angle), mark.y + away * math.sin(angle)
        if number % 3 == 2:
            gone.append(index)
        real[index] = Landmark(mark.name, mark.kind, mark.id, x, y, mark.yaw)
    return [mark for index, mark in enumerate(real) if index not in gone]


def with_landmarks(topo_map: TopoMap, landmarks: Iterable[Landmark]) -> TopoMap:
    """The same map with these landmarks."""
    return TopoMap(
        topo_map.name, topo_map.places.values(), topo_map.passages, topo_map.file, landmarks
    )


def corridor_landmarks(points: Sequence[tuple[float, float]]) -> list[Landmark]:
    """Landmarks every 6 m beside the line through ``points``, on alternate sides, facing across."""
    marks: list[Landmark] = []
    for (ax, ay), (bx, by) in pairwise(points):
        length = math.hypot(bx - ax, by - ay)
        ux, uy = (bx - ax) / length, (by - ay) / length
        for along in np.arange(3.0, length, 6.0):
            side = 1.0 if len(marks) % 2 else -1.0
            x, y = ax + along * ux - side * 1.1 * uy, ay + along * uy + side * 1.1 * ux
            # turned a little toward the approaching robot
            yaw = math.atan2(-side * ux - uy, side * uy - ux)
            marks.append(Landmark(f"mark-{len(marks)}", "aruco", len(marks), x, y, yaw))
    return marks


def place_landmarks(topo_map: TopoMap) -> list[Landmark]:
    """A landmark a metre beside every second place that is not a door, facing it."""
    rng = np.random.default_rng(5)
    marks: list[Landmark] = []
    for index, place in enumerate(topo_map.places.values()):
        if index % 2 or place.kind in {"door", "danger"}:
            continue
        angle = float(rng.uniform(-math.pi, math.pi))
        x, y = place.x + math.cos(angle), place.y + math.sin(angle)
        yaw = wrap_angle(angle + math.pi)
        marks.append(Landmark(f"mark-{len(marks)}", "aruco", len(marks), x, y, yaw))
    return marks


def tour(topo_map: TopoMap, rng: np.random.Generator, goals: int) -> list[tuple[float, float]]:
    """The points of a tour from a random place by the shortest paths to random goals."""
    names = [p.name for p in topo_map.places.values() if p.kind not in {"door", "danger"}]
    here = names[int(rng.integers(len(names)))]
    way = [here]
    for _ in range(goals):
        there = names[int(rng.integers(len(names)))]
        way += nx.shortest_path(topo_map.graph, here, there, weight="length")[1:]
        here = there
    return [(topo_map.places[name].x, topo_map.places[name].y) for name in way]


@dataclass(frozen=True)
class Report:
    """A localiser's results on a drive: one entry per camera frame."""

    time: Array
    driven: Array
    error: Array
    nees: Array
    confidence: Array
    lost: npt.NDArray[np.bool_]
    updates: int

    @property
    def totals(self) -> tuple[float, float, float, float, int]:
        """Sums of errors, nees, confidences and losses, and the number of updates."""
        sums = [float(column.sum()) for column in (self.error, self.nees, self.confidence)]
        return (*sums, float(self.lost.sum()), self.updates)  # type: ignore[return-value]

    @property
    def localized_at(self) -> int | None:
        """The first frame with confidence of at least 0.9 and an error of at most 1 m."""
        right = np.flatnonzero((self.confidence >= 0.9) & (self.error <= 1.0))
        return int(right[0]) if len(right) else None

    @property
    def confidently_wrong(self) -> float:
        """Time [s] with confidence of at least 0.9 and an error above 1 m."""
        return 0.1 * float(((self.confidence >= 0.9) & (self.error > 1.0)).sum())


def follow(
    localizer: Localizer,
    topo_map: TopoMap,
    moments: Iterable[Moment],
    recognizer: FakeRecognizer,
    start: Pose | None,
) -> Report:
    """Run ``localizer`` on a drive."""
    localizer.reset()
    rows: list[tuple[float, ...]] = []
    updates = 0
    for moment in moments:
        if not rows:
            localizer.start(topo_map, start, moment.odometry)
        detections = recognizer(moment.time, moment.true)
        belief = localizer.update(moment.odometry, None, detections)
        pose, true = belief.pose, moment.true
        off = np.array((pose.x - true.x, pose.y - true.y, wrap_angle(pose.yaw - true.yaw)))
        nees = float(off @ np.linalg.solve(belief.covariance, off))
        error = float(np.hypot(off[0], off[1]))
        rows.append((moment.time, moment.driven, error, nees, belief.confidence, belief.lost))
        updates = belief.updates
    time, driven, position_error, nees, confidence, lost = np.array(rows).T
    return Report(time, driven, position_error, nees, confidence, lost > 0.0, updates)


RING = [(0.0, 0.0), (14.0, 0.0), (14.0, 8.0), (0.0, 8.0), (0.0, 0.0)]
CORNERS = [Place(f"corner-{i}", *point) for i, point in enumerate(RING[:4])]
SIDES = [
    Passage(a.name, b.name, math.hypot(a.x - b.x, a.y - b.y), 2.0)
    for a, b in zip(CORNERS, [*CORNERS[1:], CORNERS[0]], strict=True)
]
MARKS = corridor_landmarks(RING)
HALL = TopoMap("ring", CORNERS, SIDES, landmarks=MARKS)
START = Pose(0.0, 0.0, 0.0)
