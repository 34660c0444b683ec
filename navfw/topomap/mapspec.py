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

    x: Annotated[Coordinate, Field(description="in the map frame [m]")]
    y: Annotated[Coordinate, Field(description="in the map frame [m]")]
    kind: Annotated[PlaceKind, Field(description="kind of place")] = "room"


class EdgeSpec(StrictModel):
    """The keys of a passage; its numbers are validated together with its places."""

    from_: Annotated[str, Field(alias="from", description="a place")]
    to: Annotated[str, Field(description="another place")]
    length: Annotated[
        float | None, Field(description="[m]; the straight distance when left out")
    ] = None
    width: Annotated[
        float | None, Field(description="free width at the narrowest point [m]; unlimited if none")
    ] = None
    danger: Annotated[
        Share | None, Field(description="0 to 1; 1 at danger places, else 0, when left out")
    ] = None
    doorness: Annotated[
        Share | None, Field(description="0 to 1; 1 at door places, else 0, when left out")
    ] = None
    uncertainty: Annotated[Share, Field(description="0 to 1; 1: may be open or closed")] = 0.0


class MapLandmarkSpec(StrictModel):
    """The keys of a landmark: a flat upright square."""

    kind: Annotated[
        str,
        Field(pattern=r"^[A-Za-z_]\w*$", description="aruco, or the name of a plugin"),
    ] = "aruco"
    id: Annotated[int, Field(ge=0, le=1_000_000, description="unique among those of its kind")]
    x: Annotated[Coordinate, Field(description="of the centre, in the map frame [m]")]
    y: Annotated[Coordinate, Field(description="of the centre, in the map frame [m]")]
    z: Annotated[float, Field(ge=0.0, le=100.0, description="centre above the floor [m]")] = 0.5
    yaw: Annotated[
        float,
        Field(
            ge=-6.3, le=6.3, description="direction of its normal, counter-clockwise from x [rad]"
        ),
    ]
    size: Annotated[float, Field(gt=0.0, le=10.0, description="length of its side [m]")] = 0.25


class MapSpec(StrictModel):
    """The keys of a map file."""

    name: Annotated[str, Field(min_length=1, description="of the map")]
    floor_plan: Annotated[
        str | None,
        Field(
            min_length=1,
            max_length=1000,
            description="yaml file of a floor plan, as of ROS' map_server, relative to this file",
        ),
    ] = None
    places: Annotated[dict[str, PlaceSpec], Field(description="by name")]
    edges: list[EdgeSpec] = Field(default_factory=list, description="passages between places")
    landmarks: dict[str, MapLandmarkSpec] = Field(
        default_factory=dict, description="squares that a camera can recognise, by name"
    )
