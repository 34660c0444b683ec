"""``navfw schema KIND``: the JSON Schema of a kind of file, for editors and other tools."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Annotated

import typer

from navfw.cli.output import print_json, quiet_stdout
from navfw.errors import UnknownNameError

if TYPE_CHECKING:
    from pydantic import BaseModel

__all__ = ["MODELS", "add_to"]

MODELS = {
    "map": "navfw.topomap.mapspec:MapSpec",
    "mission": "navfw.missions.missionspec:MissionSpec",
    "robot": "navfw.robotfile:RobotSpec",
    "rules": "navfw.fuzzy.rulespec:RuleBaseSpec",
    "stack": "navfw.stackfile:StackSpec",
    "suite": "navfw.suite.suitefile:SuiteSpec",
    "world": "navfw.sim.worldspec:WorldSpec",
}
"""The model of each kind of file, as ``module:Class``; imported when asked for."""


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(schema)


def schema(
    kind: Annotated[
        str, typer.Argument(metavar="KIND", help=f"Kind of file: {', '.join(MODELS)}.")
    ],
) -> None:
    """Print the JSON Schema of a kind of file. Editors complete and explain keys by it.

    It gives keys, types and bounds. What files say of each other is checked by navfw check.
    """
    if kind not in MODELS:
        raise UnknownNameError("kind of file", kind, MODELS)
    with quiet_stdout():
        found = _model(kind).model_json_schema()
    print_json({"$schema": "https://json-schema.org/draft/2020-12/schema", **found})


def _model(kind: str) -> type[BaseModel]:
    module, _, name = MODELS[kind].partition(":")
    model: type[BaseModel] = getattr(importlib.import_module(module), name)
    return model
