"""Free distance along arcs and all around, against geometry and references in plain Python."""

import functools
import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from localmap_samples import ORIGIN, ROBOT, WALL_AHEAD, grid_with

from navfw.context import CommandGrid
from navfw.localmap import Arcs, LocalMap, OccupancyGrid, Ranges
from navfw.localmap.free_distances import arcs_of, free_distance, ranges_around
from navfw.localmap.ray_kernels import Ground, Start, cast_ranges, sweep_arcs
from navfw.numerics import Array
from navfw.robot import Footprint, RobotModel
from navfw.signals import OccupiedDisc, Pose, Twist

Box = tuple[float, float, float, float]

COMMANDS = CommandGrid(ROBOT)
STRAIGHT = COMMANDS.w.size // 2
MAX_SPEED = COMMANDS.v.size - 1


def arcs(occupancy: OccupancyGrid, pose: Pose = ORIGIN, margin: float = 0.04) -> Arcs:
    return arcs_of(occupancy, pose, COMMANDS.v, COMMANDS.w, margin)


def test_free_length_toward_a_wall() -> None:
    curves = arcs(grid_with(WALL_AHEAD), margin=0.0)
    slow = int(np.searchsorted(COMMANDS.v, 0.05))
    assert 2.0 * COMMANDS.v[slow] / COMMANDS.w[-1] < 1.0 - ROBOT.radius
    assert curves.free[slow, -1] == curves.reach, "tight curves stay short of it"
    toward = arcs(grid_with(WALL_AHEAD))
    expected = 1.0 - ROBOT.radius - 0.04
    assert toward.free[MAX_SPEED, STRAIGHT] == pytest.approx(expected, abs=0.06)
    assert np.all(toward.free[COMMANDS.v == 0.0] == toward.reach)
    assert toward.free[0, STRAIGHT] == toward.reach  # backwards, away from the wall


def test_an_arc_that_leads_away_from_contact_is_free() -> None:
    touching = arcs(grid_with((0.2, 0.3, -1.0, 1.0)))
    assert touching.free[MAX_SPEED, STRAIGHT] < 0.05
    assert touching.free[0, STRAIGHT] == touching.reach


def test_unobserved_cells_end_the_observed_length() -> None:
    unobserved = arcs(grid_with(observed=False), margin=0.0)
    assert unobserved.free[MAX_SPEED, STRAIGHT] == unobserved.reach
    # only the footprint is observed, and 0.1 m beside the centre have to be
    expected = ROBOT.radius - 0.1
    assert unobserved.observed[MAX_SPEED, STRAIGHT] == pytest.approx(expected, abs=0.08)


@pytest.mark.parametrize(
    ("thing", "hidden", "bars"),
    [
        ((0.0, 0.1, 0.4, 0.5), (0.0, 0.1, 0.25, 0.35), True),
        ((0.0, 0.1, 0.4, 0.5), None, False),
        ((0.4, 0.5, 0.2, 0.3), (0.4, 0.5, 0.05, 0.15), False),
    ],
    ids=["beside", "all observed", "in view"],
)
def test_hidden_floor_beside_what_was_seen_bars_forward_arcs(
    thing: Box, hidden: Box | None, bars: bool
) -> None:
    """Of a thing only the side was seen that faced the camera."""
    occupancy = grid_with(thing)
    if hidden is not None:
        (top, left), (bottom, right) = (occupancy.index(*hidden[k::2]) for k in (0, 1))
        occupancy.log_odds[top : bottom + 1, left : right + 1] = 0.0
    row, column = int(np.searchsorted(COMMANDS.v, 0.2)), COMMANDS.w.size - 1
    twist, swept = Twist(COMMANDS.v[row], COMMANDS.w[column]), arcs(occupancy, margin=0.0)
    contact = free_distance(occupancy, ORIGIN, twist).contact
    assert (contact < 0.3, swept.free[row, column] < 0.3) == (bars, bars)
    assert swept.free[row, STRAIGHT] == swept.reach


def test_backward_arcs_are_free_over_observed_floor_alone() -> None:
    occupancy = grid_with(observed=False)
    assert arcs(occupancy, margin=0.0).free[0, STRAIGHT] == pytest.approx(0.0, abs=0.06)
    for k in range(1, 60):  # the footprint leaves a trail of observed floor behind
        occupancy.update(Pose(0.01 * k, 0, 0), 0.1 * k)
    behind = arcs(occupancy, Pose(0.59, 0, 0), margin=0.0)
    assert 0.4 < behind.free[0, STRAIGHT] < 0.7


@pytest.mark.parametrize(
    "robot", [ROBOT, RobotModel(footprint=Footprint(front=0.3, rear=0.3, width=0.4))]
)
def test_the_own_track_is_free_for_backing_up_until_something_moves_there(
    robot: RobotModel,
) -> None:
    chosen = LocalMap(robot)
    occupancy = chosen.occupancy
    for k in range(60):
        occupancy.update(Pose(0.01 * k, 0, 0), 0.1 * k)
    end, back = Pose(0.59, 0, 0), Twist(-0.1, 0.0)
    for forgotten in (False, True):
        if forgotten:
            occupancy.log_odds[:] = 0.0
            occupancy.update(end, 6.0)
        free = arcs_of(occupancy, end, COMMANDS.v, COMMANDS.w, 0.0).free[0, STRAIGHT]
        assert free == pytest.approx(0.59, abs=0.08)
        observed = free_distance(occupancy, end, back).unobserved - robot.disc_radius
        assert observed == pytest.approx(0.59, abs=0.08)
    aside = free_distance(occupancy, Pose(0.59, 0, 0.5), back).unobserved - robot.disc_radius
    assert aside < 0.2, "off the track nothing is known"
    chosen.forget_track((OccupiedDisc(0.2, 0.0, 0.2),))
    assert free_distance(occupancy, end, back).unobserved <= robot.disc_radius + 0.1


@settings(max_examples=20, deadline=None)
@given(st.floats(-math.pi, math.pi))
def test_ranges_turn_with_the_robot(yaw: float) -> None:
    ranges = ranges_around(grid_with(WALL_AHEAD), Pose(0, 0, yaw))
    toward = int(np.argmin(np.abs(np.angle(np.exp(1j * (ranges.bearings + yaw))))))
    off = float(np.angle(np.exp(1j * (ranges.bearings[toward] + yaw))))
    expected = 1.0 / math.cos(off) - ROBOT.radius
    assert ranges.free[toward] == pytest.approx(expected, abs=0.08)
    assert ranges.limit - ROBOT.radius <= ranges.free.max() <= ranges.limit


def test_free_distance_of_a_twist_is_that_of_its_arc() -> None:
    occupancy = grid_with(WALL_AHEAD)
    ahead = free_distance(occupancy, ORIGIN, Twist(0.3, 0.0))
    assert ahead.contact == pytest.approx(1.0 - ROBOT.radius, abs=0.06)
    assert ahead.unobserved > ahead.contact - 1e-9
    assert free_distance(occupancy, ORIGIN, Twist(-0.1, 0.0)) == (1.0, 1.0)
    assert free_distance(occupancy, ORIGIN, Twist(0.0, 1.0)) == (1.0, 1.0)


@settings(max_examples=200)
@given(st.integers(0, 10_000), st.floats(-0.5, 0.8), st.floats(-1.5, 1.5), st.floats(0.2, 1.3))
def test_only_obstacles_near_its_way_bar_a_twist(seed: int, v: float, w: float, far: float) -> None:
    occupancy, random = grid_with(), np.random.default_rng(seed)
    x, y = np.meshgrid(*(start + 0.05 * np.arange(occupancy.size) for start in occupancy.origin))
    pose = Pose(*random.uniform(-1.0, 1.0, 3))
    outside = np.hypot(x - pose.x, y - pose.y) > far
    occupancy.log_odds = np.where(outside & (random.random(x.shape) < 0.1), 2.0, -1.0)
    free = free_distance(occupancy, pose, Twist(v, w))
    assert occupancy.clearance.max() > 0.0  # from here on the whole field is known
    assert free_distance(occupancy, pose, Twist(v, w)) == free


def test_clearance_is_the_least_of_the_first_stretch() -> None:
    # boxes beside the way straight on, 0.3 m from its middle
    for x, counts in ((0.3, True), (0.55, True), (0.8, False)):
        clear = arcs(grid_with((x, x + 0.05, 0.3, 0.5))).clearance[MAX_SPEED, STRAIGHT]
        nearest = 0.3 if counts else math.hypot(0.3, x - 0.6)
        # the clearance is that of the body's rim, whatever margin the free lengths keep
        assert clear == pytest.approx(nearest - ROBOT.radius, abs=0.06)
    occupancy = grid_with((0.3, 0.35, 0.3, 0.5))
    straight = [arcs(occupancy, margin=m).clearance[MAX_SPEED, STRAIGHT] for m in (0.0, 0.08)]
    assert straight[1] == pytest.approx(straight[0])


def test_arcs_reach_1_6_m_and_those_of_a_twist_1_m() -> None:
    occupancy = grid_with()
    assert arcs(occupancy).reach == 1.6
    assert (arcs(occupancy).free == 1.6).all()
    assert free_distance(occupancy, ORIGIN, Twist(0.3, 0.0)) == (1.0, 1.0)
    far = grid_with((1.5, 1.6, -0.1, 0.1))
    assert free_distance(far, ORIGIN, Twist(0.3, 0.0)).contact == 1.0
    assert arcs(far).free[MAX_SPEED, STRAIGHT] < 1.4


def test_behind_the_robot_the_rim_keeps_out_of_unobserved_cells() -> None:
    occupancy = grid_with()
    # unobserved from 0.8 m behind the centre on; 0.1 m beside the centre have to be observed
    _, column = occupancy.index(-0.8, 0.0)
    occupancy.log_odds[:, : column + 1] = 0.0
    expected = 0.8 - 0.1 - ROBOT.radius
    for margin in (0.0, 0.1):
        behind = arcs(occupancy, margin=margin).free[0, STRAIGHT]
        assert behind == pytest.approx(expected - margin, abs=0.07)
    assert arcs(occupancy, margin=0.0).observed[0, STRAIGHT] == pytest.approx(expected, abs=0.07)


def ranges_of(free: Callable[[float], float], limit: float = 3.0) -> Ranges:
    """Ranges every 7.5 degrees, ``free`` [m] by the bearing [degrees]."""
    bearings = np.radians(np.arange(-172.5, 180.1, 7.5))
    values = np.array([free(math.degrees(bearing)) for bearing in bearings])
    return Ranges(bearings, values, values, limit)


def one_near(bearing: float, at: float) -> float:
    """0.5 m at the bearing ``at`` [degrees], else 2 m."""
    return 0.5 if abs(bearing - at) < 1.0 else 2.0


@pytest.mark.parametrize(
    ("side", "low", "high"), [("front", -30, 30), ("left", 30, 120), ("right", -120, -30)]
)
def test_the_range_of_a_side_is_the_least_of_its_sector(side: str, low: float, high: float) -> None:
    for bearing in np.arange(-172.5, 180.1, 7.5):
        near = functools.partial(one_near, at=float(bearing))
        ranges = ranges_of(near)
        inside = low - 1e-6 <= bearing <= high + 1e-6
        assert getattr(ranges, side) == (0.5 if inside else 2.0)


@pytest.mark.parametrize(
    ("left", "right", "front", "degree"),
    [
        (0.7, 0.7, 2.0, 1.0),
        (0.8, 0.5, 2.0, 1.0),
        (1.2, 0.5, 2.0, 0.5),
        (0.5, 1.2, 2.0, 0.5),
        (1.6, 0.5, 2.0, 0.0),
        (2.9, 0.5, 2.0, 0.0),
        (0.7, 0.7, 0.4, 0.5),
        (1.2, 0.5, 0.4, 0.25),
        (0.7, 0.7, 0.0, 0.0),
    ],
)
def test_a_corridor_has_walls_at_both_sides_and_free_space_ahead(
    left: float, right: float, front: float, degree: float
) -> None:
    def free(bearing: float) -> float:
        if 29 < abs(bearing) < 31:
            return 3.0  # 30 degrees belong to front and side
        if abs(bearing) < 30:
            return front
        return left if bearing > 0 else right

    ranges = ranges_of(free)
    assert ranges.corridor == pytest.approx(degree)


def test_ranges_are_all_around_up_to_3_m_from_the_rim() -> None:
    ranges = ranges_around(grid_with(), ORIGIN)
    assert ranges.bearings == pytest.approx(np.radians(np.arange(-172.5, 180.1, 7.5)))
    assert not ranges.bearings.flags.writeable
    assert ranges.limit == 3.0
    assert (ranges.free == 3.0 - ROBOT.radius).all()
    assert (ranges.observed == 3.0 - ROBOT.radius).all()
    # within an obstacle there is no distance, not a negative one
    inside = ranges_around(grid_with((-0.1, 0.1, -0.1, 0.1)), ORIGIN)
    assert (inside.free == 0.0).all()
    assert (inside.observed == 0.0).all()
    unobserved = ranges_around(grid_with(observed=False), ORIGIN)
    assert (unobserved.free == 3.0 - ROBOT.radius).all()
    assert unobserved.observed == pytest.approx(np.zeros(48), abs=0.07)


# --- kernels, against references that step through the grid --------------------------------------

CELL = 0.05
SIZE = 61
CORNER = (-1.3, 0.4)
"""Odom position [m] of cell [0, 0]: the axes differ, so that they cannot be mistaken."""
CENTRE = (CORNER[0] + CELL * (SIZE // 2), CORNER[1] + CELL * (SIZE // 2))
RIM, REACH, HORIZON = 0.18, 1.0, 0.4


def cell_of(x: float, y: float) -> tuple[int, int] | None:
    """(row, column) of an odom point; None outside the grid."""
    row = math.floor((y - CORNER[1]) / CELL + 0.5)
    column = math.floor((x - CORNER[0]) / CELL + 0.5)
    return (row, column) if 0 <= row < SIZE and 0 <= column < SIZE else None


def ground_of(clearance: Array, observed: Array) -> Ground:
    return (clearance, observed.astype(np.uint8), *CORNER, CELL)


def reference_arc(
    clearance: Array, observed: Array, start: Start, v: float, w: float
) -> tuple[float, float, float]:
    """Free length, observed length and clearance of one command, step by step along its circle."""
    x, y, yaw = start
    at = cell_of(x, y)
    assert at is not None
    least = float(clearance[at])
    if v == 0.0:
        return REACH, REACH, least - RIM
    step, forward = 0.5 * CELL, math.copysign(1.0, v)
    longest = min(REACH, math.pi * abs(v / w)) if w else REACH
    # an arc that starts in contact is free as long as no cell is nearer by more than 2 cm
    nearest_allowed = min(RIM, least - 0.02)
    length, contact, unobserved = 0.0, False, math.inf
    while length < longest:
        heading = yaw + forward * (length + 0.5 * step) * w / v
        x += forward * step * math.cos(heading)
        y += forward * step * math.sin(heading)
        at = cell_of(x, y)
        if at is None:
            break
        contact = clearance[at] < nearest_allowed
        if contact:
            break
        if clearance[at] > nearest_allowed:
            nearest_allowed = min(RIM, max(nearest_allowed, clearance[at] - 0.02))
        if length < HORIZON:
            least = min(least, clearance[at])
        if not observed[at]:
            unobserved = min(unobserved, length)
        length += step
    if not contact and length >= longest - step:
        length = REACH
    return length, min(length, unobserved), least - RIM


def random_ground(rng: np.random.Generator, tight: bool) -> tuple[Array, Array]:
    """A random clearance and random observed cells; ``tight``: the start is in contact."""
    rows, columns = np.mgrid[:SIZE, :SIZE]
    clearance = np.full((SIZE, SIZE), 2.0)
    for _ in range(rng.integers(1, 6)):
        r, c = rng.integers(0, SIZE, 2)
        clearance = np.minimum(clearance, CELL * np.hypot(rows - r, columns - c))
    if tight:
        near = SIZE // 2 + rng.integers(-3, 4, 2)
        clearance = np.minimum(clearance, CELL * np.hypot(rows - near[0], columns - near[1]))
    observed = rng.random((SIZE, SIZE)) < rng.choice([0.5, 0.97, 1.0])
    return clearance, observed


@settings(max_examples=150)
@given(
    seed=st.integers(0, 2**32 - 1),
    tight=st.booleans(),
    v=st.sampled_from([-0.15, -0.05, 0.0, 0.05, 0.2, 0.5]),
    w=st.sampled_from([-1.2, -0.4, 0.0, 0.3, 1.2]),
)
def test_arcs_are_those_of_the_reference(seed: int, tight: bool, v: float, w: float) -> None:
    rng = np.random.default_rng(seed)
    clearance, observed = random_ground(rng, tight)
    # off the centre, so that arcs leave the grid at times
    x, y = (c + rng.uniform(-0.9, 0.9) for c in CENTRE) if not tight else CENTRE
    start = (x + 1e-4, y + 1e-4, rng.uniform(-3.1, 3.1))
    expected = reference_arc(clearance, observed, start, v, w)
    ground, command = ground_of(clearance, observed), (np.array([v]), np.array([w]))
    swept = np.empty((3, 1, 1))
    sweep_arcs(ground, start, *command, RIM, REACH, HORIZON, *swept)
    assert swept.ravel() == pytest.approx(expected, abs=1e-9)


BEARINGS = np.linspace(-math.pi, math.pi, 25)[1:]


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), limit=st.sampled_from([0.7, 3.0]))
def test_ranges_are_the_first_occupied_and_unobserved_cells(seed: int, limit: float) -> None:
    rng = np.random.default_rng(seed)
    occupied = rng.random((SIZE, SIZE)) < rng.choice([0.0, 0.01])
    occupied |= np.roll(occupied, 1, 0) | np.roll(occupied, 1, 1)
    rows, columns = np.mgrid[:SIZE, :SIZE]
    spots = np.argwhere(occupied)
    clearance = np.full((SIZE, SIZE), 8.0)
    for r, c in spots:
        clearance = np.minimum(clearance, CELL * np.hypot(rows - r, columns - c))
    observed = rng.random((SIZE, SIZE)) < rng.choice([0.9, 1.0])
    observed &= np.roll(observed, 1, 0) & np.roll(observed, 1, 1)
    start = (CENTRE[0] + 1e-4, CENTRE[1] + 1e-4, rng.uniform(-3.1, 3.1))
    free, seen = np.empty((2, BEARINGS.size))
    cast_ranges(ground_of(clearance, observed), start, BEARINGS, limit, free, seen)
    for bearing, range_, first in zip(BEARINGS, free, seen, strict=True):
        c, s = math.cos(bearing + start[2]), math.sin(bearing + start[2])

        def at(distance: float, c: float = c, s: float = s) -> tuple[int, int] | None:
            return cell_of(start[0] + distance * c, start[1] + distance * s)

        hit, gap = at(range_), at(first)
        assert range_ == limit or (hit is not None and clearance[hit] < CELL)
        assert first in (limit, range_) or (gap is not None and not observed[gap])
        # what is at least two cells deep along the ray is not missed
        cells = [at(distance) for distance in np.arange(0.0, limit, 0.2 * CELL)]
        inside = cells[: cells.index(None)] if None in cells else cells
        steps = range(len(inside) - 9)
        deep = [k for k in steps if all(occupied[j] for j in inside[k : k + 10])]
        assert range_ <= min(deep, default=math.inf) * 0.2 * CELL + CELL
        wide = [k for k in steps if not any(observed[j] for j in inside[k : k + 10])]
        assert first <= min(wide, default=math.inf) * 0.2 * CELL + CELL
        assert first <= range_ <= limit
