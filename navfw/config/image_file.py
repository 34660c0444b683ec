"""Reads image files; their size in bytes and pixels is checked before anything is decoded."""

from __future__ import annotations

import contextlib
import io
import os
import re
import warnings
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image as PillowImage

from navfw.config.input_file import read_input, shown_path
from navfw.errors import ConfigError
from navfw.process.process_resources import redirected

MAX_PIXELS = 64_000_000
"""Largest number of pixels of an image: phones take 12 to 50 megapixels."""

_DAMAGED = re.compile(
    rb"bad Huffman code|premature end of data|([3-9][0-9]|[0-9]{3,}) extraneous bytes"
)
"""Warnings of libjpeg when it invents pixels and decodes the image nevertheless. A few extraneous
bytes are harmless: some cameras write them."""
_NETPBM = re.compile(rb"(P[2356](?:(?:\s|#[^\n]*\n)+\d+){2}(?:\s|#[^\n]*\n)+)(\d+)")
"""The header of a PGM or PPM file up to its largest value."""
_REFUSED = {
    **dict.fromkeys((b"heic", b"heix", b"hevc", b"heim", b"heis", b"mif1", b"msf1"), "a HEIC"),
    **dict.fromkeys((b"avif", b"avis"), "an AVIF"),
}


def read_image(
    path: str | Path,
    flags: int = cv2.IMREAD_COLOR,
    max_pixels: int = MAX_PIXELS,
) -> npt.NDArray[np.uint8 | np.uint16]:
    """Read the image in a file, decoded by OpenCV with ``flags`` (default: BGR, 8 bits).

    Raises:
        ConfigError: the file cannot be read, is not an image, is damaged or too large.

    """
    return decode_image(read_input(path), shown_path(Path(path)), flags, max_pixels)


def decode_image(
    data: bytes, name: str, flags: int = cv2.IMREAD_COLOR, max_pixels: int = MAX_PIXELS
) -> npt.NDArray[np.uint8 | np.uint16]:
    """Decode ``data``, the content of a file called ``name``, as ``read_image`` does.

    Raises:
        ConfigError: it is not an image, is damaged or too large; the message has ``name``.

    """
    width, height = _declared_size(data, name)
    if width * height > max_pixels:
        raise ConfigError(
            f"the image is too large: {width} x {height} pixels, at most {max_pixels};"
            " scale it down",
            file=name,
        )
    largest = whole = 255
    if (head := _NETPBM.match(data)) and 0 < (largest := int(head[2])) < 65536:
        # OpenCV takes values as they are, in text up to a white space
        whole = 255 if largest < 256 else 65535
        pixels = data[head.end() :]
        data = head[1] + b"%d" % whole + pixels[pixels[:2] == b"\r\n" :] + b"\n"
    with _heard() as said:
        try:
            depth = cv2.IMREAD_ANYDEPTH if whole != largest and flags >= 0 else 0
            image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flags | depth)
        except cv2.error:
            image = None
    if _DAMAGED.search(b"".join(said)):
        raise ConfigError("the image is damaged: a part of its pixels is lost", file=name)
    if image is None or image.dtype not in (np.uint8, np.uint16):
        raise ConfigError(
            "the image is damaged, or its pixels have neither 8 nor 16 bits", file=name
        )
    if whole != largest:
        scaled = (image.astype(np.int64) * whole + largest // 2) // largest
        image = np.minimum(scaled, whole).astype(image.dtype)
        if depth & ~flags and whole > 255:
            image = (image // 256).astype(np.uint8)
    return image  # type: ignore[return-value]


def _declared_size(data: bytes, name: str) -> tuple[int, int]:
    """Width and height [px] by the header of an image file; its pixels are not decoded."""
    if data[4:8] == b"ftyp" and (kind := _REFUSED.get(data[8:12])):
        raise ConfigError(
            f"is {kind} image, which is not supported; save it as JPEG or PNG (a telephone's "
            "camera has a setting for it, such as 'Most Compatible')",
            file=name,
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # remarks on the size, which is checked here
            with PillowImage.open(io.BytesIO(data)) as image:
                # a damaged PNG: OpenCV would reserve memory by the lengths that its chunks declare
                image.verify()
                return image.size
    except PillowImage.DecompressionBombError:
        raise ConfigError("the image is too large", file=name) from None
    except Exception:  # the readers of Pillow raise many kinds of errors for damaged headers
        raise ConfigError("is not a readable image; give a PNG or JPEG file", file=name) from None


@contextlib.contextmanager
def _heard() -> Iterator[list[bytes]]:
    """What native decoders write to stderr inside the block, known at its end; nothing is shown."""
    said: list[bytes] = []
    if not hasattr(os, "set_blocking"):  # Windows, before Python 3.12
        yield said
        return
    ends = outlet, inlet = os.pipe()
    for end in ends:
        os.set_blocking(end, False)  # output beyond the pipe's buffer is dropped
    try:
        with redirected(inlet, 2):
            yield said
    finally:
        with contextlib.suppress(BlockingIOError):
            said.append(os.read(outlet, 100_000))
        for end in ends:
            os.close(end)
