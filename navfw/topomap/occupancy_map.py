"""Floor plans, grids of cells fixed in the map's frame, and their files as of ROS' map_server.

A cell is free, occupied or unknown; values and order are those of ``nav_msgs/OccupancyGrid``. The
robot may know a floor plan, like the rest of its map: it shows walls, and no furniture that was
moved since.

A file is a yaml file and its image. Occupancy is 1 for black and 0 for white, the other way round
with ``negate``; thresholds decide what is free, occupied and unknown (``RosMapSpec``), as in Nav2.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Annotated, Any, Literal

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator, ConfigDict, Field, model_validator

from navfw.assumption import Assumption
from navfw.config.document import load_yaml
from navfw.config.image_file import read_image
from navfw.config.input_file import is_file, shown_path
from navfw.config.strict_model import StrictModel
from navfw.config.yamlfile import validate
from navfw.errors import ConfigError, MapError, did_you_mean
from navfw.numerics import Array, Mask
from navfw.process.atomic import atomic_file, write_text
from navfw.signals import Pose
from navfw.signals.immutability import read_only
from navfw.topomap.mapspec import Coordinate

Cells = npt.NDArray[np.int8]

FREE, OCCUPIED, UNKNOWN = 0, 100, -1  # defined
"""The values of cells, as in ``nav_msgs/OccupancyGrid``."""

MAX_CELLS = 16_000_000  # chosen
"""Largest number of cells: 200 x 200 m at 5 cm."""


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyMap:
    """Cells (rows, columns) of ``FREE``, ``OCCUPIED`` or ``UNKNOWN``, ``resolution`` [m] wide.

    ``origin`` is the pose, in the frame ``map``, of the grid's corner: columns run along its x axis
    and rows along its y axis, so the centre of cell (i, j) is at
    ``origin.to_parent((j + 0.5) * resolution, (i + 0.5) * resolution)``. ``file`` is the yaml file
    that it was read from, ``assumed`` what its reader took for granted. The cells are read only.

    >>> plan = OccupancyMap(np.array([[FREE, OCCUPIED]]), 0.1, Pose(2.0, 3.0, 0.0))
    >>> plan.centres(*np.nonzero(plan.occupied))
    array([[2.15, 3.05]])
    >>> plan.state(np.array([[2.05, 3.01], [9.0, 9.0]]))
    array([ 0, -1], dtype=int8)

    Raises:
        MapError: it has no cells, or more than ``MAX_CELLS``.

    """

    cells: Cells
    resolution: float
    origin: Pose
    file: Path | None = None
    assumed: tuple[Assumption, ...] = ()

    def __post_init__(self) -> None:
        """Check the size, and make the cells read only."""
        if self.cells.ndim != 2 or not 0 < self.cells.size <= MAX_CELLS:
            size = " x ".join(map(str, self.cells.shape[::-1]))
            raise MapError(
                f"a floor plan has 1 to {MAX_CELLS} cells, got {size}; reduce the image and "
                "enlarge its resolution by the same factor",
                file=self.file,
            )
        cells = read_only(np.asarray(self.cells, dtype=np.int8))
        object.__setattr__(self, "cells", cells)

    @property
    def free(self) -> Mask:
        """Which cells (rows, columns) are known to be free."""
        free: Mask = self.cells == FREE
        return free

    @property
    def occupied(self) -> Mask:
        """Which cells (rows, columns) are known to be occupied."""
        occupied: Mask = self.cells == OCCUPIED
        return occupied

    def centres(self, rows: npt.NDArray[np.intp], columns: npt.NDArray[np.intp]) -> Array:
        """Return the centres (N, 2) [m] of cells in the frame ``map``."""
        along_axes = np.stack([columns + 0.5, rows + 0.5], axis=1) * self.resolution
        return self.origin.points_to_parent(along_axes)

    def cells_at(self, points: Array) -> npt.NDArray[np.intp]:
        """Return the cells (N, 2: row, column) at points (N, 2) [m, map], outside the grid too."""
        local = self.origin.points_to_local(points)
        return np.floor(local[:, ::-1] / self.resolution).astype(np.intp)

    def state(self, points: Array) -> Cells:
        """Return the states (N,) at points (N, 2) [m, map]; ``UNKNOWN`` outside the grid."""
        index = self.cells_at(points)
        inside = np.all((index >= 0) & (index < self.cells.shape), axis=1)
        states = np.full(len(points), UNKNOWN, dtype=np.int8)
        states[inside] = self.cells[index[inside, 0], index[inside, 1]]
        return states


def _number(value: Any) -> Any:
    """Convert a number in quotes, or a truth value: yaml-cpp reads either as Nav2 needs it."""
    if isinstance(value, str):
        with contextlib.suppress(ValueError):
            words = {"false": "0", "no": "0", "true": "1", "yes": "1"}
            return float(words.get(value.lower(), value))
    return int(value) if isinstance(value, bool) else value


def _at_most(most: float, unit: str, other: str, meant: Callable[[float], float]) -> Any:
    """Refuse larger magnitudes, and NaN; say what those of the ``other`` unit are."""

    def checked(value: Any) -> Any:
        if isinstance(value := _number(value), int | float) and not abs(value) <= most:
            hint = f": {other}? Write {meant(value):.6g}" if abs(meant(value)) <= most else ""
            raise ValueError(f"expected {unit}, got {value:g}{hint}")
        return value

    return BeforeValidator(checked)


Number = Annotated[Coordinate, BeforeValidator(_number)]
Angle = Annotated[
    float, _at_most(2.0 * math.pi + 1e-6, "radians (0.0 if unknown)", "degrees", math.radians)
]
Share = Annotated[
    float, _at_most(1.0, "0 to 1", "per cent", lambda v: v / 100.0), Field(ge=0.0, le=1.0)
]
Metres = Annotated[
    float, _at_most(10.0, "metres", "pixels a metre", lambda v: 1.0 / v), Field(ge=0.001, le=10.0)
]


class RosMapSpec(StrictModel):
    """The keys of a floor plan's yaml file that are used; others are ignored, as by map_server.

    In the modes ``trinary`` and ``scale`` cells between the thresholds and transparent ones are
    unknown, in ``trinary`` those of the grey level 205, too. In ``raw`` the grey levels 0 to 100
    are per cent of occupancy, and all others unknown.
    """

    model_config = ConfigDict(extra="ignore")

    image: str = Field(min_length=1, max_length=1000, description="image file, beside this")
    resolution: Metres = Field(description="edge of a pixel [m]")
    origin: tuple[Number, Number, Angle] = Field(
        description="x, y [m], yaw [rad] of the image's lower left corner in the map frame"
    )
    mode: Annotated[
        Literal["trinary", "scale", "raw"],
        BeforeValidator(lambda value: value.lower() if isinstance(value, str) else value),
        Field(description="meaning of the grey levels"),
    ] = "trinary"
    negate: Annotated[
        Literal[0, 1],
        BeforeValidator(_number),
        Field(description="1, or true: black is free and white is occupied; not in mode raw"),
    ] = 0
    occupied_thresh: Share = Field(0.65, description="occupied above this occupancy")
    free_thresh: Share = Field(0.196, description="free below this occupancy")

    @model_validator(mode="after")
    def _thresholds_in_order(self) -> RosMapSpec:
        if self.free_thresh >= self.occupied_thresh:
            raise ValueError(
                f"free_thresh {self.free_thresh:g} must be below occupied_thresh "
                f"{self.occupied_thresh:g}"
            )
        return self


IMAGE_SUFFIXES = (".pgm", ".png", ".bmp", ".ppm", ".pnm", ".jpg", ".jpeg", ".tif", ".tiff")
"""Formats of a floor plan's image; the first three are written, as by map_saver."""

_UNKNOWN_GREY = 205  # defined
"""The grey level that map_saver writes for unknown: its occupancy 0.196 is below Nav2's default
threshold 0.25 for free, and it must not be free all the same."""
_BLUR = 8  # chosen
"""How far JPEG moves that grey level."""
_LEVELS = {FREE: 254, OCCUPIED: 0, UNKNOWN: _UNKNOWN_GREY}  # defined
"""The grey levels of map_saver by state."""


def load_ros_map(path: str | Path) -> OccupancyMap:
    """Load the floor plan in a yaml file of map_server, and its image.

    The image lies in the folder of the yaml file, or anywhere below the folder above it.

    Raises:
        ConfigError: a file cannot be read, breaks the schema, or the image lies elsewhere.
        MapError: it has too many cells.

    """
    path = Path(path)
    spec = validate(load_yaml(path), RosMapSpec)
    image, assumed = _image_path(path, spec.image)
    return plan_of_image(image, spec, path, assumed)


def plan_of_image(
    image: Path, spec: RosMapSpec, file: Path, assumed: tuple[Assumption, ...] = ()
) -> OccupancyMap:
    """Read the floor plan in ``image`` as ``spec`` says; ``file`` is its yaml file.

    Raises:
        ConfigError: the image cannot be read.
        MapError: it has too many cells.

    """
    if image.suffix.lower() not in IMAGE_SUFFIXES:
        raise ConfigError(
            f"a floor plan is an image of {', '.join(IMAGE_SUFFIXES)}; convert it",
            file=shown_path(image),
        )
    jpeg = image.suffix.lower() in {".jpg", ".jpeg"}  # which photographs turn by their EXIF data
    pixels = read_image(image, cv2.IMREAD_COLOR if jpeg else cv2.IMREAD_UNCHANGED)
    if pixels.shape[0] * pixels.shape[1] > MAX_CELLS:
        raise MapError(
            f"the image has {pixels.shape[1]} x {pixels.shape[0]} pixels, a floor plan at most "
            f"{MAX_CELLS}; reduce it and enlarge the resolution by the same factor",
            file=shown_path(image),
        )
    grey, transparent = _grey_levels(pixels)
    states = _states(grey, transparent, spec, _BLUR if jpeg else 0)
    return OccupancyMap(states[::-1], spec.resolution, Pose(*spec.origin), file, assumed)


def save_ros_map(plan: OccupancyMap, path: str | Path, suffix: str = ".png") -> Path:
    """Write a plan's yaml file at ``path`` and its image beside it; return the image's path.

    ``suffix`` is one of the first three ``IMAGE_SUFFIXES``.

    Raises:
        InputError: a file cannot be written, or the suffix of the yaml file or image is another.

    """
    path = Path(path)
    if suffix not in IMAGE_SUFFIXES[:3]:
        raise ConfigError(
            f"expected an image of {', '.join(IMAGE_SUFFIXES[:3])}, got {suffix!r}", key="image"
        )
    if path.suffix.lower() not in {".yaml", ".yml"}:
        raise ConfigError("expected a .yaml file for the floor plan", file=shown_path(path))
    image = path.with_suffix(suffix)
    levels = np.zeros(plan.cells.shape, dtype=np.uint8)
    for state, level in _LEVELS.items():
        levels[plan.cells == state] = level
    content = cv2.imencode(suffix, levels[::-1])[1].tobytes()
    with atomic_file(image, parents=True) as target:
        target.write_bytes(content)
    origin = ", ".join(repr(round(v, 6)) for v in (plan.origin.x, plan.origin.y, plan.origin.yaw))
    lines = (
        f"image: {image.name}",
        "mode: trinary",
        f"resolution: {plan.resolution!r}",
        f"origin: [{origin}]",
        "negate: 0",
        "occupied_thresh: 0.65",
        "free_thresh: 0.196",
    )
    write_text(path, "\n".join(lines) + "\n", parents=True)
    return image


def _image_path(path: Path, name: str) -> tuple[Path, tuple[Assumption, ...]]:
    """Return the image's path, which is relative to the folder of the yaml file or that above.

    Where there is none, or it is a path of another computer, it is the image of that name beside
    the yaml file, in any case of letters.
    """
    steps = PurePosixPath(name)
    near = not (steps.is_absolute() or ".." in steps.parts[1:] or set("\\:~") & set(name))
    if near and is_file(path.parent / steps):
        return path.parent / steps, ()
    last = PureWindowsPath(name).name
    beside = sorted(file for file in path.parent.glob("*") if file.suffix.lower() in IMAGE_SUFFIXES)
    for file in beside:
        if file.name.lower() == last.lower():
            reason = f"there is no {name!r} near the yaml file"
            return file, (Assumption("image", f"{file.name} beside the yaml file", reason),)
    names = [file.name for file in beside]
    advice = f"; {did_you_mean(last, names)}" if names else ""
    raise ConfigError(
        f"there is no {name!r} near this file; copy the image beside it and write "
        f"image: {last}{advice}",
        file=shown_path(path),
        key="image",
    )


def _grey_levels(pixels: npt.NDArray[Any]) -> tuple[Array, Mask]:
    """Return grey levels 0 to 255 (mean of colours), and which pixels are at all transparent."""
    scaled = pixels.astype(np.float64) / (257.0 if pixels.dtype == np.uint16 else 1.0)
    if scaled.ndim == 2:
        return scaled, np.zeros(scaled.shape, dtype=np.bool_)
    colours = scaled[..., : 3 if scaled.shape[2] >= 3 else 1]
    alpha = scaled[..., -1] if scaled.shape[2] in {2, 4} else np.full(scaled.shape[:2], 255.0)
    return colours.mean(axis=2), alpha < 255.0


def _states(grey: Array, transparent: Mask, spec: RosMapSpec, blur: int) -> Cells:
    """Compute the states of all pixels from their occupancy and the thresholds."""
    if spec.mode == "raw":
        occupancy = np.round(grey) / 100.0
        unknown = occupancy > 1.0
    else:
        occupancy = grey / 255.0 if spec.negate else 1.0 - grey / 255.0
        unknown = transparent
        if spec.mode == "trinary" and not spec.negate:
            unknown = unknown | (np.abs(grey - _UNKNOWN_GREY) <= blur)
    states = np.full(grey.shape, UNKNOWN, dtype=np.int8)
    states[occupancy < spec.free_thresh] = FREE
    states[occupancy > spec.occupied_thresh] = OCCUPIED
    states[unknown] = UNKNOWN
    return states
