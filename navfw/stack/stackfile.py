"""Stack files: the plugin of each kind with its parameters, settings, and ``--set`` overrides.

A stack with ``base: default`` lists only its differences from that stack: its stages replace those
of the base, its behaviours are added, its settings change single values.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from navfw.config.document import YamlDocument
from navfw.config.overrides import Override, apply_overrides, parse_override
from navfw.config.strict_model import StrictModel
from navfw.config.yaml_text import KeyPath
from navfw.config.yamlfile import validate
from navfw.context import CommandGrid, CommandGridParams
from navfw.egomotion import seeing_speed
from navfw.egomotion.pairing import PairingParams
from navfw.errors import ConfigError, UnknownNameError, did_you_mean
from navfw.guard import PluginGuard, construct
from navfw.interfaces import Plugin
from navfw.localmap import LocalMap, LocalMapParams
from navfw.mofis.mofis import Mofis
from navfw.movers import MoverParams
from navfw.plugins import Registry
from navfw.robot import RobotModel
from navfw.safety import SafetyParams
from navfw.stack.stack_document import STAGES, read_stack


def _some_plugins(value: object) -> object:
    if not isinstance(value, Mapping) or not value:
        raise ValueError("expected plugins, each as 'name: {parameters}' or 'name:'")
    return value


def _one_plugin(value: object) -> object:
    if not isinstance(value, Mapping) or len(value) != 1:
        names = ", ".join(map(str, value)) if isinstance(value, Mapping) else ""
        got = f"got {names}" if names else "got none"
        raise ValueError(f"expected one plugin, as 'name: {{parameters}}' or 'name:'; {got}")
    return value


_Plugins = dict[str, dict[str, Any] | None]
Chosen = Annotated[_Plugins, BeforeValidator(_one_plugin), Field(min_length=1, max_length=1)]


class StackSettings(StrictModel):
    """Settings of the stack itself, beside the parameters of its plugins."""

    pairing: PairingParams = PairingParams()
    local_map: LocalMapParams = LocalMapParams()
    movers: MoverParams = MoverParams()
    commands: CommandGridParams = CommandGridParams()
    safety: SafetyParams = SafetyParams()
    derotate: bool = Field(
        True, description="remove the camera's rotation from the flow (paper sec 3)"
    )
    refine: bool = Field(True, description="refine the gyro's rotation by the flow (METHOD 2.6)")
    floor_odometry: bool | None = Field(
        None,
        description="correct wheels and gyro by the floor's motion in the images; "
        "null: if the robot's wheels skid",
    )
    stixels: bool = Field(False, description="detect thin upright obstacles by image columns")
    growing_map: bool = Field(
        False, description="the map that grows is the only one: close loops, and correct the pose"
    )
    floor_model: bool = Field(
        True,
        description="distinguish floor from obstacles by height (METHOD 2.8); false: flow "
        "below the horizon counts as unknown",
    )
    warmup: float = Field(
        1.0, ge=0.0, le=30.0, description="standstill first, for the gyro's bias [s]"
    )
    oracle: bool = Field(
        False, description="allow plugins that need the simulator's truth; results are marked"
    )


class StackSpec(StackSettings):
    """The schema of a stack file: settings, and each stage as ``plugin name: {parameters}``."""

    description: str = ""
    base: str | None = Field(
        None, description="name or file of a stack from which this one differs"
    )
    flow: Chosen
    perception: Chosen
    features: Chosen
    localizer: Chosen
    planner: Chosen
    composite: Chosen = Field(default={"travel": None})
    behaviors: Annotated[_Plugins, BeforeValidator(_some_plugins), Field(min_length=1)]
    fusion: Chosen
    controller: Chosen


@dataclass(frozen=True, slots=True)
class Choice:
    """One plugin that a stack file chooses, with its validated parameters."""

    name: str
    plugin: type[Plugin]
    params: Plugin.Params

    def as_data(self) -> dict[str, Any]:
        """Return name and all parameters as plain data."""
        return {self.name: self.params.model_dump(mode="json")}


@dataclass(frozen=True, slots=True)
class StackConfig:
    """A stack file, resolved: all plugins found, all parameters validated.

    ``known`` are the names of all behaviours, those of other stacks included.
    """

    stages: Mapping[str, Choice]
    behaviors: Mapping[str, Choice]
    settings: StackSettings
    known: frozenset[str] = frozenset()

    @property
    def plugins(self) -> tuple[type[Plugin], ...]:
        """Classes of all plugins of the stack."""
        return tuple(choice.plugin for choice in (*self.stages.values(), *self.behaviors.values()))

    def as_data(self) -> dict[str, Any]:
        """Return the configuration as plain data; written as YAML it is a stack file again."""
        return {
            **{stage: choice.as_data() for stage, choice in self.stages.items()},
            "behaviors": {
                name: choice.params.model_dump(mode="json")
                for name, choice in self.behaviors.items()
            },
            **self.settings.model_dump(mode="json"),
        }


def load_stack(
    path: str | Path,
    plugins: Registry,
    overrides: Sequence[str] = (),
    stages: Sequence[str] = STAGES,
) -> StackConfig:
    """Load the stack file at ``path`` and apply ``overrides``, such as ``offis.layers=1``.

    The first name of an override is a plugin of the stack or a section of the file. Of the
    ``stages`` that are left out no plugin is looked at.

    Raises:
        ConfigError: the file or an override breaks the schema or a plugin's parameters.
        UnknownNameError: a plugin does not exist.
        PluginError: a plugin is broken.

    """
    document = read_stack(path)
    placed = [_placed(parse_override(text), document) for text in overrides]
    document = apply_overrides(document, placed)
    spec = validate(document, StackSpec)
    chosen = {
        stage: _choose(document, plugins, stage, stage, *getattr(spec, stage)) for stage in stages
    }
    behaviors = {
        name: _choose(document, plugins, "behavior", "behaviors", name) for name in spec.behaviors
    }
    if not spec.oracle:
        _refuse_oracles(document, {**chosen, **{f"behaviors.{n}": c for n, c in behaviors.items()}})
    settings = StackSettings(**{name: getattr(spec, name) for name in StackSettings.model_fields})
    known = frozenset((*behaviors, *plugins.names("behavior")))
    return StackConfig(chosen, behaviors, settings, known)


def mofis_of(
    config: StackConfig, robot: RobotModel, guard: PluginGuard, local_map: LocalMap
) -> Mofis:
    """Build MOFIS with the behaviours, composite and fusion of a stack file."""

    def build(choice: Choice) -> Any:
        return construct(choice.plugin, robot, choice.params)

    settings, behaviors = config.settings, config.behaviors
    return Mofis(
        robot,
        {name: build(choice) for name, choice in behaviors.items()},
        build(config.stages["fusion"]),
        CommandGrid(robot, settings.commands, seeing_speed(robot, settings.pairing)),
        local_map,
        build(config.stages["composite"]),
        guard,
        config.known,
    )


def _refuse_oracles(document: YamlDocument, choices: Mapping[str, Choice]) -> None:
    """Raise ConfigError if a plugin needs truth that the stack file does not admit to using."""
    for section, choice in choices.items():
        if choice.plugin.oracle:
            with document.locating((section.split(".")[0], choice.name), key=section):
                raise ConfigError(
                    f"{choice.name} needs the simulator's truth, which no robot has; for"
                    " evaluation, say `oracle: true` in the stack file: the results are then marked"
                    " by it"
                )


def _choose(
    document: YamlDocument, plugins: Registry, kind: str, section: str, name: str
) -> Choice:
    """Return the plugin ``name`` of ``section``, its parameters checked against its own model."""
    at: KeyPath = (section, name)
    with document.locating(at, key=section, only=UnknownNameError):
        plugin = plugins.get(kind, name)
    return Choice(name, plugin, validate(document, plugin.Params, at))


def _placed(override: Override, document: YamlDocument) -> Override:
    """Complete the path of ``override``: plugins and parts of settings may be named directly.

    A stage may be given only the name of a plugin, which then has its defaults.
    """
    head = str(override.path[0])
    if override.path in [(stage,) for stage in STAGES] and isinstance(override.value, str):
        return Override(override.path, {override.value: None}, override.text)
    data = document.data if isinstance(document.data, dict) else {}
    if head in StackSpec.model_fields:
        return override
    homes = {
        str(name): stage
        for stage in (*STAGES, "behaviors")
        if isinstance(data.get(stage), dict)
        for name in data[stage]
    }
    homes = {**_SECTIONS, **homes}
    if head in homes:
        return override.under((homes[head],))
    candidates = [*StackSpec.model_fields, *homes]
    raise ConfigError(
        f"nothing in this stack is called {head!r}: {did_you_mean(head, candidates)}",
        key=override.option,
    )


_SECTIONS = {
    key: section
    for section, model in (("local_map", LocalMapParams), ("movers", MoverParams))
    for key in model.model_fields
}
"""Keys of the settings' sections that an override may begin with, and their section."""
