"""The schema of a rule base file: what its keys are, before its sentences are read."""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from navfw.fuzzy.grammar import KEYWORDS, NAME_PATTERN
from navfw.fuzzy.membership import HEDGES

__all__ = ["InputSpec", "OutputSpec", "RuleBaseSpec"]

# A universe below 1e-6 wide or beyond 1e12 would lose its samples to rounding.
_MIN_WIDTH = 1e-6
_MAX_SIZE = 1e12


class _Spec(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def _check_name(name: str) -> str:
    if not re.fullmatch(NAME_PATTERN, name):
        raise ValueError(f"expected a name of letters, digits and '_', got {name!r}")
    if name.upper() in KEYWORDS or name in HEDGES:
        raise ValueError(f"expected a name, got {name!r}, which has a meaning in rules")
    return name


class InputSpec(_Spec):
    """An input variable: its range, and the terms that rules may use of it."""

    range: tuple[float, float] = Field(description="lowest and highest value; inputs are clipped")
    unit: str = Field("1", description="unit of the range; 1 for none")
    description: str = Field("", description="what it measures")
    points: int = Field(101, ge=3, le=10_001, description="even samples over the range")
    terms: dict[str, dict[str, list[float]]] = Field(
        min_length=1, description="term name: {shape: [parameters]}"
    )

    @field_validator("range")
    @classmethod
    def _check_range(cls, value: tuple[float, float]) -> tuple[float, float]:
        low, high = value
        if not high - low >= _MIN_WIDTH:
            raise ValueError(f"expected [low, high] with high > low, got [{low:g}, {high:g}]")
        if max(abs(low), abs(high)) > _MAX_SIZE * min(1.0, high - low):
            raise ValueError(f"expected a range of ordinary size, got [{low:g}, {high:g}]")
        return value


class OutputSpec(InputSpec):
    """An output variable; ``default`` says what it is where no rule fires."""

    default: float | None = Field(
        None,
        description=(
            "value where no rule fires; giving it switches the coverage check of this output off"
        ),
    )


class RuleBaseSpec(_Spec):
    """One inference system as its file says it."""

    name: str = Field(min_length=1, description="name of the inference system")
    description: str = Field("", description="what it infers, and where it comes from")
    and_: Literal["min", "prod"] = Field("min", alias="and", description="conjunction")
    implication: Literal["min", "prod"] = Field(
        "min", description="how a rule cuts its conclusion: min clips it (Mamdani), prod scales it"
    )
    defuzzify: Literal["centroid", "bisector", "mom", "som", "lom"] = Field(
        "centroid", description="how the joined conclusions become one number"
    )
    inputs: dict[str, InputSpec] = Field(min_length=1, description="input variables by name")
    outputs: dict[str, OutputSpec] = Field(min_length=1, description="output variables by name")
    rules: list[Annotated[str, Field(min_length=1)]] = Field(
        min_length=1, description="sentences IF ... THEN ..."
    )


check_name = _check_name
