"""Times of images from a list."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from perceive_images import save

from navfw.errors import InputError
from navfw.perceive import load_image_times, open_source

GREY = np.full((48, 64), 90, np.uint8)


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "times.csv"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "text",
    [
        "5.0\n5.1\n5.3\n",
        "5.0 rgb/image_1.png\n5.1 rgb/image_2.png\n5.3 rgb/image_3.png\n",
        "# a list\n4.9 image_0.png\n5.0 image_1.png\n5.1 image_2.png\n5.3 image_3.png\n",
        "frame,time_ms,speed\n1,5000,0.2\n2,5100,0.2\n3,5300,0.2\n",
        "file, timestamp [s]\nimage_1.png, 5.0\nimage_2.png, 5.1\nimage_3.png, 5.3\n",
    ],
    ids=["times", "tum", "with others", "table", "named"],
)
def test_lists_of_all_forms(tmp_path: Path, text: str) -> None:
    folder = save(tmp_path / "images", [GREY] * 3)
    source = open_source([folder], listed=load_image_times(written(tmp_path, text)))
    assert [item.time for item in source] == pytest.approx([0.0, 0.1, 0.3])
    assert source.start == pytest.approx(5.0)
    assert source.rate == pytest.approx(1.0 / 0.15)
    assert source.notes == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"times\.csv: has no times of images"),
        ("0\n0.1\n", r"times\.csv: --times: has 2 times for 3 images; add a column 'file'"),
        ("0 a.png\n1 b.png\n2 c.png\n", "has no time of 3 of 3 images, such as image_1.png"),
        ("0\n0.2\n0.1\n", r"times\.csv:3: time 0\.1\d* s does not come after 0\.2\d* s; sort the"),
        ("0\n0.1\nlater\n", r"times\.csv:3: time: 'later' is not a time in seconds"),
        ("0\nnan\n1\n", r"times\.csv:2: time: 'nan' is not a time in seconds"),
        (
            "frame,speed\n1,2\n",
            r"times\.csv:1: has no column 'time'; name the one that holds it so",
        ),
        ("time,file\n0,image_1.png\n1\n", r"times\.csv:3: has 1 values, not 2 \(time, file\)"),
        (
            "0 image_2.png\n1 image_1.png\n2 image_3.png\n",
            r"image_2\.png was not taken after image_1\.png; give the images in the order of time",
        ),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, text: str, message: str) -> None:
    folder = save(tmp_path / "images", [GREY] * 3)
    with pytest.raises(InputError, match=message):
        open_source([folder], listed=load_image_times(written(tmp_path, text)))


def test_a_video_has_its_own_times(tmp_path: Path) -> None:
    (tmp_path / "film.mp4").write_bytes(b"x")
    with pytest.raises(InputError, match="--times: is for image files; a video has its own times"):
        open_source([tmp_path / "film.mp4"], listed=load_image_times(written(tmp_path, "0\n1\n")))
