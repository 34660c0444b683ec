"""Camera effects on rendered scenes of known truth: light, blur, skew, exposure, compression."""

import math
from itertools import pairwise

import cv2
import numpy as np
import pytest
from pydantic import ValidationError
from sim_worlds import PERFECT, drive, frames

from navfw.missions import prepare
from navfw.numerics import Array, Image
from navfw.robot import CameraEffects, CameraModel, RobotModel, SideViews, load_robot
from navfw.robot.camera_models import AutoExposure
from navfw.signals import Pose
from navfw.sim import SensorParams, Simulation, WorldSpec
from navfw.sim.camera import Camera
from navfw.sim.camera_rig import ImageSensor, Shutter, image_motion, light_falloff
from navfw.sim.event_actions import LightChange
from navfw.sim.robot_body import BodyState
from navfw.sim.scenery import Scenery
from navfw.sim.worldspec import LightSpec, TextureSpec, WallSpec

HERE = Pose(0.0, 0.0, 0.0)
CAMERA = CameraModel(width=320, height=240, mount_height=2.7, mount_forward=0.0)
NEAR = 2.95
"""Distance of the walls' faces [m]."""
UNTIL = 0.1
"""Time of the frame [s] in scenes of a robot in motion."""


def hall(*points: tuple[float, float]) -> WorldSpec:
    """A wall of one grey value along ``points``, before the sky."""
    flat = TextureSpec(contrast=0.0, brightness=120.0)
    wall = WallSpec(name="near", points=points, thickness=0.1, height=5.4, texture="flat")
    return WorldSpec(name="hall", x=(-6, 3.1), y=(-6, 6), walls=(wall,), textures={"flat": flat})


EDGE = hall((3.0, 0.0), (3.0, 5.0))
"""A wall whose edge is straight ahead, upright through the whole image."""
FILLED = hall((3.0, -5.0), (3.0, 5.0))
"""A wall that fills the image."""


def body(y: float, yaw: float) -> BodyState:
    return (0.0, y, 0.0), (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))


def wall_columns(v: float, w: float, effects: CameraEffects) -> tuple[Array, Image]:
    """Columns of every row that show the wall, parts included; and the image.

    The robot moves to the left with ``v`` [m/s] and turns with ``w`` [rad/s].
    """
    camera = Camera(CAMERA, LightSpec(), Scenery(EDGE), np.random.default_rng(0))
    shutter = Shutter(effects)
    for time in np.linspace(0.0, UNTIL, 25).tolist():
        shutter.record(time, body(v * time, w * time))
    end = body(v * UNTIL, w * UNTIL)
    image, _ = shutter.render(camera, UNTIL, end, effects.exposure_time)
    wall, sky = float(image[0, 0]), float(image[0, -1])
    return np.sum((sky - image.astype(float)) / (sky - wall), axis=1), image


@pytest.mark.parametrize("w", [1.0, -1.0])
def test_rolling_shutter_skews_an_upright_edge(w: float) -> None:
    columns, _ = wall_columns(0.0, w, CameraEffects(readout_time=0.05))
    assert columns[-1] - columns[0] == pytest.approx(w * 0.05 * CAMERA.focal, abs=0.5)
    middle = columns[CAMERA.height // 2]
    assert middle == pytest.approx(0.5 * (columns[0] + columns[-1]), abs=0.6)
    # the last row is that of the frame's time
    straight, _ = wall_columns(0.0, w, CameraEffects())
    assert np.ptp(straight) < 1e-9
    assert columns[-1] == pytest.approx(straight[0], abs=0.1)


@pytest.mark.parametrize("exposure", [0.02, 0.05])
def test_motion_blur_is_as_long_as_the_way_during_the_exposure(exposure: float) -> None:
    speed = 4.0
    columns, image = wall_columns(speed, 0.0, CameraEffects(exposure_time=exposure))
    levels = (image[0, -1] - image[120].astype(float)) / (float(image[0, -1]) - image[0, 0])
    blurred = np.count_nonzero((levels > 0.02) & (levels < 0.98))
    length = speed * exposure * CAMERA.focal / NEAR
    assert blurred == pytest.approx(length, abs=1.0)
    # the edge is where it was in the middle of the exposure
    edge = 160.0 + speed * (UNTIL - 0.5 * exposure) * CAMERA.focal / NEAR
    assert columns.mean() == pytest.approx(edge, abs=0.7)


def test_a_robot_at_rest_has_sharp_images() -> None:
    effects = CameraEffects(exposure_time=0.05, readout_time=0.03)
    _, image = wall_columns(0.0, 0.0, effects)
    _, sharp = wall_columns(0.0, 0.0, CameraEffects())
    assert np.array_equal(image, sharp)


def test_quaternions_need_no_exact_length() -> None:
    """Those of a URDF's body are a little off: it still is at rest, with and without effects."""
    camera = Camera(CAMERA, LightSpec(), Scenery(EDGE), np.random.default_rng(0))
    off = (0.0, 0.0, 0.0), (0.0, 0.0, 0.1, 0.9949)
    negative = (0.0, 0.0, 0.0), (0.0, 0.0, -0.1, -0.9949)
    assert image_motion(camera, off, off) == image_motion(camera, off, negative) == 0.0
    turned = image_motion(camera, body(0.0, 0.0), body(0.0, 0.05))
    assert turned == pytest.approx(2.0 * CAMERA.focal * 0.05, rel=1e-3)
    for effects in (CameraEffects(), CameraEffects(exposure_time=0.02)):
        shutter = Shutter(effects)
        shutter.record(0.0, off)
        image, _ = shutter.render(camera, 0.1, off, effects.exposure_time)
        assert np.array_equal(image, camera.render(*off)[0])


def simulate(effects: CameraEffects, sensors: SensorParams = PERFECT) -> Simulation:
    robot = RobotModel(camera=CAMERA, camera_effects=effects)
    return Simulation(FILLED, robot, HERE, 0, sensors)


def images(simulation: Simulation, count: int) -> list[Image]:
    return [frame.image for frame in frames(drive(simulation, 0.1 * count, 0.0, 0.0))]


def test_a_flat_wall_darkens_towards_the_corners() -> None:
    falloff = light_falloff(0.6, [CAMERA], [CAMERA])
    assert falloff is not None
    clean = np.full((240, 320), 200, np.uint8)
    image = ImageSensor(CameraEffects(vignetting=0.6)).expose(clean, falloff)
    x, y = np.meshgrid(np.arange(320) - 159.5, np.arange(240) - 119.5)
    angle = np.arctan(np.hypot(x, y) / CAMERA.focal)
    widest = math.atan(math.hypot(159.5, 119.5) / CAMERA.focal)
    assert np.abs(image - 200.0 * (1.0 - 0.6 * (angle / widest) ** 2)).max() <= 0.51
    with simulate(CameraEffects(vignetting=0.6)) as sim:
        seen = images(sim, 1)[0]
        clean, _ = sim.render_from(sim.true_pose())
    assert np.ptp(clean) <= 1
    assert np.abs(seen - clean * falloff).max() < 1.5


def test_vignetting_goes_on_in_side_views_and_landmark_frames() -> None:
    robot = RobotModel(side_views=SideViews(overlap=0.0))
    lens = (robot.camera, *robot.side_cameras)
    whole = light_falloff(0.5, lens, lens)
    fine = light_falloff(0.5, lens, [robot.landmark_view])
    assert whole is not None
    assert fine is not None
    ahead, left, right = np.split(whole, (160, 240), axis=1)
    assert left[60, -1] == pytest.approx(ahead[60, 0], abs=0.01)
    assert right[60, 0] == pytest.approx(ahead[60, -1], abs=0.01)
    assert whole.min() == pytest.approx(0.5, abs=1e-6)
    assert left.min() == whole.min() < ahead.min()
    assert fine[48, 0] == pytest.approx(ahead[60, 0], abs=0.01)


def test_exposure_follows_a_step_of_light_with_its_time_constant() -> None:
    sensor = ImageSensor(CameraEffects(auto_exposure=AutoExposure(target=100.0, time=0.5)))
    bright, dark = np.full((8, 8), 80, np.uint8), np.full((8, 8), 40, np.uint8)
    sensor.settle(bright, None)
    sensor.meter(sensor.expose(bright, None), 0.0)
    means = []
    for step in range(1, 31):
        image = sensor.expose(dark, None)
        means.append(float(image.mean()))
        sensor.meter(image, 0.1 * step)
    errors = np.log(100.0 / np.array(means))
    expected = math.log(2.0) * np.exp(-0.1 * np.arange(30) / 0.5)
    assert errors == pytest.approx(expected, abs=0.02)


def test_exposure_control_reaches_its_target_again_when_the_light_fails() -> None:
    control = AutoExposure(target=100.0, time=0.2)
    noisy = PERFECT.model_copy(update={"image_noise": 2.0})
    with simulate(CameraEffects(auto_exposure=control), noisy) as sim:
        settled = images(sim, 2)
        sim.begin(LightChange(share=0.3))
        after = images(sim, 20)
    assert settled[0].mean() == pytest.approx(100.0, abs=1.0)
    assert after[0].mean() < 40.0
    assert after[-1].mean() == pytest.approx(100.0, abs=2.0)
    amplified = after[-1].std() / settled[0].std()
    assert amplified == pytest.approx(1.0 / 0.3, rel=0.2)


def test_exposure_control_has_limits() -> None:
    bright, dark = np.full((8, 8), 240, np.uint8), np.full((8, 8), 2, np.uint8)
    effects = CameraEffects(auto_exposure=AutoExposure(target=60, max_gain=4), exposure_time=0.02)
    sensor = ImageSensor(effects)
    sensor.settle(bright, None)
    assert sensor.exposure_time == pytest.approx(0.02 * 60 / 240)
    assert sensor.gain == 1.0
    for step in range(100):
        sensor.meter(sensor.expose(dark, None), 0.1 * step)
    assert sensor.gain == 4.0
    assert sensor.exposure_time == 0.02


def test_stronger_compression_loses_more() -> None:
    floor = WorldSpec(name="floor", x=(-6, 6), y=(-6, 6))
    with Simulation(floor, RobotModel(), HERE, 0, PERFECT) as sim:
        scene, _ = sim.render_from(HERE)
    sensors = [ImageSensor(CameraEffects(jpeg_quality=value)) for value in (10, 30, 50, 75, 95)]
    ratios = [cv2.PSNR(scene, sensor.compress(scene)) for sensor in sensors]
    assert all(low + 0.5 < high for low, high in pairwise(ratios))
    assert ratios[-1] > 35.0


def test_effects_are_off_by_default_set_by_options_and_deterministic() -> None:
    assert load_robot("default").camera_effects == CameraEffects()
    webcam = load_robot("webcam").camera_effects
    assert all(getattr(webcam, name) for name in CameraEffects.model_fields)
    options = ["robot=webcam", "robot.camera_effects.jpeg_quality=40"]
    changed = prepare("empty", "straight", overrides=options).mission.spec.robot.camera_effects
    assert changed == webcam.model_copy(update={"jpeg_quality": 40})
    twice = []
    for _ in range(2):
        with simulate(webcam, SensorParams()) as sim:
            twice.append(np.array([f.image for f in frames(drive(sim, 0.4, -4.0, 4.0))]))
    assert np.array_equal(twice[0], twice[1])


def test_the_shutter_fits_between_frames() -> None:
    slow = CameraEffects(exposure_time=0.06, readout_time=0.05)
    with pytest.raises(ValidationError, match=r"0\.11 s, at 10 Hz a frame has 0\.1 s: shorten"):
        RobotModel(camera_effects=slow)
    assert RobotModel(camera=CameraModel(rate=5.0), camera_effects=slow).camera.rate == 5.0
