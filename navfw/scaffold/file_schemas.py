"""JSON Schemas of navfw's kinds of files, and the settings by which an editor finds them."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from navfw.errors import UnknownNameError

if TYPE_CHECKING:
    from pydantic import BaseModel

MODELS = {
    "map": "navfw.topomap.mapspec:MapSpec",
    "mission": "navfw.missions.missionspec:MissionSpec",
    "robot": "navfw.robot.robotfile:RobotSpec",
    "rules": "navfw.fuzzy.rulespec:RuleBaseSpec",
    "stack": "navfw.stack.stackfile:StackSpec",
    "suite": "navfw.suite.suitefile:SuiteSpec",
    "world": "navfw.sim.worldspec:WorldSpec",
}
"""The model of each kind of file, as ``module:Class``; imported when asked for."""

_PLACES = {
    "map": "maps/*.yaml",
    "mission": "worlds/*/missions/*.yaml",
    "robot": "robots/*.yaml",
    "rules": "behaviors/*.yaml",
    "stack": "stacks/*.yaml",
    "suite": "worlds/suites/*.yaml",
    "world": "worlds/*/world.yaml",
}
"""Where a project has files of each kind."""


def schema_of(kind: str) -> dict[str, Any]:
    """The JSON Schema of a kind of file: keys, types and bounds.

    Raises:
        UnknownNameError: there is no such kind.

    """
    if kind not in MODELS:
        raise UnknownNameError("kind of file", kind, MODELS)
    module, _, name = MODELS[kind].partition(":")
    model: type[BaseModel] = getattr(importlib.import_module(module), name)
    found = model.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **found}


def editor_settings() -> dict[str, Any]:
    """Files of ``.vscode`` with their content: each kind's schema, and where it applies.

    They are understood by editors with the YAML language server, VS Code's YAML extension first.
    """
    schemas = {f"schemas/{kind}.json": schema_of(kind) for kind in MODELS}
    wired = {f"./.vscode/schemas/{kind}.json": place for kind, place in _PLACES.items()}
    return {"settings.json": {"yaml.schemas": wired}, **schemas}
