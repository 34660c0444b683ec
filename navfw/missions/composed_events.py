"""Shipped mission events that are composed of others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar

from pydantic import Field

from navfw.interfaces import MissionEvent


class Blackout(MissionEvent):
    """A power failure: the lamps dim, and all open doors of the world close."""

    name: ClassVar[str] = "blackout"

    class Params(MissionEvent.Params):
        """The emergency lighting."""

        light: Annotated[float, Field(ge=0.0, le=1.0, description="share of light left")] = 0.3

    params: Params

    def actions(self, world: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
        """Dim the lamps, and close every open door."""
        doors = [door["name"] for door in world["doors"] if door["state"] == "open"]
        return [
            {"light": {"share": self.params.light}},
            *({"door": {"name": name, "state": "closed"}} for name in doors),
        ]
