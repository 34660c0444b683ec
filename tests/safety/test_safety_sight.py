"""What the safety monitor sees: valid readings and images, and the path ahead."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from behavior_samples import scene
from safety_samples import ROBOT, monitor_with, odometry, picture, reading

from navfw.localmap import LocalMap
from navfw.localmap.path_sight import PathSight
from navfw.numerics import Array, Image
from navfw.safety import SafetyMonitor
from navfw.safety.monitor import Senses
from navfw.signals import Percept, Twist

RATE = 60.0
AHEAD = Twist(0.15, 0.0)


def percept(known: float = 1.0, low: bool = True) -> Percept:
    """Of open floor; a share of the lower half is known, or of the upper one, all else unknown."""
    made = scene().percept
    assert made is not None
    rows, cols = made.confidence.shape
    confidence = np.zeros((rows, cols))
    half = confidence[rows // 2 :] if low else confidence[: rows // 2]
    half[:, :] = np.random.default_rng(0).random(half.shape) < known
    return replace(made, confidence=confidence)


def drive(monitor: SafetyMonitor, seconds: float, begin: float = 0.0, wanted: Twist = AHEAD) -> str:
    """Follow the monitor's twist from time ``begin`` [s]; the reason of its last verdict."""
    verdict = monitor.limit(wanted, begin, odometry(begin, 0.0).pose)
    for tick in range(round(seconds * RATE)):
        time = begin + tick / RATE
        measured = odometry(time, 0.0, v=verdict.twist.v)
        monitor.update(reading(time, picture() if tick % 6 == 0 else None), measured)
        verdict = monitor.limit(wanted, time, measured.pose)
        assert verdict.twist.w == wanted.w
    return verdict.reason


def test_without_sight_of_the_path_the_robot_advances_a_little_and_stops_with_a_reason() -> None:
    monitor = monitor_with()
    monitor.local_map.sight.observe(percept(0.0))
    assert drive(monitor, 1.9) == ""
    assert "nothing is seen of the path ahead" in drive(monitor, 1.0, 1.9)
    assert monitor.failure is None
    drive(monitor, monitor.params.give_up, 2.9, Twist(0.15, 0.5))
    assert "nothing is seen of the path ahead" in str(monitor.failure)


def test_reverse_and_turns_are_no_advance_and_sight_ends_the_standstill() -> None:
    monitor = monitor_with()
    monitor.local_map.sight.observe(percept(0.0))
    for begin, wanted in ((0.0, Twist(-0.1, 0.0)), (5.0, Twist(0.0, 0.8))):
        drive(monitor, 5.0, begin, wanted)
    assert drive(monitor, 1.9, 10.0) == ""
    assert drive(monitor, 1.1, 11.9)
    for _ in range(40):
        monitor.local_map.sight.observe(percept())
    assert drive(monitor, 5.0, 13.1) == ""
    assert monitor.failure is None


@pytest.mark.parametrize(
    ("known", "unobserved", "speed", "reason"),
    [
        (1.0, 0.0, 0.15, "unobserved space ahead"),
        (0.4, 0.0, 0.0, "unobserved space ahead"),
        (0.4, 10.0, 0.25, "little is seen of the path ahead: too little texture above the noise"),
    ],
)
def test_weak_sight_limits_the_speed_and_allows_no_creeping_into_the_unobserved(
    known: float, unobserved: float, speed: float, reason: str
) -> None:
    monitor = monitor_with(unobserved=unobserved, start_creep=0.0)
    monitor.local_map.sight.observe(percept(known))
    verdict = monitor.limit(Twist(0.4, 0.3), 0.0, odometry(0.0, 0.0).pose)
    assert (verdict.twist, verdict.reason) == (Twist(speed, 0.3), reason)


@pytest.mark.parametrize(("way", "settings"), [(0.1, {"start_creep": 0.1}), (0.3, {})])
def test_on_the_first_way_it_creeps_with_weak_sight_all_the_same(
    way: float, settings: dict[str, float]
) -> None:
    monitor, driven = monitor_with(unobserved=0.0, **settings), 0.0
    monitor.local_map.sight.observe(percept(0.4))
    for tick in range(200):
        time = tick / RATE
        twist = monitor.limit(AHEAD, time, odometry(0.0).pose).twist
        driven += twist.v / RATE
        shown = picture() if tick % 6 == 0 else None
        monitor.update(reading(time, shown), odometry(time, driven, v=twist.v))
    assert driven == pytest.approx(way, abs=0.01)
    monitor.reset()
    assert monitor.limit(AHEAD, 0.0, odometry(0.0).pose).twist.v == monitor.params.creep


@pytest.mark.parametrize(
    ("known", "low", "weak", "none"),
    [
        (0.0, True, True, True),
        (0.05, True, True, True),
        (0.4, True, True, False),
        (0.9, True, False, False),
        (1.0, False, True, True),
    ],
)
def test_the_cells_of_the_path_decide(known: float, low: bool, weak: bool, none: bool) -> None:
    assert not seen_by().weak, "no judgement before the first percept"
    sight = seen_by(percept(known, low))
    assert (sight.weak, sight.none, bool(sight.judgement.trouble)) == (weak, none, weak)


@pytest.mark.parametrize(("confidence", "none"), [(0.01, False), (0.0099, True)])
def test_a_cell_is_known_from_a_confidence_of_a_hundredth_on(confidence: float, none: bool) -> None:
    made = percept()
    faint = replace(made, confidence=np.full(made.confidence.shape, confidence))
    assert seen_by(faint).none == none


def seen_by(*percepts: Percept) -> PathSight:
    sight = PathSight(ROBOT)
    for percept in percepts:
        sight.observe(percept)
    return sight


def test_two_sudden_percepts_change_the_path_for_four_more_but_not_the_judgement() -> None:
    sight = seen_by(percept(), *[percept(0.0)] * 2)
    for left in range(5, -1, -1):
        assert (sight.weak, sight.changed) == (False, left > 0)
        sight.observe(percept())
    assert not seen_by(percept(), percept(0.0), percept()).changed
    assert seen_by(percept(), *[percept(0.0)] * 21).none


@pytest.mark.parametrize(
    ("before", "then", "contrast", "appeared"),
    [
        (1.0, (0.4, 0.5), 8, True),
        (1.0, (0.4, 1.0), 8, False),
        (1.0, (0.7, 0.5, 0.4), 8, False),
        (0.8, (0.1, 0.1), 8, False),
        (1.0, (0.4, 0.4), 6, False),
    ],
)
def test_where_the_path_was_well_seen_a_sudden_loss_is_something_that_has_appeared(
    before: float, then: tuple[float, ...], contrast: float, appeared: bool
) -> None:
    sight = seen_by(*[percept(before)] * 30)
    sight.contrast = contrast
    for share in then:
        assert not sight.appeared
        sight.observe(percept(share))
    assert sight.appeared is appeared


@pytest.mark.parametrize(
    ("twist", "doubted"), [(Twist(0.3, 0.1), True), (Twist(0.3, 0.6), False), (AHEAD, False)]
)
def test_what_appears_before_a_robot_that_drives_straight_on_bars_its_way(
    twist: Twist, doubted: bool
) -> None:
    chosen = LocalMap(ROBOT)
    for k in range(32):
        measured = replace(odometry(0.1 * k, 0.0), twist=twist)
        shown = replace(percept(1.0 if k < 30 else 0.2), time=0.1 * k)
        chosen.update(measured, [shown], None, measured.pose)
    assert (chosen.free_distance(measured.pose, Twist(0.3, 0.0)).contact < 1.0) is doubted


def textured(contrast: float, seed: int = 0, blur: float = 1.0) -> Image:
    """Floor of that contrast behind a lens of ``blur`` [px], and sharp things above the horizon."""
    rng = np.random.default_rng(seed)
    height, width = ROBOT.camera.height, ROBOT.camera.width
    grain: Array = rng.normal(size=(height, width))
    if blur:
        grain = np.asarray(cv2.GaussianBlur(grain, (0, 0), blur), dtype=np.float64)
    image: Array = 128.0 + contrast * grain / float(grain.std())
    image[: height // 3] = 255.0 * (rng.random((height // 3, width)) < 0.5)
    return np.clip(image.round(), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(("contrast", "weak"), [(2.0, True), (6.0, True), (9.0, False)])
def test_floor_of_little_contrast_is_seen_weakly(contrast: float, weak: bool) -> None:
    sight = seen_by(percept())
    sight.observe_image(textured(contrast))
    assert sight.contrast == pytest.approx(contrast, rel=0.1)
    assert (sight.weak, sight.none) == (weak, False)


@pytest.mark.parametrize("level", [1.0, 2.0, 4.0])
def test_noise_alone_shows_nothing_however_strong_it_is(level: float) -> None:
    sight = seen_by(percept(0.4))
    assert "little is seen" in sight.judgement.trouble
    for seed in range(20):
        sight.observe_image(textured(level, seed, blur=0.0))
    assert "nothing is seen" in sight.judgement.trouble


def test_single_images_do_not_change_the_judgement() -> None:
    sight = PathSight(ROBOT)
    sight.observe_image(textured(12.0))
    sight.observe_image(textured(2.0))
    assert sight.judgement.trouble == ""
    for seed in range(20):
        sight.observe_image(textured(3.0, seed))
    assert "little is seen" in sight.judgement.trouble
    sight.reset()
    assert sight.judgement.trouble == ""


def test_a_camera_that_sees_no_floor_judges_no_image() -> None:
    up = ROBOT.model_copy(update={"camera": ROBOT.camera.model_copy(update={"pitch": -0.9})})
    sight = PathSight(up)
    sight.observe_image(textured(2.0))
    assert not sight.weak


def test_the_contrast_does_not_depend_on_the_number_of_pixels() -> None:
    rng = np.random.default_rng(3)
    image = rng.integers(90, 150, (30, 40)).astype(np.uint8)
    contrasts = []
    for width, height in ((160, 120), (320, 240), (640, 480)):
        camera = ROBOT.camera.model_copy(update={"width": width, "height": height})
        sight = PathSight(ROBOT.with_camera(camera))
        wide = cv2.resize(image, (width, height), interpolation=cv2.INTER_LINEAR)
        sight.observe_image(np.asarray(wide, dtype=np.uint8))
        contrasts.append(sight.contrast)
    assert min(contrasts) > 5.0
    assert max(contrasts) / min(contrasts) < 1.1


@pytest.mark.parametrize(("contrast", "weak", "none"), [(40, False, False), (16, True, True)])
def test_a_floor_of_high_contrast_is_seen_though_few_of_its_cells_are_matched(
    contrast: int, weak: bool, none: bool
) -> None:
    """As near floor under a low camera, whose motion is beyond the flow's search."""
    sight, rng = PathSight(ROBOT), np.random.default_rng(2)
    shape = ROBOT.camera.height, ROBOT.camera.width
    for _ in range(40):
        sight.observe(percept(0.0))
        sight.observe_image(rng.integers(100, 100 + contrast * 2, shape).astype(np.uint8))
    assert (sight.weak, sight.none) == (weak, none)


# --- validity of the sensors: ages, and why an image is not valid ---------------------------------


def flat(mean: float, spread: float) -> Image:
    """An image whose grey levels are ``mean`` plus and minus ``spread``, in rows."""
    image = np.full((120, 160), float(mean))
    # every fourth row counts; they alternate
    image[::8] += spread
    image[4::8] -= spread
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    ("image", "trouble"),
    [
        (flat(7, 4), "dark"),
        (flat(8, 4), ""),
        (flat(248, 4), "over-exposed"),
        (flat(246, 4), ""),
        (flat(120, 2), "no contrast"),
        (flat(120, 3), ""),
    ],
)
def test_images_are_valid_within_brightness_and_contrast(image: Image, trouble: str) -> None:
    senses = Senses()
    senses.update(reading(0.0, picture()), odometry(0.0))
    senses.update(reading(0.1, image), odometry(0.1))
    assert (trouble in senses.trouble) if trouble else senses.trouble == ""
    assert senses.seeing == (trouble == "")
    assert senses.camera_age == pytest.approx(0.1 if trouble else 0.0)


@pytest.mark.parametrize(
    ("x", "yaw", "frozen", "used"),
    [
        (0.0018, 0.0, False, True),
        (0.0022, 0.0, False, False),
        (0.0, 0.0018, False, True),
        (0.0, 0.0022, False, False),
        (0.0, -0.0022, False, False),
        (0.018, 0.0, False, False),
        (0.022, 0.0, True, False),
        (-0.022, 0.0, True, False),
        (0.0, 0.032, False, False),
        (0.0, 0.039, True, False),
    ],
)
def test_an_unchanged_image_is_frozen_once_the_robot_has_moved(
    x: float, yaw: float, frozen: bool, used: bool
) -> None:
    senses, image = Senses(), picture()
    senses.update(reading(0.0, image), odometry(0.0))
    # the motion adds up from reading to reading, whichever way
    senses.update(reading(0.05), odometry(0.05, 0.5 * x, 0.5 * yaw))
    senses.update(reading(0.1, image), odometry(0.1, x, yaw))
    assert ("frozen" in senses.trouble) == frozen
    assert senses.seeing == used
    # a different image is valid, and the motion counts anew
    senses.update(reading(0.2, picture()), odometry(0.2, 2.0 * x, 2.0 * yaw))
    assert senses.trouble == ""
    assert senses.seeing


def test_an_image_that_equals_an_earlier_one_is_not_frozen() -> None:
    senses, one, other = Senses(), picture(), picture()
    for k, image in enumerate((one, other, one, other)):
        senses.update(reading(0.1 * k, image), odometry(0.1 * k, 0.05 * k))
        assert senses.trouble == ""


def test_motion_there_and_back_counts() -> None:
    senses, image = Senses(), picture()
    senses.update(reading(0.0, image), odometry(0.0))
    senses.update(reading(0.1), odometry(0.1, 0.015))
    senses.update(reading(0.2, image), odometry(0.2, 0.0))
    assert "frozen" in senses.trouble


def test_ages_count_from_the_time_stamps() -> None:
    senses = Senses()
    senses.update(reading(9.5), odometry(9.5, silent=True))
    assert senses.silence == senses.camera_age == 0.0
    senses.update(reading(10.0), odometry(10.0, silent=True))
    assert senses.camera_age == senses.silence == 0.5, "they count from the first reading"
    old = reading(10.5, picture(), frame_age=0.2, gyro_age=0.3, encoder_age=0.4)
    senses.update(old, odometry(10.5))
    ages = (senses.camera_age, senses.gyro_age, senses.encoder_age, senses.silence)
    assert ages == pytest.approx((0.2, 0.3, 0.4, 0.0))
    senses.update(reading(11.0), odometry(11.0, silent=True))
    assert senses.camera_age == pytest.approx(0.7)
    assert senses.gyro_age == senses.encoder_age == 0.0
    assert senses.silence == pytest.approx(0.5), "since the last odometry that was not silent"
    senses.update(reading(11.2), odometry(11.2))
    assert senses.silence == 0.0


def test_reset_is_the_state_before_the_first_reading() -> None:
    senses, image = Senses(), picture()
    senses.update(reading(0.0, image), odometry(0.0))
    dark = reading(1.0, np.zeros((120, 160), np.uint8), gyro_age=0.3, encoder_age=0.3)
    senses.update(dark, odometry(1.0, 0.5, silent=True))
    senses.reset()
    assert (senses.camera_age, senses.gyro_age, senses.encoder_age, senses.silence) == (0, 0, 0, 0)
    assert senses.trouble == ""
    assert senses.seeing
    # neither the last image nor the last pose is compared with
    senses.update(reading(20.0, image), odometry(20.0, 7.0))
    assert (senses.trouble, senses.camera_age, senses.silence) == ("", 0.0, 0.0)
    senses.update(reading(20.1, image), odometry(20.1, 7.0))
    assert senses.seeing
