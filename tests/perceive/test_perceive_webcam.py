"""A webcam in place of recorded images."""

from pathlib import Path

import cv2
import pytest
from cli_calls import refusal
from perceive_calls import APPROACH, perceive

from navfw.perceive.webcam import Webcam

CAPTURE = cv2.VideoCapture


@pytest.fixture
def webcam(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A webcam of number 0 whose images are those of a video."""
    path, (height, width) = tmp_path / "seen.avi", APPROACH[0].shape[:2]
    video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (width, height))
    for image in APPROACH:
        video.write(image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
    video.release()
    monkeypatch.setattr(
        cv2, "VideoCapture", lambda number: CAPTURE(str(path) if not number else "-")
    )


@pytest.mark.usefixtures("webcam")
def test_the_images_of_a_webcam_have_the_times_at_which_they_came() -> None:
    times = [item.time for item in Webcam(0, None)]
    assert len(times) == len(APPROACH)
    assert times == sorted(times)
    assert times[-1] < 5.0


@pytest.mark.usefixtures("webcam")
def test_a_webcam_is_perceived_until_it_ends() -> None:
    assert 1 <= len(perceive("--camera", "0", "--stride", "1")) < len(APPROACH)


@pytest.mark.usefixtures("webcam")
@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "for a webcam, --camera N"),
        (["--camera", "front"], "for a webcam, --camera N"),
        (["--camera", "3"], "--camera: no webcam answers as number 3"),
        (["--camera", "0", "--fps", "10"], "--fps: is for recorded images"),
    ],
)
def test_what_is_no_webcam_is_refused(words: list[str], said: str) -> None:
    assert said in refusal("perceive", *words)
