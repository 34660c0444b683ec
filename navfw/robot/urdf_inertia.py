"""Inertia of the links of a URDF that no body of that mass and size can have, and what would do.

Published files have many: 1 kg m^2 on a plate of 10 g makes a body that follows no command.
"""

from __future__ import annotations

import math
from itertools import product as combinations
from pathlib import Path

import numpy as np

from navfw.config.input_file import shown_path
from navfw.config.xml_file import line_of
from navfw.numerics import Array
from navfw.numerics.products import product, sum_in_order
from navfw.robot import RobotModel
from navfw.robot.urdf import UrdfModel, attribute_numbers, origin_frame, read_urdf

_DENSITY = 1000.0
"""Density [kg/m^3] of the cube that stands for a link without a shape: that of water."""

_ROOM, _WIDE_ROOM = 1.5, 3.0
"""Factors on the reach of a link's collision shapes, of which more may be seen, and on the size of
the robot for one without a shape or with a mesh."""

_MIN_MOMENT, _NEGLIGIBLE = 1e-3, 1e-3
"""Least principal moment as a part of the box's, a rod's about its own axis; and a moment that does
not matter, as a part of the robot's mass times its squared size."""

_ROUNDING = 1.02
"""Largest principal moment over the sum of the others, which it cannot exceed but by rounding."""

_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def inertia_notes(robot: RobotModel) -> tuple[str, ...]:
    """What to tell of the inertia of a checked robot, a line for each link."""
    if robot.urdf is None:
        return ()
    model = read_urdf(Path(robot.urdf.file), robot.urdf.packages)
    return tuple(note for note, _ in impossible_inertias(robot, model).values())


def impossible_inertias(
    robot: RobotModel, model: UrdfModel
) -> dict[str, tuple[str, tuple[float, ...]]]:
    """Links of which no body can have the inertia: what to tell, and the moments (3,) of a box.

    A principal moment is not positive, exceeds the sum of the others, or is too large or too small
    for mass and collision shapes. The box [kg m^2, about x, y, z] has the link's mass and size.

    Raises:
        ConfigError: a moment is no finite number.

    """
    extent = max(2.0 * robot.reach, robot.height)
    total = sum_in_order(mass for mass, _ in model.inertials.values())
    impossible = {}
    for link, (mass, inertial) in model.inertials.items():
        element, corners = inertial.find("inertia"), _corners(model, link)
        if element is None:
            continue
        moments = (attribute_numbers(model.file, element, key, [0.0])[0] for key in _MOMENTS)
        xx, yy, zz, xy, xz, yz = moments
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        low, middle, high = np.linalg.eigvalsh(matrix).tolist()
        size, reach = np.full(3, (mass / _DENSITY) ** (1.0 / 3.0)), _WIDE_ROOM * extent
        if len(corners):
            centre = origin_frame(model.file, inertial.find("origin"))[:3, 3]
            size = np.ptp(corners, axis=0)
            reach = _ROOM * max(math.dist(corner, centre) for corner in corners)
        squares = size * size
        box = tuple((mass / 12.0 * (squares.sum() - squares)).tolist())
        closed = low > _MIN_MOMENT * min(box) and high <= _ROUNDING * (low + middle)
        if closed and high <= max(mass * reach**2, _NEGLIGIBLE * total * extent**2):
            continue
        have, would = (", ".join(f"{m:.2g}" for m in ms) for ms in ((low, middle, high), box))
        note = (
            f"{shown_path(model.file)}:{line_of(element)}: link {link!r}: no body of {mass:g} kg"
            f" and its size has the principal moments {have} kg m^2; driven with those of a box,"
            f" ixx, iyy, izz = {would}"
        )
        impossible[link] = note, box
    return impossible


def _corners(model: UrdfModel, link: str) -> Array:
    """Corners (n, 3) [m] of boxes around the shapes of a link; none if it has none, or a mesh."""
    corners, path = [np.zeros((0, 3))], model.file
    for collision in (c for c in model.collisions if c.link == link):
        shape, frame = collision.shape, origin_frame(path, collision.origin)
        if shape.tag == "mesh":
            return corners[0]
        radius = attribute_numbers(path, shape, "radius", [0.0])[0]
        length = attribute_numbers(path, shape, "length", [2.0 * radius])[0]
        size = attribute_numbers(path, shape, "size", [2.0 * radius, 2.0 * radius, length])
        ways = 0.5 * np.array(size) * list(combinations((-1.0, 1.0), repeat=3))
        corners.append(product(ways, frame[:3, :3].T) + frame[:3, 3])
    return np.concatenate(corners)
