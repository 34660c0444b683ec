"""The specification of one run of a suite, as plain data that is sent to a worker process."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from navfw.errors import InputError
from navfw.missions.outcome import Cause, Outcome
from navfw.suite.run_row import RunKey, RunRow

if TYPE_CHECKING:
    from navfw.missions.missionfile import MissionFile
    from navfw.missions.session import Session
    from navfw.plugins import Registry
    from navfw.sim.worldspec import Look, WorldSpec
    from navfw.topomap import TopoMap
    from navfw.worldgen.generation import GeneratedWorld

BESIDE = RECORDINGS, MAPS = "recordings", "maps"
"""Names of the folders of recordings and of maps; both lie beside the folder of pictures."""

_DEFAULT_DIFFICULTY = 0.5
"""Difficulty of generated worlds in entries without one: the middle of the range 0 to 1."""

KeptRuns = Literal["all", "failed", "none"]
"""The runs whose picture, or whose recording, is kept."""


_PAIR_STREAM = 0xABC
"""Spawn key of the random stream that draws the heading at the start of a pair of places."""

_DIFFICULTY_STREAM = 0xD1F
"""Spawn key of the random stream that draws difficulties; other uses of the seed have others."""


def draw_difficulty(difficulty: float | tuple[float, float] | None, seed: int) -> float | None:
    """Return ``difficulty``; from a range, the value that ``seed`` draws (3 decimals)."""
    if not isinstance(difficulty, tuple):
        return difficulty
    stream = np.random.SeedSequence(seed, spawn_key=(_DIFFICULTY_STREAM,))
    low, high = difficulty
    return round(low + (high - low) * float(np.random.default_rng(stream).random()), 3)


def drawn_pair(topo_map: TopoMap, names: Sequence[str], seed: int) -> tuple[str, str, float]:
    """Draw two connected places among ``names``: start, goal, and the start yaw [rad] in ``map``.

    n consecutive seeds draw each of the n pairs once.

    Raises:
        InputError: no two of the places are connected.

    """
    pairs = [(a, b) for a in names for b in names if a != b and b in topo_map.part_of(a)]
    if not pairs:
        raise InputError(f"the map {topo_map.name!r} has no two places that are connected")
    order = np.random.default_rng(len(pairs)).permutation(len(pairs))
    stream = np.random.SeedSequence(seed, spawn_key=(_PAIR_STREAM,))
    yaw = float(np.random.default_rng(stream).uniform(-np.pi, np.pi))
    return (*pairs[order[seed % len(pairs)]], round(yaw, 2))


@dataclass(frozen=True, slots=True)
class Case:
    """The specification of one run of a suite, as plain data that is sent to a worker process.

    Either ``world`` and ``mission`` are files, or ``family``, ``difficulty`` (the seed draws it
    from a range), ``contrast``, ``look`` and ``seed`` define a generated world. With ``pairs`` the
    seed draws start and goal of the mission; with ``explore``, the keys of an exploration as JSON,
    the robot explores instead; with ``taught``, the keys of ``TaughtSpec`` as JSON, it drives on a
    map that is made first (``taught_maps``), or with ``given_map`` on the world's own map.
    ``stack`` is a file; if empty, the mission names the stack. ``content`` is the fingerprint of
    all that the result depends on except the seed. ``keep`` and ``record`` say for which outcomes
    a picture is kept in the folder ``pictures``, and a recording in the folder ``recordings``
    beside it.
    """

    index: int
    entry: str
    seed: int = 0
    stack: str = ""
    overrides: tuple[str, ...] = ()
    family: str = ""
    difficulty: float | tuple[float, float] | None = None
    contrast: float | None = None
    look: Look | None = None
    world: str = ""
    mission: str = ""
    pairs: bool = False
    explore: str = ""
    taught: str = ""
    given_map: bool = False
    variant: str = ""
    content: str = ""
    pictures: Path = Path()
    keep: KeptRuns = "none"
    record: KeptRuns = "none"

    @property
    def key(self) -> RunKey:
        """The columns that identify the run in the table."""
        stack = Path(self.stack).stem
        if self.family:
            where = f"{self.family}-{self.world_seed}", Path(self.mission).stem or "cross"
        else:
            where = Path(self.world).parent.name, Path(self.mission).stem
        return RunKey(self.entry, *where, self.seed, stack, self.variant)

    @property
    def world_seed(self) -> int:
        """The seed of a generated world; with ``taught``, seeds in turn share it and its map."""
        return self.seed // json.loads(self.taught)["seeds"] if self.taught else self.seed

    @property
    def columns(self) -> dict[str, Any]:
        """The columns of the table that are known before the run."""
        difficulty = draw_difficulty(self.difficulty, self.world_seed)
        return {**self.key._asdict(), "family": self.family, "difficulty": difficulty}

    def fault(self, reason: str, cause: Cause) -> RunRow:
        """Return the row of a run that ended without a result; its outcome is ``fault``."""
        reason = " ".join(reason.split())
        return RunRow(**self.columns, outcome=Outcome.FAULT, reason=reason, cause=cause.value)

    def session(self, registry: Registry) -> Session:
        """Load and check the run's world, mission and stack.

        In a generated world, ``seed`` determines the world and all noise.

        Raises:
            InputError: one of them does not exist or is invalid.

        """
        from navfw.missions import session_setup

        stack = self.stack or None
        if not self.family:
            overrides = (*self.overrides, *self._pair()) if self.pairs else self.overrides
            if self.explore:
                overrides = (f"mission.explore={self.explore}", *overrides)
            return session_setup.prepare(
                self.world,
                None if self.explore else self.mission,
                seed=self.seed,
                stack=stack,
                overrides=overrides,
                registry=registry,
            )
        world, mission = self._generated()
        return session_setup.session_of(
            world, mission, self.key.world, self.seed, stack, self.overrides, registry
        )

    def _pair(self) -> tuple[str, ...]:
        """Start and goal as overrides of the mission: two connected places of its map."""
        from navfw.missions.missionfile import load_mission, start_candidates
        from navfw.missions.session_setup import split_overrides

        for_mission, _ = split_overrides(self.overrides)
        topo_map = load_mission(Path(self.mission), for_mission).topo_map
        names = [place.name for place in start_candidates(topo_map, ())]
        start, goal, yaw = drawn_pair(topo_map, names, self.seed)
        changes = {"start": {"place": start, "yaw": yaw}, "goals": [goal], "events": []}
        return tuple(f"mission.{key}={json.dumps(value)}" for key, value in changes.items())

    def made_world(self) -> GeneratedWorld:
        """Generate the world of ``family`` and ``world_seed``."""
        from navfw import worldgen

        difficulty = draw_difficulty(self.difficulty, self.world_seed)
        if difficulty is None:
            difficulty = _DEFAULT_DIFFICULTY
        seed = self.world_seed
        return worldgen.generate(self.family, seed, difficulty, self.contrast, self.look)

    def _generated(self) -> tuple[WorldSpec, MissionFile]:
        """Return the world of ``family`` and ``seed``, and its mission with ``overrides``."""
        from navfw.config.document import parse_yaml
        from navfw.config.overrides import apply_overrides
        from navfw.missions.missionfile import mission_in, with_task
        from navfw.missions.session_setup import split_overrides

        made = self.made_world()
        text = json.dumps(made.mission.model_dump(mode="json", by_alias=True, exclude_unset=True))
        for_mission, _ = split_overrides(self.overrides)
        document = parse_yaml(text, self.key.world)
        if self.explore:
            document = with_task(document, {"explore": json.loads(self.explore)}, "explore")
        document = apply_overrides(document, for_mission)
        return made.world, mission_in(document, Path(self.key.mission), made.topo_map)
