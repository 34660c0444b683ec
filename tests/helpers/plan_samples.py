"""A small building with a floor plan, and percepts of its walls by rays through the plan."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from localization_drives import step
from localmap_samples import metric_percept

from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import Label, Odometry, Percept, Pose, Twist
from navfw.topomap import Passage, Place, TopoMap
from navfw.topomap.occupancy_map import FREE, OCCUPIED, OccupancyMap

ROBOT = RobotModel()
CELL = 0.05
BEARINGS = np.linspace(math.radians(-42.0), math.radians(42.0), 16)


def building(yaw: float = 0.0) -> OccupancyMap:
    """10 x 8 m, two rooms side by side, one divided; ``yaw`` [rad] of the grid in the map."""
    cells = np.full((160, 200), FREE, np.int8)
    cells[:2], cells[-2:], cells[:, :2], cells[:, -2:] = (OCCUPIED,) * 4
    cells[:, 130:133] = OCCUPIED
    cells[60:80, 130:133] = FREE
    cells[90:93, 133:] = OCCUPIED
    cells[90:93, 150:170] = FREE
    cells[110:130, 20:40] = OCCUPIED
    return OccupancyMap(cells, CELL, Pose(-1.0, -2.0, yaw))


PLAN = building()
START = Pose(1.0, 0.0, 0.0)
MAP = TopoMap(
    "building",
    [Place("west", 1.0, 0.0), Place("east", 7.5, 0.5)],
    [Passage("west", "east", 7.0)],
    floor_plan=PLAN,
)


def ranges(plan: OccupancyMap, eye: tuple[float, float], yaw: float) -> Array:
    """(16,) distance [m] of the nearest wall along BEARINGS from ``eye`` (x, y) [m, map]."""
    reach = np.arange(0.05, 6.0, 0.02)
    distances = np.full(len(BEARINGS), 6.0)
    for k, bearing in enumerate(BEARINGS.tolist()):
        heading = yaw + bearing
        steps = np.array([math.cos(heading), math.sin(heading)]) * reach[:, None]
        hit = np.flatnonzero(plan.state(np.array(eye) + steps) == OCCUPIED)
        distances[k] = reach[hit[0]] if len(hit) else 6.0
    return distances


def wall_percept(
    true: Pose,
    time: float,
    rng: np.random.Generator,
    plan: OccupancyMap = PLAN,
    shared: float = 0.0,
) -> Percept:
    """What OFFIS makes of the walls around a robot at ``true``.

    The depths have errors of 3 % each, and in common one with the relative sigma ``shared``: that
    of the camera's motion between the frames.
    """
    camera = ROBOT.camera
    eye = true.to_parent(camera.mount_forward, 0.0)
    depth = ranges(plan, eye, true.yaw) * np.cos(BEARINGS)
    depth *= 1.0 + 0.03 * rng.standard_normal(depth.size)
    if shared > 0.0:
        depth *= 1.0 + shared * rng.standard_normal()
    x = -camera.focal * np.tan(BEARINGS)
    points = np.stack([x, np.zeros_like(x)], axis=-1)[None]
    nearness, sigma = (1.0 / depth)[None], (0.03 / depth)[None]
    return metric_percept(time, points, nearness, sigma, Label.OBSTACLE, camera.mount_height)


def arcs(
    start: Pose,
    legs: Sequence[tuple[float, float, float]],
    scale: float = 1.0,
    bias: float = 0.0,
) -> Iterator[tuple[Pose, Odometry]]:
    """True poses and odometry at 10 Hz along legs of (seconds, v [m/s], w [rad/s]).

    The odometry's way is ``scale`` times the true one, its gyro has a ``bias`` [rad/s].
    """
    true, raw, time = start, Pose(0.0, 0.0, 0.0), 0.0
    for seconds, v, w in legs:
        for _ in range(round(10.0 * seconds)):
            yield true, Odometry(time, raw, Twist(scale * v, w + bias), 0.0, still=False)
            true = true.compose(step(v, w))
            raw = raw.compose(step(scale * v, w + bias))
            time += 0.1
