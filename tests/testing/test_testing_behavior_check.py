"""Checks of behaviours, and assertions on missions."""

import itertools
import math
import time
from dataclasses import fields, replace
from typing import Annotated, Any, ClassVar

import numpy as np
import pytest
from pydantic import Field

from navfw.context import Context
from navfw.errors import PluginError, UnknownNameError
from navfw.interfaces import Behavior, Composite
from navfw.missions.outcome import MissionVerdict, Outcome
from navfw.missions.run_metrics import measure
from navfw.offis import Offis
from navfw.plugins import default_registry
from navfw.recording.run_observers import Contact, RunLogger
from navfw.robot import RobotModel
from navfw.signals import Label, Pose, Proposal, Twist
from navfw.sim import SceneGeometry, WorldSpec
from navfw.sim.worldspec import BoxSpec
from navfw.testing import (
    SCENES,
    MissionRun,
    assert_behavior_led,
    assert_clearance,
    assert_no_collision,
    assert_reached,
    assert_visited,
    check_behavior,
    check_composite,
    contexts_of,
)
from navfw.testing.behavior_scenes import BehaviorScene, wall_flow

REGISTRY = default_registry()
# behaviours that need the simulator's truth do not work in a scene
SHIPPED = [
    cls
    for kind in ("behavior", "composite")
    for name in REGISTRY.names(kind)
    if not (cls := REGISTRY.get(kind, name)).oracle
]


COUNT = itertools.count()


def spoil(context: Context) -> dict[str, float]:
    context.ranges.free[:] = 0.0
    return {}


class Stop(Behavior):
    """Proposes to stand still."""

    name: ClassVar[str] = "stop"

    def propose(self, context: Context) -> Proposal:
        return Proposal(0.5, context.commands.zeros() + 0.2, context.commands.zeros(), "rest")


class Even(Composite):
    """Gives all primitives the same weight."""

    name: ClassVar[str] = "even"

    def weigh(self, context: Context) -> dict[str, float]:
        return {"avoid": 0.5}


def weighing(weigh: Any, **members: Any) -> type[Composite]:
    return type("Odd", (Even,), {"__doc__": "Odd.", "name": "odd", "weigh": weigh, **members})


@pytest.mark.parametrize("cls", [Stop, Even, *SHIPPED], ids=lambda cls: cls.name)
def test_shipped_and_simple_plugins_keep_the_contract(cls: type[Behavior | Composite]) -> None:
    if issubclass(cls, Behavior):
        check_behavior(cls)
    else:
        check_composite(cls)


@pytest.mark.parametrize(
    ("cls", "message"),
    [
        (weighing(lambda self, context: {"avoid": 1.5}), r"weight of avoid 1.5"),
        (weighing(lambda self, context: {"avoid": math.nan}), r"weight of avoid"),
        (weighing(lambda self, context: {"avodi": 0.5}), "no behaviour: did you mean 'avoid'"),
        (weighing(lambda self, context: 1 / 0), "raised ZeroDivisionError"),
        (weighing(lambda self, context: {"avoid": next(COUNT) / 1e6}), "a new instance"),
        (weighing(lambda self, context: spoil(context)), "read-only"),
        (weighing(Even.weigh, explain=lambda self: 3), "raised TypeError"),
    ],
)
def test_a_composite_s_breach_of_the_contract_is_named(cls: type[Composite], message: str) -> None:
    with pytest.raises(PluginError, match=message):
        check_composite(cls)


def variant(**members: Any) -> type[Behavior]:
    return type("Odd", (Stop,), {"__doc__": "Odd.", "name": "odd", **members})


def proposing(change: Any) -> type[Behavior]:
    """``Stop``, with its proposal's fields replaced by what ``change`` gives for a context."""

    def propose(self: Stop, context: Context) -> Proposal:
        return replace(Stop.propose(self, context), **change(context))

    return variant(propose=propose)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: {"applicability": 1.5}, "applicability 1.5"),
        (lambda c: {"desirability": c.commands.zeros() - 0.1}, "outside [0, 1]"),
        (lambda c: {"prohibition": c.commands.zeros() + np.nan}, "not finite"),
        (lambda c: {"reason": " "}, "no reason"),
        (lambda c: {"reason": "a\nb"}, "several lines"),
        (lambda c: {"explain": lambda row, column: [object()]}, "plain data"),
        (lambda c: {"explain": None}, "plain data"),
        # fails in a single scene: the one without a waypoint
        (lambda c: {"reason": f"to {c.waypoint.place}"}, "'no waypoint'"),
        (lambda c: {"reason": c.percept.sentence or "-"}, "'before the first percept'"),
    ],
)
def test_an_unusable_proposal_is_named(change: Any, message: str) -> None:
    with pytest.raises(PluginError) as caught:
        check_behavior(proposing(change))
    assert message in str(caught.value)
    assert "class Odd" in str(caught.value)


def counted(context: Context, count: int) -> Proposal:
    desired = context.commands.zeros() + 0.001 * (count % 900)
    return Proposal(0.5, desired, context.commands.zeros(), "counting")


def propose_without_reset(self: Any, context: Context) -> Any:
    self.count = getattr(self, "count", 0) + 1
    return counted(context, self.count)


def propose_in_the_context(self: Any, context: Context) -> Any:
    context.arcs.free[0, 0] += 1.0
    return Stop.propose(self, context)


def propose_slowly(self: Any, context: Context) -> Any:
    time.sleep(0.002)
    return Stop.propose(self, context)


def propose_and_fail(self: Any, context: Context) -> Any:
    return 1 / 0


FAILING = propose_and_fail.__code__.co_firstlineno + 1


@pytest.mark.parametrize(
    ("propose", "message"),
    [
        (lambda self, context: 0.5, "returned float, not a Proposal"),
        (lambda self, context: counted(context, next(COUNT)), "a new instance"),
        (propose_without_reset, "after reset()"),
        (propose_in_the_context, "read-only"),
        (propose_slowly, "the limit is 1 ms"),
        (propose_and_fail, "behavior_check.py:{line}, in propose_and_fail: return 1 / 0)"),
    ],
)
def test_a_breach_of_the_contract_is_named(propose: Any, message: str) -> None:
    with pytest.raises(PluginError) as caught:
        check_behavior(variant(propose=propose), budget=0.001)
    assert message.format(line=FAILING) in str(caught.value)


class MapForRobot(Behavior):
    """Takes the waypoint's position in the map for one ahead of the robot."""

    name: ClassVar[str] = "map_for_robot"

    def propose(self, context: Context) -> Proposal:
        """Fast, where the waypoint seems to be ahead."""
        ahead = context.waypoint is not None and context.waypoint.x > 0.0
        speed = np.full(context.commands.shape, 0.8 if ahead else 0.1)
        return Proposal(1.0, speed, context.commands.zeros(), "it seems to be ahead")


class SlowInTheEast(Behavior):
    """Depends on the place of the robot in the map, as it may."""

    name: ClassVar[str] = "slow_in_the_east"

    def propose(self, context: Context) -> Proposal:
        """Slow from x = 3 m on."""
        speed = np.full(context.commands.shape, 0.1 if context.belief.pose.x > 3.0 else 0.8)
        return Proposal(1.0, speed, context.commands.zeros(), "the east is dangerous")


def test_the_map_s_frame_taken_for_the_robot_s_is_named() -> None:
    check_behavior(SlowInTheEast)
    with pytest.raises(PluginError, match="waypoint_local is the waypoint as seen"):
        check_behavior(MapForRobot)


def test_parameters_need_descriptions() -> None:
    class Bare(Stop):
        """Has an undescribed parameter."""

        name: ClassVar[str] = "bare"

        class Params(Stop.Params):
            """Parameters."""

            good: Annotated[float, Field(description="a weight [1]")] = 0.5
            poor: float = 0.5

        params: Params

    with pytest.raises(PluginError, match="poor has no description") as caught:
        check_behavior(Bare)
    assert "good" not in str(caught.value)


def test_what_the_registry_would_refuse_is_refused() -> None:
    with pytest.raises(PluginError):
        check_behavior(int)  # type: ignore[arg-type]


# --- the scenes themselves -----------------------------------------------------------------------


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: str(scene.name))
def test_scenes_match_their_description(scene: BehaviorScene) -> None:
    robot = RobotModel()
    last = contexts_of(scene, robot)[-1]
    assert (last.waypoint is None) == (scene.waypoint is None)
    driven = last.pose.x
    if scene.perceives and scene.twist.v > 0.0 and scene.moves:
        assert last.percept is not None
        if scene.ahead < 2.0 and scene.left > 1.0:
            assert last.ranges.front == pytest.approx(scene.ahead - driven - robot.radius, abs=0.15)
        if scene.left < 2.0:
            assert last.ranges.left < scene.left + 0.1
        if scene.right < 2.0:
            assert last.ranges.right < scene.right + 0.1
    if scene.ahead == scene.left == scene.right:
        assert last.ranges.front > 1.0
    assert (last.stalled > 1.0) == (not scene.moves)


def test_the_flow_of_a_wall_gives_its_distance() -> None:
    robot = RobotModel()
    percept = Offis(robot).perceive(wall_flow(robot, 0.0, 1.5, 20.0, 20.0), Twist(0.3, 0.0))
    wall = (np.asarray(percept.label) == Label.OBSTACLE) & (percept.confidence > 0.3)
    assert wall.sum() > 20
    depth = 1.5 - robot.camera.mount_forward
    assert np.median(1.0 / percept.nearness[wall]) == pytest.approx(depth, rel=0.02)


# --- missions ------------------------------------------------------------------------------------


WALL = BoxSpec(name="wall", at=(0.0, 0.55), size=(19.0, 0.2, 1.0))
"""It is 0.45 m away from the x axis."""


@pytest.fixture
def run() -> MissionRun:
    """From x = 0 to 4 m and back to 2 m in 6 s, led by `go` for 4 s, then by `turn`."""
    logger = RunLogger()
    for tick in range(61):
        pose = Pose(min(tick, 80 - tick) / 10, 0.0, 0.0)
        logger.add(tick / 10, pose, pose, Twist(1.0, 0.0), "go" if tick < 40 else "turn", False)
    log = logger.log()
    metrics = measure(
        log,
        SceneGeometry.from_world(WorldSpec(name="w", x=(-9.0, 9.0), y=(-9.0, 9.0), boxes=(WALL,))),
        start=(0.0, 0.0),
        goal=(2.0, 0.0),
        within=0.5,
        shortest=2.0,
        with_room=2.0,
        discs=((0.0, 0.0, 0.2),),
        succeeded=True,
    )
    verdict = MissionVerdict(Outcome.REACHED, "stopped 0.1 m from b", "turn", 60, 6.0)
    unused: Any = dict.fromkeys(f.name for f in fields(MissionRun) if f.init)
    of_run = {
        "outcome": verdict.outcome,
        "reason": verdict.reason,
        "verdict": verdict,
        "behaviors": ("go", "turn", "avoid"),
        "places": {"a": (0.0, 0.0), "b": (2.0, 0.0), "c": (4.0, 0.3), "far": (9.0, 0.0)},
        "log": log,
    }
    return MissionRun(**{**unused, **vars(metrics), **of_run})


def test_the_goals_are_reached(run: MissionRun) -> None:
    assert_reached(run)
    verdict = MissionVerdict(Outcome.STUCK, "no way", "turn", 60, 6.0)
    stuck = r"reached; stuck after 6\.0 s: no way \(leading .*turn"
    with pytest.raises(AssertionError, match=stuck):
        assert_reached(replace(run, verdict=verdict, outcome=verdict.outcome))


def test_nothing_is_touched(run: MissionRun) -> None:
    assert_no_collision(run)
    log = replace(run.log, contacts=(Contact(2.5, 2.5, 0.0, "chest"),))
    with pytest.raises(AssertionError, match=r"touched chest at \(2\.50, 0\.00\) after 2\.5 s"):
        assert_no_collision(replace(run, log=log))


def test_the_clearance_is_kept(run: MissionRun) -> None:
    assert_clearance(run, 0.2)
    with pytest.raises(AssertionError, match=r"at least 0\.3 m; the smallest was 0\.250 m"):
        assert_clearance(run, 0.3)


def test_places_are_visited_in_order(run: MissionRun) -> None:
    assert_visited(run, "a", "b", "c", "b")
    assert_visited(run, (3.0, 0.0), "c", (3.0, 0.0))
    with pytest.raises(AssertionError, match=r"within 0\.5 m of a after 3\.6 s.*was 2\.00 m"):
        assert_visited(run, "c", "a")
    with pytest.raises(AssertionError, match=r"of far; its smallest distance was 5\.00 m"):
        assert_visited(run, "far")
    with pytest.raises(AssertionError, match=r"smallest distance was 0\.30 m"):
        assert_visited(run, "c", within=0.2)
    with pytest.raises(UnknownNameError, match="place 'fat': did you mean 'far'"):
        assert_visited(run, "fat")


def test_a_behavior_led(run: MissionRun) -> None:
    assert_behavior_led(run, "go", 3.9)
    assert_behavior_led(run, "turn")
    with pytest.raises(AssertionError, match=r"5 s, got 4\.0 s; led: go 4\.0 s, turn 2\.1 s"):
        assert_behavior_led(run, "go", 5)
    with pytest.raises(AssertionError, match=r"avoid to lead for at least 0\.1 s, got 0\.0 s"):
        assert_behavior_led(run, "avoid")
    with pytest.raises(UnknownNameError, match="did you mean 'turn'"):
        assert_behavior_led(run, "tur")
