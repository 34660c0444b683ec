"""Describes types, bounds and defaults of pydantic fields, and finds the places of errors in files.

From the location in a pydantic error it derives the key in the file and the type expected there.
"""

from __future__ import annotations

import enum
import functools
import types
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticSerializationError, PydanticUndefined, to_jsonable_python

from navfw.config.yaml_text import KeyPath

_PLAIN: Mapping[Any, str] = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "text",
    Path: "a path",
    type(None): "null",
    Any: "anything",
}


class Parameter(NamedTuple):
    """A field of a parameter model, for listings.

    ``type`` is in Python's notation, ``default`` plain JSON data, ``bounds`` in words.
    """

    name: str
    type: str
    default: Any
    required: bool
    bounds: str
    description: str


def peel(annotation: Any) -> tuple[Any, tuple[Any, ...]]:
    """Return ``annotation`` without its ``Annotated`` layers, and their metadata."""
    metadata: tuple[Any, ...] = ()
    while get_origin(annotation) is Annotated:
        annotation, *extra = get_args(annotation)
        for item in extra:
            metadata += tuple(item.metadata) if isinstance(item, FieldInfo) else ()
        metadata += tuple(extra)
    return annotation, metadata


def members_of(annotation: Any) -> tuple[Any, ...]:
    """Return the members of a union, nested ones flattened; of another type, the type itself."""
    bare, _ = peel(annotation)
    if get_origin(bare) in {Union, types.UnionType}:
        return tuple(part for arg in get_args(bare) for part in members_of(arg))
    return (annotation,)


def is_model(annotation: Any) -> bool:
    """Whether ``annotation`` is a pydantic model."""
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def choices_of(annotation: Any) -> list[str]:
    """List the values that a Literal or an Enum allows, as text; empty for other types."""
    bare, _ = peel(annotation)
    if get_origin(bare) is Literal:
        return [str(a.value if isinstance(a, enum.Enum) else a) for a in get_args(bare)]
    if isinstance(bare, type) and issubclass(bare, enum.Enum):
        return [str(member.value) for member in bare]
    return []


def describe(annotation: Any, metadata: Iterable[Any] = ()) -> str:
    """Describe a type with its bounds in words: ``a number > 0``, ``a list of 2 numbers``."""
    members = members_of(annotation)
    if len(members) == 1:
        return _describe_one(annotation, tuple(metadata))
    return " or ".join(dict.fromkeys(_describe_one(member, ()) for member in members))


def _describe_one(annotation: Any, metadata: tuple[Any, ...]) -> str:
    bare, own = peel(annotation)
    bounds = _bounds_of((*own, *metadata))
    choices = choices_of(bare)
    if choices:
        return choices[0] if len(choices) == 1 else "one of " + ", ".join(choices)
    text = _PLAIN.get(bare) or _container(bare)
    return f"{text} {bounds}" if bounds else text


def _container(bare: Any) -> str:
    origin, args = get_origin(bare) or bare, get_args(bare)
    if not isinstance(origin, type):
        return str(getattr(bare, "__name__", bare))
    if issubclass(origin, BaseModel | Mapping):
        has_values = len(args) == 2 and args[1] is not Any
        return f"a mapping to {_plural(args[1])}" if has_values else "a mapping"
    if issubclass(origin, tuple) and args and args[-1] is not Ellipsis:
        parts = dict.fromkeys(_plural(arg) for arg in args)
        return f"a list of {len(args)} {' and '.join(parts)}"
    if issubclass(origin, Sequence | set | frozenset):
        return f"a list of {_plural(args[0])}" if args else "a list"
    return origin.__name__


def _plural(annotation: Any) -> str:
    bare, _ = peel(annotation)
    plurals = {int: "whole numbers", float: "numbers", str: "texts", bool: "truth values"}
    if bare in plurals:
        return plurals[bare]
    if is_model(bare):
        return "mappings"
    return f"values, each {describe(annotation)}"


_BOUNDS = {
    "gt": ">",
    "ge": ">=",
    "lt": "<",
    "le": "<=",
    "multiple_of": "a multiple of",
    "min_length": "with length >=",
    "max_length": "with length <=",
    "pattern": "that matches",
}


def _bounds_of(metadata: Iterable[Any]) -> str:
    """Bounds in words: ``>= 1 and < 5``, ``with length >= 2``; empty when there are none."""
    words: list[str] = []
    for item in metadata:
        for name, meaning in _BOUNDS.items():
            bound = getattr(item, name, None)
            if isinstance(bound, float):
                words.append(f"{meaning} {bound:g}")
            elif bound is not None:
                words.append(f"{meaning} {getattr(bound, 'pattern', bound)}")
    return " and ".join(dict.fromkeys(words))


def parameters_of(model: type[BaseModel]) -> list[Parameter]:
    """List every field of ``model``: name, type, default, bounds and description."""
    return [_parameter(name, info) for name, info in model.model_fields.items()]


def _parameter(name: str, info: FieldInfo) -> Parameter:
    bare, own = peel(info.annotation)
    default: Any = None
    if not info.is_required():
        # a factory that computes from the other fields has no fixed default
        computed = info.default_factory_takes_validated_data
        default = _plain(info.default if computed else info.get_default(call_default_factory=True))
    metadata = (*own, *info.metadata)
    members = members_of(bare)
    if not metadata and len(members) > 1:
        metadata = tuple(m for member in members for m in peel(member)[1])
    return Parameter(
        name=name,
        type=" | ".join(dict.fromkeys(_type_name(member) for member in members)),
        default=default,
        required=info.is_required(),
        bounds=_bounds_of(metadata),
        description=info.description or "",
    )


def _type_name(annotation: Any) -> str:
    """A type in Python's notation: ``float``, ``tuple[float, float]``; choices as ``a | b``."""
    bare, _ = peel(annotation)
    choices = choices_of(bare)
    if choices:
        return " | ".join(choices)
    if bare is type(None):
        return "None"
    if bare is Ellipsis:
        return "..."
    origin, args = get_origin(bare), get_args(bare)
    if origin is None or not args:
        return str(getattr(bare, "__name__", bare))
    if len(members_of(bare)) > 1:
        return " | ".join(_type_name(member) for member in members_of(bare))
    inner = ", ".join(_type_name(arg) for arg in args)
    return f"{getattr(origin, '__name__', origin)}[{inner}]"


def _plain(value: Any) -> Any:
    """Return ``value`` as JSON data, or as text where JSON has no such type."""
    if value is PydanticUndefined:
        return None
    try:
        return to_jsonable_python(value, inf_nan_mode="strings")
    except PydanticSerializationError:
        return str(value)


@dataclass(frozen=True)
class ExpectedType:
    """A type, with the metadata and description of its declaration."""

    annotation: Any
    metadata: tuple[Any, ...] = ()
    description: str = ""

    def __str__(self) -> str:
        text = describe(self.annotation, self.metadata)
        named = (getattr(item, "description", "") for item in peel(self.annotation)[1])
        about = self.description or next(filter(None, named), "")
        return f"{text} {about if about[:1] == '[' else f'({about})'}" if about else text


@dataclass
class ErrorLocation:
    """The place of an error in a document, and the type that the model expects there."""

    data: Any
    expected: ExpectedType
    path: KeyPath = ()
    certain: bool = True
    """False if the types of the model could not be followed down to ``path``."""
    known_keys: tuple[str, ...] = ()
    """The keys of the enclosing model."""
    unions: dict[KeyPath, tuple[str, ExpectedType]] = field(default_factory=dict)
    """The unions along ``path``: the label of the chosen member, and the union."""

    def follow(self, step: str | int) -> None:
        """Go one step farther along pydantic's location."""
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
        self.unions[self.path] = (label, union)
        fits = [member for member in _members(union) if _named(member, label)]
        self._expect(ExpectedType(fits[0], (), union.description) if fits else None)

    def _descend(self, step: str | int) -> None:
        bare, _ = peel(self.expected.annotation)
        origin, args = get_origin(bare) or bare, get_args(bare)
        inner: ExpectedType | None = None
        if is_model(origin):
            fields = _fields_of(origin)
            self.known_keys = tuple(fields)
            inner = fields.get(str(step))
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
    """Return the members of a union without None, or the type itself."""
    members = members_of(expected.annotation)
    if len(members) == 1:
        return [expected.annotation]
    return [m for m in members if m is not type(None)]


@functools.cache
def _fields_of(model: type[BaseModel]) -> Mapping[str, ExpectedType]:
    """Return the fields of a model by key."""
    return {
        info.alias or name: ExpectedType(
            info.annotation, tuple(info.metadata), info.description or ""
        )
        for name, info in model.model_fields.items()
    }


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
