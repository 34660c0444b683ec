"""The types, bounds and defaults of pydantic fields in words."""

from __future__ import annotations

import enum
import types
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from pydantic import BaseModel, RootModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticSerializationError, PydanticUndefined, to_jsonable_python

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
    """One field of a parameter model, for listings.

    ``type`` is in Python's notation, ``default`` plain JSON data, ``bounds`` in words.
    """

    name: str
    type: str
    default: Any
    required: bool
    bounds: str
    description: str


def peel(annotation: Any) -> tuple[Any, tuple[Any, ...]]:
    """``annotation`` without its ``Annotated`` layers, aliases and root models; their metadata."""
    metadata: tuple[Any, ...] = ()
    while True:
        if get_origin(annotation) is Annotated:
            annotation, *extra = get_args(annotation)
            for item in extra:
                metadata += tuple(item.metadata) if isinstance(item, FieldInfo) else ()
            metadata += tuple(extra)
        elif hasattr(annotation, "__value__"):  # a ``type`` alias
            annotation = annotation.__value__
        elif is_model(annotation) and issubclass(annotation, RootModel):
            root = annotation.model_fields["root"]
            annotation, metadata = root.annotation, (*metadata, *root.metadata)
        else:
            return annotation, metadata


def members_of(annotation: Any) -> tuple[Any, ...]:
    """The members of a union, nested ones flattened; for another type, the type alone."""
    bare, _ = peel(annotation)
    if get_origin(bare) in {Union, types.UnionType}:
        return tuple(part for arg in get_args(bare) for part in members_of(arg))
    return (annotation,)


def is_model(annotation: Any) -> bool:
    """Whether ``annotation`` is a pydantic model."""
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def choices_of(annotation: Any) -> list[str]:
    """The values that a Literal or an Enum allows, as text; empty for other types."""
    bare, _ = peel(annotation)
    if get_origin(bare) is Literal:
        return [str(a.value if isinstance(a, enum.Enum) else a) for a in get_args(bare)]
    if isinstance(bare, type) and issubclass(bare, enum.Enum):
        return [str(member.value) for member in bare]
    return []


def describe(annotation: Any, metadata: Iterable[Any] = ()) -> str:
    """A type in words with its bounds: ``a number > 0``, ``a list of 2 numbers``."""
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
    if issubclass(origin, tuple):
        return _tuple(origin, args)
    if issubclass(origin, Sequence | set | frozenset):
        return f"a list of {_plural(args[0])}" if args else "a list"
    return origin.__name__


def _tuple(origin: type[tuple[Any, ...]], args: tuple[Any, ...]) -> str:
    names = getattr(origin, "_fields", None)
    if names is not None:
        return f"a list of {len(names)} values"
    if not args:
        return "a list"
    if args[-1] is Ellipsis:
        return f"a list of {_plural(args[0])}"
    parts = dict.fromkeys(_plural(arg) for arg in args)
    return f"a list of {len(args)} {' and '.join(parts)}"


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
    """Every field of ``model``: name, type, default, bounds and description."""
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
    """``value`` as JSON data, or as text where JSON has no such type."""
    if value is PydanticUndefined:
        return None
    try:
        return to_jsonable_python(value, inf_nan_mode="strings")
    except PydanticSerializationError:
        return str(value)
