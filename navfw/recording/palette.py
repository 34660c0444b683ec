"""Define the colours of all pictures, reports and videos of runs and maps.

>>> behavior_color("avoid"), behavior_color("go_to_xy")
('#E69F00', '#0072B2')
"""

from __future__ import annotations

import colorsys
import zlib

from navfw.signals import Label

WALL, FURNITURE, EDGE, FLOOR = "#4A4A4A", "#D9D2C5", "#8C8577", "#FBFAF7"
"""Walls, furniture and its outline, and the floor in top view."""
START, GOAL, CONTACT, ESTIMATE = "#2E7D32", "#B0004E", "#D00000", "#303030"
LOCAL_GOAL = "#F0027F"
MOVING = "#00838F"
"""Moving obstacles and their paths."""
FREE, OCCUPIED = "#9BD3A5", "#4A2377"
"""Free and occupied cells of the local map."""
FLOW = "#FFBF1A"
CELLS = {
    Label.FLOOR: "#33A64D",
    Label.OBSTACLE: "#D62629",
    Label.DROP: "#9933B3",
    Label.ABOVE: "#3373CC",
    Label.UNKNOWN: "#999999",
}
"""Flow cells, by their label."""

# Okabe and Ito's colours first, distinct for colour-blind readers
_SHIPPED = {
    "go_to_xy": "#0072B2",
    "avoid": "#E69F00",
    "follow_wall": "#009E73",
    "emergency": "#D55E00",
    "centre_corridor": "#56B4E9",
    "traverse_door": "#CC79A7",
    "give_way": "#B8A800",
    "peek": "#6A51A3",
    "escape": "#8C510A",
    "explore": "#1B4F4A",
    "search": "#7F1D4E",
    "look_again": "#A3B18A",
    "look_around": "#3D405B",
    "keep_clear": "#2A9D8F",
    "avoid_quadrants": "#C08497",
    "follow_wall_quadrants": "#5F7A3A",
    "emergency_quadrants": "#A44A3F",
    "none": "#9A9A9A",
    "": "#9A9A9A",
}
_LIGHTNESS = (0.3, 0.42, 0.54)
_SATURATION = 0.55


def behavior_color(name: str) -> str:
    """Return the colour ``#RRGGBB`` of a behaviour; "none" and "" mean that none leads."""
    if name in _SHIPPED:
        return _SHIPPED[name]
    level, hue = divmod(zlib.crc32(name.encode()), 360)
    lightness = _LIGHTNESS[level % len(_LIGHTNESS)]
    parts = colorsys.hls_to_rgb(hue / 360.0, lightness, _SATURATION)
    return "#" + "".join(f"{round(255.0 * part):02X}" for part in parts)


def camera_key() -> list[tuple[str, str]]:
    """Return names and colours of the marks drawn over the camera's images."""
    names = {Label.ABOVE: "above the robot"}
    cells = [(names.get(label, label.name.lower()), color) for label, color in CELLS.items()]
    return [("flow, turning removed", FLOW), *cells]


def rgb(color: str) -> tuple[int, int, int]:
    """Convert a colour ``#RRGGBB`` to red, green and blue (0 to 255).

    >>> rgb(WALL)
    (74, 74, 74)
    """
    red, green, blue = bytes.fromhex(color.removeprefix("#"))
    return red, green, blue


def bgr(color: str) -> tuple[int, int, int]:
    """Convert a colour ``#RRGGBB`` to blue, green and red (0 to 255), OpenCV's order."""
    red, green, blue = rgb(color)
    return blue, green, red
