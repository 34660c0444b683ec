"""The kinds of files that people write, in one table: a further kind is one entry here.

An entry says where a project has such files and names, as ``module:name``, what describes, loads
and checks them. These are imported only when needed, so that names are found quickly.
"""

from __future__ import annotations

import importlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class FileKind:
    """A kind of file.

    ``pattern`` says where a project has such files, ``also_in`` names further folders; navfw's own
    are in ``room``, a folder of the package, if it is given. ``model`` is the pydantic model of
    their content, ``key`` a top-level key that only they have, ``title`` their name in messages.
    ``load`` is a function of a path that raises an InputError if the file is wrong; ``check``,
    which replaces it if a check needs more than the file, is a function of the path and the
    plugins. ``plural`` is their name in ``navfw list``, which shows the ``columns`` besides the
    description.
    """

    name: str
    pattern: str
    model: str
    also_in: tuple[str, ...] = ()
    load: str = ""
    check: str = ""
    key: str = ""
    title: str = ""
    plural: str = ""
    columns: tuple[str, ...] = ()
    room: str = ""

    @property
    def folders(self) -> tuple[str, ...]:
        """The names of folders that have such files, such as ``maps``; empty for worlds."""
        return () if self.file_name else (self.pattern.split("/")[-2], *self.also_in)

    @property
    def patterns(self) -> list[str]:
        """Patterns of such files, relative to a project and to each folder on the path to them."""
        parts = self.pattern.replace("*.yaml", "*").split("/")
        whole = len(parts) if self.file_name else len(parts) - 1
        tails = ["/".join(parts[first:]) for first in range(whole)]
        return [*tails, *(f"{folder}/*" for folder in self.also_in)]

    @property
    def file_name(self) -> str | None:
        """The name that all such files have: ``world.yaml``; None if names differ."""
        name = self.pattern.split("/")[-1]
        return None if "*" in name else name

    def schema(self) -> dict[str, Any]:
        """Return the JSON Schema of such files: keys, types and bounds."""
        model = _imported(self.model)
        about = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
        return {**about, **model.model_json_schema()}

    def check_file(self, path: Path, plugins: object) -> None:
        """Load the file at ``path``, and check what can be checked without a run.

        Raises:
            InputError: the file, or one that it names, is wrong.

        """
        if self.check:
            _imported(self.check)(path, plugins)
        else:
            _imported(self.load)(os.path.join(".", path))  # noqa: PTH118 - a path, never a name


def _imported(target: str) -> Any:
    module, _, name = target.partition(":")
    return getattr(importlib.import_module(module), name)


_KINDS = (
    FileKind(
        name="world",
        plural="worlds",
        pattern="worlds/*/world.yaml",
        key="walls",
        model="navfw.sim.worldspec:WorldSpec",
        load="navfw.sim.worldfile:load_world",
        columns=("missions",),
    ),
    FileKind(
        name="mission",
        plural="missions",
        pattern="worlds/*/missions/*.yaml",
        key="goals",
        model="navfw.missions.missionspec:MissionSpec",
        check="navfw.cli.data_files:check_mission",
        columns=("start", "goals", "timeout"),
    ),
    FileKind(
        name="map",
        plural="maps",
        pattern="maps/*.yaml",
        key="places",
        model="navfw.topomap.mapspec:MapSpec",
        check="navfw.cli.data_files:check_map",
        columns=("places", "edges"),
    ),
    FileKind(
        name="stack",
        plural="stacks",
        pattern="stacks/*.yaml",
        key="behaviors",
        model="navfw.stack.stackfile:StackSpec",
        check="navfw.cli.data_files:check_stack",
        columns=("plugins",),
        room="stack",
    ),
    FileKind(
        name="robot",
        plural="robots",
        pattern="robots/*.yaml",
        model="navfw.robot.robotfile:RobotSpec",
        load="navfw.robot.robotfile:load_robot",
        columns=("body", "speed", "camera"),
        room="robot",
    ),
    FileKind(
        name="suite",
        plural="suites",
        pattern="worlds/suites/*.yaml",
        key="entries",
        model="navfw.suite.suitefile:SuiteSpec",
        load="navfw.suite.suitefile:load_suite",
        columns=("entries", "variants"),
    ),
    FileKind(
        name="rules",
        title="rule base",
        pattern="behaviors/*.yaml",
        also_in=("plugins",),
        key="rules",
        model="navfw.fuzzy.rulespec:RuleBaseSpec",
        load="navfw.fuzzy.rulefile:load_rule_base",
    ),
)
FILE_KINDS = {kind.name: kind for kind in _KINDS}
"""The kinds of files by name."""
