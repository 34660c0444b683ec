"""Images of bags: the camera that they are of, what shows no picture, and every encoding."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from bag_samples import Sent, image, packed_image, write_bag
from cli_calls import answer, refusal
from perceive_calls import APPROACH
from perceive_images import save

from navfw.numerics import Image
from navfw.perceive.bag_source import unpacked_bag
from navfw.perceive.image_sources import open_source
from navfw.recording import Bag

GREYS = [np.asarray(cv2.resize(each, (160, 120)), np.uint8) for each in APPROACH]
COLOURED = [np.dstack([each, np.roll(each, 9, axis=0), each[::-1]]) for each in GREYS]


def info(topic: str, focal: float, **fields: Any) -> Sent:
    """A ``CameraInfo`` of images of 160 x 120 px, with distortion."""
    k = np.array([focal, 0, 80, 0, focal, 60, 0, 0, 1.0])
    p = np.array([focal - 9, 0, 80, 0, 0, focal - 9, 60, 0, 0, 0, 1.0, 0])
    whole = {"width": 160, "height": 120, "k": k, "p": p, "d": np.array([-0.2, 0.05, 0, 0, 0])}
    whole["distortion_model"] = "plumb_bob"
    return Sent(topic, "sensor_msgs/msg/CameraInfo", 0.0, whole | fields)


def lens(path: Path, sent: list[Sent], topic: str = "/left/image_raw") -> tuple[Any, list[str]]:
    """Focal length, principal point and number of coefficients of a bag's images, and its notes."""
    sent = [*(image(topic, 0.1 * k, each, "mono8") for k, each in enumerate(GREYS)), *sent]
    bag = Bag(write_bag(path / f"{len(list(path.iterdir()))}.mcap", sent))
    with unpacked_bag(bag) as files:
        read = files.lens
    if read is None:
        return None, bag.notes
    numbers = [read.matrix[0, 0], *read.matrix[:2, 2].tolist(), read.coefficients.size]
    return numbers, bag.notes


def test_the_camera_info_is_that_beside_the_images_or_none(tmp_path: Path) -> None:
    both = [info("/left/camera_info", 80.0), info("/right/camera_info", 160.0)]
    assert lens(tmp_path, both)[0] == [80.0, 80.0, 60.0, 5]
    assert lens(tmp_path, both, "/left/image_raw/compressed")[0] == [80.0, 80.0, 60.0, 5]
    assert lens(tmp_path, both[1:], "/right/image_rect_color")[0] == [151.0, 80.0, 60.0, 0]
    found, notes = lens(tmp_path, both[1:])
    assert found is None
    assert "there is no /left/camera_info of /left/image_raw: /right/camera_info may be" in notes[0]


def test_rectified_binned_and_cut_images_have_the_lens_that_rep_104_says(tmp_path: Path) -> None:
    full = {"width": 320, "height": 240, "k": np.array([80.0, 0, 160, 0, 80, 120, 0, 0, 1])}
    part = {"x_offset": 80, "y_offset": 60, "width": 160, "height": 120}
    half = {"binning_x": 2, "binning_y": 2}
    own = "/left/camera_info"
    assert lens(tmp_path, [info(own, 80.0, **full, roi=part)])[0] == [80.0, 80.0, 60.0, 5]
    assert lens(tmp_path, [info(own, 80.0, **full, **half)])[0] == [40.0, 79.75, 59.75, 5]
    whole = {"binning_x": 0, "binning_y": 1, "roi": {"width": 160, "height": 120}}
    assert lens(tmp_path, [info(own, 80.0, **whole)])[0] == [80.0, 80.0, 60.0, 5]
    for topic, rectified in (
        ("/left/image_rect", True),
        ("/left/image_rect_color/compressed", True),
        ("/left/rect/image", True),
        ("/left/image_rectangle", False),
    ):
        path = f"{topic.removesuffix('/compressed').rpartition('/')[0]}/camera_info"
        found, _ = lens(tmp_path, [info(path, 80.0)], topic)
        assert found == ([71.0, 80.0, 60.0, 0] if rectified else [80.0, 80.0, 60.0, 5])


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        (
            {"width": 640, "height": 360, "k": np.array([320, 0, 320, 0, 320, 180, 0, 0, 1.0])},
            "is for images of 640 x 360 px, not 160 x 120",
        ),
        ({"k": np.array([4.2, 0, 80, 0, 4.2, 60, 0, 0, 1])}, "field of view of 174 degrees"),
        ({"k": np.array([9e3, 0, 80, 0, 9e3, 60, 0, 0, 1])}, "field of view of 1.0 degrees"),
        (
            {"k": np.array([80.0, 0, 999, 0, 80, 60, 0, 0, 1])},
            "point 999 is not near the middle of 160 px",
        ),
        ({"binning_x": 2, "binning_y": 2}, "images have 80 x 60 px, not 160 x 120"),
        (
            {"width": 320, "height": 240, "binning_x": 2, "binning_y": 2},
            "point 80 is not near the middle of 320 px: the camera matrix is that of",
        ),
        ({"distortion_model": "omni"}, "the model 'omni' is not supported"),
    ],
)
def test_a_camera_info_that_contradicts_its_images_is_told_and_not_used(
    fields: dict[str, Any], said: str, tmp_path: Path
) -> None:
    found, notes = lens(tmp_path, [info("/left/camera_info", 80.0, **fields)])
    assert found is None
    assert notes[-1].startswith("/left/camera_info is not used: ")
    assert said in notes[-1]


def test_depth_infrared_and_video_are_not_taken_for_pictures(tmp_path: Path) -> None:
    depth = np.full((120, 160), 900, np.uint16).view(np.uint8).reshape(120, 320)
    jpeg = cv2.imencode(".jpg", GREYS[0])[1].tobytes()
    others = [
        image("/camera/aligned_depth_to_color/image_raw", 0.0, depth, "16UC1"),
        image("/camera/infra1/image_rect_raw", 0.0, GREYS[0], "mono8"),
        packed_image("/camera/ir/image/compressed", 0.0, jpeg, "jpeg"),
        packed_image("/camera/front/compressedDepth", 0.0, jpeg, "16UC1; compressedDepth png"),
        packed_image("/camera/film", 0.0, jpeg, "h264"),
    ]
    others = [each._replace(time=0.01 * k) for each in others for k in range(20)]
    pictures = [image("/depth_camera/rgb", 0.1 * k, COLOURED[k], "rgb8") for k in range(3)]
    bag = Bag(write_bag(tmp_path / "all.mcap", others + pictures))
    assert (bag.image_topic, bag.assumed) == ("/depth_camera/rgb", [])
    path = write_bag(tmp_path / "none.mcap", others)
    said = refusal("perceive", path)
    for topic, what in (
        ("/camera/infra1/image_rect_raw", "depth or infrared, by its name"),
        ("/camera/front/compressedDepth", "depth (16UC1; compressedDepth png)"),
        ("/camera/film", "video (h264)"),
    ):
        assert f"{topic} shows {what}" in said
    assert Bag(path, "/camera/infra1/image_rect_raw").image_topic == "/camera/infra1/image_rect_raw"
    said = refusal("perceive", path, "--topic", "/camera/aligned_depth_to_color/image_raw")
    assert "--topic: /camera/aligned_depth_to_color/image_raw shows depth (16UC1)" in said
    several = [pictures[k]._replace(topic=f"/{side}") for side in ("right", "left") for k in (0, 1)]
    assert [str(each) for each in Bag(write_bag(tmp_path / "two.bag", several)).assumed] == [
        "topic of images: /left, as /right has such messages too (--topic)"
    ]


def planes(grey: Image, *, first: int) -> Image:
    """Luminance and neutral colour, byte by byte."""
    pixels = np.full((*grey.shape, 2), 128, np.uint8)
    pixels[..., first] = grey
    return pixels


def deep(pixels: Image, order: str = "<u2") -> Image:
    """Pixels of 16 bits, as their bytes."""
    return (pixels.astype(order) * 257).view(np.uint8).reshape(pixels.shape[0], -1)


def mosaic(encoding: str) -> Callable[[Image], Image]:
    """The pixels behind the filters of a Bayer pattern."""

    def made(bgr: Image) -> Image:
        raw = np.zeros(bgr.shape[:2], np.uint8)
        for n, letter in enumerate(encoding[6:10]):
            raw[n // 2 :: 2, n % 2 :: 2] = bgr[n // 2 :: 2, n % 2 :: 2, "bgr".index(letter)]
        return raw

    return made


GREY_ENCODINGS: dict[str, Callable[[Image], Image]] = {
    "mono8": lambda grey: grey,
    "8UC1": lambda grey: grey,
    "mono16": deep,
    "yuv422_yuy2": lambda grey: planes(grey, first=0),
    "yuyv": lambda grey: planes(grey, first=0),
    "yuv422": lambda grey: planes(grey, first=1),
    "uyvy": lambda grey: planes(grey, first=1),
    "nv12": lambda grey: np.vstack([grey, np.full((60, 160), 128, np.uint8)]),
    "nv21": lambda grey: np.vstack([grey, np.full((60, 160), 128, np.uint8)]),
}
COLOUR_ENCODINGS: dict[str, Callable[[Image], Image]] = {
    "bgr8": lambda bgr: bgr,
    "8UC3": lambda bgr: bgr,
    "rgb8": lambda bgr: bgr[..., ::-1],
    "bgra8": lambda bgr: np.dstack([bgr, bgr[..., 0]]),
    "8UC4": lambda bgr: np.dstack([bgr, bgr[..., 0]]),
    "rgba8": lambda bgr: np.dstack([bgr[..., ::-1], bgr[..., 0]]),
    "bgr16": deep,
    "16UC3": deep,
    "rgb16": lambda bgr: deep(bgr[..., ::-1]),
    "rgba16": lambda bgr: deep(np.dstack([bgr[..., ::-1], bgr[..., 0]])),
}
BAYER = [f"bayer_{order}{bits}" for order in ("rggb", "bggr", "gbrg", "grbg") for bits in (8, 16)]


def recorded(encoding: str, pictures: list[Image]) -> list[Sent]:
    """``pictures`` as messages of ``encoding``, with the size of the picture."""
    sent = []
    for k, picture in enumerate(pictures):
        made = np.ascontiguousarray((GREY_ENCODINGS | COLOUR_ENCODINGS)[encoding](picture))
        each = image("/camera/image", 0.1 * k, made, encoding)
        sent.append(each._replace(fields=each.fields | {"height": 120, "width": 160}))
    return sent


def test_images_of_every_encoding_are_those_of_a_folder(tmp_path: Path) -> None:
    cases = [(name, GREYS, GREYS) for name in GREY_ENCODINGS]
    cases += [(name, COLOURED, COLOURED) for name in COLOUR_ENCODINGS]
    for name, pictures, expected in cases:
        with unpacked_bag(Bag(write_bag(tmp_path / f"{name}.mcap", recorded(name, pictures)))) as f:
            seen = [each.image for each in open_source([f.folder], 10.0)]
        wanted = [cv2.cvtColor(p, cv2.COLOR_GRAY2BGR) if p.ndim == 2 else p for p in expected]
        assert np.array_equal(seen, wanted), name


def test_raw_images_are_those_of_a_converter(tmp_path: Path) -> None:
    for name in BAYER:
        raws = [mosaic(name)(each) for each in COLOURED]
        sent = [
            image("/c", 0.1 * k, deep(raw) if name.endswith("16") else raw, name)
            for k, raw in enumerate(raws)
        ]
        sent = [each._replace(fields=each.fields | {"width": 160}) for each in sent]
        with unpacked_bag(Bag(write_bag(tmp_path / f"{name}.mcap", sent))) as files:
            seen = [each.image for each in open_source([files.folder], 10.0)]
        code = getattr(cv2, f"COLOR_Bayer{name[6:10].upper()}2BGR")
        off = np.abs(np.array(seen, np.int16) - np.array([cv2.cvtColor(raw, code) for raw in raws]))
        assert off.max() <= (1 if name.endswith("16") else 0), name  # means are rounded otherwise


def test_bytes_of_big_endian_images_are_swapped(tmp_path: Path) -> None:
    sent = [image("/c", 0.1 * k, deep(each, ">u2"), "mono16") for k, each in enumerate(GREYS)]
    sent = [s._replace(fields=s.fields | {"width": 160, "is_bigendian": 1}) for s in sent]
    with unpacked_bag(Bag(write_bag(tmp_path / "big.mcap", sent))) as files:
        seen = [each.image[..., 0] for each in open_source([files.folder], 10.0)]
    assert np.array_equal(seen, GREYS)


@pytest.mark.slow
def test_sentences_and_turns_of_a_bag_are_those_of_its_images_in_a_folder(tmp_path: Path) -> None:
    text = "width: 160\nheight: 120\nK: [80, 0, 80, 0, 80, 60, 0, 0, 1]\nD: [-0.2, 0.05, 0, 0, 0]\n"
    (tmp_path / "lens.yaml").write_text(text, encoding="utf-8")
    said = {}
    for name, pictures in (("grey", GREYS), ("colour", COLOURED)):
        folder = save(tmp_path / name, [np.atleast_3d(each) for each in pictures])
        views = answer("perceive", folder, "--fps", "10", "--calibration", tmp_path / "lens.yaml")
        said[name] = [(view["sentence"], view["rotation_deg"]["yaw"]) for view in views]
    own = [info("/camera/camera_info", 80.0)]
    for encoding in GREY_ENCODINGS | COLOUR_ENCODINGS:
        name = "grey" if encoding in GREY_ENCODINGS else "colour"
        sent = recorded(encoding, GREYS if name == "grey" else COLOURED)
        views = answer("perceive", write_bag(tmp_path / f"{encoding}.mcap", sent + own))
        assert [(v["sentence"], v["rotation_deg"]["yaw"]) for v in views] == said[name], encoding
