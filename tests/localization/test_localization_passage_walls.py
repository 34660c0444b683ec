"""Walls beside the passages of a map: corridors and doors found, and the pose corrected by them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from localization_drives import odometry
from plan_samples import wall_percept

from navfw.localization.landmark_model import LandmarkExistence
from navfw.localization.metric_filter import MetricFilter, MetricFilterParams
from navfw.localization.passage_walls import PassageAxis, corridor_fix, door_fix, passage_axes
from navfw.localization.plan_field import PlanScan
from navfw.localization.topological import PassageObserver, _is_ahead
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import Pose
from navfw.topomap import Passage, Place, TopoMap
from navfw.topomap.occupancy_map import FREE, OCCUPIED, OccupancyMap

WIDTH = 1.5
CORRIDOR = PassageAxis((2.0, 1.0), 0.5, 8.0, WIDTH)
DOOR = PassageAxis((2.0, 1.0), 0.5, 0.0, 0.9)
SMALL = st.floats(-0.12, 0.12)


def map_with_a_door() -> TopoMap:
    """A corridor of two passages with a side door, and a room behind it."""
    places = [
        Place("west", 0.0, 0.0, "corridor"),
        Place("middle", 3.0, 0.02, "junction"),
        Place("east", 8.0, 0.0, "corridor"),
        Place("door", 3.0, 1.0, "door"),
        Place("room", 3.0, 2.0, "room"),
        Place("corner", 6.0, 3.0, "room"),
    ]
    passages = [
        Passage("west", "middle", 3.0, width=1.2),
        Passage("middle", "east", 5.0, width=1.5),
        Passage("middle", "door", 1.0, width=0.9),
        Passage("door", "room", 1.0, width=1.0),
        Passage("room", "corner", 4.0),
    ]
    return TopoMap("hall", places, passages)


def test_straight_corridors_and_doors_are_found() -> None:
    corridor, door = passage_axes(map_with_a_door())
    assert corridor.length == pytest.approx(8.0, abs=0.01)
    assert corridor.width == 1.5
    assert corridor.frame(Pose(4.0, 0.5, 0.1)).y == pytest.approx(0.5, abs=0.05)
    assert (door.is_door, door.width, door.origin) == (True, 0.9, (3.0, 1.0))
    assert abs(math.sin(door.yaw)) == pytest.approx(1.0, abs=0.001)


def seen(axis: PassageAxis, robot: Pose, points: Array, noise: float = 0.02) -> PlanScan:
    """``points`` (n, 2) in the frame of the axis, as the robot at that pose (map) sees them."""
    rng = np.random.default_rng(0)
    at = axis.frame(robot)
    c, s = math.cos(at.yaw), math.sin(at.yaw)
    local = (points - np.array([at.x, at.y])) @ np.array([[c, -s], [s, c]])
    local = local + rng.normal(0.0, noise, local.shape)
    return PlanScan(local, np.full(len(local), noise), np.zeros_like(local))


def walls(*offsets: float, start: float = 1.0, end: float = 4.0) -> Array:
    along = np.linspace(start, end, 25)
    return np.concatenate([np.column_stack([along, np.full(25, off)]) for off in offsets])


def on_axis(axis: PassageAxis, x: float, y: float, yaw: float) -> Pose:
    return Pose(*axis.origin, axis.yaw).compose(Pose(x, y, yaw))


@given(aside=SMALL, turned=SMALL, off=SMALL, yaw=SMALL, back=st.booleans())
def test_a_corridor_corrects_heading_and_lateral_position(
    aside: float, turned: float, off: float, yaw: float, back: bool
) -> None:
    heading = math.pi * back
    true = on_axis(CORRIDOR, 1.5, aside, turned + heading)
    believed = on_axis(CORRIDOR, 1.5, aside + off, turned + yaw + heading)
    fix = corridor_fix(CORRIDOR, believed, seen(CORRIDOR, true, walls(0.75, -0.75)))
    assert fix is not None
    assert fix.turn == pytest.approx(-yaw, abs=0.02)
    assert fix.shift == pytest.approx(-off, abs=0.03)
    assert max(fix.turn_sigma, fix.shift_sigma) < 0.08
    # the correction as rows of x, y, yaw moves the believed pose to the true one
    rows, values, _ = fix.rows()
    error = np.array([true.x - believed.x, true.y - believed.y, -yaw])
    assert rows @ error == pytest.approx(values, abs=0.03)


@pytest.mark.parametrize(
    ("offsets", "what"),
    [((0.75,), "one wall"), ((0.75, -0.45), "narrower"), ((0.95, -0.93), "wider")],
)
def test_the_middle_needs_two_walls_as_in_the_map(offsets: tuple[float, ...], what: str) -> None:
    robot = on_axis(CORRIDOR, 1.5, 0.0, 0.0)
    fix = corridor_fix(CORRIDOR, robot, seen(CORRIDOR, robot, walls(*offsets)))
    assert fix is not None, what
    assert math.isinf(fix.shift_sigma)
    assert fix.turn == pytest.approx(0.0, abs=0.02)
    assert fix.rows()[0].shape == (1, 3)


def test_things_in_a_corridor_do_not_move_its_walls() -> None:
    rng = np.random.default_rng(1)
    things = np.column_stack([rng.uniform(1.5, 3.0, 15), rng.uniform(0.45, 0.6, 15)])
    behind_doors = np.column_stack([rng.uniform(2.0, 3.0, 10), rng.uniform(-1.0, -0.85, 10)])
    robot = on_axis(CORRIDOR, 1.0, 0.1, 0.0)
    points = np.concatenate([walls(0.75, -0.75), things, behind_doors])
    fix = corridor_fix(CORRIDOR, robot, seen(CORRIDOR, robot, points))
    assert fix is not None
    assert fix.shift == pytest.approx(0.0, abs=0.06)
    numbers = (fix.turn, fix.turn_sigma, fix.shift, fix.shift_sigma)
    assert numbers == pytest.approx((-0.010668242, 0.021787211, 0.036081733, 0.052126456))


def test_too_little_wall_tells_nothing() -> None:
    robot = on_axis(CORRIDOR, 1.5, 0.0, 0.0)
    for points in (walls(0.75, -0.75, end=1.3), walls(0.75)[:4], walls(2.5, -2.5)):
        assert corridor_fix(CORRIDOR, robot, seen(CORRIDOR, robot, points)) is None


def wall_with_a_gap(width: float, middle: float = 0.0) -> Array:
    left = np.linspace(middle + 0.5 * width, 1.6, 12)
    right = np.linspace(-1.6, middle - 0.5 * width, 12)
    across = np.concatenate([left, right])
    return np.column_stack([np.zeros_like(across), across])


@given(off=SMALL, back=st.booleans())
def test_a_door_corrects_the_lateral_position(off: float, back: bool) -> None:
    x, yaw = (1.4, math.pi) if back else (-1.4, 0.0)
    true, believed = on_axis(DOOR, x, 0.05, yaw), on_axis(DOOR, x, 0.05 + off, yaw)
    fix = door_fix(DOOR, believed, seen(DOOR, true, wall_with_a_gap(0.9), noise=0.005))
    assert fix is not None
    assert fix.shift == pytest.approx(-off, abs=0.09)
    assert math.isinf(fix.turn_sigma)


@pytest.mark.parametrize(("width", "shift"), [(0.3, None), (0.65, 0.0), (0.8, 0.0), (1.3, None)])
def test_doors_may_look_narrower_but_no_other_gap_is_one(width: float, shift: float | None) -> None:
    """Cells of the image reach over its edges."""
    robot = on_axis(DOOR, -1.4, 0.0, 0.0)
    fix = door_fix(DOOR, robot, seen(DOOR, robot, wall_with_a_gap(width), noise=0.005))
    assert (fix and fix.shift) == pytest.approx(shift, abs=0.05)


@pytest.mark.parametrize(
    ("x", "y", "yaw", "is_ahead"),
    [
        (-1.0, 0.0, 0.0, True),
        (-1.0, 0.4, 0.5, True),
        (1.0, 0.0, 3.1, True),
        (1.0, 0.0, 0.0, False),
        (-1.0, 0.0, 3.1, False),
        (-0.3, 0.0, 0.0, False),
        (-2.1, 0.0, 0.0, False),
        (-1.0, 0.5, 0.0, False),
        (-1.0, 0.0, 0.7, False),
    ],
)
def test_a_door_is_ahead_from_either_side(x: float, y: float, yaw: float, is_ahead: bool) -> None:
    assert _is_ahead(DOOR, on_axis(DOOR, x, y, yaw)) == is_ahead


@pytest.mark.parametrize(("moved", "taken"), [(0.0, True), (1.2, False)])
def test_the_filter_takes_walls_unless_they_contradict_it(moved: float, taken: bool) -> None:
    true, believed = on_axis(CORRIDOR, 1.5, 0.0, 0.0), on_axis(CORRIDOR, 1.5, 0.1, 0.05)
    fix = corridor_fix(CORRIDOR, believed, seen(CORRIDOR, true, walls(0.75, -0.75)))
    assert fix is not None
    params = MetricFilterParams()
    tracked = MetricFilter(params, LandmarkExistence(params.prior), RobotModel())
    known = np.diag([0.2**2, 0.2**2, 0.05**2])
    tracked.initialize(believed, known, odometry(Pose(0.0, 0.0, 0.0)))
    tracked.observe_passage(replace(fix, shift=fix.shift + moved))
    at = CORRIDOR.frame(tracked.pose)
    if not taken:
        assert tracked.pose == believed
        return
    assert (at.x, at.y, at.yaw) == pytest.approx((1.5, 0.0, 0.0), abs=0.03)
    across = np.array([-math.sin(CORRIDOR.yaw), math.cos(CORRIDOR.yaw), 0.0])
    along = np.array([math.cos(CORRIDOR.yaw), math.sin(CORRIDOR.yaw), 0.0])
    after = tracked.pose_covariance
    assert across @ after @ across < 0.1 * 0.2**2 < along @ after @ along


def test_a_drifting_pose_stays_in_its_corridor() -> None:
    """Odometry turns by 2 degrees a metre; walls alone keep the believed pose on its way."""
    cells, rng = np.full((60, 180), OCCUPIED, dtype=np.int8), np.random.default_rng(0)
    cells[15:45, :] = FREE  # the corridor of the map, 1.5 m wide
    cells[45:, 71:89] = FREE  # its door
    plan = OccupancyMap(cells, 0.05, Pose(-1.0, -1.5, 0.0))
    observer = PassageObserver(map_with_a_door(), RobotModel())
    believed, odom, fixes = Pose(0.5, 0.1, 0.0), Pose(0.0, 0.0, 0.0), 0
    for step in range(60):
        true = Pose(0.5 + 0.1 * step, 0.1, 0.0)
        moved = Pose(0.1, 0.0, math.radians(0.2)) if step else Pose(0.0, 0.0, 0.0)
        odom, believed = odom.compose(moved), believed.compose(moved)
        percept = wall_percept(true, 0.2 * step, rng, plan)
        for fix in observer.observe(believed, odometry(odom, 0.2 * step, 0.5), percept):
            fixes += 1
            turn, shift = fix.turn, fix.shift if math.isfinite(fix.shift_sigma) else 0.0
            believed = Pose(believed.x, believed.y + shift, believed.yaw + turn)
    assert 4 <= fixes <= 7, "at most one a metre"
    assert abs(odom.yaw) > 0.2
    assert abs(believed.yaw) < 0.06
    assert abs(believed.y - 0.1) < 0.1
    assert (believed.x, believed.y, believed.yaw) == pytest.approx(
        (6.397586, 0.178413, 0.045282), abs=1e-6
    )
