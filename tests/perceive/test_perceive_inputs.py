"""Images as people have them: deep, turned, broken, shuffled, with gaps; videos of telephones."""

import struct
from pathlib import Path
from unittest.mock import Mock

import cv2
import numpy as np
import pytest
from cli_calls import sole_refusal
from hypothesis import given
from hypothesis import strategies as st
from perceive_calls import APPROACH, perceive
from perceive_images import HEIGHT, WIDTH, save, texture, wall_at
from PIL import Image as PillowImage

from navfw.errors import InputError
from navfw.numerics import Image
from navfw.perceive import lens_estimate
from navfw.perceive.image_sources import ImageSource, open_source
from navfw.perceive.image_times import natural_key
from navfw.perceive.lens_estimate import lens_pairs

PICTURE = texture()[:48, :64]
UPRIGHT_MATRIX = struct.pack(">9i", 0, 65536, 0, -65536, 0, 0, 0, 0, 1 << 30)
"""Display matrix of an MP4 file that was taken with the telephone upright."""


def names(source: ImageSource) -> list[str]:
    return [item.name for item in source]


def film(path: Path, frames: int = 6, codec: str = "mp4v", rate: float = 25.0) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), rate, (64, 48))
    for k in range(frames):
        writer.write(cv2.cvtColor(np.roll(PICTURE, k, axis=1), cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


@pytest.mark.parametrize("bits", [10, 12, 14, 16])
@pytest.mark.parametrize("suffix", [".png", ".tiff", ".pgm"])
def test_deep_images_by_their_true_range(tmp_path: Path, bits: int, suffix: str) -> None:
    white = (1 << bits) - 1
    # the brightest pixel of the sequence is not in its first image
    for k, share in enumerate((0.3, 1.0, 0.6)):
        deep = np.rint(PICTURE / PICTURE.max() * share * white).astype(np.uint16)
        assert cv2.imwrite(str(tmp_path / f"image_{k}{suffix}"), deep)
    source = open_source([tmp_path], 10.0)
    for item, share in zip(source, (0.3, 1.0, 0.6), strict=True):
        expected = PICTURE[..., None] / PICTURE.max() * share * 255.0
        assert item.image.dtype == np.uint8
        assert np.abs(item.image - expected).max() <= 1.0
    assert source.notes == [f"images of 16 bits with values up to {white}: taken as {bits} bits"]


def test_brighter_image_between_the_samples_is_told(tmp_path: Path) -> None:
    for k in range(40):
        level = 60_000 if k == 2 else 4000
        cv2.imwrite(str(tmp_path / f"{k}.png"), np.full((48, 64), level, np.uint16))
    source = open_source([tmp_path], 10.0)
    levels = [int(item.image.max()) for item in source]
    assert levels[2] == 255
    assert levels[3] == 4000 >> 4
    assert source.notes[-1] == "1 images have pixels beyond 12 bits, cut off"


def test_floating_point_image(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for k in range(2):
        cv2.imwrite(str(tmp_path / f"{k}.tiff"), np.ones((48, 64), np.float32))
    with pytest.raises(InputError, match=r"0\.tiff: .* its pixels have neither 8 nor 16 bits"):
        names(open_source([tmp_path]))
    assert capfd.readouterr().err == ""


def test_photograph_is_turned_upright(tmp_path: Path) -> None:
    for k in range(2):
        picture = PillowImage.fromarray(PICTURE)
        data = picture.getexif()
        data[0x0112] = 6  # taken with the camera upright
        picture.save(tmp_path / f"{k}.jpg", exif=data, quality=95)
    for item in open_source([tmp_path]):
        assert item.image.shape == (64, 48, 3)
        assert np.abs(item.image[..., 0] - np.rot90(PICTURE, -1).astype(float)).mean() < 3.0


def test_heic_says_what_to_do(tmp_path: Path) -> None:
    for name in ("IMG_1.HEIC", "IMG_2.jpg"):
        (tmp_path / name).write_bytes(b"\0\0\0\x18ftypheic" + bytes(100))
    with pytest.raises(InputError, match=r"IMG_1\.HEIC: is a HEIC image, .*save it as JPEG"):
        names(open_source([tmp_path]))
    with pytest.raises(InputError, match=r"IMG_2\.jpg: is a HEIC image"):
        names(open_source([tmp_path / "IMG_2.jpg", tmp_path / "IMG_2.jpg"]))
    save(tmp_path, [PICTURE] * 2)
    source = open_source([tmp_path])
    assert names(source) == ["image_1.png", "image_2.png"]
    assert source.notes[-1].startswith("2 of 4 images left out: ")


def test_broken_image_costs_itself_alone(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for k in range(1, 6):
        cv2.imwrite(str(tmp_path / f"image_{k}.jpg"), texture()[:240, :320])
    whole = (tmp_path / "image_3.jpg").read_bytes()
    middle = len(whole) // 2
    for part in (
        whole[:middle],
        whole[:30],
        b"",
        whole.replace(b"\xff\xda", b"\0\0"),
        whole[:middle] + bytes(60) + whole[middle + 60 :],
    ):
        (tmp_path / "image_3.jpg").write_bytes(part)
        source = open_source([tmp_path], 10.0)
        items = list(source)
        assert [item.time for item in items] == pytest.approx([0.0, 0.1, 0.3, 0.4])
        assert not any(item.after_gap for item in items)
        assert source.notes[0].startswith("1 of 5 images left out: ")
        assert "image_3.jpg: " in source.notes[0]
    (tmp_path / "image_3.jpg").write_bytes(whole + b"data of the maker's own")
    assert len(names(open_source([tmp_path], 10.0))) == 5
    assert capfd.readouterr().err == ""


def test_images_across_a_gap_are_not_compared(tmp_path: Path) -> None:
    save(tmp_path, [PICTURE] * 12)
    for k in range(4, 9):
        (tmp_path / f"image_{k}.png").write_bytes(b"")
    source = open_source([tmp_path], 10.0)
    assert [item.name for item in source if item.after_gap] == ["image_9.png"]
    what = "is not a readable image; give a PNG or JPEG file"
    named = "; ".join(f"{tmp_path / f'image_{k}.png'}: {what}" for k in (4, 5, 6))
    assert source.notes[0] == f"5 of 12 images left out: {named}; and 2 more"
    assert source.notes[1] == "not compared across gaps in time: 0.60 s before image_9.png"
    # an image every second: two missing ones are no gap
    for k in (4, 5, 6):
        cv2.imwrite(str(tmp_path / f"image_{k}.png"), PICTURE)
    assert not any(item.after_gap for item in open_source([tmp_path], 1.0))


def test_shuffled_images_are_refused(tmp_path: Path) -> None:
    save(tmp_path, [PICTURE] * 4)
    paths = [tmp_path / f"image_{k}.png" for k in (1, 3, 2, 4)]
    with pytest.raises(InputError, match=r"image_2\.png: comes after image_3\.png: .* sort them"):
        open_source(paths, 10.0)
    assert names(open_source(paths[::2], 10.0)) == ["image_1.png", "image_2.png"]
    # names without a common pattern have no order
    (tmp_path / "image_3.png").rename(tmp_path / "last.png")
    named = [tmp_path / name for name in ("last.png", "image_4.png", "image_2.png")]
    assert names(open_source(named, 10.0)) == ["last.png", "image_4.png", "image_2.png"]


@pytest.mark.parametrize(
    ("stamps", "interval", "start"),
    [
        (("1403636579763555584", "1403636579813555456"), 0.049999872, 1403636579.7635556),
        (("1403636579763555", "1403636579813555"), 0.05, 1403636579.763555),
        (("1403636579763", "1403636579813"), 0.05, 1403636579.763),
        (("12.50", "12.75"), 0.25, 12.5),
    ],
)
def test_time_stamps_of_all_kinds(
    tmp_path: Path, stamps: tuple[str, str], interval: float, start: float
) -> None:
    for stamp in stamps:
        cv2.imwrite(str(tmp_path / f"{stamp}.png"), PICTURE)
    source = open_source([tmp_path])
    assert [item.time for item in source] == pytest.approx([0.0, interval], abs=5e-7)
    assert source.start == pytest.approx(start, abs=1e-5)
    assert source.duration == pytest.approx(interval, abs=5e-7)
    assert source.rate == pytest.approx(1.0 / interval, rel=1e-4)
    assert [item.time for item in open_source([tmp_path], 10.0)] == pytest.approx([0.0, 0.1])


def test_time_stamps_that_go_back(tmp_path: Path) -> None:
    paths = [tmp_path / f"{stamp}.png" for stamp in ("1.50", "1.60", "1.55")]
    for path in paths:
        cv2.imwrite(str(path), PICTURE)
    with pytest.raises(InputError, match=r"1\.55\.png: comes after 1\.60\.png"):
        open_source(paths)
    back = [paths[1], paths[2], paths[0]]
    with pytest.raises(InputError, match=r"1\.55\.png: its time stamp .* after that of 1\.60\.png"):
        open_source(back)
    assert names(open_source(back, 20.0)) == ["1.60.png", "1.55.png", "1.50.png"]


def test_upright_video_of_a_telephone(tmp_path: Path) -> None:
    data = film(tmp_path / "lying.mp4").read_bytes()
    at = data.index(b"tkhd") + 44
    upright = tmp_path / "upright.mp4"
    upright.write_bytes(data[:at] + UPRIGHT_MATRIX + data[at + 36 :])
    lying = list(open_source([tmp_path / "lying.mp4"]))
    source = open_source([upright])
    for turned, item in zip(source, lying, strict=True):
        assert (turned.image == np.rot90(item.image, -1)).all()
        assert turned.time == item.time
    assert source.notes == ["the video is turned by 90 degrees, as its file says"]


def test_video_that_ends_early(tmp_path: Path) -> None:
    whole = film(tmp_path / "whole.avi", 30, "MJPG").read_bytes()
    (tmp_path / "part.avi").write_bytes(whole[: len(whole) // 2])
    source = open_source([tmp_path / "part.avi"])
    count = len(names(source))
    assert 10 <= count <= 16
    assert f"the video ends early: only {count} of 30 frames could be read" in source.notes[0]
    whole = film(tmp_path / "whole.mp4", 30).read_bytes()
    (tmp_path / "part.mp4").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="if the recording was cut off, its index is missing"):
        open_source([tmp_path / "part.mp4"])


def test_a_video_that_is_damaged_inside_is_told(tmp_path: Path) -> None:
    av = pytest.importorskip("av", reason="needs the extra video")
    file, picture = tmp_path / "whole.mp4", texture()
    with av.open(file, "w") as video:
        stream = video.add_stream("libx264", rate=20, options={"threads": "1"})
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        for k in range(40):
            view = np.repeat(picture[:HEIGHT, 4 * k : 4 * k + WIDTH, None], 3, axis=2)
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(view), format="bgr24")
            video.mux(stream.encode(frame))
        video.mux(stream.encode(None))
    assert notes_of(file) == []
    content = bytearray(file.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 5] = b"\x5a" * 5
    (tmp_path / "damaged.mp4").write_bytes(content)
    told = "; ".join(notes_of(tmp_path / "damaged.mp4"))
    assert "the video is damaged: its decoder met errors at" in told


def notes_of(path: Path) -> list[str]:
    source = open_source([path])
    names(source)
    return source.notes


def test_a_rate_that_no_moving_camera_has_is_doubted(tmp_path: Path) -> None:
    source = open_source([film(tmp_path / "slow.avi", 4, "MJPG", rate=1.0)])
    assert source.rate == 1.0
    assert not source.rate_known
    assert "the video says 1 images a second" in source.notes[0]


def test_images_of_other_sizes_are_left_out_and_told(tmp_path: Path) -> None:
    images = [PICTURE[:30], *[PICTURE] * 5, PICTURE[:20]]
    source = open_source([save(tmp_path / "mixed", images)])
    assert names(source) == [f"image_{k}.png" for k in range(2, 7)]
    assert (
        "2 images are not 64 x 48 as the others, and left out: image_1.png is 64 x 30"
        in (source.notes[-1])
    )
    source = open_source([save(tmp_path / "all", [PICTURE[:k] for k in (30, 31, 32)])])
    with pytest.raises(InputError, match=r"has 1 image of one size: image_2.png is 64 x 31"):
        names(source)


def test_video_of_16_bits(tmp_path: Path) -> None:
    depth = [cv2.VIDEOWRITER_PROP_DEPTH, cv2.CV_16U, cv2.VIDEOWRITER_PROP_IS_COLOR, 0]
    codec, file = cv2.VideoWriter.fourcc(*"FFV1"), str(tmp_path / "deep.mkv")
    writer = cv2.VideoWriter(file, cv2.CAP_FFMPEG, codec, 25.0, (64, 48), depth)
    for _ in range(2):
        writer.write(PICTURE.astype(np.uint16) * 257)
    writer.release()
    for item in open_source([tmp_path / "deep.mkv"]):
        assert np.abs(item.image.astype(int) - PICTURE[..., None]).max() <= 1


def film_of_a_telephone(*_: object) -> Mock:
    """Stands for OpenCV's reader: frames at irregular times, and some without a time."""
    width, height, rate = cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT, cv2.CAP_PROP_FPS
    facts = {width: 64.0, height: 48.0, rate: 25.0}
    stamps = [40.0, 73.0, 140.0, 140.0, 0.0, 240.0]

    def read() -> tuple[bool, Image]:
        shown = bool(stamps)
        if shown:
            facts[cv2.CAP_PROP_POS_MSEC] = stamps.pop(0)
        return shown, np.zeros((48, 64, 3), np.uint8)

    return Mock(read=read, get=lambda what: facts.get(what, 0.0))


def test_frames_at_their_own_times(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "film.mp4").write_bytes(b"x")
    monkeypatch.setattr(cv2, "VideoCapture", film_of_a_telephone)
    times = [item.time for item in open_source([tmp_path / "film.mp4"])]
    assert times == pytest.approx([0.0, 0.033, 0.1, 0.14, 0.18, 0.2])
    times = [item.time for item in open_source([tmp_path / "film.mp4"], 10.0)]
    assert times == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])


@given(st.lists(st.integers(0, 10_000), unique=True, min_size=1))
def test_numbers_in_names_count_as_numbers(numbers: list[int]) -> None:
    paths = [Path(f"image_{n}.png") for n in numbers]
    assert sorted(paths, key=natural_key) == [Path(f"image_{n}.png") for n in sorted(numbers)]


def test_folder_in_natural_order_without_what_is_no_image(tmp_path: Path) -> None:
    save(tmp_path, [PICTURE] * 11)
    (tmp_path / "TTI.mat").write_bytes(b"x")
    (tmp_path / ".image_0.png").write_bytes(b"x")
    source = open_source([tmp_path])
    items = list(source)
    assert [item.name for item in items] == [f"image_{n}.png" for n in range(1, 12)]
    assert [item.time for item in items] == pytest.approx([0.1 * n for n in range(11)])
    assert [str(each) for each in source.assumed] == [
        "frame rate: 10 images a second, as no file says when they were taken (--fps, --times)"
    ]
    assert source.notes == []


def test_files_as_a_shell_expands_them_or_as_somebody_means_them(tmp_path: Path) -> None:
    save(tmp_path, [PICTURE] * 11)
    paths = sorted(tmp_path.iterdir())
    assert paths[1].name == "image_10.png"
    assert names(open_source(paths, 25.0))[:2] == ["image_1.png", "image_2.png"]
    backward = [tmp_path / "image_3.png", tmp_path / "image_1.png"]
    assert names(open_source(backward, 25.0)) == ["image_3.png", "image_1.png"]


def test_video_tells_its_rate(tmp_path: Path) -> None:
    source = open_source([film(tmp_path / "film.avi", 4, "MJPG")])
    items = list(source)
    assert [item.time for item in items] == pytest.approx([0.0, 0.04, 0.08, 0.12])
    assert items[0].image.shape == (48, 64, 3)
    assert source.notes == []


def test_video_that_is_none(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "film.mp4").write_bytes(b"nothing of the sort" * 50)
    with pytest.raises(InputError, match=r"film\.mp4: is not a readable video"):
        open_source([tmp_path / "film.mp4"])
    assert capfd.readouterr().err == ""


def test_a_sequence_has_two_images_of_one_size(tmp_path: Path) -> None:
    save(tmp_path, [PICTURE])
    with pytest.raises(InputError, match="has 1 image; flow needs at least two"):
        names(open_source([tmp_path]))
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
    save(tmp_path / "a", [PICTURE, PICTURE])
    (tmp_path / "film.mp4").write_bytes(b"x")
    with pytest.raises(InputError, match="give one folder, or image files, not both"):
        open_source([tmp_path / "a" / "image_1.png", tmp_path / "a"])
    with pytest.raises(InputError, match="give one video, or image files, not both"):
        open_source([tmp_path / "a" / "image_1.png", tmp_path / "film.mp4"])
    with pytest.raises(InputError, match="there is no such file"):
        open_source([tmp_path / "nowhere"])


def test_images_are_paired_until_one_is_bad(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    picture = texture()
    folder = save(tmp_path, [wall_at(2.0 - 0.06 * k, picture) for k in range(12)])
    pairs, size = lens_pairs(open_source([folder], 10.0), lambda: None)
    assert size == (WIDTH, HEIGHT)
    assert 4 < len(pairs) < 12
    assert min(len(pair.points) for pair in pairs) >= 60
    with monkeypatch.context() as patch:  # images are read until six are exceeded
        patch.setattr(lens_estimate, "MAX_PIXELS", 6 * WIDTH * HEIGHT)
        ticks: list[int] = []
        part, _ = lens_pairs(open_source([folder], 10.0), lambda: ticks.append(1))
        assert len(ticks) == 7
        assert 0 < len(part) < len(pairs)
    assert cv2.imwrite(str(folder / "image_7.png"), np.zeros((90, 90, 3), np.uint8))
    fewer, _ = lens_pairs(open_source([folder], 10.0), lambda: None)
    assert 0 < len(fewer) < len(pairs)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["frame_1403636579763555584", "frame_1403636579813555584"], [0.0, 0.05]),
        (["1403636579763555584_left", "1403636579813555584_left"], [0.0, 0.05]),
        (["cam0-1700000000.25-rgb", "cam0-1700000000.75-rgb"], [0.0, 0.5]),
        (["1403636579_763555584", "1403636579_813555584"], [0.0, 0.05]),
        (["IMG_1700000000123_0", "IMG_1700000000223_0"], [0.0, 0.1]),
        (["1234567890_1403636579763555584", "1234567890_1403636579813555584"], [0.0, 0.05]),
        (["up_123456789012345", "up_123456839012345"], [0.0, 0.05]),  # ns since power-on
        # dates, counters and versions are no times
        (["20260130142533", "20260130142534"], None),
        (["PXL_20260130_142533123", "PXL_20260130_142533156"], None),
        (["0000000000", "0000000001"], None),
        (["v2.0_0001", "v2.0_0002"], None),
        (["a_1403636579763555584", "b"], None),
    ],
)
def test_stamps_in_names_may_have_words_around_them(
    names: list[str], expected: list[float] | None, tmp_path: Path
) -> None:
    for name in names:
        cv2.imwrite(str(tmp_path / f"{name}.png"), PICTURE)
    source = open_source([tmp_path])
    assert [item.time for item in source] == pytest.approx(expected or [0.0, 0.1])
    what = "times" if expected else "frame rate"
    assert [each.what for each in source.assumed] == [what]


def test_images_of_two_cameras_in_one_folder_are_refused(tmp_path: Path) -> None:
    for name in ("1403636579763555584_left", "1403636579763555584_right", "1403636579813555584_x"):
        cv2.imwrite(str(tmp_path / f"{name}.png"), PICTURE)
    with pytest.raises(InputError, match="its time stamp does not come after that of"):
        open_source([tmp_path])


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("https://example.org/a.mp4", "an address is not read: download it"),
        ("rtsp://10.0.0.2/stream", "ffmpeg -t 60 -i 'rtsp://10.0.0.2/stream' drive.mp4"),
        ("-", "standard input is not read: write it to a file"),
        ("/dev/video0", "a camera is not read: record a video: ffmpeg -t 60 -i /dev/video0"),
        ("0", "ffmpeg -t 60 -i /dev/video0 drive.mp4"),
    ],
)
def test_what_is_no_file_is_refused_with_the_way_to_one(source: str, said: str) -> None:
    assert said in sole_refusal("perceive", source)


def test_an_avif_image_is_refused_by_name(tmp_path: Path) -> None:
    for k in range(2):
        (tmp_path / f"{k}.avif").write_bytes(bytes(4) + b"ftypavif" + bytes(40))
    assert "0.avif: is an AVIF image, which is not supported" in sole_refusal("perceive", tmp_path)


@pytest.mark.parametrize("rate", [0.05, 120.0, 960.0])
def test_videos_of_any_frame_rate_are_judged(rate: float, tmp_path: Path) -> None:
    views = perceive(save(tmp_path, APPROACH), "--fps", rate)
    assert [view["dt"] for view in views] == pytest.approx([1.0 / rate] * 4, rel=2.0)


@pytest.mark.parametrize("names", [("left{}.png", "right{}.png"), ("{}.color.png", "{}.depth.png")])
def test_images_of_two_cameras_are_not_one_sequence(names: tuple[str, str], tmp_path: Path) -> None:
    for k in range(3):
        for name in names:
            cv2.imwrite(str(tmp_path / name.format(k)), PICTURE)
    with pytest.raises(InputError, match=r"has the number of .*, so they are of two cameras"):
        open_source([tmp_path])
    one = sorted(tmp_path.glob(names[0].format("*")))
    assert len(list(open_source(one, 10.0))) == 3


def test_encoded_frames_alone_have_no_rate(tmp_path: Path) -> None:
    av = pytest.importorskip("av", reason="needs the extra video")
    with av.open(tmp_path / "raw.h264", "w", format="h264") as video:
        stream = video.add_stream("libx264", rate=50, options={"threads": "1"})
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for _ in range(9):
            video.mux(stream.encode(av.VideoFrame.from_ndarray(PICTURE, format="gray8")))
        video.mux(stream.encode(None))
    source = open_source([tmp_path / "raw.h264"])
    assert not source.rate_known
    assert [each.what for each in source.assumed] == ["frame rate"]
