"""How likely the places of a map make what OFFIS says of the way ahead (METHOD 4.4).

A table has for each kind of place how often OFFIS names each situation there. The one that ships
has been learnt on drives whose truth was known (``navfw learn situations``); so have others.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from navfw.config.document import YamlDocument, load_yaml
from navfw.config.yamlfile import validate
from navfw.errors import ConfigError, UnknownNameError
from navfw.signals import Array, Percept
from navfw.topomap import PLACE_KINDS, TopoMap

__all__ = [
    "FLOOR",
    "LEARNT",
    "NO_TABLE",
    "SITUATIONS",
    "SituationTable",
    "heard",
    "learn_table",
    "load_table",
    "situation_table",
    "weights_of",
]

FLOOR = 0.05
"""The least likelihood: OFFIS is a weak witness and never vetoes."""

SITUATIONS = (
    "door",
    "corridor",
    "corner",
    "wall",
    "left wall",
    "right wall",
    "left slope wall",
    "right slope wall",
)
"""OFFIS' elementary situations; what it calls "unknown" says nothing."""

SMOOTHING = 20.0
"""Looks at the mean of all kinds that are added to those at each kind."""

LEARNT, NO_TABLE = "learnt", "none"
"""Names of the table that ships, and of no table at all."""

_MIRRORED = (("left wall", "right wall"), ("left slope wall", "right slope wall"))
_SHIPPED = Path(__file__).with_name("situations.yaml")


class TableSpec(BaseModel):
    """A table as its file has it."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    description: Annotated[str, Field(description="where it comes from")] = ""
    looks: Annotated[
        Mapping[str, Annotated[float, Field(ge=0.0)]],
        Field(description="how many looks were taken at places of each kind"),
    ] = Field(default_factory=dict)
    seen_at: Annotated[
        Mapping[str, Mapping[str, Annotated[float, Field(ge=0.0, le=1.0)]]],
        Field(min_length=1, description="kind of place: {situation: probability}"),
    ]


@dataclass(frozen=True)
class SituationTable:
    """The probability of each of SITUATIONS (in that order) at places of each kind.

    ``looks`` says from how many looks it was learnt. A kind without a row is like the mean of all.
    """

    seen_at: Mapping[str, Array]
    looks: Mapping[str, float]

    def likelihoods(self, topo_map: TopoMap, situations: Mapping[str, float]) -> Array | None:
        """(places,) likelihood of the ``situations`` (degrees) at each place, in [FLOOR, 1].

        None where they say nothing.
        """
        shares, sure = weights_of(situations)
        if sure <= 0.0:
            return None
        kinds = {place.kind for place in topo_map.places.values()}
        mean = np.mean(list(self.seen_at.values()), axis=0)
        of_kind = {kind: float(shares @ self.seen_at.get(kind, mean)) for kind in kinds}
        best = max(of_kind.values())
        if best <= 0.0:
            return None
        scaled = {kind: 1.0 - sure * (1.0 - value / best) for kind, value in of_kind.items()}
        return np.array([max(FLOOR, scaled[place.kind]) for place in topo_map.places.values()])

    def text(self, description: str) -> str:
        """The content of a file with this table."""
        looks = ", ".join(f"{kind}: {count:.0f}" for kind, count in self.looks.items())
        lines = [f"description: {json.dumps(description)}", f"looks: {{{looks}}}", "seen_at:"]
        for kind, row in self.seen_at.items():
            shares = [f"{name}: {p:.4f}" for name, p in zip(SITUATIONS, row, strict=True)]
            lines.append(f"  {kind}: {{{', '.join(shares)}}}")
        return "\n".join(lines) + "\n"


def heard(percept: Percept | None) -> Mapping[str, float] | None:
    """The degrees of situations in a percept that says something, else None."""
    return percept.situations if percept is not None and percept.sees_depth else None


def weights_of(situations: Mapping[str, float]) -> tuple[Array, float]:
    """(8,) shares of SITUATIONS in what OFFIS says, and how sure that is, in [0, 1]."""
    degrees = np.array([max(situations.get(name, 0.0), 0.0) for name in SITUATIONS])
    total = float(degrees.sum())
    if total < 1e-6:
        return degrees, 0.0
    return degrees / total, min(1.0, total)


def learn_table(looks: Iterable[tuple[str, Mapping[str, float]]]) -> SituationTable:
    """The table of ``looks``: each the kind of the place it was taken at, and OFFIS' degrees.

    Left and right are counted alike; kinds that were seldom seen are drawn to the mean of all.

    Raises:
        ValueError: no look says anything.

    """
    sums: dict[str, Array] = {kind: np.zeros(len(SITUATIONS)) for kind in PLACE_KINDS}
    for kind, situations in looks:
        shares, sure = weights_of(situations)
        sums[kind] += sure * shares
    for row in sums.values():
        for pair in _MIRRORED:
            both = [SITUATIONS.index(name) for name in pair]
            row[both] = row[both].mean()
    # the mean of kinds, not of looks: however often places of a kind are passed
    mean = np.sum([row / (row.sum() + SMOOTHING) for row in sums.values()], axis=0)
    if mean.sum() <= 0.0:
        raise ValueError("OFFIS has said nothing")
    mean /= mean.sum()
    smooth = {kind: row + SMOOTHING * mean for kind, row in sums.items()}
    return SituationTable(
        {kind: row / row.sum() for kind, row in smooth.items()},
        {kind: float(row.sum()) for kind, row in sums.items()},
    )


def situation_table(name: str) -> SituationTable | None:
    """The table of that name: the one that ships, none, or that of a file.

    Raises:
        ConfigError: there is no such file, or it is no table.

    """
    if name == NO_TABLE:
        return None
    return _shipped() if name == LEARNT else load_table(name)


@lru_cache(maxsize=1)
def _shipped() -> SituationTable:
    return load_table(_SHIPPED)


def load_table(file: str | Path) -> SituationTable:
    """The table in a file.

    Raises:
        ConfigError: it breaks the schema, or its probabilities do not add up to 1.
        UnknownNameError: it names a kind of place or a situation that there is not.

    """
    document = load_yaml(file)
    spec = validate(document, TableSpec)
    rows = {}
    for kind, given in spec.seen_at.items():
        _known(document, "kind of place", kind, PLACE_KINDS, ("seen_at", kind))
        for name in given:
            _known(document, "situation", name, SITUATIONS, ("seen_at", kind, name))
        row = np.array([given.get(name, 0.0) for name in SITUATIONS])
        if abs(row.sum() - 1.0) > 0.01:
            raise ConfigError(
                f"expected probabilities that add up to 1, got {row.sum():.3g}",
                file=document.file,
                line=document.line_of(("seen_at", kind)),
                key=f"seen_at.{kind}",
            )
        rows[kind] = row / row.sum()
    return SituationTable(rows, dict(spec.looks))


def _known(
    document: YamlDocument, what: str, name: str, known: Iterable[str], path: tuple[str, ...]
) -> None:
    if name not in list(known):
        line, key = document.line_of(path), ".".join(path)
        raise UnknownNameError(what, name, known, file=document.file, line=line, key=key)
