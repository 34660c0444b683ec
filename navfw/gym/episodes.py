"""The runs that an environment drives: which world and mission a seed gives."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from navfw.config.lookup import find, find_mission
from navfw.config.overrides import Settings, override_texts
from navfw.errors import InputError
from navfw.gym.agent_plugins import ACTIONS
from navfw.missions.session import Session
from navfw.plugins import Registry, default_registry
from navfw.suite.case import Case
from navfw.suite.entry_cases import with_seed
from navfw.suite.suitefile import EntrySpec, parse_seeds


@dataclass(frozen=True)
class Episodes:
    """Sessions by seed, with an agent in the place of one stage; the same as in a suite."""

    case: Case
    entry: EntrySpec
    registry: Registry

    @classmethod
    def of(
        cls,
        action: str,
        *,
        family: str | None,
        difficulty: float | tuple[float, float],
        world: str | None,
        mission: str | None,
        stack: str | None,
        changes: Settings,
    ) -> Episodes:
        """The episodes of a family, or of a world's mission.

        Raises:
            InputError: it is neither or both, or one of the names does not exist.

        """
        if (family is None) == (world is None) or (world is None) != (mission is None):
            raise InputError(
                "expected either a family, or a world and a mission: "
                'gymnasium.make("navfw/Mission-v0", world="office", mission="lobby-to-lab")'
            )
        overrides = (*override_texts(changes), *ACTIONS[action].overrides())
        file = "" if stack is None else str(find("stack", stack).absolute())
        case = Case(0, family or world or "", 0, file, stack or "", "", "", overrides)
        entry = EntrySpec(world=world, family=family)
        if family is not None:
            entry = EntrySpec(family=family, difficulty=difficulty)
            case = replace(case, family=family, mission_name="cross")
        elif world is not None and mission is not None:
            case = replace(
                case,
                world=str(find("world", world).absolute()),
                mission=str(find_mission(world, mission).absolute()),
                world_name=world,
                mission_name=Path(mission).stem,
            )
        registry = default_registry()
        for kind in ACTIONS.values():
            registry.register(kind.plugin, "navfw.gym")
        return cls(case, entry, registry)

    def session(self, seed: int) -> Session:
        """The run of ``seed``, which determines the world of a family, and all noise.

        Raises:
            InputError: the seed is out of range, or world, mission or stack is wrong.

        """
        parse_seeds(f"{seed}:{seed + 1}")
        return with_seed(self.case, self.entry, seed).session(self.registry)
