"""The rendered images obey the camera model: projection, depth, textures, noise; side views."""

import math
from collections.abc import Iterator

import cv2
import numpy as np
import pytest
from pydantic import ValidationError
from sim_worlds import PERFECT

from navfw.numerics import Array
from navfw.robot import CameraModel, RobotModel, SideViews
from navfw.signals import Frame, Pose
from navfw.sim import SensorParams, Simulation, WorldSpec
from navfw.sim.camera import DepthImage
from navfw.sim.event_actions import CameraFault
from navfw.sim.worldspec import BoxSpec, CylinderSpec, WallSpec

WORLD = WorldSpec(
    name="hall",
    x=(-6, 6),
    y=(-6, 6),
    walls=(WallSpec(name="north", points=((4, -6), (4, 6)), thickness=0.2),),
    boxes=(BoxSpec(name="box", at=(2.5, -1.5), size=(1, 1, 1)),),
)
HERE = Pose(-3.0, 0.5, 0.0)


def simulate(camera: CameraModel, sensors: SensorParams = PERFECT) -> Simulation:
    return Simulation(WORLD, RobotModel(camera=camera), HERE, 0, sensors)


@pytest.fixture(scope="module")
def sim() -> Iterator[Simulation]:
    with simulate(CameraModel()) as simulation:
        yield simulation


def visible_points(camera: CameraModel, depth: DepthImage, pose: Pose) -> Array:
    """Every pixel's point (height, width, 3) in the map, by the camera model; nan for the sky."""
    depth = np.where(np.isfinite(depth), depth, np.nan)
    x = np.arange(camera.width) - 0.5 * (camera.width - 1)
    y = np.arange(camera.height) - 0.5 * (camera.height - 1)
    gx, gy = np.meshgrid(x, y)
    rays = np.stack([gx / camera.focal, gy / camera.focal, np.ones_like(gx)], axis=-1)
    base = (rays * depth[..., None]) @ camera.base_from_camera.T
    base += (camera.mount_forward, 0.0, camera.mount_height)
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    rotation = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    points: Array = base @ rotation + np.array([pose.x, pose.y, 0.0])
    return points


@pytest.mark.parametrize(
    "camera",
    [
        CameraModel(),
        CameraModel(pitch=0.3, hfov=1.2),
        CameraModel(width=128, height=80, mount_height=0.25),
    ],
)
def test_points_project_as_the_camera_model_does(camera: CameraModel) -> None:
    """Floor points have height 0, wall points are on the wall: an error of half a pixel fails."""
    pose = Pose(-1.0, 0.5, 0.6)
    with simulate(camera) as simulation:
        _, depth = simulation.render_from(pose)
    points = visible_points(camera, depth, pose)
    floor = (points[..., 2] < 0.05) & (points[..., 0] < 3.6)
    assert floor.mean() > 0.2
    assert np.abs(points[floor][:, 2]).max() < 0.003
    wall = (points[..., 2] > 0.1) & (points[..., 0] > 3.6)
    assert wall.mean() > 0.1
    assert np.abs(points[wall][:, 0] - 3.9).max() < 0.005


def test_texture_repeats_every_two_metres(sim: Simulation) -> None:
    """Two metres before a wall, with f = 80 px, a tile of 2 m is 80 px wide."""
    image, depth = sim.render_from(Pose(3.9 - 2.0 - 0.1, 2.5, 0.0))
    assert np.allclose(depth[:60], 2.0, atol=1e-3)
    upper = image[:60].astype(float)
    assert upper.std() > 25
    assert np.abs(upper[:, :80] - upper[:, 80:]).mean() < 1.0
    assert np.abs(upper[:, :70] - upper[:, 70:140]).mean() > 15


@pytest.mark.parametrize("pitch", [0.0, 0.5])
def test_robot_is_not_in_its_own_image(pitch: float) -> None:
    with simulate(CameraModel(pitch=pitch)) as simulation:
        simulation.read()
        depth = simulation.true_depth()
        points = visible_points(simulation.robot.camera, depth, simulation.true_pose())
        ahead = points[..., 0] - simulation.true_pose().x
        assert ahead[np.isfinite(depth)].min() > simulation.robot.radius
        assert points[-1, :, 2] == pytest.approx(0.0, abs=0.003)


def test_supersampling_keeps_the_geometry(sim: Simulation) -> None:
    pose = Pose(0.5, 1.0, 0.4)
    plain, depth = sim.render_from(pose)
    with simulate(CameraModel(), PERFECT.model_copy(update={"supersample": 2})) as fine:
        smooth, fine_depth = fine.render_from(pose)
    assert smooth.shape == plain.shape
    shift, _ = cv2.phaseCorrelate(plain.astype(float), smooth.astype(float))
    assert np.abs(shift).max() < 0.1
    both = np.isfinite(depth) & np.isfinite(fine_depth)
    assert np.median(np.abs(depth[both] - fine_depth[both]) / depth[both]) < 0.02


def test_image_noise_has_the_specified_standard_deviation_and_is_uncorrelated() -> None:
    with simulate(CameraModel(), PERFECT.model_copy(update={"image_noise": 3.0})) as noisy:
        frames = [noisy.read().frame]
        noisy.advance(0.1)
        frames.append(noisy.read().frame)
        clean, _ = noisy.render_from(noisy.true_pose())
    used = (clean > 20) & (clean < 235)
    noise = [(frame.image.astype(float) - clean)[used] for frame in frames if frame is not None]
    assert len(noise) == 2
    for difference in noise:
        assert difference.std() == pytest.approx(3.0, rel=0.05)
        assert abs(difference.mean()) < 0.1
    assert abs(np.corrcoef(noise[0], noise[1])[0, 1]) < 0.05


CRATES = WorldSpec(
    name="hall",
    x=(-6, 6),
    y=(-6, 6),
    boxes=(BoxSpec(name="crate", at=(0.4, 2.0), size=(1, 1, 0.5)),),
    cylinders=(CylinderSpec(name="column", at=(1.2, -1.5), radius=0.3),),
)
# the camera is above the axle: turning the robot does not translate it
WIDE = RobotModel(camera=CameraModel(mount_forward=0.0), side_views=SideViews())


def first_frame(robot: RobotModel, yaw: float, sensors: SensorParams = PERFECT) -> Frame:
    with Simulation(CRATES, robot, Pose(0.0, 0.0, yaw), 0, sensors) as sim:
        frame = sim.read().frame
    assert frame is not None
    return frame


def test_side_views_overlap_the_image_and_extend_to_the_specified_angle() -> None:
    left, right = WIDE.side_cameras
    assert left.turn == -right.turn > 0.0
    inner = left.turn - 0.5 * left.hfov
    assert inner == pytest.approx(0.5 * WIDE.camera.hfov - math.radians(5.0))
    assert WIDE.seen_aside == pytest.approx(left.turn + 0.5 * left.hfov)
    assert left.focal == pytest.approx(WIDE.camera.focal)
    assert left.height == WIDE.camera.height
    with pytest.raises(ValidationError, match=r"side views reach \d+ degrees"):
        RobotModel(side_views=SideViews(width=400))


@pytest.mark.parametrize("side", [0, 1])
def test_side_view_equals_the_image_of_a_turned_camera(side: int) -> None:
    camera = WIDE.side_cameras[side]
    plain = CameraModel.model_validate(camera.model_dump(exclude={"turn"}))
    turned = first_frame(WIDE.with_camera(plain), camera.turn).image
    seen = first_frame(WIDE, 0.0).sides[side]
    assert seen.shape == turned.shape == (camera.height, camera.width)
    # the wheels settle a little differently under a robot that stands turned
    assert np.mean(np.abs(seen.astype(float) - turned.astype(float))) < 2.0
    assert np.std(seen) > 10.0


def test_side_views_have_the_noise_and_faults_of_the_camera() -> None:
    noisy = first_frame(WIDE, 0.0, PERFECT.model_copy(update={"image_noise": 3.0}))
    clean = first_frame(WIDE, 0.0)
    for one, other in zip((noisy.image, *noisy.sides), (clean.image, *clean.sides), strict=True):
        assert 1.0 < np.std(one.astype(float) - other.astype(float)) < 5.0
    with Simulation(CRATES, WIDE, Pose(0.0, 0.0, 0.0), 0, PERFECT) as sim:
        sim.begin(CameraFault(black=True))
        frame = sim.read().frame
    assert frame is not None
    assert not any(image.any() for image in (frame.image, *frame.sides))


def test_side_views_do_not_change_the_image_and_are_optional() -> None:
    alone = first_frame(WIDE.with_camera(WIDE.camera), 0.3)
    assert np.array_equal(alone.image, first_frame(WIDE, 0.3).image)
    assert RobotModel().side_cameras == ()
    assert RobotModel().seen_aside == pytest.approx(math.radians(45.0))
    assert first_frame(RobotModel(), 0.0).sides == ()
