"""From the location in a pydantic error to the key in the file and the type expected there.

Pydantic's locations mix keys and indices with the labels of union members. The walk here follows
model, data and location together, and so tells labels from keys.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, get_args, get_origin, get_type_hints

from pydantic import BaseModel, Discriminator, Tag
from pydantic.fields import FieldInfo

from navfw.config.document import KeyPath
from navfw.config.type_descriptions import choices_of, describe, is_model, members_of, peel


@dataclass(frozen=True)
class ExpectedType:
    """A type, with the metadata, description and discriminator of its declaration."""

    annotation: Any
    metadata: tuple[Any, ...] = ()
    description: str = ""
    discriminator: Any = None

    def __str__(self) -> str:
        text = describe(self.annotation, self.metadata)
        return f"{text} ({self.description})" if self.description else text

    @classmethod
    def of_field(cls, info: FieldInfo) -> ExpectedType:
        """The type that a field of a model expects."""
        return cls(
            info.annotation, tuple(info.metadata), info.description or "", info.discriminator
        )


@dataclass(frozen=True)
class ErrorLocation:
    """Where an error is in the document, and what the model expects there."""

    path: KeyPath
    expected: ExpectedType
    certain: bool
    """False where the types of the model could not be followed down to ``path``."""
    known_keys: tuple[str, ...] = ()
    """The keys of the enclosing model."""
    tag_key: str = ""
    tags: tuple[str, ...] = ()
    """Of a discriminated union: the discriminating key, and its values."""
    unions: Mapping[KeyPath, tuple[str, ExpectedType]] = field(default_factory=dict)
    """The plain unions along ``path``: the label of the member in the location, and the union."""


def locate(loc: Sequence[str | int], data: Any, model: type[BaseModel]) -> ErrorLocation:
    """Follow ``loc``, the location in an error that ``model`` raised for ``data``."""
    walk = _LocationWalk(ExpectedType(model), data)
    for step in loc:
        walk.follow(step)
    return walk.location()


class _LocationWalk:
    """The position in model, data and document after the steps of a location so far."""

    def __init__(self, expected: ExpectedType, data: Any) -> None:
        self._expected: ExpectedType | None = expected
        self._data = data
        self._path: KeyPath = ()
        self._known: tuple[str, ...] = ()
        self._unions: dict[KeyPath, tuple[str, ExpectedType]] = {}

    def location(self) -> ErrorLocation:
        expected = self._expected
        tag_key, tags = ("", ()) if expected is None else _tags(expected)
        return ErrorLocation(
            self._path,
            expected or ExpectedType(Any),
            expected is not None,
            self._known,
            tag_key,
            tags,
            self._unions,
        )

    def follow(self, step: str | int) -> None:
        self._unwrap()
        expected = self._expected
        if expected is None:
            self._guess(step)
        elif len(_members(expected)) > 1:
            self._choose(expected, str(step))
        elif step == "[key]":  # the key itself is invalid, not its value
            self._expected = None
        else:
            self._descend(expected, step)

    def _unwrap(self) -> None:
        """Replace ``X | None`` by X: it adds no step to a location."""
        while self._expected is not None:
            members = _members(self._expected)
            if len(members) != 1:
                return
            bare, metadata = peel(members[0])
            if members[0] is self._expected.annotation or bare is self._expected.annotation:
                return
            self._expected = dataclasses.replace(
                self._expected, annotation=bare, metadata=(*metadata, *self._expected.metadata)
            )

    def _choose(self, union: ExpectedType, label: str) -> None:
        key, _ = _tags(union)
        if not key:
            self._unions[self._path] = (label, union)
        fits = [
            m for m in _members(union) if (label in _tags_of(m, key) if key else _named(m, label))
        ]
        self._expected = ExpectedType(fits[0], (), union.description) if fits else None

    def _descend(self, expected: ExpectedType, step: str | int) -> None:
        bare, _ = peel(expected.annotation)
        origin, args = get_origin(bare) or bare, get_args(bare)
        inner: ExpectedType | None = None
        if is_model(origin):
            fields = _fields(origin)
            self._known = tuple(fields)
            inner = fields.get(str(step))
        elif dataclasses.is_dataclass(origin) or hasattr(origin, "_fields"):
            fields = _hinted(origin)
            self._known = tuple(fields)
            if isinstance(step, int):  # a named tuple, given as a list
                inner = dict(enumerate(fields.values())).get(step)
            else:
                inner = fields.get(str(step))
        elif isinstance(origin, type) and issubclass(origin, Mapping) and len(args) == 2:
            inner = ExpectedType(args[1])
        elif isinstance(origin, type) and issubclass(origin, tuple) and isinstance(step, int):
            same = len(args) == 2 and args[1] is Ellipsis
            inner = (
                ExpectedType(args[0])
                if same
                else ExpectedType(args[step])
                if step < len(args)
                else None
            )
        elif isinstance(step, int) and args:
            inner = ExpectedType(args[0])
        else:
            self._expected = None
            self._guess(step)
            return
        self._step(step)
        self._expected = inner

    def _guess(self, step: str | int) -> None:
        """Without a type to follow: a step is a key if the data has it, otherwise a label."""
        if isinstance(step, int) or (isinstance(self._data, dict) and step in self._data):
            self._step(step)

    def _step(self, step: str | int) -> None:
        self._path = (*self._path, step)
        try:
            self._data = self._data[step]
        except (KeyError, IndexError, TypeError):
            self._data = None


def _members(expected: ExpectedType) -> list[Any]:
    """The members of a union without None, or the type itself."""
    members = members_of(expected.annotation)
    if len(members) == 1:
        return [expected.annotation]
    return [m for m in members if m is not type(None)]


@functools.cache
def _hinted(origin: Any) -> Mapping[str, ExpectedType]:
    """The fields of a dataclass or named tuple."""
    hints = get_type_hints(origin, include_extras=True)
    return {name: ExpectedType(hint) for name, hint in hints.items()}


@functools.cache
def _fields(model: type[BaseModel]) -> Mapping[str, ExpectedType]:
    fields: dict[str, ExpectedType] = {}
    for name, info in model.model_fields.items():
        alias = info.validation_alias if isinstance(info.validation_alias, str) else info.alias
        fields[alias or name] = ExpectedType.of_field(info)
        if alias and model.model_config.get("populate_by_name"):
            fields[name] = ExpectedType.of_field(info)
    return fields


def _tags(expected: ExpectedType) -> tuple[str, tuple[str, ...]]:
    """The discriminating key of a union, and its values; empty for other types."""
    found = expected.discriminator
    for item in (*peel(expected.annotation)[1], *expected.metadata):
        found = found or getattr(item, "discriminator", None)
    while isinstance(found, Discriminator):
        found = found.discriminator
    if found is None or len(_members(expected)) < 2:
        return "", ()
    key = found if isinstance(found, str) else "kind"
    return key, tuple(tag for member in _members(expected) for tag in _tags_of(member, key))


def _tags_of(member: Any, key: str) -> list[str]:
    bare, metadata = peel(member)
    named = [str(item.tag) for item in metadata if isinstance(item, Tag)]
    if named or not is_model(bare):
        return named
    field_ = _fields(bare).get(key)
    return choices_of(field_.annotation) if field_ is not None else []


def _named(member: Any, label: str) -> bool:
    """Whether ``label`` is pydantic's label for ``member`` of a plain union."""
    bare, _ = peel(member)
    origin = get_origin(bare) or bare
    if choices_of(bare):
        return label.startswith(("literal[", "enum", getattr(bare, "__name__", "literal[")))
    name = getattr(origin, "__name__", str(origin))
    if is_model(origin):
        return label == name or f" {name}]" in label
    return label.split("[", maxsplit=1)[0] in {name, f"constrained-{name}"} or f", {name}" in label
