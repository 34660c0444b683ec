"""Parameters of the detection, tracking and prediction of moving objects."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from navfw.movers.conflict_prediction import ConflictParams
from navfw.movers.tracking import TrackerParams


class MoverParams(BaseModel):
    """Whether moving objects are detected, and how they are tracked and predicted."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    detect: Annotated[bool, Field(description="detect moving objects")] = False
    tracking: TrackerParams = TrackerParams()
    conflicts: ConflictParams = ConflictParams()
