"""The kinds of parts that ``navfw new`` writes into a project: files, names, next command.

It is plain data, so that the command line can list the kinds without importing more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

NameRule = Literal["identifier", "hyphenated"]
"""How a part is named: like Python code, or like worlds and missions."""

_PART = {"part_name": "{name}", "PartName": "{class_name}"}
"""Words of the templates in ``parts`` that are replaced by the part's name."""


@dataclass(frozen=True)
class PartKind:
    """A kind of part.

    ``files`` maps each file to write, relative to the project, to its template in
    ``navfw/scaffold/templates``; ``words`` maps regular expressions to replacements in all of them.
    In both, and in ``then``, the next command, ``{name}`` is the name, ``{module}`` the name with
    underscores, ``{class_name}`` that of the class, ``{world}`` the world of a mission, and
    ``{start}`` one of ``starts``, by default the first. ``unique`` lists the kinds of things among
    which the name must be new.
    """

    help: str
    rule: NameRule
    unique: tuple[str, ...]
    files: Mapping[str, str]
    words: Mapping[str, str]
    then: str
    starts: tuple[str, ...] = ("",)


def _stage(kind: str, what: str) -> PartKind:
    """Return a stage of the stack: a plugin, a stack with it, and a mission with that stack."""
    return PartKind(
        help=f"Write {what}, a stack with it, and a test.",
        rule="identifier",
        unique=("plugin", "stack"),
        files={
            "plugins/{name}.py": f"parts/{kind}.py.template",
            "stacks/{name}.yaml": "parts/stack.yaml",
            "tests/test_{name}.py": "parts/test_stage.py.template",
        },
        words={**_PART, "part_kind": kind},
        then="navfw run paper-room through-the-door --stack {name}",
    )


PARTS: dict[str, PartKind] = {
    "behavior": PartKind(
        help="Write a behaviour with rules, and a test of what it says.",
        rule="identifier",
        unique=("plugin",),
        files={
            "behaviors/{name}.py": "parts/{start}/behavior.py.template",
            "behaviors/{name}.yaml": "parts/{start}/rules.yaml",
            "tests/test_{name}.py": "parts/{start}/test.py.template",
        },
        words=_PART,
        then='navfw run empty straight --set "behaviors.{name}={{}}"',
        starts=("slow-near", "keep-distance", "prefer-side"),
    ),
    "flow": _stage("flow", "a flow processor"),
    "fusion": _stage("fusion", "a command fusion"),
    "localizer": _stage("localizer", "a localiser"),
    "planner": _stage("planner", "a planner of routes"),
    "world": PartKind(
        help="Write a world with map and mission, and a test.",
        rule="hyphenated",
        unique=("world", "map"),
        files={
            "worlds/{name}/world.yaml": "project/worlds/den/world.yaml",
            "worlds/{name}/missions/next-room.yaml": "project/worlds/den/missions/next-room.yaml",
            "maps/{name}.yaml": "project/maps/den.yaml",
            "tests/test_{module}.py": "project/tests/test_next_room.py.template",
        },
        words={r"\bden\b": "{name}", r"\nstack: careful[^\n]*": ""},
        then="navfw run {name} next-room",
    ),
    "mission": PartKind(
        help="Write a mission in a world, WORLD/NAME, after another one there; and a test.",
        rule="hyphenated",
        unique=("mission",),
        files={
            "worlds/{world}/missions/{name}.yaml": "{model}",
            "tests/test_{module}.py": "parts/test_mission.py.template",
        },
        words={
            r"(?ms)^description:.*?(?=^\S)": "description: as {model_name}; set start and goals\n",
            "part_world": "{world}",
            **_PART,
        },
        then="navfw run {world} {name}",
    ),
    "suite": PartKind(
        help="Write a suite of missions, with two variants of the stack.",
        rule="hyphenated",
        unique=("suite",),
        files={"worlds/suites/{name}.yaml": "parts/suite.yaml"},
        words={},
        then="navfw suite {name} --seeds 0:2",
    ),
}
"""The kinds of parts, by the word after ``navfw new``."""
