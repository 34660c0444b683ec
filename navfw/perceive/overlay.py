"""Draw a result over its image: flow, quadrants by distance, planes, and the sentence."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np
from PIL import Image as PillowImage
from PIL import ImageDraw, ImageFont

from navfw.config.extras import require_extra
from navfw.errors import InputError
from navfw.numerics import Array, Image
from navfw.offis.percept_explanation import front_in
from navfw.perceive.image_sources import ImageSource
from navfw.perceive.pair_result import PairResult
from navfw.perceive.perceiver_options import WorkingSize
from navfw.perceive.sentence_evidence import strongest_term
from navfw.process.atomic import AtomicFolder
from navfw.recording.video_output import VIDEO_SUFFIX, VideoOutput
from navfw.signals import FlowField, Label, Percept

Colour = tuple[int, int, int]
"""Blue, green, red, each in 0..255."""
_HALO = 0.11
"""Width of the halo around letters, relative to their size."""


@cache
def _font(size: float, bold: bool) -> ImageFont.FreeTypeFont:
    """Load DejaVu Sans, which comes with matplotlib; matplotlib itself is not loaded."""
    require_extra("report", "matplotlib")
    spec = find_spec("matplotlib")
    (folder,) = (spec and spec.submodule_search_locations) or ("",)
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(Path(folder, "mpl-data", "fonts", "ttf", name), size)


def text_width(text: str, size: float) -> float:
    """Return the width [px] of ``text`` in letters of ``size`` [px]."""
    return _font(size, bold=False).getlength(text)


def write(
    image: Image,
    text: str,
    at: tuple[float, float],
    size: float,
    colour: Colour,
    *,
    bold: bool = False,
    halo: Colour | None = None,
) -> None:
    """Write ``text`` in letters of ``size`` [px] into ``image``, from ``at`` (x, y) [px] on.

    ``at`` is on the base line; ``halo`` is the colour of an outline that keeps the text
    readable on any background.
    """
    font = _font(size, bold)
    stroke = 0.0 if halo is None else max(1.0, _HALO * size)
    left, top = max(0, int(at[0] - size)), max(0, int(at[1] - 1.5 * size))
    right = int(at[0] + font.getlength(text) + size)
    # the part with the text alone: a copy of all of the image costs more than the letters
    around = image[top : max(0, int(at[1] + size)), left : max(0, right)]
    if not around.size:
        return
    canvas = PillowImage.fromarray(np.ascontiguousarray(around))
    ImageDraw.Draw(canvas).text(
        (at[0] - left, at[1] - top),
        text,
        fill=colour,
        font=font,
        anchor="ls",
        stroke_width=stroke,
        stroke_fill=halo,
    )
    around[:] = np.asarray(canvas)


def write_key(
    image: Image,
    key: Sequence[tuple[str, Colour]],
    at: tuple[float, float],
    size: float,
    ink: Colour,
) -> None:
    """Write names in ``ink``, each after a patch of its colour, in as many lines as they need.

    ``size`` [px] is that of letters, ``at`` (x, y) [px] the left end of the first base line; the
    same margin is kept on the right.
    """
    left, base = at
    x, patch = left, 0.8 * size
    for name, colour in key:
        width = 1.3 * size + text_width(name, size)
        if x > left and x + width > image.shape[1] - left:
            x, base = left, base + 1.5 * size
        corner = round(x), round(base - patch)
        cv2.rectangle(image, corner, (round(x + patch), round(base)), colour, cv2.FILLED)
        write(image, name, (x + 1.3 * size, base), size, ink)
        x += width + 1.2 * size


def wrap(text: str, size: float, width: float) -> list[str]:
    """Split ``text`` at spaces into lines up to ``width`` [px], in letters of ``size`` [px]."""
    lines: list[str] = []
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and text_width(longer, size) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


_NO_FOLDERS = {".avi", ".m4v", ".mov", ".mkv", ".webm", ".gif", ".png", ".jpg", ".jpeg"}
_OURS = re.compile(r"view-[0-9]{5,}\.png")


class _Pictures(AtomicFolder):
    """A folder of pictures, written as they are drawn; the first replaces earlier ones."""

    def __init__(self, target: Path) -> None:
        super().__init__(target, _OURS, "--overlay")
        self._count = 0

    def add(self, picture: Image) -> None:
        if self._count == 0:
            self._refuse_foreign()
            self.place.mkdir(exist_ok=True)
            for earlier in self.place.iterdir():
                earlier.unlink()
        self._count += 1
        name = f"view-{self._count:05d}.png"
        if not cv2.imwrite(str(self.path / name), picture):
            raise InputError("is not writable", file=self.target)
        (self.path / name).replace(self.place / name)

    def _move_into_place(self) -> None:
        """Do nothing: each picture is in its place already."""


def open_output(target: Path, source: ImageSource) -> VideoOutput | _Pictures:
    """Open a new ``.mp4``, otherwise a folder whose overlay images are replaced.

    Raises:
        InputError: the target is an existing file, a folder with other files, or of another type.
        MissingExtraError: the library that writes videos is not installed.

    """
    suffix = target.suffix.lower()
    if suffix == VIDEO_SUFFIX:
        if target.is_file():
            raise InputError("exists; remove it, or choose another --overlay", file=target)
        return VideoOutput(target, min(max(source.rate, 1.0), 120.0), "--overlay")
    if suffix in _NO_FOLDERS:
        expected = f"is neither a {VIDEO_SUFFIX} nor the name of a folder"
        raise InputError(expected, file=target, key="--overlay")
    return _Pictures(target)


# Okabe and Ito's colours (as blue, green, red), distinguishable by colour-blind readers
COLOURS: dict[str, Colour] = {
    "near": (0, 94, 213),
    "middle": (0, 159, 230),
    "far": (178, 114, 0),
    "floor": (115, 158, 0),
    "unknown": (150, 150, 150),
    "small things": (66, 228, 240),
}
"""Colours of the distance terms, of the floor, of unknown cells, and of small things."""
_INK, _PAPER, _FAINT, _WARNING = (30, 26, 24), (250, 250, 250), (170, 165, 160), (60, 190, 250)
_PLANE, _FOCUS = (255, 255, 160), (120, 255, 120)
_KEY = (*COLOURS.items(), ("flow", _PAPER), ("planes", _PLANE), ("heading", _FOCUS))
"""Marks that are drawn over the image, with their colours."""
_LONG_SIDE, _SHORT_SIDE = 1024, 480
_LETTERS = 17.0
_LINE = 24
_MARGIN = 18
_LINES = 6
_KEY_WIDTH = 700
"""Width [px] from which the key fits on one line."""
_SHIFT = 4
_NEWEST = 0.05
"""Age [s] of a statement from which its age is written behind it."""


def draw(image: Image, result: PairResult, size: WorkingSize) -> Image:
    """Return ``image`` (height, width, 3) enlarged, with the overlay of ``result`` and a caption.

    All images of a sequence get the same, even size.
    """
    scale = min(_LONG_SIDE / max(size.width, size.height), 8.0)
    scale = max(scale, _SHORT_SIDE / size.width)
    width, height = 2 * round(0.5 * scale * size.width), 2 * round(0.5 * scale * size.height)
    way = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_CUBIC
    scene = np.asarray(cv2.resize(image, (width, height), interpolation=way), dtype=np.uint8)
    scene = np.asarray(0.82 * scene, dtype=np.uint8)
    # from working pixels relative to the centre to pixels of the enlarged image
    gain = scale / size.scale
    middle = np.array([0.5 * width, 0.5 * height])
    half = 0.5 * gain * np.array([size.cut_width, size.cut_height])
    corners = middle - half, middle + half
    _draw_quadrants(scene, result, corners)
    if result.known:
        # words are held over pairs: planes of this pair are drawn where they show what is said
        said, degrees = front_in(result.percept.sentence), result.percept.situations
        if said != "unknown" and any(n.endswith(said) and degrees[n] >= 0.5 for n in degrees):
            _draw_planes(scene, result.percept, corners)
        draw_flow(scene, result.flow, gain)
        if result.focus is not None:
            _draw_focus(scene, np.array(result.focus) * scale, result, scale)
    _label_quadrants(scene, result, corners)
    for thing in result.small or ():
        box, ink = np.array(thing.box).reshape(2, 2) * (width, height), COLOURS["small things"]
        _frame(scene, box[0], box[1], ink)
        at = float(box[0, 0]), min(float(box[1, 1]) + 17.0, height - 5.0)
        write(scene, f"{thing.distance:.1f}", at, 14.0, ink, halo=_INK)
    return np.concatenate([scene, _caption(result, width)])


def draw_flow(scene: Image, flow: FlowField, gain: float) -> None:
    """Draw arrows of confident vectors, circles for others; ``gain`` is scene px per flow px."""
    middle = 0.5 * np.array([scene.shape[1], scene.shape[0]])
    width = max(1, round(gain / 4.0))
    order = np.argsort(flow.confidence.ravel())
    points, vectors = flow.points.reshape(-1, 2), flow.vectors.reshape(-1, 2)
    for cell in order:
        confidence = float(flow.confidence.ravel()[cell])
        tip = middle + gain * points[cell]
        if confidence <= 0.05 or not np.isfinite(vectors[cell]).all():
            cv2.circle(scene, _fixed(tip), 2 << _SHIFT, (120, 120, 120), 1, cv2.LINE_AA, _SHIFT)
            continue
        tail = tip - gain * vectors[cell]
        shade = round(110 + 145 * confidence)
        length = float(np.hypot(*(tip - tail)))
        head = min(0.45, 7.0 * max(width, 1) / max(length, 1.0))
        for colour, thick in (((20, 20, 20), width + 2), ((shade, shade, shade), width)):
            cv2.arrowedLine(
                scene, _fixed(tail), _fixed(tip), colour, thick, cv2.LINE_AA, _SHIFT, head
            )


def _draw_quadrants(scene: Image, result: PairResult, corners: tuple[Array, Array]) -> None:
    """Tint quadrants by distance, the nearest ones as the sentence says, and frame their parts.

    Cells of floor have its colour, unknown cells that of the unknown.
    """
    percept = result.percept
    nearest = next(iter(percept.obstacles.values()), {})
    tint = np.zeros((*percept.label.shape, 4))  # colour and share
    ends = np.zeros(2), np.array(percept.label.shape[::-1], dtype=np.float64)
    for name, degrees in percept.quadrants.items():
        (x0, y0), (x1, y1) = (np.rint(end).astype(int).tolist() for end in _region(name, ends))
        share = 0.34 if name in nearest else 0.14
        tint[y0:y1, x0:x1] = (*COLOURS[nearest.get(name, strongest_term(degrees))], share)
    unknown = np.full(percept.label.shape, not result.known) | (percept.label == Label.UNKNOWN)
    tint[unknown] = (*COLOURS["unknown"], 0.14)
    tint[(percept.label == Label.FLOOR) & ~unknown] = (*COLOURS["floor"], 0.34)
    x0, y0, x1, y1 = (round(v) for end in corners for v in end.tolist())
    tint = cv2.resize(tint, (x1 - x0, y1 - y0), interpolation=cv2.INTER_NEAREST)
    part, alpha = scene[y0:y1, x0:x1], tint[..., 3:]
    part[:] = np.rint((1.0 - alpha) * part + alpha * tint[..., :3]).astype(np.uint8)
    for layer in list(percept.obstacles.values())[1:]:
        for name, term in layer.items():
            low, high = _region(name, corners)
            _frame(scene, low + 3, high - 3, COLOURS[term])
    middle = 0.5 * (corners[0] + corners[1])
    for begin, end in (
        ((middle[0], corners[0][1]), (middle[0], corners[1][1])),
        ((corners[0][0], middle[1]), (corners[1][0], middle[1])),
    ):
        cv2.line(scene, _fixed(begin), _fixed(end), (235, 235, 235), 1, cv2.LINE_AA, _SHIFT)


def _frame(scene: Image, low: Array, high: Array, colour: Colour) -> None:
    for ink, thick in ((_INK, 5), (colour, 3)):
        cv2.rectangle(scene, _fixed(low), _fixed(high), ink, thick, cv2.LINE_AA, _SHIFT)


def _label_quadrants(scene: Image, result: PairResult, corners: tuple[Array, Array]) -> None:
    for name, degrees in result.percept.quadrants.items():
        term = strongest_term(degrees) if result.known else "unknown"
        low, high = _region(name, corners)
        text = term
        contact = result.quadrant_contact[name]
        if result.known and term != "unknown" and math.isfinite(contact) and contact < 100.0:
            text += f" {contact * result.scale.speed:.1f} m" if result.scale.metric else ""
            text += f" {contact:.1f} s"
        x = low[0] + 8 if name in ("P2", "P3") else high[0] - 8 - text_width(text, 15.0)
        y = low[1] + 21 if name in ("P1", "P2") else high[1] - 10
        write(scene, text, (float(x), float(y)), 15.0, _PAPER, halo=_INK)


def _draw_planes(scene: Image, percept: Percept, corners: tuple[Array, Array]) -> None:
    """Draw the left and the right plane as walls, the nearer side taller (METHOD R9)."""
    low, high = corners
    middle = 0.5 * (low + high)
    reach = 0.5 * (high[1] - low[1])
    for side, code in percept.slopes.items():
        digits = [int(digit) for digit in code if digit.isdigit()]
        if len(digits) != 2:
            continue
        left, right = (low[0], middle[0]) if side == "left" else (middle[0], high[0])
        tall = [reach * (0.1 + 0.26 * digit) for digit in digits]
        inset = 0.02 * (high[0] - low[0])
        outline = np.array(
            [
                (left + inset, middle[1] - tall[0]),
                (right - inset, middle[1] - tall[1]),
                (right - inset, middle[1] + tall[1]),
                (left + inset, middle[1] + tall[0]),
            ]
        )
        fixed = np.rint(outline * (1 << _SHIFT)).astype(np.int32)
        for colour, thick in ((_INK, 4), (_PLANE, 2)):
            cv2.polylines(scene, [fixed], True, colour, thick, cv2.LINE_AA, _SHIFT)


def _draw_focus(scene: Image, at: Array, result: PairResult, scale: float) -> None:
    """Draw a cross where the camera heads, in an ellipse of two standard deviations."""
    height, width = scene.shape[:2]
    if not (0.0 <= at[0] < width and 0.0 <= at[1] < height):
        return
    variances, axes = np.linalg.eigh(result.motion.egomotion.covariance[3:, 3:])
    half = 2.0 * scale * result.focal * np.sqrt(np.clip(variances, 0.0, 1.0))
    turn = math.degrees(math.atan2(-axes[1, 1], -axes[0, 1]))  # bearing is left, elevation up
    ellipse = (tuple(at.tolist()), tuple((2.0 * half[::-1]).tolist()), turn)
    cv2.ellipse(scene, ellipse, _FOCUS, 1, cv2.LINE_AA)
    for colour, thick in ((_INK, 5), (_FOCUS, 2)):
        cv2.circle(scene, _fixed(at), 9 << _SHIFT, colour, thick, cv2.LINE_AA, _SHIFT)
        for step in ((14, 0), (-14, 0), (0, 14), (0, -14)):
            inner = at + 0.45 * np.array(step)
            cv2.line(scene, _fixed(inner), _fixed(at + step), colour, thick, cv2.LINE_AA, _SHIFT)


def _caption(result: PairResult, width: int) -> Image:
    """Return the sentence, the figures of the result and the key, in a strip of fixed height."""
    key_lines = 1 if width > _KEY_WIDTH else 2
    height = (_LINES + key_lines) * _LINE + 2 * _MARGIN
    strip = np.full((height, width, 3), _INK, dtype=np.uint8)
    ages = {one.says: f" ({one.age:.1f} s ago)" for one in result.statements if one.age >= _NEWEST}
    clauses = result.percept.sentence.split("; ")
    clauses = [clause + ages.get(clause.removeprefix("Layer1: "), "") for clause in clauses]
    front = [clause for clause in clauses if not clause.startswith(("Layer", "Small"))]
    right = _figures(result)
    room = width - 2 * _MARGIN
    y = _MARGIN + 15.0
    write(strip, "; ".join(front), (_MARGIN, y), _LETTERS + 3, _PAPER, bold=True)
    for k, line in enumerate(right):
        x = width - _MARGIN - text_width(line, 14.0)
        write(strip, line, (x, y + 19.0 * k), 14.0, _FAINT)
    room_left = room - max(text_width(line, 14.0) for line in right) - 24.0
    lines: list[tuple[str, Colour]] = []
    for clause in clauses:
        if clause not in front:
            lines += [(line, _PAPER) for line in wrap(clause, _LETTERS - 2, room_left)]
    if result.notes:
        lines += [(line, _WARNING) for line in wrap("; ".join(result.notes), _LETTERS - 2, room)]
    for k, (line, colour) in enumerate(lines[: _LINES - 1]):
        write(strip, line, (_MARGIN, y + _LINE * (k + 1)), _LETTERS - 2, colour)
    below = height - _MARGIN - _LINE * (key_lines - 1)
    write_key(strip, _KEY, (_MARGIN, below), 14.0, _FAINT)
    return strip


def _figures(result: PairResult) -> list[str]:
    contact = f"{result.contact:.1f} s" if math.isfinite(result.contact) else "-"
    planes = "  ".join(f"{side} {code}" for side, code in result.percept.slopes.items())
    return [
        f"{result.time:.2f} s   {result.now}",
        f"contact ahead in {contact}",
        f"confidence {result.confidence:.2f}",
        f"planes {planes}",
    ]


def _region(name: str, corners: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return the upper left and lower right corner [px] of a quadrant or its part (``sP23``)."""
    low, high = corners
    for digit in name.lstrip("sP"):
        middle = 0.5 * (low + high)
        right, upper = digit in "14", digit in "12"
        low, high = (
            np.array([middle[0] if right else low[0], low[1] if upper else middle[1]]),
            np.array([high[0] if right else middle[0], middle[1] if upper else high[1]]),
        )
    return low, high


def _fixed(point: Array | tuple[float, float]) -> tuple[int, int]:
    """Convert ``point`` [px] to OpenCV's fixed-point coordinates."""
    return round(float(point[0]) * (1 << _SHIFT)), round(float(point[1]) * (1 << _SHIFT))
