"""The base class of the models that data files are validated against."""

from pydantic import BaseModel, ConfigDict


class StrictModel(BaseModel):
    """A frozen model that accepts neither unknown keys nor infinite or NaN numbers."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
