from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from perceive_images import save

from navfw.errors import InputError
from navfw.perceive import natural_key, open_source

GREY = np.full((48, 64, 3), 90, np.uint8)


def names(source: object) -> list[str]:
    return [item.name for item in source]  # type: ignore[attr-defined]


@given(st.lists(st.integers(0, 10_000), unique=True, min_size=1))
def test_numbers_in_names_count_as_numbers(numbers: list[int]) -> None:
    paths = [Path(f"image_{n}.png") for n in numbers]
    assert sorted(paths, key=natural_key) == [Path(f"image_{n}.png") for n in sorted(numbers)]


def test_folder_in_natural_order_without_what_is_no_image(tmp_path: Path) -> None:
    save(tmp_path, [GREY] * 11)
    (tmp_path / "TTI.mat").write_bytes(b"x")
    (tmp_path / ".image_0.png").write_bytes(b"x")
    source = open_source([tmp_path])
    items = list(source)
    assert [item.name for item in items] == [f"image_{n}.png" for n in range(1, 12)]
    assert [item.time for item in items] == pytest.approx([0.1 * n for n in range(11)])
    assert source.notes == ["no --fps given: 10 images a second assumed"]


def test_files_as_a_shell_expands_them_or_as_somebody_means_them(tmp_path: Path) -> None:
    save(tmp_path, [GREY] * 11)
    paths = sorted(tmp_path.iterdir())
    assert paths[1].name == "image_10.png"
    assert names(open_source(paths, 25.0))[:2] == ["image_1.png", "image_2.png"]
    backward = [tmp_path / "image_3.png", tmp_path / "image_1.png"]
    assert names(open_source(backward, 25.0)) == ["image_3.png", "image_1.png"]


def test_time_stamps_in_names(tmp_path: Path) -> None:
    for stamp in ("1305031453.359684", "1305031453.391690", "1305031453.423683"):
        cv2.imwrite(str(tmp_path / f"{stamp}.png"), GREY)
    source = open_source([tmp_path])
    assert [item.time for item in source] == pytest.approx([0.0, 0.032006, 0.063999], abs=1e-6)
    assert source.rate == pytest.approx(31.25, abs=0.01)
    assert [item.time for item in open_source([tmp_path], 10.0)] == pytest.approx([0.0, 0.1, 0.2])


def test_video_tells_its_rate(tmp_path: Path) -> None:
    film = cv2.VideoWriter(
        str(tmp_path / "film.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (64, 48)
    )
    for _ in range(4):
        film.write(GREY)
    film.release()
    source = open_source([tmp_path / "film.avi"])
    items = list(source)
    assert [item.time for item in items] == pytest.approx([0.0, 0.04, 0.08, 0.12])
    assert items[0].image.shape == GREY.shape
    assert source.notes == []


def test_video_that_is_none(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "film.mp4").write_bytes(b"nothing of the sort" * 50)
    with pytest.raises(InputError, match=r"film\.mp4: is not a readable video"):
        open_source([tmp_path / "film.mp4"])
    assert capfd.readouterr().err == ""


def test_sizes_must_agree(tmp_path: Path) -> None:
    save(tmp_path, [GREY, GREY[:40]])
    with pytest.raises(InputError, match=r"image_2\.png: is 64 x 40, but image_1\.png is 64 x 48"):
        names(open_source([tmp_path]))


def test_too_few_images(tmp_path: Path) -> None:
    save(tmp_path, [GREY])
    with pytest.raises(InputError, match="has 1 image; flow needs at least two"):
        names(open_source([tmp_path]))


def test_damaged_image(tmp_path: Path) -> None:
    save(tmp_path, [GREY, GREY])
    (tmp_path / "image_2.png").write_bytes(b"")
    with pytest.raises(InputError, match=r"image_2\.png: is not a readable image"):
        names(open_source([tmp_path]))


def test_folder_without_images_says_what_may_be_meant(tmp_path: Path) -> None:
    (tmp_path / "rgb").mkdir()
    (tmp_path / "depth").mkdir()
    with pytest.raises(InputError, match="contains no images; did you mean one of: depth, rgb"):
        open_source([tmp_path])


@pytest.mark.parametrize("fps", [0.0, -1.0, float("nan"), float("inf")])
def test_frame_rate_out_of_range(tmp_path: Path, fps: float) -> None:
    with pytest.raises(InputError, match="--fps: must be between"):
        open_source([tmp_path], fps)


def test_mixtures_are_refused(tmp_path: Path) -> None:
    save(tmp_path / "a", [GREY, GREY])
    (tmp_path / "film.mp4").write_bytes(b"x")
    with pytest.raises(InputError, match="give one folder, or image files, not both"):
        open_source([tmp_path / "a" / "image_1.png", tmp_path / "a"])
    with pytest.raises(InputError, match="give one video, or image files, not both"):
        open_source([tmp_path / "a" / "image_1.png", tmp_path / "film.mp4"])
    with pytest.raises(InputError, match="there is no such file"):
        open_source([tmp_path / "nowhere"])
