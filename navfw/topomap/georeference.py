"""Places in degrees, in Web Mercator, or far from an origin: in metres about one nearby."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from navfw.assumption import Assumption
from navfw.errors import MapError

_RADIUS, _ECCENTRICITY = 6_378_137.0, 0.00669437999014  # defined
"""Of the ellipsoid WGS 84: its larger radius [m], and the square of its eccentricity."""
_SPAN = 0.5  # chosen
"""Extent [degrees or m] of all places: no map of degrees is larger, and none of metres smaller."""
_FAR = 1e5  # chosen
"""Distance [m] from the origin beyond which another origin is taken: maps go to 1e6."""

_GEOGRAPHIC = re.compile(r"CRS84|\b(?:4326|4258|4269|4979)\b|longlat|GEOG(?:CS|CRS)", re.IGNORECASE)
_FEET = re.compile(r"units=(?:us-)?ft|UNIT\[\"[^\"]*foot|\bftUS\b", re.IGNORECASE)
_MERCATOR = re.compile(r"\b(?:3857|900913|102100)\b|pseudo-mercator", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class LocalFrame:
    """Converts coordinates of a file to metres: (x - x0) * kx, (y - y0) * ky."""

    x0: float = 0.0
    y0: float = 0.0
    kx: float = 1.0
    ky: float = 1.0
    assumed: tuple[Assumption, ...] = ()

    def __call__(self, x: float, y: float) -> tuple[float, float]:
        """Return the position [m] of a point of the file."""
        return (x - self.x0) * self.kx, (y - self.y0) * self.ky


def local_frame(
    points: Sequence[tuple[float, float]], crs: str = "", *, metric: bool = False
) -> LocalFrame:
    """The frame of the ``points`` of a file whose ``crs`` is said in any form, or ""; in metres.

    Degrees of longitude and latitude are recognised by ``crs``, and by their size unless they are
    known to be ``metric``.

    Raises:
        MapError: ``crs`` says feet, or degrees that cannot be those of a map.

    """
    if not points or not all(math.isfinite(value) for point in points for value in point):
        return LocalFrame()
    (x0, x1), (y0, y1) = ((min(values), max(values)) for values in zip(*points, strict=True))
    span, middle = max(x1 - x0, y1 - y0), 0.5 * (y0 + y1)
    possible = max(-x0, x1) <= 180.0 and max(-y0, y1) <= 90.0 and span < _SPAN
    geographic = bool(_GEOGRAPHIC.search(crs)) and not re.search("PROJ(?:CS|CRS)", crs)
    if metric and not geographic:
        return LocalFrame()
    if _FEET.search(crs):
        raise MapError("the crs is in feet: convert the places to metres")
    if geographic and not possible:
        raise MapError(
            "the crs says degrees of longitude and latitude, in which the places would span "
            f"{span:g} degrees, not less than {_SPAN:g}; if they are metres, remove the crs"
        )
    if geographic or (possible and span > 0.0):
        # metres per degree of longitude and latitude, by the ellipsoid's radii of curvature
        sine = math.sin(math.radians(middle))
        normal = _RADIUS / math.sqrt(1.0 - _ECCENTRICITY * sine**2)
        meridian = normal * (1.0 - _ECCENTRICITY) / (1.0 - _ECCENTRICITY * sine**2)
        kx, ky = math.radians(normal * math.cos(math.radians(middle))), math.radians(meridian)
        taken = f"metres east and north of longitude {x0:.7g}, latitude {y0:.7g}"
        reason = "its crs says degrees" if geographic else "the numbers are degrees by their size"
    elif max(-x0, x1, -y0, y1) > _FAR:
        x0, y0 = math.floor(x0), math.floor(y0)
        kx = ky = 1.0 / math.cosh(middle / _RADIUS) if _MERCATOR.search(crs) else 1.0
        taken = f"metres from x {x0:.0f}, y {y0:.0f} of the file"
        stretched = f"EPSG:3857 stretches lengths there by {1.0 / kx:.3f}"
        known = "its crs counts as metres and the" if crs.strip(' "') else "the"
        reason = f"{known} numbers are far from its origin" if kx == 1.0 else stretched
    else:
        return LocalFrame()
    return LocalFrame(x0, y0, kx, ky, (Assumption("coordinates", taken, reason),))
