"""Suite files: the worlds, missions and families of generated worlds that a suite evaluates.

::

    description: Rooms with furniture, easy to hard.
    entries:
      - family: rooms
        difficulty: [0.2, 1.0]        # a number, or a range that the seed draws from
      - world: office                 # a name or a path
        missions: [lobby-to-lab]      # default: all of the world
        stack: default
        set: {avoid.spare: 0.1, mission.timeout: 120}
      - name: black for 6 s           # with events, and the behaviour that passes
        family: rooms
        events: [{at: 8, lasting: 6, camera: black}]
        expect: arrival
      - {name: map it, family: rooms, explore: {limit: 600}}   # instead of a mission
      - {world: office, taught: {source: tour}}   # on a map that is made first
      - worlds: ../imported           # a folder of worlds, each with its missions; see --worlds
    variants:                         # every run is made with each variant
      default: {}
      paper: {stack: paper}
      no-memory: {set: {local_map.memory: false}}
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from navfw.config.document import YamlDocument, load_yaml
from navfw.config.installed_packages import is_installed
from navfw.config.lookup import find
from navfw.config.strict_model import StrictModel
from navfw.config.yaml_text import KeyPath
from navfw.config.yamlfile import validate
from navfw.errors import ConfigError, InputError
from navfw.missions.missionspec import EventSpec, ExploreSpec
from navfw.sim.worldspec import MAX_CONTRAST, Look

MAX_SEED = 2**32
"""Seeds must be below this."""

_MAX_SEEDS = 100_000
"""Largest number of seeds of a suite; it catches mistyped ranges."""

Expect = Literal["arrival", "stop"]
"""When a run passes: it reaches its goals, or it stops for a known reason without collision."""

Name = Annotated[str, Field(min_length=1, max_length=60, pattern=r"^[\w][\w .+-]*$")]
Contrast = Annotated[float, Field(ge=0.0, le=MAX_CONTRAST)]
Difficulty = Annotated[float, Field(ge=0.0, le=1.0)]


def _ascending(interval: tuple[float, float]) -> tuple[float, float]:
    if interval[0] > interval[1]:
        raise ValueError(f"must ascend: {interval[0]:g} is above {interval[1]:g}")
    return interval


class TaughtSpec(StrictModel):
    """Missions between random places of a map that is made first, from a tour or exploration."""

    source: Literal["tour", "explore"] = Field(
        "tour", description="what shows the world: a recorded tour of its map's places, or explore"
    )
    seeds: int = Field(
        20, ge=1, le=10_000, description="seeds in turn that share a map, and its world"
    )
    start: Literal["known", "unknown"] = Field(
        "known", description="whether the stack gets the start pose"
    )
    moved: float = Field(
        0.0, ge=0.0, le=1.0, description="share of the furniture that is moved afterwards"
    )


class EntrySpec(StrictModel):
    """An entry of a suite: a world, a folder of worlds, or a family of generated worlds."""

    name: Name | None = Field(None, description="name in the table [default: world or family]")
    world: str | None = Field(None, description="a world's name or file")
    missions: tuple[str, ...] | None = Field(
        None, min_length=1, description="missions of the world [default: all]"
    )
    pairs: bool = Field(
        False, description="from one place of the missions' map to another; the seed draws which"
    )
    explore: ExploreSpec | None = Field(
        None, description="explore each world, from the start of its first mission: {limit: 600}"
    )
    taught: TaughtSpec | None = Field(
        None, description="between places of a map that is made before: {source: tour}"
    )
    worlds: str | None = Field(None, description="a folder of worlds; relative to the suite file")
    family: str | None = Field(None, description="a family of generated worlds")
    difficulty: (
        Difficulty | Annotated[tuple[Difficulty, Difficulty], AfterValidator(_ascending)] | None
    ) = Field(None, description="of the family, 0 to 1; or [from, to], drawn by the seed")
    contrast: Contrast | None = Field(
        None, description="of every surface of the family [grey levels; default: each its own]"
    )
    look: Look | None = Field(
        None, description="of the family's surfaces, instead of noise with high contrast"
    )
    stack: str | None = Field(None, description="a stack's name or file [default: each mission's]")
    robot: str | None = Field(None, description="a robot's name or file [default: each mission's]")
    set: Mapping[str, Any] = Field(
        default_factory=dict, description="changed values, as with --set: {avoid.spare: 0.1}"
    )
    events: tuple[EventSpec, ...] | None = Field(
        None, max_length=1000, description="replace the missions' events"
    )
    expect: Expect | None = Field(
        None, description="what passes: 90 % of the runs arrive, or all stop without collision"
    )

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        sources = [key for key in ("world", "worlds", "family") if getattr(self, key) is not None]
        if len(sources) != 1:
            got = " and ".join(sources) or "none of them"
            raise ValueError(f"expected exactly one of world, worlds, family; got {got}")
        if self.family is None and self.difficulty is not None:
            raise ValueError("difficulty is for a family of generated worlds")
        if self.family is None and self.contrast is not None:
            raise ValueError("contrast is for a family of generated worlds")
        if self.look is not None and (self.family is None or self.contrast is not None):
            raise ValueError("look is for a family of generated worlds without contrast")
        if self.family is not None and self.missions is not None:
            raise ValueError("a generated world has one mission of its own: leave out missions")
        for key in ("explore", "taught"):
            if getattr(self, key) is not None and (self.missions is not None or self.pairs):
                raise ValueError(f"{key} takes the place of missions: leave out missions and pairs")
        if self.explore is not None and self.taught is not None:
            raise ValueError("expected explore, or taught: {source: explore}; got both")
        if self.family is not None and self.pairs:
            raise ValueError("pairs are for worlds that have missions")
        return self

    @property
    def title(self) -> str:
        """The entry's name in the table."""
        if self.name is not None:
            return self.name
        source = self.family or self.world or self.worlds or ""
        path = Path(source)
        return path.parent.name if path.name == "world.yaml" else path.stem or source

    @property
    def overrides(self) -> tuple[str, ...]:
        """Robot, events and ``set`` as arguments of ``--set``, with values as JSON (also YAML)."""
        changes = _changes(self)
        if self.events is not None:
            events = [event.model_dump(mode="json", exclude_unset=True) for event in self.events]
            changes["mission.events"] = events
        return _options(changes)


class VariantSpec(StrictModel):
    """A variant: changes to the configuration with which every run of a suite is repeated."""

    stack: str | None = Field(None, description="a stack's name or file; replaces the entries'")
    robot: str | None = Field(None, description="a robot's name or file; replaces the entries'")
    set: Mapping[str, Any] = Field(
        default_factory=dict, description="changed values, applied after those of the entries"
    )
    package: str | None = Field(
        None, description="an installed package that it needs; without, it is skipped"
    )
    given_map: bool = Field(
        False, description="entries with taught: the same missions, on the world's own map"
    )

    @property
    def overrides(self) -> tuple[str, ...]:
        """Robot and ``set`` as arguments of ``--set``."""
        return _options(_changes(self))


def lacking_packages(variants: Mapping[str, VariantSpec]) -> dict[str, str]:
    """Return the variants whose package is not installed: the reason, by name of the variant."""
    return {
        name: f"needs {variant.package}, which is not installed"
        for name, variant in variants.items()
        if variant.package is not None and not is_installed(variant.package)
    }


def _changes(spec: EntrySpec | VariantSpec) -> dict[str, Any]:
    """Changed values by path: first the robot, then those of ``set``, which may change it."""
    return ({} if spec.robot is None else {"robot": spec.robot}) | dict(spec.set)


def _options(changes: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(f"{key}={json.dumps(value)}" for key, value in changes.items())


class SuiteSpec(StrictModel):
    """The schema of a suite file."""

    description: str = Field("", description="one line for people")
    entries: tuple[EntrySpec, ...] = Field(min_length=1, max_length=1000)
    variants: Mapping[Name, VariantSpec | None] = Field(
        default_factory=dict, max_length=100, description="by name: every run is made with each"
    )


@dataclass(frozen=True)
class Suite:
    """A loaded suite file with the positions of its keys."""

    name: str
    file: Path
    document: YamlDocument
    spec: SuiteSpec

    @property
    def variants(self) -> dict[str, VariantSpec]:
        """The variants by name; one without changes, named "", if the suite has none."""
        variants = {name: spec or VariantSpec() for name, spec in self.spec.variants.items()}
        return variants or {"": VariantSpec()}

    def locating(
        self, index: int, key: str = "", variant: str = ""
    ) -> AbstractContextManager[None]:
        """Context in which errors get the file, line and key of this entry or variant."""
        path: KeyPath = ("variants", variant) if variant else ("entries", index)
        return self.document.locating((*path, key) if key else path)


def load_suite(name: str | Path) -> Suite:
    """Load a suite by name or file; its worlds are not checked until ``plan_runs``.

    Raises:
        UnknownNameError: there is no suite of that name.
        ConfigError: the file breaks the schema, or two entries have the same name.

    """
    file = find("suite", name)
    document = load_yaml(file)
    spec = validate(document, SuiteSpec)
    suite = Suite(file.stem, file, document, spec)
    titles: dict[str, int] = {}
    for index, entry in enumerate(spec.entries):
        if entry.title in titles:
            what = f"a second entry called {entry.title!r}; give one of them another name"
            with suite.locating(index):
                raise ConfigError(what)
        titles[entry.title] = index
    return suite


def parse_seeds(text: str) -> range:
    """Parse ``A:B`` as the seeds from A up to, but not including, B.

    >>> parse_seeds("1000:1200")
    range(1000, 1200)

    Raises:
        InputError: ``text`` is malformed, or its range is empty or too large.

    """
    first, colon, last = text.partition(":")
    both = [number.strip() for number in (first, last)]
    if not colon or not all(number.isascii() and number.isdigit() for number in both):
        raise InputError(f"expected A:B, the seeds from A up to B-1, got {text!r}", key="--seeds")
    if any(len(number) > 12 for number in both) or int(both[1]) > MAX_SEED:
        raise InputError(f"seeds must be below {MAX_SEED}, got {text!r}", key="--seeds")
    seeds = range(int(both[0]), int(both[1]))
    if not seeds:
        raise InputError(f"there is no seed in {text!r}: B must be above A", key="--seeds")
    if len(seeds) > _MAX_SEEDS:
        what = f"at most {_MAX_SEEDS} seeds at a time, got {len(seeds)}"
        raise InputError(what, key="--seeds")
    return seeds
