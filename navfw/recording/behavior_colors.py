"""The colour of each behaviour, the same in all pictures and reports of runs.

>>> behavior_colors(["avoid", "go_to_xy"])
{'avoid': '#E69F00', 'go_to_xy': '#0072B2'}
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable

__all__ = ["behavior_colors"]

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
    "none": "#9A9A9A",
    "": "#9A9A9A",
}
_OTHERS = ("#1B4F4A", "#7F1D4E", "#A3B18A", "#3D405B", "#C08497", "#5F7A3A", "#264DE4", "#A44A3F")


def behavior_colors(leaders: Iterable[str]) -> dict[str, str]:
    """The colour of each leader by its name; "none" and "" mean that none leads.

    Behaviours that navfw does not ship get theirs by their name; of two that would get the same,
    the later takes the next.
    """
    colors: dict[str, str] = {}
    for name in dict.fromkeys(leaders):
        first = zlib.crc32(name.encode())
        ring = [_OTHERS[(first + step) % len(_OTHERS)] for step in range(len(_OTHERS))]
        free = [color for color in ring if color not in colors.values()]
        colors[name] = _SHIPPED.get(name, (free or ring)[0])
    return colors
