"""Convert ROS's image messages to images in BGR, and recognize those that show no picture."""

from __future__ import annotations

import re
from typing import Any

import cv2
import numpy as np

from navfw.config.image_file import MAX_PIXELS, decode_image
from navfw.errors import ConfigError, did_you_mean
from navfw.numerics import Image

BITS = (8, 10, 12, 14, 16)
"""Bits of a camera's pixels; messages keep pixels of more than 8 bits in 16."""
_MAX_PAD = 256
"""Bytes behind a row, besides another row, from which on its encoding is wrong: colour as grey."""
_GREY = cv2.COLOR_GRAY2BGR
_ENCODINGS: dict[str, tuple[int, int | None, int | None]] = {
    **dict.fromkeys(("mono8", "8UC1", "mono16"), (1, 0, _GREY)),
    **dict.fromkeys(("nv12", "nv21", "nv24", "i420"), (1, 0, _GREY)),  # colour follows the rows
    **dict.fromkeys(("yuyv", "yuv422_yuy2"), (2, 0, _GREY)),
    **dict.fromkeys(("uyvy", "yuv422"), (2, 1, _GREY)),
    **dict.fromkeys(("bgr8", "8UC3", "bgr16", "16UC3"), (3, None, None)),
    **dict.fromkeys(("rgb8", "rgb16"), (3, None, cv2.COLOR_RGB2BGR)),
    **dict.fromkeys(("bgra8", "8UC4", "bgra16", "16UC4"), (4, None, cv2.COLOR_BGRA2BGR)),
    **dict.fromkeys(("rgba8", "rgba16"), (4, None, cv2.COLOR_RGBA2BGR)),
    **dict.fromkeys(("bayer_rggb8", "bayer_rggb16"), (1, 0, cv2.COLOR_BayerRGGB2BGR)),
    **dict.fromkeys(("bayer_bggr8", "bayer_bggr16"), (1, 0, cv2.COLOR_BayerBGGR2BGR)),
    **dict.fromkeys(("bayer_gbrg8", "bayer_gbrg16"), (1, 0, cv2.COLOR_BayerGBRG2BGR)),
    **dict.fromkeys(("bayer_grbg8", "bayer_grbg16"), (1, 0, cv2.COLOR_BayerGRBG2BGR)),
}
"""Numbers of a pixel, the index of the one that is used (None: all), OpenCV's code to BGR.

16UC1 is depth; of YUV the luminance is used.
"""
_DISTANCES = re.compile(r"compressedDepth|(16U|16S|32S|32F|64F)C[12]?(?!\w)")
_COLOURED = re.compile(r"rgb|bgr|bayer|yuv|yuyv|uyvy|nv\d|8UC[34]|16UC[34]")
_SIDE_CAMERA = re.compile(r"depth|disparity|infra|(?:^|[/_])ir\d*(?:$|[/_])", re.IGNORECASE)
_FILM = re.compile(r"theora|h\.?26[45]|hevc|\bav1|\bvp[89]|CompressedVideo|FFMPEGPacket", re.I)


def is_film(kind: str) -> str:
    """Return the part of a message's type or format that names a video; "" if none does."""
    film = _FILM.search(kind)
    return film[0] if film else ""


def no_picture(message: Any, topic: str) -> str:
    """Return "" if a message on ``topic`` shows a picture, else what: depth, infrared or video."""
    kind = message.format if hasattr(message, "format") else message.encoding
    if _DISTANCES.search(kind):
        return f"depth ({kind:.40})"
    if is_film(kind):
        return f"video ({kind:.40})"
    if _SIDE_CAMERA.search(topic) and not _COLOURED.match(kind):
        return "depth or infrared, by its name"
    return ""


def ros_image(message: Any, name: str) -> Image:
    """Convert an ``Image`` or ``CompressedImage`` named ``name`` to BGR (height, width, 3), 8 bits.

    Pixels of 16 bits are scaled by the least number of bits that holds all of them.

    Raises:
        ConfigError: its encoding is unknown, its size impossible, or its content damaged.

    """
    image = deep_image(message, name)
    bits = 8
    if image.dtype != np.uint8:
        bits = next(bits for bits in BITS if int(image.max()) < 1 << bits)
    return np.asarray(image >> (bits - 8), dtype=np.uint8)


def deep_image(message: Any, name: str) -> Any:
    """Convert an image as ``ros_image`` does, but keep 16 bits (uint16)."""
    if hasattr(message, "format"):
        return np.asarray(decode_image(bytes(message.data), name), dtype=np.uint8)
    coding, is_deep = message.encoding, "16" in message.encoding
    if coding not in _ENCODINGS:
        hint = did_you_mean(coding, _ENCODINGS)
        raise ConfigError(f"unknown encoding {coding!r:.40}: {hint}", file=name)
    channels, part, conversion = _ENCODINGS[coding]
    height, width, step = message.height, message.width, message.step
    row = channels * width * (2 if is_deep else 1)
    data = np.asarray(message.data, dtype=np.uint8)
    fits = 0 < width * height <= MAX_PIXELS
    fits = fits and row <= step < 2 * row + _MAX_PAD
    if not (fits and step * height <= data.size):
        what = f"has {data.size} bytes in rows of {step} for {width} x {height} pixels"
        raise ConfigError(f"the image {what} of {coding}", file=name)
    rows = np.ascontiguousarray(data[: step * height].reshape(height, step)[:, :row])
    if is_deep:
        rows = rows.view(">u2" if message.is_bigendian else "<u2").astype(np.uint16)
    image = rows.reshape(height, width, channels)
    image = image if part is None else np.ascontiguousarray(image[..., part])
    return image if conversion is None else cv2.cvtColor(image, conversion)
