"""What plugins are given cannot be changed: every field reachable from it is tried."""

import enum
import inspect
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
from pydantic import BaseModel

from navfw.context import Context
from navfw.interfaces import KINDS, Plugin
from navfw.missions import prepare
from navfw.missions.missionspec import Blackout
from navfw.missions.oracle import plugins_of
from navfw.plugins import default_registry
from navfw.robot import RobotModel
from navfw.signals import Conflicts, FlowField
from navfw.signals.immutability import Sealed, immutable, read_only

pytestmark = pytest.mark.usefixtures("workdir")  # away from any project that has plugins

_LEAVES = (type(None), bool, int, float, str, bytes, slice, enum.Enum, Path, np.generic)


def changeable(value: Any, path: str = "it") -> list[str]:
    """The paths at which ``value`` or something reachable from it could be changed."""
    paths: list[str] = []
    visited: dict[int, object] = {}

    def visit(item: Any, path: str) -> None:
        if id(item) in visited or isinstance(item, _LEAVES) or inspect.isroutine(item):
            return
        visited[id(item)] = item
        if not _is_immutable(item):
            paths.append(path)
        for name, part in _parts(item):
            visit(part, f"{path}.{name}")

    visit(value, path)
    return paths


def _is_immutable(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return not value.flags.writeable
    if is_dataclass(value) or isinstance(value, BaseModel | Sealed):
        try:
            setattr(value, "an_additional_attribute", 0)  # noqa: B010 - none is declared
        except (AttributeError, TypeError, ValueError):
            return True
        return False
    if isinstance(value, Mapping):
        return not hasattr(value, "__setitem__")
    return isinstance(value, tuple | frozenset)


def _parts(value: Any) -> Iterator[tuple[object, object]]:
    """Name and value of each part of ``value``: of fields, variables and items."""
    if isinstance(value, tuple | frozenset):
        yield from enumerate(value)
    elif isinstance(value, MappingProxyType):  # any other makes its items anew
        yield from value.items()
    elif is_dataclass(value):
        yield from ((field.name, getattr(value, field.name)) for field in fields(value))
    elif isinstance(value, BaseModel | Sealed):
        yield from ((name, part) for name, part in vars(value).items() if name[0] != "_")


EVENT = "mission.events=[{at: 1, plugin: {blackout: {}}}]"
OWN = {"rng": "a random generator is given to be drawn from"}
"""Arguments that a plugin may change."""
OWN_PARAMETERS = {"posters.images", "landmarks.posters.images"}
"""Mappings in parameters: no other plugin reads them, and mapping proxies cannot be copied."""


class Arguments:
    """The last value of each argument that the plugins of a stack were called with."""

    def __init__(self) -> None:
        self.last: dict[str, object] = {}

    def watch(self, plugin: Plugin) -> None:
        """Note the arguments of every method of the interface of ``plugin``'s kind."""
        for name, method in inspect.getmembers(KINDS[plugin.kind], inspect.isfunction):
            if not name.startswith("_") and name != "reset":
                given = list(inspect.signature(method).parameters)[1:]
                called = partial(self._call, plugin.kind, name, given, getattr(plugin, name))
                setattr(plugin, name, called)

    def _call(self, kind: str, name: str, given: list[str], method: Any, *args: Any) -> Any:
        for argument, value in zip(given, args, strict=False):
            if value is not None and value != ():
                self.last[f"{kind}.{name}({argument})"] = value
        return method(*args)


@pytest.fixture(scope="module")
def arguments() -> dict[str, object]:
    """All arguments of the plugins of a drive through the office, by kind, method and name."""
    noted = Arguments()
    actions = Blackout.actions

    def noting(event: Blackout, world: Mapping[str, Any]) -> Any:
        noted.last["event.actions(world)"] = world
        return actions(event, world)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Blackout, "actions", noting)
        overrides = ["mission.timeout=4", EVENT]
        session = prepare("office", "lobby-to-lab", stack="landmarks", overrides=overrides)
    assert session.stack.mofis.composite is not None
    for plugin in plugins_of(session.stack).values():
        noted.watch(plugin)
    session.run()
    noted.last["topo_map"] = session.mission.topo_map
    noted.last["robot"] = session.stack.robot
    return noted.last


def test_nothing_that_a_plugin_is_given_can_be_changed(arguments: dict[str, object]) -> None:
    kinds = {name.partition(".")[0] for name in arguments} & set(KINDS)
    assert kinds == set(KINDS) - {"landmark", "family"}, "these are given a number, and OWN"
    for name, value in arguments.items():
        assert changeable(value, name) == []


def test_the_context_tried_has_all_its_parts(arguments: dict[str, object]) -> None:
    context = arguments["behavior.propose(context)"]
    assert isinstance(context, Context)
    layer = np.ones(context.commands.shape)
    whole = replace(context, conflicts=Conflicts(layer, layer.copy(), layer.copy(), 1.0))
    assert all(getattr(whole, name) is not None for name in Context.__dataclass_fields__)
    assert changeable(whole) == []


def test_parameters_of_shipped_plugins_cannot_be_changed() -> None:
    registry, robot = default_registry(), RobotModel()
    for plugin in registry.listing():
        if plugin["status"] == "ok":
            cls = registry.get(plugin["kind"], plugin["name"])
            required = [f for f in cls.Params.model_fields.values() if f.is_required()]
            if not required:
                assert set(changeable(cls.Params(), plugin["name"])) <= OWN_PARAMETERS
    assert changeable(robot) == []


@pytest.mark.parametrize(
    "value",
    [
        {"a": [1.0, {"b": np.zeros(2)}], "c": {1, 2}},
        [np.arange(4.0).reshape(2, 2).T, "text", None],
        np.zeros((0, 3)),
        MappingProxyType({"a": {"b": 1.0}}),
    ],
)
def test_immutable_copies_of_plain_data(value: object) -> None:
    copy = immutable(value)
    assert changeable(copy) == []
    np.testing.assert_equal(_plain(copy), _plain(value))


def test_a_read_only_copy_is_equal_and_made_once() -> None:
    source = np.arange(6.0).reshape(2, 3)[:, ::-1]
    copy = read_only(source)
    assert copy.dtype == source.dtype
    np.testing.assert_array_equal(copy, source)
    source[:] = 0.0
    assert copy.any()
    assert read_only(copy) is copy


def test_fields_keep_shared_grid_points() -> None:
    registry = default_registry()
    matcher: Any = registry.get("flow", "block_matching")(RobotModel())
    points = matcher._points
    flow = FlowField(0.0, points, points, points[..., 0], points[..., 0], None)  # type: ignore[arg-type]
    assert flow.points is points


def _plain(value: Any) -> Any:
    """Dicts and lists in place of immutable copies."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return set(value) if isinstance(value, set | frozenset) else value
