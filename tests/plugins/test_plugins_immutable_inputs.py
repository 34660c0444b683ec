"""What plugins are given cannot be changed: every field reachable from it is tried."""

import contextlib
import enum
import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, is_dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from types import MappingProxyType, MemberDescriptorType
from typing import Any

import numpy as np
import pytest
from pydantic import BaseModel

from navfw.context import Context
from navfw.interfaces import KINDS, Plugin
from navfw.missions import Blackout, plugins_of, prepare
from navfw.plugins import default_registry
from navfw.robot import RobotModel
from navfw.signals import Conflicts, FlowField, Sealed, freeze, immutable, read_only

pytestmark = pytest.mark.usefixtures("workdir")  # away from any project that has plugins

_LEAVES = (type(None), bool, int, float, str, bytes, slice, enum.Enum, Path, np.generic)
_KNOWN = (np.ndarray, frozenset, tuple, Mapping, BaseModel, Sealed)
_WITHOUT_ATTRIBUTES = (np.ndarray, frozenset, tuple, MappingProxyType)
_REFUSALS = (AttributeError, TypeError, ValueError)  # pydantic's and dataclasses' are among them


def changeable(value: object, path: str = "it") -> list[str]:
    """The paths at which ``value`` or something reachable from it could be changed.

    What refuses all attempts counts as changeable all the same if its type is not a known one.
    """
    return sorted(set(_changeable(value, path, {})))


def _changeable(value: object, path: str, visited: dict[int, object]) -> Iterator[str]:
    if id(value) in visited or isinstance(value, _LEAVES) or inspect.isroutine(value):
        return
    visited[id(value)] = value
    known = is_dataclass(value) or isinstance(value, _KNOWN)
    if not known or any(_succeeds(attempt) for attempt in _attempts(value)):
        yield path
    for name in [*_attributes(value), "an_additional_attribute"]:
        if _succeeds(partial(_set, value, name)):
            yield f"{path}.{name}"
    for part, get in _parts(value):
        item = get()
        if item is get():  # what is made anew at each access is the reader's own
            yield from _changeable(item, f"{path}{part}", visited)


def _attempts(value: Any) -> Iterator[Callable[[], object]]:
    """The ways to change an array or a mapping itself."""
    if isinstance(value, np.ndarray):
        yield from _array_attempts(value)
    elif isinstance(value, Mapping):
        key = next(iter(value), "an additional key")
        yield lambda: value.__setitem__(key, value.get(key))  # type: ignore[index]
        yield lambda: value.update({})  # type: ignore[attr-defined]


def _parts(value: Any) -> Iterator[tuple[str, Callable[[], object]]]:
    """How to read each part of ``value``, and the part's name."""
    if isinstance(value, frozenset | tuple):
        for index, item in enumerate(value):
            yield f"[{index}]", lambda item=item: item  # type: ignore[misc]
    elif isinstance(value, Mapping):
        for key in value:
            yield f"[{key!r}]", partial(value.__getitem__, key)
    for name in _attributes(value):
        yield f".{name}", partial(getattr, value, name)


def _attributes(value: object) -> list[str]:
    """The public attributes of an instance: fields, variables, slots and properties."""
    if isinstance(value, _WITHOUT_ATTRIBUTES):
        return []
    described = (property, cached_property, MemberDescriptorType)
    own = {
        name
        for base in set(type(value).__mro__) - {object, BaseModel}
        for name, member in vars(base).items()
        if isinstance(member, described)
    }
    own.update(getattr(value, "__dict__", {}))
    return sorted(name for name in own if not name.startswith(("_", "model_")))


def _set(value: object, name: str) -> None:
    setattr(value, name, getattr(value, name, 0))


def _array_attempts(array: np.ndarray[Any, Any]) -> Iterator[Callable[[], object]]:
    """Write, and make writable: the array, and every array whose memory it shows."""
    owner: Any = array
    while isinstance(owner, np.ndarray):
        yield partial(owner.__setitem__, ..., owner.copy())
        yield partial(owner.setflags, write=True)
        yield partial(setattr, owner.flags, "writeable", True)
        owner = owner.base
    if isinstance(owner, bytearray | memoryview):
        yield lambda: None


def _succeeds(attempt: Callable[[], object]) -> bool:
    with contextlib.suppress(*_REFUSALS):
        attempt()
        return True
    return False


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


def test_every_interface_is_tried() -> None:
    for kind, base in KINDS.items():
        for name, method in inspect.getmembers(base, inspect.isfunction):
            for argument in list(inspect.signature(method).parameters)[1:]:
                known = argument in OWN or kind in {"landmark", "family"} or name == "__init__"
                assert known or name in base.__dict__, f"{kind}.{name}({argument})"


# --- the attempts themselves ----------------------------------------------------------------------


@dataclass(frozen=True)
class _Loose:
    """Frozen, with a field of a mutable type."""

    part: object = field(default_factory=list)


@dataclass
class _Open:
    """Not frozen."""

    part: float = 0.0


class _OpenModel(BaseModel):
    """Not frozen."""

    part: float = 0.0


@pytest.mark.parametrize(
    "part",
    [
        [],
        {},
        set(),
        {"a": 1.0},
        np.zeros(3),
        np.zeros(3)[1:],
        np.zeros((2, 2)).T,
        np.broadcast_to(np.zeros(3), (2, 3)),
        np.frombuffer(bytearray(8)),
        MappingProxyType({"a": []}),
        (1.0, [2.0]),
        _Open(),
        _OpenModel(),
        Sealed(),
    ],
    ids=lambda part: type(part).__name__,
)
def test_a_field_that_can_be_changed_is_found(part: object) -> None:
    if isinstance(part, np.ndarray):
        part.setflags(write=False)
    assert changeable(_Loose(part))
    assert not changeable(_Loose(immutable(())))


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


def test_a_field_of_another_type_is_left_to_the_checks() -> None:
    part: Any = [[1.0]]
    loose = _Loose(part)
    freeze(loose, "part")
    assert loose.part is part


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
