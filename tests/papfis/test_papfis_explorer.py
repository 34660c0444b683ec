"""The planner ``explorer``: frontiers, their choice by rules, and what is given up."""

import itertools
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.errors import RuleBaseError
from navfw.numerics import Array, Mask
from navfw.papfis.explorer import Explorer
from navfw.papfis.frontier_choice import INPUTS, RULE_BASE, FrontierRules, inputs_of
from navfw.papfis.given_up import GivenUp, Pursuit, narrow_passages
from navfw.papfis.known_ground import MARGIN, Frontier, KnownGround
from navfw.robot import RobotModel
from navfw.signals import Belief, GrownGrid, Pose, Waypoint
from navfw.signals.grown_grid import Evidence
from navfw.topomap import Place, TopoMap

CELL = 0.05
ROBOT = RobotModel()
FREE, OCCUPIED = -64, 64
NOWHERE = TopoMap("nowhere", [Place("start", 0.0, 0.0)], [])


def grid_of(free: Mask, occupied: Mask) -> GrownGrid:
    """The grid with these cells; the first has its centre at the origin."""
    evidence = np.zeros(free.shape, np.int8)
    evidence[free] = FREE
    evidence[occupied] = OCCUPIED
    return GrownGrid(evidence, (0.0, 0.0), CELL)


def room(width: float, height: float) -> tuple[Mask, Mask]:
    """An observed room of this size [m]: its free and its occupied cells, the walls around it."""
    shape = round(height / CELL) + 2, round(width / CELL) + 2
    free = np.zeros(shape, np.bool_)
    free[1:-1, 1:-1] = True
    return free, ~free


def ground_of(free: Mask, occupied: Mask, at: tuple[float, float]) -> tuple[KnownGround, Array]:
    """The ground of a grid for the robot at a point, and the costs of paths from there."""
    ground = KnownGround.of(grid_of(free, occupied), ROBOT, at)
    return ground, ground.costs_from(*at)


def test_a_room_that_was_seen_has_no_frontier() -> None:
    ground, costs = ground_of(*room(4.0, 3.0), (2.0, 1.5))
    assert ground.frontiers(costs) == []
    assert ground.known_area == pytest.approx((4.0 - 0.44) * (3.0 - 0.44), rel=0.1)


@pytest.mark.parametrize(("gap", "frontiers"), [(0.9, True), (0.36, False)])
def test_a_frontier_is_where_the_body_fits(gap: float, frontiers: bool) -> None:
    free, occupied = room(4.0, 3.0)
    half = round(0.5 * gap / CELL)
    occupied[30 - half : 30 + half, -1] = False
    ground, costs = ground_of(free, occupied, (2.0, 1.5))
    found = ground.frontiers(costs)
    assert bool(found) == frontiers
    for frontier in found:
        assert abs(frontier.y - 1.5) < 0.5 * gap
        assert frontier.x == pytest.approx(4.05, abs=0.15)
        assert frontier.length == pytest.approx(2.05, abs=0.2)
        assert 1.0 < frontier.gain < math.pi * 2.5**2


def test_a_single_unseen_ray_is_no_frontier() -> None:
    free, occupied = room(4.0, 3.0)
    free[20:22, 30:60] = False
    ground, costs = ground_of(free, occupied, (1.0, 2.0))
    assert ground.frontiers(costs) == []


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.0, 0.6))
def test_frontiers_are_unseen_beside_what_can_be_reached(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    free, occupied = room(5.0, 4.0)
    for _ in range(6):
        row, column = rng.integers(0, free.shape[0]), rng.integers(0, free.shape[1])
        window = np.s_[row : row + rng.integers(1, 20), column : column + rng.integers(1, 20)]
        if rng.random() < share:
            occupied[window] = True
        free[window] = False
    free[35:46, 45:56], occupied[35:46, 45:56] = True, False
    at = 2.5, 2.0
    ground, costs = ground_of(free & ~occupied, occupied, at)
    for frontier in ground.frontiers(costs):
        cell = ground.index(frontier.x, frontier.y)
        assert ground.unseen[cell]
        assert ground.clearance[cell] >= MARGIN
        assert frontier.length >= math.dist(at, (frontier.x, frontier.y)) - 2.0 * ground.cell
        path = ground.path_to(costs, frontier.x, frontier.y)
        assert math.dist(path[0], at) <= ground.cell
        assert all(math.isfinite(ground.price[ground.index(x, y)]) for x, y in path)
        assert (np.hypot(*np.diff(path, axis=0).T) < 1.5 * ground.cell).all()


def test_ground_seen_through_a_gap_is_reported_as_too_narrow() -> None:
    free, occupied = room(4.0, 3.0)
    occupied[1:-1, 40], free[1:-1, 40] = True, False
    occupied[28:33, 40], free[28:33, 40] = False, True
    ground, costs = ground_of(free, occupied, (1.0, 1.5))
    assert ground.frontiers(costs) == []
    ((x, _),) = narrow_passages(ground, costs)
    assert x > 2.0


# --- the rules ------------------------------------------------------------------------------------

LEVELS = {
    "gain": (0.0, 0.7, 1.5, 3.0, 7.0),
    "path": (0.3, 1.5, 3.0, 6.0, 15.0, 50.0),
    "turn": (0.0, 60.0, 90.0, 180.0),
    "clearance": (0.0, 0.08, 0.3),
    "reserve": (5.0, 20.0, 100.0),
}


def test_the_rules_cover_their_inputs_and_merit_is_monotone() -> None:
    rules = FrontierRules()
    shape = tuple(map(len, LEVELS.values()))
    table = np.array(list(itertools.product(*LEVELS.values()))).T
    merits = rules.merits(dict(zip(INPUTS, table, strict=True))).reshape(shape)
    for axis, (name, sign) in enumerate(
        {"gain": 1, "path": -1, "turn": -1, "clearance": 1, "reserve": 1}.items()
    ):
        assert (sign * np.diff(merits, axis=axis) >= -1e-9).all(), name
    assert merits.min() < 0.05
    assert merits.max() > 0.95


@given(
    st.tuples(
        *(
            st.floats(low, high)
            for low, high in ((0, 20), (0, 200), (0, 180), (-0.2, 2), (-100, 1000))
        )
    )
)
def test_some_rule_fires_for_any_frontier(values: tuple[float, ...]) -> None:
    inputs = dict(zip(INPUTS, values, strict=True))
    fired = FrontierRules().explain(inputs)
    assert fired
    assert sum(rule["strength"] for rule in fired) >= 1.0


def test_rules_of_the_user_take_the_place_of_those_that_ship(tmp_path: Path) -> None:
    text = RULE_BASE.read_text().replace(
        "path IS at_hand THEN merit IS excellent", "path IS at_hand THEN merit IS none"
    )
    mine = tmp_path / "mine.yaml"
    mine.write_text(text)
    inputs = {"gain": 0.2, "path": 0.5, "turn": 0.0, "clearance": 0.5, "reserve": 100.0}
    one = {name: np.array([value]) for name, value in inputs.items()}
    assert FrontierRules().merits(one)[0] == pytest.approx(1.25 / 1.35)
    planner = Explorer(ROBOT, Explorer.Params(rules=str(mine)))
    assert planner._rules.merits(one)[0] == pytest.approx(0.25 / 1.35)
    mine.write_text(text.replace("gain", "worth"))
    with pytest.raises(RuleBaseError, match=r"mine.yaml.*expected the inputs gain, path"):
        FrontierRules(mine)


def test_the_turn_is_to_the_begin_of_the_path() -> None:
    frontier = Frontier(-3.0, 0.0, 1.0, 3.0, 0.3, (0.0, 0.5))
    inputs = inputs_of([frontier], Pose(0.0, 0.0, 0.0), [50.0])
    assert inputs[:, 0].tolist() == pytest.approx([1.0, 3.0, 90.0, 0.3, 50.0])


# --- giving up ------------------------------------------------------------------------------------


def test_progress_is_a_shorter_path_or_new_floor() -> None:
    pursuit = Pursuit(0.0, 5.0, 10.0)
    pursuit.update(4.0, 4.9, 10.0)
    assert pursuit.since == 0.0
    pursuit.update(5.0, 4.7, 10.0)
    assert pursuit.since == 5.0
    pursuit.update(8.0, 6.0, 11.0)
    assert pursuit.since == 8.0


def test_a_frontier_that_was_given_up_counts_again_when_it_changes() -> None:
    frontier = Frontier(1.0, 0.0, 2.0, 3.0, 0.3, (0.5, 0.0))
    left = GivenUp(frontier.x, frontier.y, frontier.gain, "nothing can be seen there")
    assert left.covers(frontier)
    assert not left.covers(Frontier(3.0, 0.0, 2.0, 3.0, 0.3, (0.5, 0.0)))
    assert not left.covers(Frontier(1.0, 0.1, 1.0, 3.0, 0.3, (0.5, 0.0)))


# --- the planner, with a robot that sees all around -----------------------------------------------


class Walk:
    """A robot that goes straight to its waypoints and sees ``truth`` (free cells) within 1.5 m."""

    def __init__(self, free: Mask, planner: Explorer, at: tuple[float, float]) -> None:
        self.free, self.planner = free, planner
        self.x, self.y, self.yaw, self.time = *at, 0.0, 0.0
        self.seen = np.zeros(free.shape, np.bool_)
        self.blind = np.zeros(free.shape, np.bool_)
        self.waypoint: Waypoint | None = None
        self.length = 0.0

    def step(self, speed: float = 0.4, period: float = 0.5) -> bool:
        """Go on for ``period`` [s]; whether the exploration goes on."""
        rows, columns = np.indices(self.free.shape)
        near = np.hypot(columns * CELL - self.x, rows * CELL - self.y) <= 1.5
        self.seen |= near & ~self.blind
        self.planner.observe_grid(grid_of(self.seen & self.free, self.seen & ~self.free))
        belief = Belief(self.time, Pose(self.x, self.y, self.yaw), np.zeros((3, 3)))
        self.waypoint = self.planner.update(belief)
        self.time += period
        if self.waypoint is None:
            return False
        dx, dy = self.waypoint.x - self.x, self.waypoint.y - self.y
        away = math.hypot(dx, dy)
        share = min(1.0, speed * period / max(away, 1e-9))
        x, y = self.x + share * dx, self.y + share * dy
        row, column = round(y / CELL), round(x / CELL)
        inside = 0 <= row < self.free.shape[0] and 0 <= column < self.free.shape[1]
        if inside and self.free[row, column] and away > 0.05:
            self.length += share * away
            self.yaw = math.atan2(dy, dx)
            self.x, self.y = x, y
        return True

    def run(self, limit: float = 600.0) -> None:
        """Explore to the end."""
        while self.step():
            assert self.time < limit, "the exploration does not end"


def two_rooms() -> Mask:
    """Two rooms of 4 x 4 m with a door of 0.9 m between them: the free cells."""
    free, _ = room(8.2, 4.0)
    free[:, 80:84] = False
    free[31:49, 80:84] = True
    return free


def explorer(**params: object) -> Explorer:
    planner = Explorer(ROBOT, Explorer.Params(**params))  # type: ignore[arg-type]
    planner.start(NOWHERE, [])
    return planner


def with_doorway(width: float) -> Evidence:
    """Evidence of a room, and of a doorway to the right between the bands of its sides."""
    wall, half = ~room(4.0, 3.0)[0], round(0.5 * width / CELL)
    wall = np.pad(wall, ((0, 0), (0, 8)), constant_values=True)  # the right one is 0.45 m thick
    wall[30 - half : 30 + half, 81:] = False
    band = cv2.dilate(wall.view(np.uint8), np.ones((5, 5), np.uint8)) > 0
    evidence = np.where(wall, 64, np.where(band, 30, FREE)).astype(np.int8)
    evidence[:, 85:] = 0  # the inner half of the doorway is unseen
    return evidence


def choice_at(evidence: Evidence, x: float, *given_up: GivenUp) -> dict[str, Any]:
    """What an explorer at (x, 1.5) [m] chooses first, or after it has ``given_up`` others."""
    planner = explorer(return_home=False)
    planner._given_up = [*given_up]
    planner.observe_grid(GrownGrid(evidence, (0.0, 0.0), CELL))
    planner.update(Belief(0.0, Pose(x, 1.5, 0.0), np.zeros((3, 3))))
    return planner.explain_choice()


@pytest.mark.parametrize(("width", "looks"), [(0.65, True), (0.3, False)])
def test_a_doorway_between_the_bands_of_its_sides_is_looked_at(width: float, looks: bool) -> None:
    chosen = choice_at(with_doorway(width), 2.0)
    assert (chosen["heads_for"] == "frontier") == looks
    if looks:
        assert chosen["x"] == pytest.approx(4.2, abs=0.2)
        assert chosen["y"] == pytest.approx(1.5, abs=0.2)


@pytest.mark.parametrize(("x", "doorway"), [(2.4, False), (3.3, True)])
def test_a_doorway_nearby_comes_before_frontiers_far_off(x: float, doorway: bool) -> None:
    evidence = with_doorway(0.65)
    evidence[:, :4] = 0  # the room goes on at the left
    assert (choice_at(evidence, x)["x"] > 4.0) == doorway


@pytest.mark.parametrize(("x", "worth"), [(7.5, True), (1.0, False)])
def test_crumbs_far_off_are_left(x: float, worth: bool) -> None:
    free, occupied = room(9.0, 3.0)
    free[25:33, 172:180] = False  # 0.16 m^2
    evidence = grid_of(free, occupied & ~free).log_odds.copy()
    evidence[25:33, 172:180] = 0
    assert ("x" in choice_at(evidence, x)) == worth


@pytest.mark.parametrize(("tries", "x", "anew"), [(1, 1.7, True), (1, 2.3, False), (2, 1.7, False)])
def test_what_is_large_is_tried_again_once_from_afar(tries: int, x: float, anew: bool) -> None:
    evidence = grid_of(*room(4.0, 3.0)).log_odds.copy()
    evidence[:, 60:] = 0
    first = choice_at(evidence, 1.7)
    left = GivenUp(first["x"], first["y"], first["inputs"]["gain"], "", tries)
    chosen = choice_at(evidence, x, left)
    assert ((chosen["x"], chosen["y"]) == (left.x, left.y)) == anew


@pytest.mark.thorough
def test_two_rooms_are_explored_and_the_robot_returns() -> None:
    walk = Walk(two_rooms(), explorer(), (1.0, 1.0))
    walk.run()
    assert (walk.seen & walk.free).sum() >= 0.97 * walk.free.sum()
    assert math.dist((walk.x, walk.y), (1.0, 1.0)) <= 0.2
    assert walk.planner.notes == ""
    assert walk.length < 45.0


@pytest.mark.thorough
def test_without_return_it_stops_where_it_ends() -> None:
    walk, back = (Walk(two_rooms(), explorer(return_home=r), (1.0, 1.0)) for r in (False, True))
    walk.run()
    back.run()
    assert walk.length < back.length
    assert (walk.seen & walk.free).sum() >= 0.97 * walk.free.sum()


@pytest.mark.thorough
def test_it_is_back_in_time() -> None:
    walk = Walk(two_rooms(), explorer(limit=40.0), (1.0, 1.0))
    walk.run()
    assert walk.time <= 41.0
    assert math.dist((walk.x, walk.y), (1.0, 1.0)) <= 0.2
    assert "no time was left" in walk.planner.notes


@pytest.mark.thorough
def test_where_nothing_can_be_seen_is_given_up_and_listed() -> None:
    walk = Walk(two_rooms(), explorer(patience=5.0), (1.0, 1.0))
    walk.blind[:, 90:] = True
    walk.run()
    assert math.dist((walk.x, walk.y), (1.0, 1.0)) <= 0.2
    assert "nothing can be seen there" in walk.planner.notes
    given_up = walk.planner.explain_choice()["given_up"]
    assert min(left["x"] for left in given_up) > 3.9


def test_the_choice_is_kept_and_explained() -> None:
    walk = Walk(two_rooms(), explorer(keep=1.0), (1.0, 1.0))
    for _ in range(3):
        walk.step(speed=0.01)
    first = walk.planner.explain_choice()
    walk.step(speed=0.01)
    again = walk.planner.explain_choice()
    assert math.dist((first["x"], first["y"]), (again["x"], again["y"])) <= 0.7
    assert first["heads_for"] == "frontier"
    assert set(first["inputs"]) == set(INPUTS)
    assert first["rules"][0]["strength"] > 0.0
    merits = [other["merit"] for other in first["others"]]
    assert merits == sorted(merits, reverse=True)
