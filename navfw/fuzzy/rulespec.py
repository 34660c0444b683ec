"""The schema of a rule base file: its keys and their values; sentences are parsed elsewhere."""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import Field, field_validator

from navfw.config.strict_model import StrictModel
from navfw.fuzzy.membership import HEDGES, MAX_SIZE
from navfw.fuzzy.rulebase import KEYWORDS, NAME_PATTERN

_MIN_WIDTH = 1e-6  # chosen
"""Least width of a range, in its unit: rounding would merge the samples of a narrower one."""


def check_name(name: str) -> None:
    """Check that ``name`` can be a variable or term in a rule; raise ValueError if it cannot."""
    if not re.fullmatch(NAME_PATTERN, name):
        raise ValueError(f"expected a name of letters, digits and '_', got {name!r}")
    if name.upper() in KEYWORDS or name in HEDGES:
        raise ValueError(f"expected a name, got {name!r}, which is a keyword or hedge of the rules")


class InputSpec(StrictModel):
    """An input variable: its range, and its terms."""

    range: tuple[float, float] = Field(description="lowest and highest value; inputs are clipped")
    unit: str = Field("1", description="unit of the range; 1 for none")
    description: str = Field("", description="what it measures")
    points: int = Field(101, ge=2, le=10_001, description="even samples over the range")
    terms: dict[str, dict[str, list[float]]] = Field(
        min_length=1, description="term name: {shape: [parameters]}"
    )

    @field_validator("range")
    @classmethod
    def _check_range(cls, value: tuple[float, float]) -> tuple[float, float]:
        low, high = value
        if not high - low >= _MIN_WIDTH:
            raise ValueError(f"expected [low, high] with high > low, got [{low:g}, {high:g}]")
        if max(abs(low), abs(high)) > MAX_SIZE * min(1.0, high - low):
            raise ValueError(
                f"expected bounds of at most {MAX_SIZE:g} and {MAX_SIZE:g} times the width, "
                f"got [{low:g}, {high:g}]"
            )
        return value


class OutputSpec(InputSpec):
    """An output variable; ``default`` is its value if no rule fires."""

    default: float | None = Field(
        None,
        description=(
            "value where no rule fires; an output with a default is not checked for coverage"
        ),
    )


class RuleBaseSpec(StrictModel):
    """The schema of a rule base file: one inference system."""

    name: str = Field(min_length=1, description="name of the inference system")
    description: str = Field("", description="what it infers, and where it comes from")
    and_: Literal["min", "prod"] = Field("min", alias="and", description="conjunction")
    implication: Literal["min", "prod"] = Field(
        "min",
        description=(
            "how the firing strength limits a conclusion: min clips it (Mamdani), prod scales it"
        ),
    )
    defuzzify: Literal["centroid"] = Field(
        "centroid", description="how the union of the conclusions becomes one number"
    )
    inputs: dict[str, InputSpec] = Field(min_length=1, description="input variables by name")
    outputs: dict[str, OutputSpec] = Field(min_length=1, description="output variables by name")
    rules: list[Annotated[str, Field(min_length=1)]] = Field(
        min_length=1, description="sentences IF ... THEN ..."
    )
