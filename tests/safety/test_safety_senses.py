"""Validity of the sensors: ages, and why an image is not valid."""

from __future__ import annotations

import numpy as np
import pytest
from safety_samples import odometry, picture, reading

from navfw.numerics import Image
from navfw.safety import MOVED, MOVED_SLIGHTLY, Senses


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
        (0.9 * MOVED_SLIGHTLY, 0.0, False, True),
        (1.1 * MOVED_SLIGHTLY, 0.0, False, False),
        (0.0, 0.9 * MOVED_SLIGHTLY, False, True),
        (0.0, 1.1 * MOVED_SLIGHTLY, False, False),
        (0.0, -1.1 * MOVED_SLIGHTLY, False, False),
        (0.9 * MOVED[0], 0.0, False, False),
        (1.1 * MOVED[0], 0.0, True, False),
        (-1.1 * MOVED[0], 0.0, True, False),
        (0.0, 0.9 * MOVED[1], False, False),
        (0.0, 1.1 * MOVED[1], True, False),
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
    senses.update(
        reading(10.5, picture(), frame_age=0.2, gyro_age=0.3, encoder_age=0.4), odometry(10.5)
    )
    assert senses.camera_age == pytest.approx(0.2)
    assert senses.gyro_age == pytest.approx(0.3)
    assert senses.encoder_age == pytest.approx(0.4)
    assert senses.silence == 0.0
    senses.update(reading(11.0), odometry(11.0, silent=True))
    assert senses.camera_age == pytest.approx(0.7)
    assert senses.gyro_age == senses.encoder_age == 0.0
    assert senses.silence == pytest.approx(0.5), "since the last odometry that was not silent"
    senses.update(reading(11.2), odometry(11.2))
    assert senses.silence == 0.0


def test_reset_is_the_state_before_the_first_reading() -> None:
    senses, image = Senses(), picture()
    senses.update(reading(0.0, image), odometry(0.0))
    senses.update(
        reading(1.0, np.zeros((120, 160), np.uint8), gyro_age=0.3, encoder_age=0.3),
        odometry(1.0, 0.5, silent=True),
    )
    senses.reset()
    assert (senses.camera_age, senses.gyro_age, senses.encoder_age, senses.silence) == (0, 0, 0, 0)
    assert senses.trouble == ""
    assert senses.seeing
    # neither the last image nor the last pose is compared with
    senses.update(reading(20.0, image), odometry(20.0, 7.0))
    assert senses.trouble == ""
    assert senses.camera_age == 0.0
    assert senses.silence == 0.0
    senses.update(reading(20.1, image), odometry(20.1, 7.0))
    assert senses.seeing
