"""Flow that needs more than images: of the aligned floor, and of the simulator's truth."""

import dataclasses
import math

import numpy as np
import pytest
from flow_scene import board_image, cell_truth, room, turn_about

from navfw.camera_geometry.rotations import derotate
from navfw.config import find
from navfw.egomotion.pairing import camera_motion
from navfw.errors import ConfigError, PluginError, SimulationError
from navfw.flow.floor_aligned import FloorAlignedFlow
from navfw.flow.ideal import Ideal, nearness_at, true_vectors
from navfw.missions import SimulatorTruth, prepare
from navfw.missions.oracle import reveal
from navfw.numerics import Array
from navfw.robot import CameraModel, RobotModel
from navfw.signals import CameraMotion, Frame, FramePair, Pose
from navfw.sim import SensorParams, Simulation, load_world

ROBOT = RobotModel()
CAMERA = ROBOT.camera
START = Pose(0.0, 0.0, 0.0)


def pair(now: Pose, camera: CameraModel = CAMERA) -> FramePair:
    motion = camera_motion(ROBOT.with_camera(camera), START, now, 0.2)
    before, after = (Frame(t, board_image(camera, pose)) for t, pose in ((0.0, START), (0.2, now)))
    return FramePair(before, after, motion)


def floor_flow(points: Array, motion: CameraMotion, camera: CameraModel) -> Array:
    """Derotated flow of the floor at ``points``, by METHOD 2.5 and 2.8."""
    down = -camera.base_from_camera[2]
    rays = np.concatenate([points / camera.focal, np.ones((*points.shape[:2], 1))], axis=-1)
    nearness = (rays @ down) / camera.mount_height
    s = motion.translation
    lever = points * s[2] - camera.focal * s[:2]
    return np.asarray(lever * (nearness / (1.0 + s[2] * nearness))[..., None])


@pytest.mark.parametrize(
    ("now", "pitch"),
    [
        (Pose(0.08, 0.0, 0.0), 0.0),
        (Pose(0.1, 0.01, 0.15), 0.0),
        (Pose(0.0, 0.0, -0.2), 0.0),
        (Pose(0.06, 0.0, 0.05), 0.2),
        (Pose(-0.03, 0.0, 0.0), -0.1),
    ],
)
@pytest.mark.parametrize("coarse", [False, True])
def test_flow_of_the_floor_is_what_geometry_says(now: Pose, pitch: float, coarse: bool) -> None:
    camera = CAMERA.model_copy(update={"pitch": pitch})
    aligned, frames = FloorAlignedFlow(ROBOT.with_camera(camera)), pair(now, camera)
    flow = derotate(aligned.compute(frames, coarse), camera)
    expected = floor_flow(flow.points, frames.motion, camera)
    down = flow.points[..., 1] > 14.0 - camera.focal * math.tan(pitch)
    good = (flow.confidence > 0.0) & down
    assert good.sum() > 0.5 * down.sum()
    error = np.hypot(*np.moveaxis(flow.vectors - expected, -1, 0))[good]
    assert np.median(error) < 0.1
    assert np.quantile(error, 0.95) < 0.4


def test_noise_and_darkness_are_not_taken_for_flow_and_other_sizes_refused() -> None:
    given = pair(Pose(0.08, 0.0, 0.0))
    dark = Frame(0.2, np.full_like(given.now.image, 7))
    unlit = FloorAlignedFlow(ROBOT).compute(FramePair(given.past, dark, given.motion))
    assert not unlit.confidence.any()
    noise = np.random.default_rng(1).integers(0, 255, given.now.image.shape, dtype=np.uint8)
    flow = FloorAlignedFlow(ROBOT).compute(FramePair(given.past, Frame(0.2, noise), given.motion))
    assert flow.confidence.mean() < 0.1
    small = Frame(0.2, given.now.image[:60])
    with pytest.raises(ConfigError, match="160 x 60"):
        FloorAlignedFlow(ROBOT).compute(FramePair(given.past, small, given.motion))


def test_a_camera_that_looks_up_sees_no_floor() -> None:
    up = ROBOT.model_copy(update={"camera": CAMERA.model_copy(update={"pitch": -0.62})})
    assert not FloorAlignedFlow(up).floor_visible
    assert FloorAlignedFlow(ROBOT).floor_visible


@dataclasses.dataclass
class Known:
    """Truth of one pair."""

    deep: Array
    moved: CameraMotion

    def depth(self, frame: Frame) -> np.ndarray:
        return self.deep.astype(np.float32)

    def motion(self, pair: FramePair) -> CameraMotion:
        return self.moved


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(("angle", "way"), [(0.05, 0.0), (0.0, 0.06), (-0.1, 0.08)])
def test_it_is_the_true_flow(axis: int, angle: float, way: float) -> None:
    motion = CameraMotion(turn_about(axis, angle), way * np.eye(3)[axis], 0.1)
    scene = room(CAMERA)
    pair, truth = scene.pair(motion)
    ideal = Ideal(ROBOT)
    ideal.set_truth(Known(scene.render(np.eye(3), np.zeros(3), 1)[1], motion))
    flow = ideal.compute(pair)
    seen = flow.confidence > 0
    off = np.linalg.norm(flow.vectors - cell_truth(truth, flow.points, CAMERA), axis=-1)
    assert seen.mean() > 0.75
    assert np.quantile(off[seen], 0.9) < 0.005
    assert flow.motion is pair.motion


def test_what_the_past_image_did_not_show_is_not_trusted() -> None:
    motion = CameraMotion(turn_about(1, 0.2), np.zeros(3), 0.1)
    pair, _ = room(CAMERA).pair(motion)
    ideal = Ideal(ROBOT)
    ideal.set_truth(Known(np.full((120, 160), 2.0), motion))
    confidence = ideal.compute(pair).confidence
    assert not confidence[:, 0].any()
    assert confidence[2:-2, 4:].all()


def test_the_infinitely_far_only_turns_and_nearness_is_not_mixed_across_an_edge() -> None:
    far = np.array([[10.0, -5.0]])
    motion = CameraMotion(np.eye(3), np.array([0.3, 0.0, 1.0]), 0.1)
    np.testing.assert_allclose(true_vectors(far, np.zeros(1), motion, 80.0), [[0, 0]], atol=1e-9)
    depth = np.full((120, 160), 1.0, np.float32)
    depth[:, 80:] = 4.0
    points = np.array([[-0.2, 0.0], [0.2, 0.0], [-0.6, 0.0]])
    np.testing.assert_allclose(nearness_at(points, depth, CAMERA), [1.0, 0.25, 1.0])


def test_an_honest_mission_is_given_nothing() -> None:
    session = prepare("office", "lobby-to-lab", overrides=["mission.timeout=0.2"])
    assert session.run().summary()["oracle"] is False
    session.stack.vision.flow.plugin = Ideal(ROBOT)  # slipped past the stack file
    with session.simulation() as simulation:
        reveal(simulation, session.stack)
        frame = simulation.read().frame
        assert frame is not None
        pair = FramePair(frame, frame, CameraMotion(np.eye(3), np.zeros(3), 0.1))
        with pytest.raises(PluginError, match="only a mission or a benchmark"):
            session.stack.vision.flow.plugin.compute(pair)


def test_the_simulators_truth_is_that_of_its_frames() -> None:
    world, here = load_world(find("world", "office")), Pose(1.6, 1.4, 0.5)
    with Simulation(world, ROBOT, here, 1, SensorParams.preset("perfect")) as simulation:
        truth = SimulatorTruth(simulation)
        first = simulation.read().frame
        start = simulation.true_pose()
        simulation.drive(6.0, 7.0)
        simulation.advance(0.3)
        second = simulation.read().frame
        end = simulation.true_pose()
        assert first is not None
        assert second is not None
        moved = truth.motion(FramePair(first, second, CameraMotion(np.eye(3), np.zeros(3), 0.3)))
        way = math.hypot(end.x - start.x, end.y - start.y)
        assert moved.translation[2] == pytest.approx(way, abs=0.003)
        turn = math.atan2(moved.rotation[0, 2], moved.rotation[2, 2])
        assert turn == pytest.approx(end.yaw - start.yaw, abs=1e-3)
        assert truth.depth(second).shape == (120, 160)
        with pytest.raises(SimulationError):
            truth.depth(first)
        with pytest.raises(SimulationError):
            simulation.true_motion(Frame(9.0, first.image), second)
