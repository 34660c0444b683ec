"""The keys of a floor plan's yaml file, that of ROS' map_server, as a pydantic model."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, ConfigDict, Field, model_validator

from navfw.config.strict_model import StrictModel

PlanMode = Literal["trinary", "scale", "raw"]

Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Angle = Annotated[float, Field(ge=-100.0, le=100.0)]

_TRUTH = {"y": 1, "yes": 1, "true": 1, "on": 1, "n": 0, "no": 0, "false": 0, "off": 0}
"""The words that yaml-cpp, and so map_server, reads as truth values."""


def _truth(value: Any) -> Any:
    """A truth value as a number: Nav2 reads ``negate`` as either."""
    if isinstance(value, bool):
        return int(value)
    return _TRUTH.get(value.lower(), value) if isinstance(value, str) else value


class RosMapSpec(StrictModel):
    """The keys that are used; map_server ignores others, such as ``map_type``, and so does navfw.

    Mode ``trinary`` has free, occupied and unknown cells. In ``scale`` the cells between the
    thresholds, and transparent ones, are unknown. In ``raw`` the grey levels 0 to 100 are per cent
    of occupancy, and all others unknown.
    """

    model_config = ConfigDict(extra="ignore")

    image: Annotated[
        str, Field(min_length=1, max_length=1000, description="PGM, PNG or BMP file, beside this")
    ]
    resolution: Annotated[float, Field(ge=0.001, le=10.0, description="edge of a pixel [m]")]
    origin: Annotated[
        tuple[Coordinate, Coordinate, Angle],
        Field(description="x, y [m], yaw [rad] of the image's lower left corner in the map frame"),
    ]
    mode: Annotated[PlanMode, Field(description="meaning of the grey levels")] = "trinary"
    negate: Annotated[
        Literal[0, 1],
        BeforeValidator(_truth),
        Field(description="1, or true: black is free and white is occupied; not in mode raw"),
    ] = 0
    occupied_thresh: Annotated[
        float, Field(ge=0.0, le=1.0, description="occupied above this occupancy")
    ] = 0.65
    free_thresh: Annotated[
        float, Field(ge=0.0, le=1.0, description="free below this occupancy")
    ] = 0.196

    @model_validator(mode="after")
    def _thresholds_in_order(self) -> RosMapSpec:
        if self.free_thresh >= self.occupied_thresh:
            raise ValueError(
                f"free_thresh {self.free_thresh:g} must be below occupied_thresh "
                f"{self.occupied_thresh:g}"
            )
        return self
