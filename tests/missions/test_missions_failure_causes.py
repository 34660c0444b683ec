"""Symptoms from a run's log, the true geometry and the local map; each cause from symptoms."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from navfw.missions import MissionResult, prepare
from navfw.missions.failure_causes import FailureSymptoms, classify, collect_symptoms, sentence
from navfw.missions.outcome import Cause, MissionVerdict, Outcome
from navfw.missions.session import Session
from navfw.mofis.mofis import DecisionInputs
from navfw.movers.tracking import Track
from navfw.plugins import default_registry
from navfw.recording.run_observers import Contact, RunLog, RunLogger
from navfw.signals import Belief, Odometry, Pose, Sight, Twist
from navfw.sim import SceneGeometry, Simulation, WorldSpec
from navfw.sim.world_changes import ChangeTrack, WalkerTrack
from navfw.sim.worldspec import BoxSpec, CylinderSpec

CLAMP_MAX = 3.0


def motion(driven: float, gained: float, lately: float, turned: float) -> dict[str, Any]:
    """Ways [m] and progress [m] in all; way [m] and turns [rad] in the last 30 s."""
    late = {"recent": 30.0, "recent_driven": lately, "recent_turned": turned}
    return {"driven": driven, "gained": gained, **late}


DRIVES = motion(20.0, 18.0, 9.0, 2.0)
CIRCLES = motion(20.0, 4.0, 9.0, 30.0)
TURNS = motion(6.0, 5.0, 0.1, 40.0)
STANDS = motion(6.0, 5.0, 0.1, 0.3)
PATH = {"path_costs": (5.0, 4.5, 4.0)}
PHANTOMS = {"path_costs": (math.inf, 4.0, 4.0)}


@pytest.mark.parametrize("outcome", [Outcome.STUCK, Outcome.TIMEOUT])
@pytest.mark.parametrize(
    ("symptoms", "cause"),
    [
        ({"estimate_error": 0.8, **STANDS}, Cause.ESTIMATE_ERROR),
        ({**PHANTOMS, **STANDS}, Cause.PHANTOM_OBSTACLES),
        ({"path_costs": (9.0, 4.0, 4.0), **CIRCLES}, Cause.PHANTOM_OBSTACLES),
        ({"path_costs": (math.inf, math.inf, 5.0), **STANDS}, Cause.BLURRED_MAP),
        ({"path_costs": (9.0, 8.0, 5.0), **CIRCLES}, Cause.BLURRED_MAP),
        ({"path_costs": (math.inf, math.inf, math.inf)}, Cause.LOCAL_GOAL_UNREACHABLE),
        ({**PATH, **STANDS}, Cause.STANDSTILL),
        ({**PATH, **STANDS, "vetoed": 0.6}, Cause.VETOED),
        ({**PATH, **CIRCLES}, Cause.OSCILLATING),
        ({**PATH, **TURNS}, Cause.OSCILLATING),
        ({**STANDS}, Cause.STANDSTILL),
        ({}, Cause.UNKNOWN),
    ],
)
def test_stuck_and_timeout(outcome: Outcome, symptoms: dict[str, Any], cause: Cause) -> None:
    assert classify(FailureSymptoms(outcome, **symptoms)) is cause


@pytest.mark.parametrize("outcome", [Outcome.STUCK, Outcome.TIMEOUT])
@pytest.mark.parametrize(
    ("symptoms", "nothing", "little"),
    [
        ({**PATH, **TURNS}, Cause.NOTHING_SEEN, Cause.LITTLE_SEEN),
        ({**PATH, **STANDS}, Cause.NOTHING_SEEN, Cause.LITTLE_SEEN),
        ({**PHANTOMS, **TURNS}, Cause.NOTHING_SEEN, Cause.PHANTOM_OBSTACLES),
        ({"estimate_error": 0.8, **TURNS}, Cause.ESTIMATE_ERROR, Cause.ESTIMATE_ERROR),
    ],
)
def test_a_robot_that_sees_too_little_to_go_on(
    outcome: Outcome, symptoms: dict[str, Any], nothing: Cause, little: Cause
) -> None:
    assert classify(FailureSymptoms(outcome, sight=Sight.NOTHING, **symptoms)) is nothing
    assert classify(FailureSymptoms(outcome, sight=Sight.LITTLE, **symptoms)) is little


HIT = {"bearing": 0.1, "speed": 0.3, "mapped": "unknown"}
BLOCKED = {**HIT, "mapped": "occupied"}


@pytest.mark.parametrize(
    ("outcome", "symptoms", "cause"),
    [
        (Outcome.COLLIDED, HIT, Cause.UNSEEN),
        (Outcome.COLLIDED, {**HIT, "mapped": "free"}, Cause.MAPPED_AS_FREE),
        (Outcome.COLLIDED, BLOCKED, Cause.DROVE_INTO),
        (Outcome.COLLIDED, {**BLOCKED, "bearing": -1.4}, Cause.TURNED_INTO),
        (Outcome.COLLIDED, {**BLOCKED, "bearing": 3.0, "speed": -0.1}, Cause.REVERSED_INTO),
        (Outcome.COLLIDED, {**HIT, "bearing": 0.2, "speed": -0.1}, Cause.UNSEEN),
        (Outcome.COLLIDED, {**HIT, "mapped": ""}, Cause.OBSTACLE),
        (Outcome.COLLIDED, {**BLOCKED, "by_mover": True}, Cause.MOVER),
        (Outcome.LOST, {"estimate_error_max": 0.4, "slack": 0.1}, Cause.ESTIMATE_ERROR),
        (Outcome.LOST, {"estimate_error_max": 0.02, "slack": 0.1}, Cause.GOAL_MISSED),
        (Outcome.TIMEOUT, {**DRIVES}, Cause.SLOW),
        (Outcome.TIMEOUT, {**DRIVES, "sight": Sight.LITTLE}, Cause.SLOW),
        (Outcome.STUCK, {**DRIVES}, Cause.OSCILLATING),
        (Outcome.FAULT, {"fault": Cause.BAD_COMMAND}, Cause.BAD_COMMAND),
        (Outcome.FAULT, {}, Cause.UNKNOWN),
    ],
)
def test_causes_of_one_outcome(outcome: Outcome, symptoms: dict[str, Any], cause: Cause) -> None:
    assert classify(FailureSymptoms(outcome, **symptoms)) is cause


@pytest.mark.parametrize("outcome", list(Outcome))
def test_every_failure_has_a_cause_and_nothing_else_has(outcome: Outcome) -> None:
    failed = outcome not in {Outcome.REACHED, Outcome.CANCELLED}
    assert (classify(FailureSymptoms(outcome)) is not None) == failed


@pytest.fixture(scope="module")
def empty() -> Session:
    """A straight drive of 3 m from (0, 0); the tests put objects in its path."""
    return prepare("empty", "straight", registry=default_registry())


def session_with(empty: Session, **objects: Any) -> Session:
    world = WorldSpec(name="w", x=(-6.0, 6.0), y=(-6.0, 6.0), **objects)
    return replace(empty, world=world, plan=SceneGeometry.from_world(world))


def log_to(x: float, y: float, yaw: float, contact: str = "", speed: float = 0.4) -> RunLog:
    """Four seconds straight to (x, y), ending with a contact with the body ``contact``."""
    logger = RunLogger()
    for tick in range(240):
        pose = Pose(x, y, yaw).compose(Pose(speed * (tick - 239) / 60.0, 0.0, 0.0))
        logger.add(tick / 60.0, pose, pose, Twist(speed, 0.0), "go_to_xy", False)
    if contact:
        logger.contacts.append(Contact(239 / 60.0, x, y, contact))
    return logger.log()


OFFSET = Pose(0.7, -0.4, 0.3)
"""Pose of the map frame in odom, other than the identity, to detect mixed-up frames."""


def result_of(
    session: Session, outcome: Outcome, log: RunLog, occupied: list[tuple[float, float]]
) -> MissionResult:
    """A run with this outcome; the local map is occupied at these points (map frame)."""
    verdict = MissionVerdict(outcome, "reason", "go_to_xy", log.ticks, float(log.time[-1]))
    stack = session.stack
    stack.start(session.mission.start, session.mission.goals)
    now = Pose(*log.true[-1])
    odometry = Odometry(float(log.time[-1]), OFFSET.compose(now), Twist(0.3, 0.0), 0.0, False)
    occupancy = stack.local_map.occupancy
    occupancy.update(odometry.pose, odometry.time)
    rows, columns = np.indices(occupancy.log_odds.shape)
    for x, y in occupied:
        row, column = occupancy.index(*OFFSET.to_parent(x, y))
        near = np.hypot(rows - row, columns - column) <= 2
        occupancy.log_odds[near] = CLAMP_MAX
    belief = Belief(odometry.time, now, np.zeros((3, 3)))
    stack.mofis.decide(DecisionInputs(odometry, belief, session.mission.goals[-1]))
    stack.state = replace(stack.state, time=odometry.time, odometry=odometry, belief=belief)
    ended = SimpleNamespace(
        timings=SimpleNamespace(render=0.0, physics=0.0, sensors=0.0, landmarks=0.0),
        collision_cause=None,
        change_track=lambda: ChangeTrack(()),
        walker_track=lambda: None,
    )
    drive: Any = SimpleNamespace(
        verdict=verdict,
        log=log,
        sim_time=4.0,
        wall_time=1.0,
        faults=(),
        events=SimpleNamespace(log=()),
    )
    return MissionResult.of(session, drive, cast(Simulation, ended))


def symptoms_of(*ended: Any) -> Any:
    """The symptoms of ``result_of`` these arguments; the parts that a test reads are there."""
    return collect_symptoms(result_of(*ended))


@pytest.mark.parametrize("mapped", [True, False])
@pytest.mark.parametrize("yaw", [0.0, 2.1])
def test_a_frontal_collision(empty: Session, mapped: bool, yaw: float) -> None:
    x, y = 0.38 * math.cos(yaw), 0.38 * math.sin(yaw)  # the robot's radius is 0.18 m
    session = session_with(empty, cylinders=(CylinderSpec(name="post", at=(x, y), radius=0.2),))
    rim = (0.18 * math.cos(yaw), 0.18 * math.sin(yaw))
    log = log_to(0.0, 0.0, yaw, "post")
    symptoms = symptoms_of(session, Outcome.COLLIDED, log, [rim] if mapped else [])
    assert symptoms.bearing == pytest.approx(0.0, abs=0.01)
    assert symptoms.speed == pytest.approx(0.4, abs=0.01)
    assert classify(symptoms) is (Cause.DROVE_INTO if mapped else Cause.UNSEEN)


@pytest.mark.parametrize(("height", "told"), [(1.0, "post"), (0.05, "a low foot (post)")])
def test_a_failure_is_told_in_a_sentence(empty: Session, height: float, told: str) -> None:
    post = CylinderSpec(name="post", at=(0.38, 0.0), radius=0.2, height=height)
    session = session_with(empty, cylinders=(post,))
    ended = result_of(session, Outcome.COLLIDED, log_to(0.0, 0.0, 0.0, "post"), [])
    assert sentence(Cause.UNSEEN, ended) == f"{told} was never seen"
    assert sentence(Cause.SLOW, ended) == "the robot was still on its way to the goal"
    assert sentence(Cause.ESTIMATE_ERROR, ended) == "the robot was not where it believed to be"
    state = session.stack.state
    assert state.belief is not None
    session.stack.state = replace(state, belief=replace(state.belief, lost=True))
    assert sentence(Cause.ESTIMATE_ERROR, ended) == "the robot did not find out where it was"


@pytest.mark.parametrize(
    ("path", "tracked", "told"),
    [
        ([(3.0, 0.0), (0.43, 0.0)], None, "in view for the last 4.0 s, was not known to be there"),
        ([(-3.0, 0.0), (-0.43, 0.0)], (0.5, 0.0), "out of view, was taken to be 0.9 m from where"),
        ([(3.0, 0.0), (0.43, 0.0)], (0.5, 0.0), "in view for the last 4.0 s and tracked"),
    ],
)
def test_how_a_walker_was_missed_is_told(
    empty: Session,
    path: list[tuple[float, float]],
    tracked: tuple[float, float] | None,
    told: str,
) -> None:
    points = np.array(path)[:, None]
    movers = WalkerTrack(("anna",), np.array([0.25]), np.array([0.0, 4.0]), points)
    ended = result_of(empty, Outcome.COLLIDED, log_to(0.0, 0.0, 0.0, "anna"), [])
    stack = SimpleNamespace(**vars(ended.session.stack))
    state = np.array([*OFFSET.to_parent(*tracked), 0.0, 0.0]) if tracked else None
    tracks = () if state is None else (Track(state, np.eye(4), 0.25, 4.0),)
    stack.tracker = SimpleNamespace(confirmed=tracks)
    session: Any = SimpleNamespace(stack=stack, plan=empty.plan)
    said = sentence(Cause.MAPPED_AS_FREE, replace(ended, movers=movers, session=session))
    assert said.startswith(f"a walker (anna), {told}")


def test_a_collision_while_reversing(empty: Session) -> None:
    session = session_with(empty, boxes=(BoxSpec(name="crate", at=(-0.68, 0.1), size=(1, 1, 1)),))
    log = log_to(0.0, 0.0, 0.0, "crate", speed=-0.15)
    symptoms = symptoms_of(session, Outcome.COLLIDED, log, [])
    assert abs(symptoms.bearing) == pytest.approx(math.pi, abs=0.01)
    assert classify(symptoms) is Cause.REVERSED_INTO


def test_a_collision_with_a_mover_is_at_its_position_at_that_time(empty: Session) -> None:
    """It moves past the robot's left side and is touched there, 0.43 m from its centre."""
    points = np.array([[[0.0, 2.0]], [[0.0, 0.43]]])
    movers = WalkerTrack(("walker",), np.array([0.25]), np.array([0.0, 4.0]), points)
    for cause, expected in (("mover", Cause.MOVER), ("robot", Cause.TURNED_INTO)):
        ended = result_of(empty, Outcome.COLLIDED, log_to(0, 0, 0, "walker"), [(0.0, 0.18)])
        symptoms = collect_symptoms(replace(ended, movers=movers, collision_cause=cause))
        assert symptoms.bearing == pytest.approx(0.5 * math.pi, abs=0.01)
        assert classify(symptoms) is expected


WALL = [(1.0, 0.05 * i) for i in range(-75, 76)]
"""Occupied points across the whole local map, 1 m ahead of the origin."""


def test_a_mapped_wall_that_does_not_exist_is_a_phantom(empty: Session) -> None:
    symptoms = symptoms_of(empty, Outcome.STUCK, log_to(0.0, 0.0, 0.0), WALL)
    assert symptoms.path_costs[1] == symptoms.path_costs[2] < 6.0  # 3 m of unknown floor
    assert classify(symptoms) is Cause.PHANTOM_OBSTACLES


def test_a_mapped_wall_that_exists_is_no_phantom(empty: Session) -> None:
    walls = tuple(
        BoxSpec(
            name=f"wall {x}, {y}", at=(x, y), size=(2.0 - 1.9 * abs(x), 2.0 - 1.9 * abs(y), 1.0)
        )
        for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))
    )
    session = session_with(empty, boxes=walls)
    line = [-1.0 + 0.05 * i for i in range(41)]
    square = [point for a in line for point in ((a, 1.0), (a, -1.0), (1.0, a), (-1.0, a))]
    symptoms = symptoms_of(session, Outcome.STUCK, log_to(0.0, 0.0, 0.0), square)
    assert symptoms.path_costs[1] == math.inf
    assert classify(symptoms) is Cause.LOCAL_GOAL_UNREACHABLE


def test_a_gap_closed_by_blurred_edges_is_blamed_on_the_blur(empty: Session) -> None:
    """A wall with a gap 0.8 m wide; in the local map its ends are too thick to pass."""
    walls = tuple(
        BoxSpec(name=f"wall {side:+d}", at=(1.0, side * 3.4), size=(0.1, 6.0, 1.0))
        for side in (1, -1)
    )
    session = session_with(empty, boxes=walls)
    line = [-4.5 + 0.05 * i for i in range(181)]
    thick = [(1.0, y) for y in line if abs(y) > 0.2]
    symptoms = symptoms_of(session, Outcome.STUCK, log_to(0.0, 0.0, 0.0), thick)
    assert symptoms.path_costs[1] > 1.5 * symptoms.path_costs[2]
    assert classify(symptoms) is Cause.BLURRED_MAP


def test_progress_is_measured_along_the_shortest_path(empty: Session) -> None:
    """From 1.6 m behind the start to 0.5 m ahead of it; the goal is at 3 m."""
    symptoms = symptoms_of(empty, Outcome.TIMEOUT, log_to(0.5, 0.0, 0.0), [])
    assert symptoms.driven == pytest.approx(1.59, abs=0.02)
    assert symptoms.gained == pytest.approx(0.5, abs=0.01)
    assert symptoms.recent_turned == pytest.approx(0.0)
    assert classify(symptoms) is Cause.OSCILLATING
    slow = symptoms_of(empty, Outcome.TIMEOUT, log_to(1.5, 0.0, 0.0), [])
    assert classify(slow) is Cause.SLOW


@pytest.mark.parametrize("sight", list(Sight))
def test_sight_is_the_median_over_the_end_of_the_run(empty: Session, sight: Sight) -> None:
    log = log_to(0.5, 0.0, 0.0)
    early = len(log.time) // 3
    others = np.where(np.arange(len(log.time)) < early, (sight + 1) % 3, sight).astype(np.int8)
    assert symptoms_of(empty, Outcome.STUCK, replace(log, sight=others), []).sight is sight
