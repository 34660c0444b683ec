"""The keys of a map file, as pydantic models, and its limits: what ``mapfile`` reads and writes."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from navfw.config.strict_model import StrictModel
from navfw.topomap.elements import PlaceKind

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]


class PlaceSpec(StrictModel):
    """The keys of a place."""

    x: Coordinate = Field(description="in the map frame [m]")
    y: Coordinate = Field(description="in the map frame [m]")
    kind: PlaceKind = Field("room", description="kind of place")


class EdgeSpec(StrictModel):
    """The keys of a passage; its numbers are validated together with its places."""

    from_: str = Field(alias="from", description="a place")
    to: str = Field(description="another place")
    length: float | None = Field(None, description="[m]; the straight distance when left out")
    width: float | None = Field(
        None, description="free width at the narrowest point [m]; unlimited if none"
    )
    danger: Share | None = Field(
        None, description="0 to 1; 1 at danger places, else 0, when left out"
    )
    doorness: Share | None = Field(
        None, description="0 to 1; 1 at door places, else 0, when left out"
    )
    uncertainty: Share = Field(0.0, description="0 to 1; 1: may be open or closed")


class MapLandmarkSpec(StrictModel):
    """The keys of a landmark: a flat upright square."""

    kind: str = Field(
        "aruco", pattern=r"^[A-Za-z_]\w*$", description="aruco, or the name of a plugin"
    )
    id: int = Field(ge=0, le=1_000_000, description="unique among those of its kind")
    x: Coordinate = Field(description="of the centre, in the map frame [m]")
    y: Coordinate = Field(description="of the centre, in the map frame [m]")
    z: float = Field(0.5, ge=0.0, le=100.0, description="centre above the floor [m]")
    yaw: float = Field(
        ge=-6.3, le=6.3, description="direction of its normal, counter-clockwise from x [rad]"
    )
    size: float = Field(0.25, gt=0.0, le=10.0, description="length of its side [m]")


class MapSpec(StrictModel):
    """The keys of a map file."""

    name: str = Field(min_length=1, description="of the map")
    floor_plan: str | None = Field(
        None,
        min_length=1,
        max_length=1000,
        description="yaml file of a floor plan, as of ROS' map_server, relative to this file",
    )
    places: dict[str, PlaceSpec] = Field(description="by name")
    edges: list[EdgeSpec] = Field(default_factory=list, description="passages between places")
    landmarks: dict[str, MapLandmarkSpec] = Field(
        default_factory=dict, description="squares that a camera can recognise, by name"
    )
