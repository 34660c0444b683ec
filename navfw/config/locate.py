"""From the location in a pydantic error to the key in the file and the type that is wanted there.

Pydantic's locations mix keys and indices with the labels of union members; the walk here follows
model, data and location together, so that a label is never taken for a key.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, get_args, get_origin, get_type_hints

from pydantic import BaseModel, Discriminator, Tag
from pydantic.fields import FieldInfo

from navfw.config.describe import choices_of, describe, is_model, members_of, peel
from navfw.config.document import KeyPath

__all__ = ["Place", "Wanted", "locate"]


@dataclass(frozen=True)
class Wanted:
    """A type with all that its declaration says about it."""

    annotation: Any
    metadata: tuple[Any, ...] = ()
    description: str = ""
    discriminator: Any = None

    def __str__(self) -> str:
        text = describe(self.annotation, self.metadata)
        return f"{text} ({self.description})" if self.description else text

    @classmethod
    def of_field(cls, info: FieldInfo) -> Wanted:
        """What a field of a model wants."""
        return cls(
            info.annotation, tuple(info.metadata), info.description or "", info.discriminator
        )


@dataclass(frozen=True)
class Place:
    """Where an error is, and what the model wants there."""

    path: KeyPath
    wanted: Wanted
    certain: bool
    """False where the model's type could not be followed down to this place."""
    known_keys: tuple[str, ...] = ()
    """The keys that the enclosing model knows."""
    tag_key: str = ""
    tags: tuple[str, ...] = ()
    """Of a discriminated union: the key that tells the members apart, and its values."""
    unions: Mapping[KeyPath, tuple[str, Wanted]] = field(default_factory=dict)
    """The plain unions on the way: the label of the member taken, and the whole union."""


def locate(loc: Sequence[str | int], data: Any, model: type[BaseModel]) -> Place:
    """Follow ``loc``, the location in an error that ``model`` raised for ``data``."""
    walk = _Walk(Wanted(model), data)
    for step in loc:
        walk.take(step)
    return walk.place()


class _Walk:
    def __init__(self, wanted: Wanted, data: Any) -> None:
        self._wanted: Wanted | None = wanted
        self._data = data
        self._path: KeyPath = ()
        self._known: tuple[str, ...] = ()
        self._unions: dict[KeyPath, tuple[str, Wanted]] = {}

    def place(self) -> Place:
        wanted = self._wanted
        tag_key, tags = ("", ()) if wanted is None else _tags(wanted)
        return Place(
            self._path,
            wanted or Wanted(Any),
            wanted is not None,
            self._known,
            tag_key,
            tags,
            self._unions,
        )

    def take(self, step: str | int) -> None:
        self._unwrap()
        wanted = self._wanted
        if wanted is None:
            self._guess(step)
        elif len(_members(wanted)) > 1:
            self._choose(wanted, str(step))
        elif step == "[key]":  # the key itself is refused, not the value beneath it
            self._wanted = None
        else:
            self._descend(wanted, step)

    def _unwrap(self) -> None:
        """What is optional adds no step to a location."""
        while self._wanted is not None:
            members = _members(self._wanted)
            if len(members) != 1:
                return
            bare, metadata = peel(members[0])
            if members[0] is self._wanted.annotation or bare is self._wanted.annotation:
                return
            self._wanted = dataclasses.replace(
                self._wanted, annotation=bare, metadata=(*metadata, *self._wanted.metadata)
            )

    def _choose(self, union: Wanted, label: str) -> None:
        key, _ = _tags(union)
        if not key:
            self._unions[self._path] = (label, union)
        fits = [
            m for m in _members(union) if (label in _tags_of(m, key) if key else _named(m, label))
        ]
        self._wanted = Wanted(fits[0], (), union.description) if fits else None

    def _descend(self, wanted: Wanted, step: str | int) -> None:
        bare, _ = peel(wanted.annotation)
        origin, args = get_origin(bare) or bare, get_args(bare)
        inner: Wanted | None = None
        if is_model(origin):
            fields = _fields(origin)
            self._known = tuple(fields)
            inner = fields.get(str(step))
        elif dataclasses.is_dataclass(origin) or hasattr(origin, "_fields"):
            hints = {k: Wanted(v) for k, v in get_type_hints(origin, include_extras=True).items()}
            self._known = tuple(hints)
            if isinstance(step, int):  # a named tuple filled by a list
                inner = dict(enumerate(hints.values())).get(step)
            else:
                inner = hints.get(step)
        elif isinstance(origin, type) and issubclass(origin, Mapping) and len(args) == 2:
            inner = Wanted(args[1])
        elif isinstance(origin, type) and issubclass(origin, tuple) and isinstance(step, int):
            same = len(args) == 2 and args[1] is Ellipsis
            inner = Wanted(args[0]) if same else Wanted(args[step]) if step < len(args) else None
        elif isinstance(step, int) and args:
            inner = Wanted(args[0])
        else:
            self._wanted = None
            self._guess(step)
            return
        self._step(step)
        self._wanted = inner

    def _guess(self, step: str | int) -> None:
        """Without a type to follow, a step is a key if the data has it, and a label otherwise."""
        if isinstance(step, int) or (isinstance(self._data, dict) and step in self._data):
            self._step(step)

    def _step(self, step: str | int) -> None:
        self._path = (*self._path, step)
        try:
            self._data = self._data[step]
        except (KeyError, IndexError, TypeError):
            self._data = None


def _members(wanted: Wanted) -> list[Any]:
    """The members of a union without None, or the type itself."""
    members = members_of(wanted.annotation)
    if len(members) == 1:
        return [wanted.annotation]
    return [m for m in members if m is not type(None)]


def _fields(model: type[BaseModel]) -> dict[str, Wanted]:
    fields: dict[str, Wanted] = {}
    for name, info in model.model_fields.items():
        alias = info.validation_alias if isinstance(info.validation_alias, str) else info.alias
        fields[alias or name] = Wanted.of_field(info)
        if alias and model.model_config.get("populate_by_name"):
            fields[name] = Wanted.of_field(info)
    return fields


def _tags(wanted: Wanted) -> tuple[str, tuple[str, ...]]:
    """The key and the values that tell the members of a discriminated union apart."""
    found = wanted.discriminator
    for item in (*peel(wanted.annotation)[1], *wanted.metadata):
        found = found or getattr(item, "discriminator", None)
    while isinstance(found, Discriminator):
        found = found.discriminator
    if found is None or len(_members(wanted)) < 2:
        return "", ()
    key = found if isinstance(found, str) else "kind"
    return key, tuple(tag for member in _members(wanted) for tag in _tags_of(member, key))


def _tags_of(member: Any, key: str) -> list[str]:
    bare, metadata = peel(member)
    named = [str(item.tag) for item in metadata if isinstance(item, Tag)]
    if named or not is_model(bare):
        return named
    field_ = _fields(bare).get(key)
    return choices_of(field_.annotation) if field_ is not None else []


def _named(member: Any, label: str) -> bool:
    """Whether pydantic calls the member of a plain union by this label."""
    bare, _ = peel(member)
    origin = get_origin(bare) or bare
    if choices_of(bare):
        return label.startswith(("literal[", "enum", getattr(bare, "__name__", "literal[")))
    name = getattr(origin, "__name__", str(origin))
    if is_model(origin):
        return label == name or f" {name}]" in label
    return label.split("[", maxsplit=1)[0] in {name, f"constrained-{name}"} or f", {name}" in label
