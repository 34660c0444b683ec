"""Walkers: positions, yielding, the cause of contacts; drops: floor, images, the robot's fall."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sim_worlds import PERFECT, drive

from navfw.errors import WorldError
from navfw.robot import RobotModel
from navfw.signals import Pose, Twist
from navfw.sim import SceneGeometry, Simulation, WorldSpec
from navfw.sim.solids import floor_pieces, treads_of
from navfw.sim.world_changes import Walker, WalkerTrack
from navfw.sim.worldspec import BoxSpec, DropSpec, WalkerSpec

ROBOT = RobotModel()


def anna(**changes: object) -> WalkerSpec:
    data = {"name": "anna", "path": [(2, 0), (-3, 0)], "speed": 0.4, "yields": False, **changes}
    return WalkerSpec.model_validate(data)


def hall_of(*walkers: WalkerSpec) -> WorldSpec:
    return WorldSpec(name="hall", x=(-6, 6), y=(-6, 6), movers=walkers)


def simulate(start: Pose, *walkers: WalkerSpec) -> Simulation:
    return Simulation(hall_of(*walkers), ROBOT, start, 0, PERFECT)


def drive_at(sim: Simulation, speed: float, seconds: float) -> None:
    """Drive at ``speed`` [m/s] for ``seconds`` [s] or until the first contact."""
    drive(sim, seconds, *ROBOT.wheel_speeds(Twist(speed, 0.0)), until_contact=True)


def test_back_and_forth_and_loop() -> None:
    corners = [(0, 0), (2, 0), (2, 1)]
    back_and_forth = Walker(anna(path=corners))
    assert back_and_forth.length == 6.0
    assert back_and_forth.pose_at(1.0) == (1.0, 0.0, 0.0)
    assert back_and_forth.pose_at(2.5) == (2.0, 0.5, math.pi / 2)
    assert back_and_forth.pose_at(3.5) == (2.0, 0.5, -math.pi / 2)
    loop = Walker(anna(path=corners, walk="loop"))
    assert loop.length == pytest.approx(3 + math.sqrt(5))
    assert loop.pose_at(3 + math.sqrt(5) / 2)[:2] == pytest.approx((1.0, 0.5))


@given(
    st.lists(
        st.tuples(st.integers(-5, 5), st.integers(-5, 5)), min_size=2, max_size=6, unique=True
    ),
    st.sampled_from(["loop", "back-and-forth"]),
    st.floats(0, 100),
    st.floats(0, 1),
)
def test_path_is_continuous_and_periodic(
    corners: list[tuple[int, int]], walk: str, travelled: float, step: float
) -> None:
    path = Walker(anna(path=corners, walk=walk))
    pose, later = path.pose_at(travelled), path.pose_at(travelled + step)
    assert math.dist(pose[:2], later[:2]) <= step + 1e-9
    assert path.pose_at(travelled + path.length)[:2] == pytest.approx(pose[:2], abs=1e-9)


def test_phase_sets_the_initial_position_which_must_be_clear_of_the_robot() -> None:
    walker = Walker(anna(phase=0.25))
    assert (walker.x, walker.y) == (-0.5, 0.0)
    with pytest.raises(WorldError, match="'anna' when time begins"):
        simulate(Pose(1.8, 0.2, 0), anna())


def test_moves_in_simulated_time() -> None:
    with simulate(Pose(0, 3, 0), anna()) as sim:
        drive_at(sim, 0.0, 2.0)
        track = sim.walker_track()
    assert track.time[[0, -1]] == pytest.approx([0.0, 2.0])
    assert track.points[-1, 0] == pytest.approx([2.0 - 0.4 * 2.0, 0.0])
    halfway = track.at(np.array([1.0]))
    assert halfway[0, 0] == pytest.approx([1.6, 0.0], abs=1e-6)


def test_depth_image_shows_the_walker_at_its_position() -> None:
    with simulate(Pose(0, 3, 0), anna()) as sim:
        for _ in range(3):
            drive_at(sim, 0.0, 1.0)
            depth = sim.render_from(Pose(-4, 0, 0))[1]
            eye = -4 + ROBOT.camera.mount_forward
            surface = sim.walkers[0].x - sim.walkers[0].spec.radius
            assert depth[60, 80] == pytest.approx(surface - eye, abs=0.02)


def test_walker_that_yields_waits_and_continues() -> None:
    with simulate(Pose(0, 0, 0), anna(yields=True)) as sim:
        drive_at(sim, 0.0, 6.0)
        assert sim.contacts == ()
        assert sim.collision_cause is None
        waiting = sim.walkers[0].x
        assert sim.walkers[0].waiting
        assert waiting == pytest.approx(ROBOT.radius + 0.25 + 0.6, abs=0.01)
        drive_at(sim, -0.15, 4.0)  # the robot makes room
        assert not sim.walkers[0].waiting or sim.walkers[0].x < waiting - 0.3
        assert sim.contacts == ()


def test_walker_yields_only_to_a_robot_in_front() -> None:
    walker = Walker(anna(yields=True))  # at (2, 0), heading -x
    for robot, waits in (
        (Pose(1.2, 0.0, 0.0), True),
        (Pose(1.2, 0.7, 0.0), False),  # beside its lane
        (Pose(2.8, 0.0, 0.0), False),  # behind
        (Pose(0.5, 0.0, 0.0), False),  # far
    ):
        walker.update_waiting(robot, ROBOT.radius)
        assert walker.waiting is waits, robot


@pytest.mark.parametrize(
    ("x", "yaw", "changes", "speed", "cause"),
    [
        (0.0, 0.0, {}, 0.0, "mover"),  # it moves into a standing robot
        (0.5, math.pi, {"speed": 0.6}, 0.1, "mover"),  # and into one from behind
        (-2.0, 0.0, {}, 0.3, "robot"),
        (-2.0, 0.0, {"yields": True}, 0.3, "robot"),
    ],
)
def test_the_one_that_approaches_is_the_cause(
    x: float, yaw: float, changes: dict[str, object], speed: float, cause: str
) -> None:
    with simulate(Pose(x, 0, yaw), anna(**changes)) as sim:
        drive_at(sim, speed, 10.0)
        assert (sim.contacts, sim.collision_cause) == (("anna",), cause)
        apart = math.hypot(sim.walkers[0].x - sim.true_pose().x, sim.true_pose().y)
    assert apart == pytest.approx(ROBOT.radius + 0.25, abs=0.015)


@pytest.mark.parametrize(("speed", "cause"), [(0.2, "mover"), (0.7, "robot")])
def test_the_cause_is_whose_motion_closed_the_distance(speed: float, cause: str) -> None:
    # it stands when touched, after a second in which both have come nearer
    with simulate(Pose(1.1 - 1.2 * speed, 0, 0), anna(speed=0.3)) as sim:
        drive_at(sim, speed, 1.2)
        drive_at(sim, 0.0, 5.0)
        assert (sim.contacts, sim.collision_cause) == (("anna",), cause)


def test_robot_is_the_cause_of_contacts_with_solids() -> None:
    crate = BoxSpec(name="crate", at=(1, 0), size=(1, 1, 1))
    world = hall_of().model_copy(update={"boxes": (crate,)})
    with Simulation(world, ROBOT, Pose(0, 0, 0), 0) as sim:
        drive_at(sim, 0.3, 5.0)
        assert (sim.contacts, sim.collision_cause) == (("crate",), "robot")


def test_clearance_uses_the_walkers_positions_at_each_time() -> None:
    points = np.array([[[0.0, 0.0], [9.0, 9.0]], [[2.0, 0.0], [9.0, 9.0]]])
    track = WalkerTrack(("anna", "ben"), np.array([0.25, 0.5]), np.array([0.0, 2.0]), points)
    here = np.array([[3.0, 0.0]] * 4)
    found = track.clearances(here, np.array([0.0, 1.0, 2.0, 5.0]))
    assert found == pytest.approx([2.75, 1.75, 0.75, 0.75])
    empty = WalkerTrack((), np.zeros(0), np.zeros(1), np.empty((1, 0, 2)))
    assert np.isinf(empty.clearances(here, np.zeros(4))).all()


PIT = {"name": "pit", "x": [3, 4], "y": [1, 2], "depth": 0.8}


def hall(**drop: Any) -> WorldSpec:
    """A walled hall of 6 x 3 m with one drop in its middle."""
    return WorldSpec.model_validate(
        {
            "name": "hall",
            "x": [0, 6],
            "y": [0, 3],
            "walls": [{"name": "wall", "points": [[0, 0], [6, 0], [6, 3], [0, 3], [0, 0]]}],
            "drops": [PIT | drop],
        }
    )


@pytest.mark.parametrize("down", ["east", "west", "north", "south"])
@pytest.mark.parametrize("steps", [0, 3])
def test_robot_that_drives_into_a_drop_falls(down: str, steps: int) -> None:
    world = hall(steps=steps, down=down)
    with Simulation(world, RobotModel(), Pose(2.0, 1.5, 0.0), 0) as simulation:
        drive(simulation, 8.0, 8.0, 8.0, until_contact=True)
        assert simulation.contacts == ("pit",)
        assert simulation.collision_cause == "robot"
        # wheels or a caster have just passed the rim
        assert 2.8 < simulation.true_pose().x < 3.15


def test_robot_that_drives_past_a_drop_does_not_fall() -> None:
    with Simulation(hall(), RobotModel(), Pose(2.0, 0.6, 0.0), 0) as simulation:
        drive(simulation, 8.0, 8.0, 8.0)
        assert simulation.contacts == ()
        assert simulation.true_pose().x == pytest.approx(5.2, abs=0.1)
        assert simulation.true_pose().y == pytest.approx(0.6, abs=0.01)


@pytest.mark.parametrize(("steps", "down"), [(0, "east"), (4, "east"), (4, "west"), (3, "north")])
@pytest.mark.parametrize("yaw", [0.0, 0.4])
def test_depth_image_shows_the_treads_through_the_hole(steps: int, down: str, yaw: float) -> None:
    world = hall(steps=steps, down=down)
    robot = RobotModel()
    eye = Pose(2.0, 1.5 - 1.4 * math.sin(yaw), yaw)
    with Simulation(world, robot, Pose(1.0, 1.5, 0.0), seed=0) as simulation:
        _, depth = simulation.render_from(eye)
    camera = robot.camera
    v, u = np.mgrid[0 : camera.height, 0 : camera.width]
    x, y = u + 0.5 - camera.width / 2, v + 0.5 - camera.height / 2
    ray = np.stack([x / camera.focal, y / camera.focal, np.ones_like(x)], -1)
    ray = ray @ camera.base_from_camera.T
    c, s = math.cos(yaw), math.sin(yaw)
    east, north = c * ray[..., 0] - s * ray[..., 1], s * ray[..., 0] + c * ray[..., 1]
    x0, y0 = eye.x + c * camera.mount_forward, eye.y + s * camera.mount_forward
    floor = camera.mount_height / np.maximum(-ray[..., 2], 1e-6)
    over_x, over_y = x0 + floor * east, y0 + floor * north
    rim = 0.06  # pixels at the rim may have either depth
    drop = world.drops[0]
    hole = (np.abs(over_x - 3.5) < 0.5 - rim) & (np.abs(over_y - 1.5) < 0.5 - rim)
    assert hole.sum() > 100
    # march along the rays that enter the hole until they meet a tread or a side
    far = np.linspace(0.3, 5.0, 1500)
    px = x0 + far * east[hole][:, None]
    py = y0 + far * north[hole][:, None]
    pz = camera.mount_height + far * ray[hole][:, 2][:, None]
    solid = pz < 0.0
    for tread in treads_of(drop):
        within = (px > tread.x[0]) & (px < tread.x[1]) & (py > tread.y[0]) & (py < tread.y[1])
        solid &= ~(within & (pz > -tread.depth))
    expected = far[np.argmax(solid, axis=1)]
    error = np.abs(depth[hole] - expected)
    assert np.median(error) < 0.01
    assert np.mean(error < 0.05) > 0.93
    beside = (floor > 0.6) & (over_x > 2.2) & (over_x < 2.9) & (np.abs(over_y - 1.5) < 0.8)
    assert np.allclose(depth[beside], floor[beside], atol=0.03)


@given(
    st.lists(st.floats(0.0, 10.0), min_size=4, max_size=4, unique=True),
    st.lists(st.floats(0.0, 8.0), min_size=4, max_size=4, unique=True),
)
def test_floor_and_drops_cover_the_world_once(xs: list[float], ys: list[float]) -> None:
    xs, ys = sorted(round(x, 2) for x in xs), sorted(round(y, 2) for y in ys)
    if len({*xs}) < 4 or len({*ys}) < 4:
        return
    drops = tuple(DropSpec(name=f"{i}", x=(xs[i], xs[i + 1]), y=(ys[i], ys[i + 1])) for i in (0, 2))
    world = WorldSpec(name="plain", x=(0.0, 10.0), y=(0.0, 8.0), drops=drops)
    rng = np.random.default_rng(0)
    points = rng.uniform((0, 0), (10, 8), (200, 2))
    inside = sum((piece.distance(points) < 0.0).astype(int) for piece in floor_pieces(world))
    for drop in drops:
        for tread in treads_of(drop):
            inside = inside + (tread.rectangle.distance(points) < 0.0)
    assert np.all(np.asarray(inside) == 1)


def test_shortest_path_leads_around_drops() -> None:
    free = SceneGeometry.from_world(hall().model_copy(update={"drops": ()}))
    plan = SceneGeometry.from_world(hall())
    assert plan.clearance(3.5, 1.5) == pytest.approx(-0.5)
    assert plan.clearance(2.7, 1.5) == pytest.approx(0.3)
    straight, _ = free.shortest_path((1.0, 1.5), (5.0, 1.5), 0.18)
    around, corners = plan.shortest_path((1.0, 1.5), (5.0, 1.5), 0.18)
    assert straight == pytest.approx(4.0)
    assert around > 4.2
    assert plan.clearances(corners).min() > 0.179
