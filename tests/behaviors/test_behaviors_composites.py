"""Composites beside travel: patrol, search and react, and one in a user's own folder."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from behavior_samples import behavior_of, composite_of, scene, twist_of
from plugin_rows import broken_rows

from navfw.context import Context
from navfw.errors import InputError
from navfw.interfaces import Composite
from navfw.localmap import LocalGoal
from navfw.plugins import default_registry
from navfw.robot import RobotModel
from navfw.signals import Belief, Twist, Waypoint

ROBOT = RobotModel()
OPEN, CORRIDOR = scene(ticks=20), scene(ticks=20, left=0.7, right=0.7)
WALL = scene(ticks=8, ahead=0.9)
DOOR = Waypoint(OPEN.pose.x + 0.7, 0.0, 0.25, "door", "door", final=False, width=0.9)


# --- patrol --------------------------------------------------------------------------------------


def test_patrol_cruises_and_is_cautious_at_doors_and_beside_obstacles() -> None:
    patrol = composite_of("patrol")
    in_the_open = patrol.weigh(OPEN)
    assert in_the_open["cruise"] == pytest.approx(0.3)
    assert patrol.weigh(replace(OPEN, waypoint=DOOR))["cruise"] == 1.0
    assert patrol.weigh(scene(ticks=20, left=0.45))["cruise"] > 0.9
    assert patrol.weigh(CORRIDOR)["centre_corridor"] > 0.9
    assert "IF" in str(patrol.explain()[0]["rule"])


def test_patrol_weighs_as_travel_does_without_progress() -> None:
    barred = LocalGoal(0.8, 0.0, math.inf, reachable=False, detour=math.inf)
    stuck = composite_of("patrol").weigh(replace(OPEN, idle=20.0, local_goal=barred))
    assert stuck["follow_wall"] == 1.0
    assert stuck["cruise"] == 0.0
    assert stuck["go_to_xy"] < 0.5


def test_cruise_is_moderate_in_the_open_and_slower_at_a_door() -> None:
    in_the_open = twist_of("cruise", OPEN).v
    assert 0.25 < in_the_open < 0.8 * OPEN.commands.max_v
    assert twist_of("cruise", replace(OPEN, waypoint=DOOR)).v < 0.7 * in_the_open
    aimless = replace(OPEN, waypoint=None)
    assert behavior_of("cruise").propose(aimless).applicability == 0.0


# --- search --------------------------------------------------------------------------------------


def uncertain(time: float, sigma: float, twist: Twist) -> Context:
    """OPEN with a position uncertain by ``sigma`` [m]."""
    belief = Belief(time, OPEN.pose, np.diag([sigma**2, 0.01, 0.01]))
    return replace(OPEN, time=time, belief=belief, twist=twist)


def leader(search: Composite, context: Context) -> str:
    weights = search.weigh(context)
    return max(("go_to_xy", "look_around", "explore"), key=weights.__getitem__)


def test_search_travels_while_the_position_is_certain() -> None:
    weights = composite_of("search").weigh(uncertain(1.0, 0.2, Twist(0.3, 0.0)))
    assert weights["go_to_xy"] > weights["look_around"] == weights["explore"] == 0.0


@pytest.mark.parametrize("idle", [0.0, 8.0, 30.0])
@pytest.mark.parametrize("at", [OPEN, CORRIDOR, replace(OPEN, waypoint=DOOR)])
def test_search_weighs_as_travel_does_while_the_position_is_certain(
    at: Context, idle: float
) -> None:
    barred = LocalGoal(1.0, 0.0, 5.0, reachable=False, detour=3.0)
    for context in (replace(at, idle=idle), replace(at, idle=idle, local_goal=barred)):
        certain = replace(context, belief=replace(context.belief, covariance=np.diag([0.01] * 3)))
        weights = dict(composite_of("search").weigh(certain))
        for name, weight in composite_of("travel").weigh(certain).items():
            assert weights[name] == pytest.approx(weight, abs=1e-9), name


def test_search_never_gives_up_while_the_belief_is_lost() -> None:
    """However small the covariance: one wrong landmark gives a small one at a wrong place."""
    search = composite_of("search")
    for k in range(140):
        belief = Belief(1.0 + k, OPEN.pose, np.diag([0.01] * 3), confidence=0.1, lost=True)
        context = replace(OPEN, time=1.0 + k, belief=belief, waypoint=None, local_goal=None)
        assert leader(search, replace(context, twist=Twist(0.0, 0.1))) != "go_to_xy"


def test_search_alternates_between_looking_around_and_exploring() -> None:
    search = composite_of("search")
    leaders = []
    time, twist = 1.0, Twist(0.0, 1.0)
    while time < 30.0:
        leaders.append(leader(search, uncertain(time, 1.0, twist)))
        twist = Twist(0.0, 1.0) if leaders[-1] == "look_around" else Twist(0.3, 0.0)
        time += 0.1
    order = [name for k, name in enumerate(leaders) if k == 0 or leaders[k - 1] != name]
    assert order[:4] == ["look_around", "explore", "look_around", "explore"]
    assert leaders.index("explore") == pytest.approx(63, abs=2), "one turn at 1 rad/s"
    stretch = leaders[leaders.index("explore") :].index("look_around")
    assert stretch == pytest.approx(67, abs=2), "2 m at 0.3 m/s"


def test_search_ends_when_the_position_is_certain_and_starts_anew() -> None:
    search = composite_of("search")
    for k in range(70):
        last = leader(search, uncertain(1.0 + 0.1 * k, 1.0, Twist(0.0, 1.0)))
    assert last == "explore"
    assert leader(search, uncertain(8.1, 0.1, Twist(0.0, 0.0))) == "go_to_xy"
    assert leader(search, uncertain(8.2, 1.0, Twist(0.0, 0.0))) == "look_around"


def test_search_without_result_is_suspended_for_a_while() -> None:
    search = composite_of("search")
    leaders = {k: leader(search, uncertain(1.0 + k, 1.0, Twist(0.0, 0.1))) for k in range(140)}
    assert leaders[10] == "look_around"
    assert leaders[70] == leaders[115] == "go_to_xy"
    assert leaders[125] == "look_around"


def test_look_around_turns_on_the_spot_toward_the_waypoint_first() -> None:
    aside = replace(OPEN, waypoint=Waypoint(0.0, -3.0, 0.3, "there", "goal", final=True))
    for context, sign in ((OPEN, 1.0), (aside, -1.0)):
        twist = twist_of("look_around", context)
        assert twist.v == 0.0
        assert twist.w * sign > 0.3


def test_explore_heads_for_free_unobserved_space() -> None:
    bearings = OPEN.ranges.bearings
    free = np.full(bearings.size, 0.6)
    observed = free.copy()
    left = (bearings > 0.6) & (bearings < 1.4)
    free[left] = 3.0
    ranges = replace(OPEN.ranges, free=free, observed=np.minimum(observed, free))
    context = replace(OPEN, ranges=ranges)
    assert twist_of("explore", context).w > 0.4
    # of two free ways, the unobserved one
    right = (bearings < -0.6) & (bearings > -1.4)
    free[right] = 3.0
    observed[left] = 3.0
    both = replace(context, ranges=replace(ranges, free=free, observed=observed))
    assert twist_of("explore", both).w < -0.4


def test_explore_creeps_where_nothing_ahead_is_observed() -> None:
    free = np.full(OPEN.ranges.bearings.size, 3.0)
    for observed, slowest, fastest in ((0.0, 0.02, 0.12), (3.0, 0.2, 0.5)):
        ranges = replace(OPEN.ranges, free=free, observed=np.full_like(free, observed))
        assert slowest < twist_of("explore", replace(OPEN, ranges=ranges)).v < fastest


# --- react ---------------------------------------------------------------------------------------


def test_react_follows_walls_only_without_progress() -> None:
    react = composite_of("react")
    moving = react.weigh(replace(WALL, idle=0.0))
    assert moving["follow_wall_quadrants"] == 0.0
    assert moving["go_to_xy"] < 0.5 < moving["avoid_quadrants"]
    stuck = react.weigh(replace(WALL, idle=20.0))
    assert stuck["follow_wall_quadrants"] == 1.0
    assert stuck["go_to_xy"] == 0.0
    assert react.weigh(replace(OPEN, idle=20.0))["go_to_xy"] == 1.0
    assert react.explain()


def test_react_moves_the_view_before_it_judges_by_an_old_percept() -> None:
    react = composite_of("react")
    assert react.weigh(replace(WALL, idle=20.0))["look_again"] == 0.0
    old = replace(WALL, time=WALL.time + 2.0)
    weights = react.weigh(replace(old, idle=20.0))
    assert weights["look_again"] == 1.0
    assert weights["go_to_xy"] == weights["follow_wall_quadrants"] == 0.0
    # while the robot comes nearer, an object that was seen long ago does not hold it back
    assert react.weigh(replace(old, idle=0.0))["go_to_xy"] == 1.0
    never = replace(WALL, percept=None, idle=20.0)
    assert react.weigh(never)["look_again"] == 1.0


@pytest.mark.parametrize(("aside", "through"), [(0.0, True), (2.0, False)])
def test_react_lets_no_wall_beside_a_door_that_is_faced_turn_the_robot_away(
    aside: float, through: bool
) -> None:
    wall = scene(ticks=8, ahead=0.9, left=0.5)
    x, y = wall.pose.to_parent(0.5, aside * 0.5)
    door = Waypoint(x, y, 0.25, "door", "door", final=False, width=0.9)
    weights = composite_of("react").weigh(replace(wall, waypoint=door))
    assert (weights["traverse_door"] > 0.5 > weights["avoid_quadrants"]) is through
    assert (weights["traverse_door"] == 0.0) is not through


def test_react_leaves_a_wall_for_a_waypoint_that_is_faced_with_nothing_near_ahead() -> None:
    beside = scene(ticks=8, left=0.5)
    stuck = replace(beside, idle=20.0)
    assert composite_of("react").weigh(stuck)["go_to_xy"] == 1.0
    assert stuck.waypoint is not None
    aside = replace(stuck, waypoint=replace(stuck.waypoint, x=beside.pose.x, y=2.0))
    weights = composite_of("react").weigh(aside)
    assert (weights["follow_wall_quadrants"], weights["go_to_xy"]) == (1.0, 0.0)


# --- in a user's own folder ----------------------------------------------------------------------

RULED = '''
"""Wary: a composite in a user's own folder, by rules."""

from typing import ClassVar

from navfw import RuledComposite


class Wary(RuledComposite):
    """Weighs the goal fully where there is room."""

    name: ClassVar[str] = "wary"

    def inputs(self, context):
        return {"room": context.ranges.front > 1.0}
'''
ROOM = """
name: wary
inputs:
  room:
    range: [0, 1]
    terms: {no: {trapezoid: [0, 0, 0.3, 0.7]}, yes: {trapezoid: [0.3, 0.7, 1, 1]}}
outputs:
  go_to_xy:
    range: [0, 1]
    terms: {low: {triangle: [-0.2, 0, 0.2]}, high: {triangle: [0.8, 1, 1.2]}}
rules:
  - IF room IS no THEN go_to_xy IS low
  - IF room IS yes THEN go_to_xy IS high
"""


def test_a_composite_by_rules_needs_its_inputs_and_a_rule_file(tmp_path: Path) -> None:
    (tmp_path / "wary.py").write_text(RULED)
    cls = default_registry([tmp_path]).get("composite", "wary")
    assert issubclass(cls, Composite)
    with pytest.raises(InputError, match=r"wary\.yaml"):
        cls(ROBOT)
    (tmp_path / "wary.yaml").write_text(ROOM)
    wary = cls(ROBOT)
    assert wary.explain() == ()
    near = replace(OPEN, ranges=replace(OPEN.ranges, free=np.full_like(OPEN.ranges.free, 0.5)))
    weights = [dict(wary.weigh(context)) for context in (OPEN, near)]
    assert weights == [{"go_to_xy": 1.0}, {"go_to_xy": 0.0}]
    assert [rule["rule"] for rule in wary.explain()] == ["IF room IS no THEN go_to_xy IS low"]
    wary.reset()
    assert wary.explain() == ()


@pytest.mark.parametrize(
    ("instead", "message"),
    [
        ("def input(self, context)", "missing inputs(self, context); define it instead of 'input'"),
        ("def inputs(self)", "inputs(self) has the wrong parameters: too many"),
    ],
)
def test_a_composite_by_rules_without_inputs_is_refused_at_once(
    tmp_path: Path, instead: str, message: str
) -> None:
    (tmp_path / "wary.py").write_text(RULED.replace("def inputs(self, context)", instead))
    (broken,) = broken_rows(default_registry([tmp_path]))
    assert message in broken["error"]
