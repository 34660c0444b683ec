"""Localisation on a floor plan: matching, tracking, consistency, search for an unknown start."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plan_samples import MAP, PLAN, ROBOT, START, arcs, building, wall_percept

from navfw.config import find
from navfw.errors import MapError
from navfw.localization.floor_plan import FloorPlanLocalizer
from navfw.localization.passage_walls import KnownWalls
from navfw.localization.plan_field import PlanField, PlanScan, scan_of
from navfw.numerics import Array
from navfw.plugins import default_registry
from navfw.robot import Footprint, RobotModel
from navfw.signals import Belief, Odometry, Pose, Twist, wrap_angle
from navfw.stack import load_stack
from navfw.topomap import Passage, Place, TopoMap
from navfw.topomap.occupancy_map import FREE, OCCUPIED, OccupancyMap

SURE_XY = 0.1
SURE_YAW = 0.1

ROUND = [(2.0, 0.5, 0.3), (4.0, 0.5, 0.35), (3.0, 0.5, 0.5), (4.0, 0.5, 0.3), (4.0, 0.5, 0.6)]
"""A round through the large room."""
Report = list[tuple[Pose, Belief]]
AT_REST = Odometry(0.0, Pose(0.0, 0.0, 0.0), Twist(0.0, 0.0), 0.0, still=True)


def started(
    start: Pose | None = START,
    plan: OccupancyMap | None = PLAN,
    robot: RobotModel = ROBOT,
    **params: float,
) -> FloorPlanLocalizer:
    """A localiser whose map has that floor plan."""
    localizer = FloorPlanLocalizer(robot, FloorPlanLocalizer.Params(**params))
    localizer.reset()
    topo_map = TopoMap("b", list(MAP.places.values()), MAP.passages, floor_plan=plan)
    localizer.start(topo_map, start, AT_REST)
    return localizer


def drawn(*areas: Any, missing: Any = ()) -> OccupancyMap:
    """The plan with these areas of its cells occupied, and without the wall ``missing``."""
    cells = PLAN.cells.copy()
    for area in areas:
        cells[area] = OCCUPIED
    cells[missing or np.s_[:0]] = FREE
    return OccupancyMap(cells, PLAN.resolution, PLAN.origin)


def centres() -> Array:
    """The centres (n, 2) [m, map] of the plan's cells, row by row."""
    rows, columns = np.indices(PLAN.cells.shape)
    return PLAN.centres(rows.ravel(), columns.ravel())


def follow(
    localizer: FloorPlanLocalizer,
    legs: list[tuple[float, float, float]] = ROUND,
    seen: OccupancyMap = PLAN,
    scale: float = 1.03,
    seed: int = 0,
    shared: float = 0.0,
) -> Report:
    """True poses and beliefs along ``legs``, with a percept of ``seen`` at every third step."""
    report, rng = [], np.random.default_rng(seed)
    for step, (true, odometry) in enumerate(arcs(START, legs, scale)):
        percept = None if step % 3 else wall_percept(true, odometry.time, rng, seen, shared)
        report.append((true, localizer.update(odometry, percept, ())))
    return report


def error(true: Pose, belief: Belief) -> float:
    return math.dist((true.x, true.y), (belief.pose.x, belief.pose.y))


def totals(report: Report) -> tuple[float, float, float, int, int]:
    """Sums of errors, of variances while not lost, of confidences, of losses; and the updates."""
    beliefs = [belief for _, belief in report]
    variances = sum(float(np.trace(b.covariance)) for b in beliefs if not b.lost)
    confidences, losses = sum(b.confidence for b in beliefs), sum(b.lost for b in beliefs)
    errors = sum(error(*moment) for moment in report)
    return errors, variances, confidences, losses, beliefs[-1].updates


def off_by(true: Pose, pose: Pose) -> Array:
    """The error (3,) of a pose."""
    return np.array([pose.x - true.x, pose.y - true.y, wrap_angle(pose.yaw - true.yaw)])


def all_round(true: Pose, plan: OccupancyMap) -> PlanScan:
    """What a robot at ``true`` sees that turns to four sides, as seen before the turns."""
    rng = np.random.default_rng(1)
    points, sigma = [], []
    for side in (0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi):
        turned = Pose(true.x, true.y, true.yaw + side)
        scan = scan_of(wall_percept(turned, 0.0, rng, plan), ROBOT)
        c, s = math.cos(side), math.sin(side)
        points.append(scan.points @ np.array([[c, s], [-s, c]]))
        sigma.append(scan.sigma)
    joined = np.concatenate(points)
    return PlanScan(joined, np.concatenate(sigma), np.zeros_like(joined))


@pytest.mark.parametrize("yaw", [0.0, 0.4])
def test_a_scan_finds_the_pose_near_a_guess(yaw: float) -> None:
    plan = building(yaw)
    true = plan.origin.compose(Pose(4.0, 2.5, 0.2))
    scan = all_round(true, plan)
    guess = Pose(true.x + 0.1, true.y - 0.1, true.yaw + 0.04)
    known = np.linalg.inv(np.diag([0.15, 0.15, 0.06]) ** 2)
    match = PlanField(plan).match(scan, guess, known)
    off = off_by(true, match.pose)
    assert off @ (match.information + known) @ off < 16.3  # 99.9 % of 3 degrees of freedom
    assert np.hypot(off[0], off[1]) < 0.08, "the guess is 0.14 m off"
    assert match.belonging > 0.5


def test_rays_through_walls_tell_a_wrong_pose() -> None:
    true = Pose(4.0, 2.5, 0.2)
    scan, field = all_round(true, PLAN), PlanField(PLAN)
    behind_the_wall = Pose(6.0, 2.5, 0.2)
    poses = np.array([(pose.x, pose.y, pose.yaw) for pose in (true, behind_the_wall)])
    at_true, beyond = field.blocked(scan, poses)
    assert at_true < 0.05
    assert beyond > 0.2
    elsewhere = PlanScan(scan.points, scan.sigma, scan.points)  # seen from where they are
    assert not field.blocked(elsewhere, poses).any()


def test_the_field_is_exact_to_the_last_bit() -> None:
    """As its squares are whole numbers, every process then computes the same field."""
    occupied = building(0.0).occupied
    field = PlanField(building(0.0)).cells
    centres, others = np.argwhere(~occupied), np.argwhere(occupied)
    for row, column in centres[:: len(centres) // 200]:
        squared = ((others - (row, column)) ** 2).sum(axis=1).min()
        assert field[row, column] == np.float32(math.sqrt(squared) - 0.5)


def test_walls_correct_wheels_that_report_too_much_way() -> None:
    report = follow(started())
    errors = [error(*moment) for moment in report]
    assert np.percentile(errors, 95) < 0.10
    assert totals(report) == pytest.approx((7.1193787, 0.53141865, 170.0, 0, 33), rel=1e-5)


def test_the_covariance_is_about_right() -> None:
    """The normalised squared error of the pose is 3 on average for exact covariances."""
    nees = []
    for seed in range(3):
        for true, belief in follow(started(), scale=1.005, seed=seed, shared=0.05):
            off = off_by(true, belief.pose)
            nees.append(off @ np.linalg.solve(belief.covariance, off))
    assert 0.2 < np.mean(nees) < 6.0


def test_a_common_error_of_the_distances_is_no_error_of_the_pose() -> None:
    true = Pose(4.0, 2.5, 0.2)
    scan, known = all_round(true, PLAN), np.linalg.inv(np.diag([0.1, 0.1, 0.03]) ** 2)
    for scale in (0.94, 1.06):
        farther = PlanScan(scale * scan.points, scan.sigma, scan.origins)
        match = PlanField(PLAN).match(farther, true, known)
        assert math.dist((match.pose.x, match.pose.y), (true.x, true.y)) < 0.04
        assert match.belonging > 0.5
    ahead = scan_of(wall_percept(Pose(6.0, 4.0, 0.0), 0.0, np.random.default_rng(1)), ROBOT)
    along = PlanField(PLAN).match(ahead, Pose(6.0, 4.0, 0.0), known).information[0, 0]
    assert along < (0.03 * np.median(ahead.points[:, 0])) ** -2, "the scale hides the distance"


def test_a_room_lined_with_furniture_does_not_draw_the_robot_to_its_walls() -> None:
    # cupboards 0.4 m deep
    seen = drawn(np.s_[2:10, 2:130], np.s_[-10:-2, 2:130], np.s_[:, 2:10], np.s_[:, 122:130])
    report = follow(started(), seen=seen, scale=1.0, seed=3, shared=0.05)
    assert max(error(*moment) for moment in report) < 0.03, "the odometry is exact"


def test_a_skidding_turn_corrects_nothing() -> None:
    robot = ROBOT.model_copy(update={"skid": 0.08})
    report = follow(started(robot=robot), [(2.0, 0.05, 0.8), (3.0, 0.4, 0.0)], scale=1.0)
    assert report[19][1].updates == 0
    assert report[-1][1].updates > 0


def test_furniture_and_missing_walls_do_not_mislead() -> None:
    furniture, outer_wall = (np.s_[20:36, 60:76], np.s_[140:156, 80:100]), np.s_[:2, 20:60]
    report = follow(started(), seen=drawn(*furniture, missing=outer_wall))
    assert np.percentile([error(*moment) for moment in report], 95) < 0.20


def test_walls_that_are_not_there_are_seen_through() -> None:
    way = [true for true, _ in arcs(START, ROUND)]
    local = [true.points_to_local(centres()) for true in way[50::35]]
    across = [(np.abs(at) < (0.05, 0.6)).all(axis=1) for at in local]  # the way, 1.2 m wide
    report = follow(started(plan=drawn(*np.reshape(across, (-1, *PLAN.cells.shape)))))
    assert not any(belief.lost for _, belief in report)
    assert np.percentile([error(*moment) for moment in report], 95) < 0.15


def test_things_all_around_that_the_plan_does_not_show_lose_no_robot() -> None:
    way = np.array([(true.x, true.y) for true, _ in arcs(START, ROUND)])
    away = np.hypot(*(centres()[:, None] - way[None, ::4]).transpose(2, 0, 1)).min(axis=1)
    boxes = drawn(away.reshape(PLAN.cells.shape) >= 0.7)  # on both sides, hiding the walls
    report = follow(started(), seen=boxes, scale=1.0)
    assert not any(belief.lost for _, belief in report)
    assert max(error(*moment) for moment in report) < 0.3
    assert min(belief.confidence for _, belief in report) < 0.5, "it knows that it may be wrong"


def test_an_unknown_start_is_found_and_never_confidently_wrong() -> None:
    report = follow(started(None), scale=1.005)
    assert report[0][1].lost
    found = [k for k, (_, belief) in enumerate(report) if not belief.lost]
    assert found
    assert 0.05 * found[0] < 12.0, "at 0.5 m/s and 10 Hz a step is 5 cm"
    assert all(error(*report[k]) < 0.3 for k in found)
    assert report[found[0]][1].hypotheses == 1
    assert report[0][1].hypotheses == 0, "before the first search"
    assert totals(report) == pytest.approx((293.008494, 0.56848561, 54.0, 116, 11), rel=1e-5)


def test_in_a_room_that_looks_the_same_from_two_places_it_stays_lost_and_says_two() -> None:
    cells = np.full((120, 160), OCCUPIED, np.int8)
    cells[4:116, 4:156] = FREE
    room = OccupancyMap(cells, PLAN.resolution, PLAN.origin)
    report = follow(started(None, room), seen=room, scale=1.0)
    assert all(belief.lost for _, belief in report)
    assert {belief.hypotheses for _, belief in report} == {0, 2}


@pytest.mark.parametrize("told", [(7.5, 4.2, 1.9), (2.0, 2.0, 0.0), (3.0, 4.0, -1.5)], ids=str)
def test_a_robot_elsewhere_than_it_was_told_doubts_and_finds_itself(
    told: tuple[float, float, float],
) -> None:
    moments = follow(started(Pose(*told)), ROUND * 2, scale=1.0, seed=4)
    replaced = next(k for k, moment in enumerate(moments) if error(*moment) < 0.2)
    assert 2.0 < 0.05 * replaced < 11.0, "after some way, not by one scan"
    assert 0.0 < min(belief.confidence for _, belief in moments[:replaced]) < 0.05
    assert max(error(*moment) for moment in moments[replaced + 50 :]) < 0.1


def test_a_plan_that_contradicts_costs_no_right_pose() -> None:
    """It goes on by odometry, ever less sure, until it is lost; never from another place."""
    localizer = started(plan=drawn(np.s_[:, ::16]))  # a wall every 0.8 m that is not there
    moments = follow(localizer, scale=1.0)
    beliefs = [belief for _, belief in moments]
    assert max(error(*moment) for moment in moments) < 0.2, "the odometry is exact"
    assert np.mean([belief.confidence for belief in beliefs[80:]]) < 0.1
    assert beliefs[-1].sigma > 4.0 * beliefs[60].sigma
    assert not any(belief.lost for belief in beliefs)
    localizer.filter.diffuse(2.0, 0.0)
    gone = localizer.update(replace(AT_REST, time=99.0, pose=Pose(1.0, 0.0, 0.0)), None, ())
    assert gone.lost
    assert math.hypot(gone.pose.x, gone.pose.y) > 0.5, "it keeps its guess"


def test_a_localiser_that_never_doubts_tracks_all_the_same() -> None:
    assert error(*follow(started(doubt_below=0.0))[-1]) < 0.1


def test_nothing_seen_is_no_evidence() -> None:
    localizer, way = started(), arcs(START, [(4.0, 0.4, 0.0)])
    sigmas = [localizer.update(odometry, None, ()).sigma for _, odometry in way]
    assert sigmas[-1] > sigmas[0]


def test_a_map_without_a_plan_is_refused() -> None:
    with pytest.raises(MapError, match=r"'b' has no floor plan.*'floor_plan'"):
        started(plan=None)


def test_a_stack_takes_it_by_its_name_alone() -> None:
    config = load_stack(find("stack", "default"), default_registry(), ["localizer=floor_plan"])
    choice = config.stages["localizer"]
    assert choice.plugin is FloorPlanLocalizer
    assert choice.params == FloorPlanLocalizer.Params()


# --- walls of the plan around the robot, from where it believes itself to be -------------------

CELLS = np.full((100, 200), FREE, np.int8)
CELLS[40:46, 20:180] = OCCUPIED
WALL = TopoMap(
    "wall",
    [Place("here", 1.0, 2.0)],
    [],
    floor_plan=OccupancyMap(CELLS, 0.05, Pose(-2.0, 1.0, 0.0)),
)
"""A wall 0.3 m thick from (-1, 3) to (7, 3.3)."""
SURE = Belief(0.0, Pose(1.0, 2.0, 0.5 * math.pi), np.diag([0.02, 0.02, 0.02]) ** 2)


CART = RobotModel(footprint=Footprint(front=0.5, rear=0.1, width=0.3), track=0.2)


def known_walls(topo_map: TopoMap = WALL) -> KnownWalls:
    walls = KnownWalls.of(topo_map, CART)
    assert walls is not None
    return walls


def test_walls_are_where_the_robot_sees_them() -> None:
    odom = Pose(10.0, 0.0, 0.0)  # the wall, 1 m ahead, runs across
    points = known_walls().around(SURE, odom)
    assert np.abs(points - (10.0, 0.0)).max() <= 2.0
    assert points[:, 0].min() == pytest.approx(11.0, abs=0.03)
    assert points[:, 0].max() == pytest.approx(11.3, abs=0.03)
    middle = points[np.abs(points[:, 1]) < 1.9]
    assert len(middle) == 2 * 76, "the surfaces alone, one point a cell"
    turned = known_walls().around(SURE, Pose(10.0, 0.0, 0.5 * math.pi))
    assert np.allclose(turned, np.column_stack([10.0 - points[:, 1], points[:, 0] - 10.0]))


@pytest.mark.parametrize(
    "belief",
    [
        replace(SURE, lost=True),
        replace(SURE, covariance=np.diag([1.1 * SURE_XY, 0.0, 0.0]) ** 2),
        replace(SURE, covariance=np.diag([0.0, 0.0, 1.1 * SURE_YAW]) ** 2),
        replace(SURE, pose=Pose(50.0, 2.0, 0.0)),
    ],
    ids=["lost", "position unsure", "heading unsure", "far off"],
)
def test_no_walls_are_known_without_a_pose(belief: Belief) -> None:
    assert known_walls().around(belief, Pose(0.0, 0.0, 0.0)).shape == (0, 2)


def test_only_bodies_that_are_not_round_need_them() -> None:
    assert KnownWalls.of(WALL, RobotModel()) is None


def test_without_a_plan_the_walls_beside_doors_are_known() -> None:
    places = [Place("hall", 0.0, 0.0), Place("door", 1.0, 1.0, "door"), Place("room", 2.0, 2.0)]
    passages = [Passage("hall", "door", 1.5, width=0.9), Passage("door", "room", 1.5, width=0.8)]
    walls = known_walls(TopoMap("slanting", places, passages))
    points = walls.around(replace(SURE, pose=Pose(1.0, 1.0, 0.0)), Pose(0.0, 0.0, 0.0))
    along = points @ np.array([[1.0, 1.0], [1.0, -1.0]]) / math.sqrt(2.0)
    assert np.allclose(along[:, 0], 0.0), "across the way through the door"
    beside = np.sort(along[:, 1])
    assert beside[beside > 0.0].min() == pytest.approx(0.43, abs=0.01), "half the lesser width"
    assert np.allclose(beside, -beside[::-1]), "on both sides"
    assert 0.6 < beside.max() < 0.8


@given(*[st.floats(-5.0, 5.0)] * 5)
def test_points_and_poses_move_alike(x: float, y: float, yaw: float, a: float, b: float) -> None:
    pose, points = Pose(x, y, yaw), np.array([[a, b], [b, a]])
    local = pose.points_to_local(points)
    assert np.allclose(local, [pose.to_local(*point) for point in points.tolist()])
    assert np.allclose(pose.points_to_parent(local), points)
