"""Convert ROS messages to a stack's readings, and goals to waypoints; without rclpy.

Images, rates and wheels have clocks and faults of their own: each is checked when it comes.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from navfw.errors import ConfigError, InputError
from navfw.numerics import Array
from navfw.recording import planar_pose, turn_rates
from navfw.recording.ros_messages import wheel_joints
from navfw.recording.static_frames import BASES, StaticFrames
from navfw.robot import RobotModel
from navfw.ros.camera_images import CameraImages, grey_image
from navfw.signals import Encoders, Frame, Inertial, SensorReading, Waypoint
from navfw.topomap import TopoMap
from navfw.topomap.occupancy_map import FREE

TOLERANCE = 0.3
"""Distance [m] from a goal that was sent within which it counts as reached."""
_CLOCKS = 1.0
"""Difference [s] of a stamp from the time of its reception from which stamps are not used."""
_JUMP = 1.0
"""Backward step [s] of the clock beyond which it counts as started anew."""
_MAX_ROWS = 1000
"""Messages of gyro and wheels that wait for each other."""
_MAX_TICKS = 1e12
"""Largest count of an encoder that is accepted."""
_FASTER, _BURST = 3.0, 0.3
"""Largest speed of wheels, over the top speed, and delay [s] of messages that come at once: ticks
counted by their reception then come in no time."""


class SensorInputs:
    """Holds the newest messages of one robot's sensors, and makes its ``SensorReading``s.

    Times are those of stamps [s] from the first message on; ``shift`` [s] is added to them, so that
    time never goes back, even when a simulated clock begins anew. ``note`` is called with remarks
    for people. ``snap`` [Hz]: stamps are multiples of 1 / ``snap``, exactly, not of nanoseconds.
    ``images`` is the full name of the topic of images, ``camera`` converts them.
    """

    def __init__(
        self,
        robot: RobotModel,
        note: Callable[[str], None],
        joints: Sequence[str] = (),
        imu_rpy: Sequence[float] = (0.0, 0.0, 0.0),
        snap: float = 0.0,
        images: str = "image",
    ) -> None:
        self._robot, self._note, self._snap = robot, note, snap
        self._joints = (joints[:1], joints[1:2]) if joints else wheel_joints(robot)
        turn = Rotation.from_euler("xyz", imu_rpy).as_matrix()
        self._axes: Array | None = turn if any(imu_rpy) else None
        self._mounts = StaticFrames()
        self._begin = 0.0 if snap else None
        self._last: dict[str, float] = {}
        self._agreed = set[str]()
        self._rates: deque[tuple[float, ...]] = deque(maxlen=_MAX_ROWS)
        self._inertial = Inertial(0.0, math.nan, math.nan, math.nan)
        self._ticks = self._zero = np.zeros(2)
        self._rolled: deque[tuple[float, Array]] = deque(maxlen=_MAX_ROWS)
        self._read: list[tuple[float, Array]] = []
        self._odometry: tuple[float, float, float] | None = None
        self._lost = self._waited = self._odd = False
        self.camera = CameraImages(robot.camera, images, note)
        self._frame: Frame | None = None
        self._landmarks: Frame | None = None
        self.shift = 0.0

    def time_of(self, topic: str, stamp: Any, now: float) -> float | None:
        """Return the time [s] of a message that came at ``now`` [s]; None if ``stamp`` goes back.

        A stamp of another clock is replaced by its reception; if clocks have agreed, one that lags
        behind comes late. A simulated clock is at 0 before it is heard.
        """
        time = float(stamp.sec) + 1e-9 * float(stamp.nanosec)
        behind = math.inf if topic in self._agreed else _CLOCKS
        if self._snap:
            time = round(time * self._snap) / self._snap
        elif now > 0.0 and -_CLOCKS <= now - time <= behind:
            self._agreed.add(topic)
        elif now > 0.0:
            where = "behind" if time < now else "ahead of"
            what = f"the clock of {topic} is {abs(time - now):.3g} s {where} this node's"
            self._note(f"{what}: its messages count from their reception")
            time = now
        self._begin = time if self._begin is None else self._begin
        time += self.shift - self._begin
        if time < self._last.get(topic, -math.inf) - _JUMP:
            self._restart(topic, time)
            time = self._last[topic]
        elif time <= self._last.get(topic, -math.inf):
            self._note(f"stamps on {topic} go back: such messages are left out")
            return None
        self._last[topic] = time
        return time

    def _restart(self, topic: str, time: float) -> None:
        """Go on from the newest time: the clock has begun anew, and with it the wheels."""
        self._note(f"the clock of {topic} went back by more than {_JUMP:g} s: it has begun anew")
        newest = max(self._last.values())
        self.shift += newest - time + 1.0 / self._robot.control_rate
        self._last = {topic: newest + 1.0 / self._robot.control_rate}
        self._zero, self._odometry = self._ticks.copy(), None
        self._rates.clear()

    def image(self, topic: str, message: Any, now: float, *, landmarks: bool = False) -> None:
        """Take an image message that came at ``now`` [s], for ``landmarks`` or the camera's."""
        time = self.time_of(topic, message.header.stamp, now)
        if time is None:
            return
        try:
            grey = grey_image(message, topic)
            if landmarks:
                self._landmarks = Frame(time, grey)
                return
            self._frame = Frame(time, self.camera.taken(grey))
        except (ConfigError, cv2.error, ValueError) as error:
            self._note(f"images on {topic} are left out: {error}")

    def imu(self, topic: str, message: Any, now: float) -> None:
        """Take rates of an ``Imu`` that came at ``now`` [s], rotated into base_link's axes."""
        rates = np.array((*turn_rates(message), math.nan, math.nan)[:3])
        axes = self._axes_of(topic, message.header.frame_id.lstrip("/"))
        turned = axes @ rates if np.isfinite(rates).all() else rates
        if not math.isfinite(turned[2]):
            self._note(f"rates on {topic} are not numbers: such messages are left out")
            return
        if (time := self.time_of(topic, message.header.stamp, now)) is not None:
            self._rates.append((time, *turned.tolist()))

    def mounts(self, message: Any) -> None:
        """Take static transforms, a ``TFMessage``: they contain how the IMU is mounted."""
        if not self._mounts.add(message):
            self._note("a transform on /tf_static is left out: its rotation is none")

    def _axes_of(self, topic: str, frame: str) -> Array:
        """Return the axes of ``frame`` in base_link, as the columns of a rotation (3, 3)."""
        if self._axes is not None:
            return self._axes
        for above, axes in self._mounts.above(frame).items():
            if above in BASES or not above:
                return axes
        what = f"no transform from {frame[:40]!r} to base_link on /tf_static"
        self._note(f"{what}: rates on {topic} count as base_link's, or set imu_rpy")
        return np.eye(3)

    def joints(self, topic: str, message: Any, now: float) -> bool:
        """Take a ``JointState`` that came at ``now`` [s]; return whether it has the wheels."""
        angles = []
        names, positions = list(message.name), np.asarray(message.position, dtype=np.float64)
        for side in self._joints:
            at = next((names.index(joint) for joint in side if joint in names), None)
            if at is None or at >= len(positions):
                what = f"no position of {' or '.join(side) or 'a wheel'} on {topic}"
                self._note(f"{what}: set wheel_joints, of {', '.join(names[:6])}")
                return False
            angles.append(positions[at])
        per_angle = self._robot.ticks_per_turn / (2.0 * math.pi)
        return self._wheels(topic, message, now, np.array(angles) * per_angle)

    def odometry(self, topic: str, message: Any, now: float) -> bool:
        """Take distances and turns of an ``Odometry`` that came at ``now`` [s]; return if valid."""
        x, y, yaw = planar_pose(message)
        if not all(map(math.isfinite, (x, y, yaw))):
            self._note(f"poses on {topic} are not numbers: such messages are left out")
            return False
        rolled = np.zeros(2)
        if self._odometry is not None:
            turn = math.remainder(yaw - self._odometry[2], 2.0 * math.pi)
            middle = self._odometry[2] + 0.5 * turn
            way = (x - self._odometry[0]) * math.cos(middle)
            way += (y - self._odometry[1]) * math.sin(middle)
            rolled = way + 0.5 * self._robot.track * turn * np.array([-1.0, 1.0])
        self._odometry = x, y, yaw
        per_way = self._robot.ticks_per_turn / (2.0 * math.pi * self._robot.wheel_radius)
        return self._wheels(topic, message, now, self._ticks - self._zero + rolled * per_way)

    def _wheels(self, topic: str, message: Any, now: float, ticks: Array) -> bool:
        """Take counts (2,) since power-on; return whether they are used."""
        if not (np.abs(ticks) < _MAX_TICKS).all():
            self._note(f"angles on {topic} are not numbers: such messages are left out")
            return False
        time = self.time_of(topic, message.header.stamp, now)
        if time is None:
            return False
        jump = self._jump(time, ticks)
        self._odd = bool(jump) and not self._odd
        if self._odd:
            self._note(f"wheels on {topic} roll {jump}, which they cannot: they are left out")
            return False
        if self._lost or jump:  # twice in a row: counts have begun anew
            self._zero, self._lost = self._ticks - ticks, False
        self._ticks = self._zero + ticks
        if len(self._rolled) > 1 and time - self._rolled[-2][0] < 1.0 / self._robot.control_rate:
            self._rolled.pop()  # faster than the stack needs them
        self._rolled.append((time, self._ticks))
        return True

    def _jump(self, time: float, ticks: Array) -> str:
        """Say how far counts (2,) are from the last ones if wheels cannot roll so far; or ""."""
        robot, last = self._robot, (self._rolled or self._read or [(-math.inf, ticks)])[-1][0]
        turns = (self._zero + ticks - self._ticks) / robot.ticks_per_turn
        rolled = 2.0 * math.pi * robot.wheel_radius * float(np.abs(turns).max())
        top = robot.max_v + 0.5 * robot.track * robot.max_w
        if self._snap or self._lost or rolled <= _FASTER * top * (time - last + _BURST):
            return ""
        return f"{rolled:.3g} m in {time - last:.3g} s"

    @property
    def newest(self) -> float:
        """The newest time [s] of all messages; 0 before the first."""
        return max(self._last.values(), default=0.0)

    def newest_of(self, topic: str) -> float:
        """Return the time [s] of the newest message of ``topic``; -inf before the first."""
        return self._last.get(topic, -math.inf)

    def complete(self, time: float, images: Sequence[str]) -> bool:
        """Return whether the rates of ``time`` [s] and the ``images`` of that time came."""
        frames = {"image": self._frame, "landmarks": self._landmarks}
        came = all(frames.get(name) is not None for name in images)
        return came and bool(self._rates) and self._rates[-1][0] >= time

    def stamp_of(self, time: float) -> int:
        """Return the stamp [ns] of ``time`` [s], by the clock of the sensors."""
        return round(1e9 * (time - self.shift + (self._begin or 0.0)))

    def readings(self, silent_at: float | None = None) -> Iterator[SensorReading]:
        """Yield a reading for each message of the wheels since the last call, and for the image.

        The counts are interpolated for the image's time: odometry must be known where it was taken.
        Each image is given once; one that is newer than the wheels waits for the next call. Rates
        are means from one reading to the next. With ``silent_at`` [s] the wheels' counts stay until
        then, and the distance that they roll is lost, as in the simulator.
        """
        if silent_at is not None:
            self._lost = True
            self._rolled.append((silent_at, self._ticks))
        begin = self._read[-1][0] if self._read else -math.inf
        rolled = [row for row in self._rolled if row[0] > begin]
        self._rolled.clear()
        if not rolled:
            return
        known, end = [*self._read, *rolled], rolled[-1][0]
        self._read = rolled[-1:]
        times = {time for time, _ in rolled}
        taken = math.inf if self._frame is None else self._frame.time
        late = self._waited or silent_at is not None
        for time in sorted(times | {taken} if begin < taken < end else times):
            yield self._reading(time, known, seen=taken <= time or (late and time == end))
        self._waited = self._frame is not None

    def _reading(
        self, time: float, known: Sequence[tuple[float, Array]], *, seen: bool
    ) -> SensorReading:
        means = list[tuple[float, ...]]()
        while self._rates and self._rates[0][0] <= time:
            means.append(self._rates.popleft())
        if means:
            rates = np.mean([row[1:] for row in means], axis=0).tolist()
            self._inertial = Inertial(means[-1][0], *rates)
        at, ticks = [row[0] for row in known], np.array([row[1] for row in known])
        left, right = (round(float(np.interp(time, at, ticks[:, side]))) for side in (0, 1))
        frame = landmarks = None
        if seen:
            frame, self._frame = self._frame, None
            landmarks, self._landmarks = self._landmarks, None
        return SensorReading(time, self._inertial, Encoders(time, left, right), frame, landmarks)


def goal_at(topo_map: TopoMap, name: str, tolerance: float = TOLERANCE) -> Waypoint:
    """Return the place called ``name`` of the map as a goal, reached within ``tolerance`` [m].

    Raises:
        UnknownNameError: there is no such place.

    """
    place = topo_map.place(name)
    return Waypoint.goal(place.x, place.y, tolerance, name)


def posed_goal(topo_map: TopoMap, message: Any) -> Waypoint:
    """Return the position of a ``PoseStamped`` in ``map`` as a goal, with ``TOLERANCE``.

    Raises:
        InputError: it is in another frame, no number, or not free floor of the map's plan.

    """
    frame, place = message.header.frame_id, message.pose.position
    if frame.lstrip("/") != "map":
        raise InputError(f"its frame is {frame!r:.40}, expected 'map'")
    if not (math.isfinite(place.x) and math.isfinite(place.y)):
        raise InputError("its position is not a number")
    plan = topo_map.floor_plan
    if plan is not None and plan.state(np.array([[place.x, place.y]]))[0] != FREE:
        raise InputError(f"({place.x:.2f}, {place.y:.2f}) is not free floor of {topo_map.name}")
    return Waypoint.goal(place.x, place.y, TOLERANCE)
