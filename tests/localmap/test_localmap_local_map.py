"""The local map as a whole: memory, planning, drops; no room where nothing is known."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from localmap_samples import ORIGIN, ROBOT, grid_with, metric_percept

from navfw.localmap import LocalGoal, LocalMap, LocalMapParams, Ranges
from navfw.localmap.local_map import DropMap
from navfw.localmap.occupancy_grid import OccupancyParams
from navfw.offis import Offis
from navfw.robot import RobotModel
from navfw.signals import (
    Belief,
    Label,
    Odometry,
    PassageQuery,
    PassageReport,
    Percept,
    Pose,
    Twist,
)
from navfw.testing.behavior_scenes import wall_flow

CERTAIN = 4
CLEAR_VOTES = 2
INTERVAL = 0.1
SPOT = 0.25

TARGET = (3.0, 1.0)
AHEAD = Twist(0.3, 0.0)


def local_map(**params: object) -> LocalMap:
    """A local map in which one frame is enough for an occupied cell."""
    chosen = {"occupancy": {"hit": 1.5, "miss": 0.7}, **params}
    return LocalMap(ROBOT, LocalMapParams.model_validate(chosen))


def wall_percept(time: float, ahead: float) -> Percept:
    return Offis(ROBOT).perceive(wall_flow(ROBOT, time, ahead, 20.0, 20.0), Twist(0.2, 0.0))


def update(local_map: LocalMap, time: float, ahead: float | None) -> LocalMap:
    """Update from the origin by a frame that shows a wall ``ahead`` [m], or nothing new."""
    odometry = Odometry(time, ORIGIN, Twist(0.2, 0.0), 0.0, still=False)
    percepts = [] if ahead is None else [wall_percept(time, ahead)]
    local_map.update(odometry, percepts, None, odometry.pose)
    local_map.set_obstacles(())
    return local_map


def ranges(local_map: LocalMap, time: float, ahead: float | None) -> Ranges:
    return update(local_map, time, ahead).ranges(ORIGIN)


def test_without_memory_the_map_holds_the_newest_frame_alone() -> None:
    with_memory, without = local_map(), local_map(memory=False)
    for chosen in (with_memory, without):
        assert ranges(chosen, 1.0, 0.8).front < 0.8, "the wall is in the map"
        assert chosen.free_distance(ORIGIN, AHEAD).contact < 0.75
    assert ranges(with_memory, 1.1, None).front < 0.8
    assert ranges(without, 1.1, None).front > 2.5
    free = without.free_distance(ORIGIN, AHEAD)
    assert free.contact == 1.0
    assert free.unobserved < 0.3, "floor that is not in view is unobserved: the robot creeps"
    assert ranges(without, 1.2, 0.8).front < 0.8


def test_without_planning_the_local_goal_is_the_waypoint_itself() -> None:
    def goal_of(local_map: LocalMap) -> LocalGoal:
        return update(local_map, 1.0, 0.8).local_goal(ORIGIN, TARGET)

    straight = goal_of(local_map(planning=False))
    assert straight.bearing == pytest.approx(math.atan2(1.0, 3.0))
    assert straight.cost == pytest.approx(math.hypot(3.0, 1.0))
    assert straight.reachable
    assert goal_of(local_map()).cost > straight.cost


# --- nothing is known -----------------------------------------------------------------------------


def all_free() -> LocalMap:
    """A local map around the origin whose floor is all observed free."""
    chosen = update(local_map(), 0.0, None)
    chosen.occupancy.log_odds[:] = -1.0
    return chosen


def passage_report(
    chosen: LocalMap,
    at: Pose = ORIGIN,
    time: float = 0.0,
    queries: Sequence[PassageQuery] = (),
    sigma: float = 0.1,
) -> PassageReport | None:
    """The report on ``queries`` of a robot at the origin of odom, and at ``at`` in the map."""
    belief = Belief(0.0, at, np.diag([sigma**2, sigma**2, 0.01]))
    odometry = Odometry(time, ORIGIN, AHEAD, 0.0, still=False)
    return chosen.passage_report(lambda: queries, odometry, belief)


@pytest.mark.parametrize("twist", [AHEAD, Twist(-0.1, 0.2), Twist(0.0, 1.0)])
def test_nothing_is_known_before_the_first_update_and_after_a_reset(twist: Twist) -> None:
    chosen = LocalMap(ROBOT)
    assert chosen.free_distance(ORIGIN, twist) == (0.0, 0.0)
    assert passage_report(chosen) is None
    chosen = all_free()
    assert chosen.free_distance(ORIGIN, twist) == (1.0, 1.0)
    assert passage_report(chosen) is not None
    chosen.reset()
    assert chosen.free_distance(ORIGIN, twist) == (0.0, 0.0)
    assert passage_report(chosen) is None


@pytest.mark.parametrize("side", [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
def test_there_is_no_room_outside_the_grid(side: tuple[float, float]) -> None:
    chosen = all_free()
    cell, size = chosen.params.occupancy.cell, chosen.occupancy.size
    inward = math.atan2(-side[1], -side[0])
    for cells, inside in ((size // 2, True), (size // 2 + 1, False)):
        pose = Pose(side[0] * cells * cell, side[1] * cells * cell, inward)
        assert chosen.free_distance(pose, AHEAD).contact == (1.0 if inside else 0.0)


@pytest.mark.parametrize(
    ("x", "sigma", "covered"),
    [(1.0, 0.1, True), (1.0, 0.5, False), (0.5, 0.1, False), (1.8, 0.1, False)],
)
def test_a_report_names_near_ends_of_legs_on_which_something_stands(
    x: float, sigma: float, covered: bool
) -> None:
    chosen = all_free()
    for ahead in (1.0, 1.8):
        chosen.occupancy.log_odds[chosen.occupancy.index(ahead, 0.1)] = 3.0
    at, end = Pose(5.0, 2.0, math.pi / 2), (5.0, 2.0 + x)  # the robot in the map
    query = PassageQuery(("a", "b"), (at.x, at.y), end, 1.0)
    report = passage_report(chosen, at, queries=[query], sigma=sigma)
    assert report is not None
    assert report.covered == ((end,) if covered else ())


@pytest.mark.parametrize(
    ("gap", "found"), [((0.2, 0.9), 0.55), ((0.2, 0.5), None), ((-0.95, -0.25), -0.6)]
)
def test_a_report_has_the_opening_beside_a_door_whose_place_is_covered(
    gap: tuple[float, float], found: float | None
) -> None:
    chosen = all_free()
    for y in np.arange(-2.0, 2.0, 0.05):
        if not gap[0] < y < gap[1]:
            chosen.occupancy.log_odds[chosen.occupancy.index(1.0, y)] = 3.0
    at, end = Pose(5.0, 2.0, math.pi / 2), (5.0, 3.0)  # the robot in the map
    for time, normal in enumerate((None, (0.0, 1.0), (0.0, -1.0))):
        query = PassageQuery(("a", "b"), (at.x, at.y), end, 0.9, normal)
        report = passage_report(chosen, at, time, [query])
        assert report is not None
        if normal is None or found is None:
            assert report.openings == ()
        else:
            ((covered, opening),) = report.openings
            assert covered == end
            assert opening == pytest.approx((5.0 - found, 3.0), abs=0.06)


def test_a_report_names_no_end_of_a_leg_off_the_grid() -> None:
    chosen = update(local_map(occupancy={"extent": 1.6}), 0.0, None)
    query = PassageQuery(("a", "b"), (0.0, 0.0), (1.4, 0.0), 1.0)
    report = passage_report(chosen, queries=[query])
    assert report is not None
    assert report.covered == ()


# --- drops ----------------------------------------------------------------------------------------


def floor_percept(
    label: Label, depth: float = 1.0, nearness: float = 1.0, sigma: float = 0.02
) -> Percept:
    """One cell whose ray meets the floor ``depth`` [m] before the camera."""
    row = ROBOT.camera.mount_height / depth * ROBOT.camera.focal
    return metric_percept(0.0, np.array([[[0.0, row]]]), nearness, sigma, label)


FLOOR, BELOW = floor_percept(Label.FLOOR), floor_percept(Label.DROP)
CLEAR = floor_percept(Label.DROP, nearness=0.5)


def drops_of(
    *percepts: Percept,
    pose: Pose = ORIGIN,
    interval: float = INTERVAL,
    robot: RobotModel = ROBOT,
) -> DropMap:
    """The drops after these percepts from ``pose``, one every ``interval`` [s]."""
    drops = DropMap(robot)
    for k, percept in enumerate(percepts):
        drops.integrate(replace(percept, time=interval * k), pose)
    return drops


def with_drop(**params: object) -> LocalMap:
    """A local map that has observed missing floor ahead of the origin."""
    chosen = local_map(**params)
    for k in range(3):
        odometry = Odometry(0.1 * k, ORIGIN, AHEAD, 0.0, still=False)
        chosen.update(odometry, [replace(CLEAR, time=0.1 * k)], None, ORIGIN)
    return chosen


def test_missing_floor_is_occupied_unless_there_is_no_memory() -> None:
    for memory in (True, False):
        chosen = with_drop(memory=memory)
        ((x, y),) = chosen.drops.points()
        chosen.set_obstacles(())
        assert chosen.occupancy.occupied[chosen.occupancy.index(x, y)] == memory
    chosen.reset()
    assert chosen.drops.points() == []


def test_a_passage_report_gives_missing_floor_in_the_map_frame() -> None:
    report = passage_report(with_drop(), Pose(2.0, -1.0, 0.5 * math.pi), 0.2)
    assert report is not None
    assert report.time == 0.2
    ((x, y),) = report.drops
    distance = ROBOT.camera.mount_forward + 1.0
    assert (x, y) == pytest.approx((2.0, -1.0 + distance), abs=0.2)


def test_many_points_below_the_floor_make_a_drop_where_the_rays_pass_it() -> None:
    pose = Pose(1.0, 2.0, math.pi / 2)
    assert drops_of(*[BELOW] * (CERTAIN - 1), pose=pose).points() == []
    ((x, y),) = drops_of(*[BELOW] * CERTAIN, pose=pose).points()
    assert math.dist((x, y), (1.0, 2.0 + ROBOT.camera.mount_forward + 1.0)) < 0.2


@pytest.mark.parametrize("aside", [-0.5, 0.5])
@pytest.mark.parametrize("pitch", [0.0, 0.9])
def test_a_drop_aside_is_where_its_rays_meet_the_floor(aside: float, pitch: float) -> None:
    robot = RobotModel.model_validate({"camera": {"pitch": pitch}})
    camera, ahead = robot.camera, 1.4
    right, down, depth = camera.base_from_camera.T @ (ahead, aside, -camera.mount_height)
    point = np.array([[[right, down]]]) * camera.focal / depth
    ((x, y),) = drops_of(*[replace(CLEAR, points=point)] * CERTAIN, robot=robot).points()
    assert x == pytest.approx(camera.mount_forward + ahead, abs=0.51 * SPOT)
    assert y == pytest.approx(aside, abs=0.51 * SPOT)


def test_clear_observations_make_a_drop_sooner_and_it_is_occupied() -> None:
    enough = CERTAIN // CLEAR_VOTES
    assert drops_of(*[CLEAR] * (enough - 1)).discs() == ()
    drops = drops_of(*[CLEAR] * enough)
    ((x, y),) = drops.points()
    occupancy = grid_with(observed=False)
    before = occupancy.occupied.copy()
    occupancy.set_obstacles(drops.discs())
    row, column = occupancy.index(x, y)
    assert occupancy.occupied[row, column]
    assert not before.any()
    assert occupancy.clearance[row, column] == 0.0
    assert occupancy.clearance[occupancy.index(x - 0.6, y)] == pytest.approx(0.45, abs=0.1)


@pytest.mark.parametrize(
    ("depth", "share", "sigma", "clear"),
    [
        # a point is clear below 0.85 of the floor's nearness ...
        (0.6, 0.83, 0.02, True),
        (0.6, 0.87, 0.02, False),
        (1.0, 0.83, 0.02, True),
        (1.0, 0.87, 0.02, False),
        # ... and five sigma of it, which are 0.1 1/m at least
        (1.4, 0.84, 0.001, True),
        (1.4, 0.84, 0.025, False),
        (0.6, 0.5, 0.16, True),
        (0.6, 0.5, 0.17, False),
    ],
)
def test_points_far_below_the_floor_are_clear(
    depth: float, share: float, sigma: float, clear: bool
) -> None:
    percept = floor_percept(Label.DROP, depth, share / depth, sigma)
    drops = drops_of(*[percept] * (CERTAIN // CLEAR_VOTES))
    assert bool(drops.points()) is clear


@pytest.mark.parametrize(
    ("cells", "confidence", "observations"),
    [
        ("DDF", (1.0, 1.0, 1.0), CERTAIN),
        ("DF", (1.0, 1.0), None),
        ("DFF", (1.0, 1.0, 1.0), None),
        ("DFF", (1.0, 0.1, 0.2), CERTAIN),
        ("CCD", (1.0, 1.0, 1.0), CERTAIN // CLEAR_VOTES),
        ("CDD", (1.0, 1.0, 1.0), CERTAIN),
        ("CCFFF", (1.0, 1.0, 1.0, 1.0, 1.0), None),
    ],
)
def test_a_spot_follows_the_majority_of_its_confident_cells(
    cells: str, confidence: tuple[float, ...], observations: int | None
) -> None:
    shape = (1, len(cells))
    percept = replace(
        BELOW,
        # so near to each other that all of them meet the floor in one spot
        points=np.array([[[0.01 * k, BELOW.points[0, 0, 1]] for k in range(len(cells))]]),
        label=np.array([[Label.FLOOR if c == "F" else Label.DROP for c in cells]], np.int8),
        nearness=np.array([[0.5 if c == "C" else 1.0 for c in cells]]),
        sigma=np.full(shape, 0.02),
        confidence=np.array([confidence]),
        height=np.zeros(shape),
    )
    pose, counts = Pose(0.0, 0.05, 0.0), range(1, 3 * CERTAIN + 1)
    needed = (count for count in counts if drops_of(*[percept] * count, pose=pose).points())
    assert next(needed, None) == observations


def test_no_drop_is_found_far_away_above_the_horizon_or_twice_in_the_same_flow() -> None:
    far, above = (floor_percept(Label.DROP, depth) for depth in (1.8, -1.0))
    assert drops_of(*[far, above] * (2 * CERTAIN)).points() == []
    assert drops_of(*[BELOW] * (10 * CERTAIN), interval=0.001).points() == []


def test_floor_observed_for_long_delays_a_drop_little() -> None:
    assert drops_of(*[FLOOR] * 50, *[CLEAR] * 3).points()


@pytest.mark.parametrize("label", [Label.FLOOR, Label.OBSTACLE])
def test_floor_votes_against_a_drop_and_obstacles_do_not_vote(label: Label) -> None:
    drops = drops_of(*[BELOW, floor_percept(label)] * (2 * CERTAIN))
    assert bool(drops.points()) is (label is Label.OBSTACLE)
    drops.reset()
    assert drops.points() == []


# --- parameters -----------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [(0.3, 0.3), (0.4, 0.3), (-0.1, 0.3), (0.1, 1.1)])
def test_the_probabilities_of_a_hit_have_to_rise(share: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="cell_share"):
        OccupancyParams(cell_share=share)
