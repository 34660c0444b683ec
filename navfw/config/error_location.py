"""From the location in a pydantic error to the key in the file and the type expected there.

Pydantic's locations mix keys and indices with the labels of union members. The walk here follows
model, data and location together, and so tells labels from keys.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, get_args, get_origin, get_type_hints

from pydantic import BaseModel, Discriminator, Tag

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


@dataclass
class ErrorLocation:
    """Where an error is in the document, and what the model expects there."""

    data: Any
    expected: ExpectedType
    path: KeyPath = ()
    certain: bool = True
    """False where the types of the model could not be followed down to ``path``."""
    known_keys: tuple[str, ...] = ()
    """The keys of the enclosing model."""
    unions: dict[KeyPath, tuple[str, ExpectedType]] = field(default_factory=dict)
    """The plain unions along ``path``: the label of the member in the location, and the union."""

    @property
    def tags(self) -> tuple[str, tuple[str, ...]]:
        """Of a discriminated union the discriminating key and its values, else nothing."""
        return _tags(self.expected) if self.certain else ("", ())

    def follow(self, step: str | int) -> None:
        """Go on by one step of pydantic's location."""
        self._unwrap()
        if not self.certain:
            self._guess(step)
        elif len(_members(self.expected)) > 1:
            self._choose(str(step))
        elif step == "[key]":  # the key itself is invalid, not its value
            self._expect(None)
        else:
            self._descend(step)

    def _expect(self, expected: ExpectedType | None) -> None:
        self.certain = expected is not None
        self.expected = expected or ExpectedType(Any)

    def _unwrap(self) -> None:
        """Replace ``X | None`` by X: it adds no step to a location."""
        while len(members := _members(self.expected)) == 1:
            bare, metadata = peel(members[0])
            if members[0] is self.expected.annotation or bare is self.expected.annotation:
                return
            metadata += self.expected.metadata
            self.expected = replace(self.expected, annotation=bare, metadata=metadata)

    def _choose(self, label: str) -> None:
        """Go on with the member of a union that has the ``label``."""
        union = self.expected
        key, _ = _tags(union)
        if not key:
            self.unions[self.path] = (label, union)
        fits = [
            m for m in _members(union) if (label in _tags_of(m, key) if key else _named(m, label))
        ]
        self._expect(ExpectedType(fits[0], (), union.description) if fits else None)

    def _descend(self, step: str | int) -> None:
        bare, _ = peel(self.expected.annotation)
        origin, args = get_origin(bare) or bare, get_args(bare)
        fields = _fields_of(origin)
        inner: ExpectedType | None = None
        if fields is not None:
            self.known_keys = tuple(fields)
            # an index: of a named tuple, given as a list
            values = dict(enumerate(fields.values()))
            inner = values.get(step) if isinstance(step, int) else fields.get(step)
        elif isinstance(origin, type) and issubclass(origin, Mapping) and len(args) == 2:
            inner = ExpectedType(args[1])
        elif isinstance(origin, type) and issubclass(origin, tuple) and isinstance(step, int):
            of_items = args[:1] * (step + 1) if args[1:] == (Ellipsis,) else args
            inner = ExpectedType(of_items[step]) if step < len(of_items) else None
        elif isinstance(step, int) and args:
            inner = ExpectedType(args[0])
        else:
            self._expect(None)
            self._guess(step)
            return
        self._step(step)
        self._expect(inner)

    def _guess(self, step: str | int) -> None:
        """Without a type to follow: a step is a key if the data has it, otherwise a label."""
        if isinstance(step, int) or (isinstance(self.data, dict) and step in self.data):
            self._step(step)

    def _step(self, step: str | int) -> None:
        self.path = (*self.path, step)
        try:
            self.data = self.data[step]
        except (KeyError, IndexError, TypeError):
            self.data = None


def locate(loc: Sequence[str | int], data: Any, model: type[BaseModel]) -> ErrorLocation:
    """Follow ``loc``, the location in an error that ``model`` raised for ``data``."""
    location = ErrorLocation(data, ExpectedType(model))
    for step in loc:
        location.follow(step)
    return location


def _members(expected: ExpectedType) -> list[Any]:
    """The members of a union without None, or the type itself."""
    members = members_of(expected.annotation)
    if len(members) == 1:
        return [expected.annotation]
    return [m for m in members if m is not type(None)]


@functools.cache
def _fields_of(origin: Any) -> Mapping[str, ExpectedType] | None:
    """The fields of a model, dataclass or named tuple by key; None of any other type."""
    if not is_model(origin):
        if not (dataclasses.is_dataclass(origin) or hasattr(origin, "_fields")):
            return None
        hints = get_type_hints(origin, include_extras=True)
        return {name: ExpectedType(hint) for name, hint in hints.items()}
    fields: dict[str, ExpectedType] = {}
    for name, info in origin.model_fields.items():
        alias = info.validation_alias if isinstance(info.validation_alias, str) else info.alias
        keys = {alias or name}
        if origin.model_config.get("populate_by_name"):
            keys.add(name)
        details = tuple(info.metadata), info.description or "", info.discriminator
        fields |= dict.fromkeys(keys, ExpectedType(info.annotation, *details))
    return fields


def _tags(expected: ExpectedType) -> tuple[str, tuple[str, ...]]:
    """The discriminating key of a union, and its values; empty for other types."""
    key = expected.discriminator
    for item in (*peel(expected.annotation)[1], *expected.metadata):
        key = key or getattr(item, "discriminator", None)
    while isinstance(key, Discriminator):
        key = key.discriminator
    if key is None or len(_members(expected)) < 2:
        return "", ()
    key = key if isinstance(key, str) else "kind"
    return key, tuple(tag for member in _members(expected) for tag in _tags_of(member, key))


def _tags_of(member: Any, key: str) -> list[str]:
    bare, metadata = peel(member)
    named = [str(item.tag) for item in metadata if isinstance(item, Tag)]
    if named or not is_model(bare):
        return named
    expected = (_fields_of(bare) or {}).get(key)
    return choices_of(expected.annotation) if expected is not None else []


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
