"""Odometry corrected by the floor: registration in metres, calibration of wheels and gyro, slip."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from navfw.egomotion import FloorOdometry, FloorRegistration
from navfw.numerics import Array, Image
from navfw.robot import CameraModel, RobotModel
from navfw.signals import CameraMotion, Frame, Odometry, Pose, Twist, YawCorrection

ROBOT = RobotModel()
METRE = 100.0
"""Pixels of the texture per metre."""
KNOWN = np.diag([3e-3, 1e-3, 2e-3]) ** 2


class PaintedFloor:
    """Views of an endless floor with a smooth random texture, and of a wall if there is one."""

    def __init__(
        self,
        seed: int = 0,
        contrast: float = 30.0,
        wall: float = math.inf,
        camera: CameraModel = ROBOT.camera,
    ) -> None:
        self._camera = camera
        rng = np.random.default_rng(seed)
        self._noise = np.random.default_rng(seed + 1)
        self._wall = wall
        rough = rng.standard_normal((2048, 2048), dtype=np.float32)
        smooth = gaussian_filter(rough, 5.0, mode="wrap")
        self._texture = smooth / smooth.std() * contrast + 128.0

    def view(self, pose: Pose, light: float = 1.0) -> Image:
        """The image that the camera of a robot at ``pose`` takes; the wall is at x = ``wall``."""
        camera = self._camera
        y, x = np.mgrid[: camera.height, : camera.width].astype(np.float64)
        right = (x - 0.5 * (camera.width - 1)) / camera.focal
        down = (y - 0.5 * (camera.height - 1)) / camera.focal
        depth = np.where(down > 0.02, camera.mount_height / np.maximum(down, 0.02), 50.0)
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        eye = pose.to_parent(camera.mount_forward, 0.0)
        along, across = c + s * right, s - c * right
        to_wall = (self._wall - eye[0]) / np.maximum(along, 1e-6)
        hit = to_wall < depth
        reach = np.minimum(depth, to_wall)
        u = np.where(hit, 7.0 + (camera.mount_height - down * reach), eye[0] + along * reach)
        v = eye[1] + across * reach
        grey = cv2.remap(
            self._texture,
            (u * METRE % 2048).astype(np.float32),
            (v * METRE % 2048).astype(np.float32),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_WRAP,
        )
        grey = light * grey + self._noise.normal(0.0, 2.0, grey.shape)
        image: Image = np.clip(grey, 0, 255).astype(np.uint8)
        return image


@pytest.mark.parametrize(
    "true",
    [Pose(0.1, 0.0, 0.0), Pose(0.08, 0.004, 0.1), Pose(-0.06, 0.0, 0.0), Pose(0.0, 0.0, 0.1)],
    ids=["ahead", "arc", "back", "turn"],
)
def test_motion_over_the_floor_is_measured_in_metres(true: Pose) -> None:
    floor, registration = PaintedFloor(), FloorRegistration(ROBOT)
    past = registration.prepare(floor.view(Pose(0.0, 0.0, 0.0)))
    now = registration.prepare(floor.view(true))
    guess = Pose(true.x + 0.003, true.y - 0.0005, true.yaw + 0.002)
    found = registration.register(past, now, guess, KNOWN)
    assert found is not None
    off = np.array([found.pose.x - true.x, found.pose.y - true.y, found.pose.yaw - true.yaw])
    assert np.abs(off[0]) < 8e-4
    assert off @ np.linalg.solve(found.covariance, off) < 16.3  # 99.9 % of 3 degrees of freedom
    assert found.share > 0.9


def test_a_change_of_light_is_no_motion() -> None:
    floor, registration = PaintedFloor(), FloorRegistration(ROBOT)
    past = registration.prepare(floor.view(Pose(0.0, 0.0, 0.0)))
    now = registration.prepare(floor.view(Pose(0.1, 0.0, 0.0), light=0.85))
    found = registration.register(past, now, Pose(0.098, 0.0, 0.0), KNOWN)
    assert found is not None
    assert found.pose.x == pytest.approx(0.1, abs=5e-4)


def test_a_bare_floor_tells_nothing_of_the_way() -> None:
    registration = FloorRegistration(ROBOT)
    floor = PaintedFloor(contrast=0.01)
    past, now = (registration.prepare(floor.view(Pose(x, 0.0, 0.0))) for x in (0.0, 0.1))
    found = registration.register(past, now, Pose(0.12, 0.0, 0.0), KNOWN)
    assert found is None or found.covariance[0, 0] > 0.003**2


def drive(
    seconds: float, speed: float, turning: float, scale: float, bias: float
) -> Iterator[tuple[Pose, Odometry]]:
    """True poses and odometry, ten a second, of wheels and a gyro with these errors."""
    true = raw = Pose(0.0, 0.0, 0.0)
    dt = 0.1
    for k in range(round(seconds / dt)):
        yield true, Odometry(k * dt, raw, Twist(scale * speed, turning + bias), 0.0, still=False)
        true = true.compose(_arc(speed * dt, turning * dt))
        raw = raw.compose(_arc(scale * speed * dt, (turning + bias) * dt))


def _arc(way: float, turn: float) -> Pose:
    return Pose(way * math.cos(0.5 * turn), way * math.sin(0.5 * turn), turn)


def test_wheels_and_gyro_are_calibrated_by_the_floor() -> None:
    floor, odometry = PaintedFloor(seed=3), FloorOdometry(ROBOT)
    true, raw = Pose(0.0, 0.0, 0.0), None
    for true, raw in drive(12.0, 0.4, 0.15, scale=1.01, bias=0.004):
        odometry.observe(Frame(raw.time, floor.view(true)), raw)
    assert raw is not None
    corrected = odometry.corrected(raw)
    error = math.dist((corrected.pose.x, corrected.pose.y), (true.x, true.y))
    assert error < 0.003 * 0.4 * 12.0 < math.dist((raw.pose.x, raw.pose.y), (true.x, true.y))
    share, bias = odometry.calibration
    assert share == pytest.approx(1.0 - 1.0 / 1.01, abs=0.002)
    assert bias == pytest.approx(0.004, abs=0.001)
    assert corrected.twist.w == pytest.approx(0.15, abs=0.001)
    assert corrected.by_floor


@pytest.mark.parametrize(
    ("camera", "wall"),
    [(ROBOT.camera, 1.3), (CameraModel(mount_height=0.66, hfov=1.065), 1.9)],
    ids=["low", "high"],
)
def test_a_wall_right_in_front_is_not_taken_for_floor(camera: CameraModel, wall: float) -> None:
    """In the end neither camera sees any floor: the high one from a distance of 1.5 m on."""
    floor = PaintedFloor(wall=wall, camera=camera)
    odometry = FloorOdometry(ROBOT.model_copy(update={"camera": camera}))
    true, raw = Pose(0.0, 0.0, 0.0), None
    for true, raw in drive(4.5, 0.2, 0.0, scale=1.0, bias=0.0):
        odometry.observe(Frame(raw.time, floor.view(true)), raw)
    assert raw is not None
    assert odometry.corrected(raw).pose.x == pytest.approx(true.x, abs=0.015)
    assert not odometry.slipping
    assert not odometry.corrected(raw).by_floor


def test_slipping_wheels_are_noticed_and_corrected() -> None:
    floor, odometry = PaintedFloor(seed=5), FloorOdometry(ROBOT)
    true, raw, noticed = Pose(0.0, 0.0, 0.0), None, False
    for true, raw in drive(5.0, 0.4, 0.0, scale=1.25, bias=0.0):
        odometry.observe(Frame(raw.time, floor.view(true)), raw)
        noticed |= odometry.slipping
    assert raw is not None
    assert noticed
    assert odometry.corrected(raw).pose.x == pytest.approx(true.x, abs=0.06)
    assert raw.pose.x - true.x > 0.4


def test_a_turn_on_skidding_wheels_is_seen_to_move_the_robot_aside() -> None:
    """The turning point lies 6 cm before base_link: a turn by 2 rad moves that by 10 cm."""
    errors = []
    for skid in (0.0, 0.08):
        floor, odometry = (
            PaintedFloor(seed=4),
            FloorOdometry(ROBOT.model_copy(update={"skid": skid})),
        )
        for time, yaw in ((0.1 * k, 0.02 * k) for k in range(101)):
            true = Pose(0.06 * (1.0 - math.cos(yaw)), -0.06 * math.sin(yaw), yaw)
            raw = Odometry(time, Pose(0.0, 0.0, yaw), Twist(0.0, 0.2), 0.0, still=False)
            odometry.observe(Frame(time, floor.view(true)), raw)
        corrected = odometry.corrected(raw).pose
        errors.append(math.dist((corrected.x, corrected.y), (true.x, true.y)))
    assert errors[0] > 0.05, "without it the wheels are believed"
    assert errors[1] < 0.015


def test_yaw_by_the_flow_corrects_the_gyro_bias_once_for_each_stretch() -> None:
    odometry = FloorOdometry(ROBOT)
    bare = np.full((ROBOT.camera.height, ROBOT.camera.width), 128, np.uint8)
    still = CameraMotion(np.eye(3), np.zeros(3), 0.2)
    estimates: list[float] = []
    for _, raw in drive(8.0, 0.4, 0.0, scale=1.0, bias=0.01):
        odometry.observe(Frame(raw.time, bare), raw)
        left = 0.01 - odometry.calibration[1]
        odometry.correct(YawCorrection(-left * still.dt, 5e-4, still))
        estimates.append(odometry.calibration[1])
    assert estimates[-1] == pytest.approx(0.01, abs=0.002)
    assert estimates[10] == estimates[9] or estimates[11] == estimates[10]


def test_slip_a_stop_and_a_jump_of_the_bias_leave_these_numbers() -> None:
    floor, odometry = PaintedFloor(seed=6), FloorOdometry(ROBOT)
    still = CameraMotion(np.eye(3), np.zeros(3), 0.2)
    for k, (true, ideal) in enumerate(drive(4.0, 0.4, 0.2, scale=1.03, bias=0.01)):
        raw = replace(ideal, silent=k in (8, 9), still=k == 30, yaw_bias=0.001 * k)
        odometry.observe(Frame(raw.time, floor.view(true)), raw)
        if k % 5 == 4:
            odometry.correct(YawCorrection(0.002 if k == 24 else 2e-4, 1e-3, still))
    state = [0.039919, 0.00041139, 0.021882, 0.021409, 0.029867]
    sigmas = [3.6395e-4, 3.1687e-5, 7.7921e-5, 8.9349e-3, 2.6358e-4]
    assert odometry._state == pytest.approx(state, rel=1e-3)
    assert np.sqrt(odometry._covariance.diagonal()) == pytest.approx(sigmas, rel=1e-3)
    found = odometry.corrected(raw)
    pose, twist = (1.39336, 0.58785, 0.79605), (0.40318, 0.21913)
    assert dataclasses.astuple(found.pose) == pytest.approx(pose, abs=1e-4)
    assert dataclasses.astuple(found.twist) == pytest.approx(twist, abs=1e-4)


def test_a_reset_forgets_all() -> None:
    odometry = FloorOdometry(ROBOT)
    raw = Odometry(1.0, Pose(1.0, 0.0, 0.3), Twist(0.1, 0.0), 0.02, still=False)
    bare: Array = np.full((ROBOT.camera.height, ROBOT.camera.width), 128.0)
    odometry.observe(Frame(1.0, bare.astype(np.uint8)), raw)
    odometry.reset()
    assert odometry.corrected(raw) is raw
    assert odometry.calibration == (0.0, 0.0)
