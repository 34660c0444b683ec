"""The numbers in the models of files, each with its bounds, found from the models themselves."""

from __future__ import annotations

import typing
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

__all__ = ["BoundedNumber", "numbers_of"]


@dataclass(frozen=True)
class BoundedNumber:
    """A number of a model: where it is, and its least and largest value (None: unbounded).

    ``path`` leads to it from the outermost model; ``[]`` stands for an item of a list or mapping.
    ``item`` is its index in a tuple of fixed length, None for a number by itself.
    """

    model: type[BaseModel]
    path: tuple[str, ...]
    whole: bool
    least: float | None
    most: float | None
    open_least: bool = False
    open_most: bool = False

    @property
    def key(self) -> str:
        return ".".join(self.path)

    @property
    def field(self) -> str:
        return next(step for step in reversed(self.path) if step != "[]")

    @property
    def ends(self) -> tuple[float, float]:
        """The least and largest values inside; just inside of ends that are excluded."""
        assert self.least is not None, f"{self.key} has no lower bound"
        assert self.most is not None, f"{self.key} has no upper bound"
        inset = 1e-6 * (self.most - self.least)
        ends = self.least + self.open_least * inset, self.most - self.open_most * inset
        return (round(ends[0]), round(ends[1])) if self.whole else ends


def numbers_of(model: type[BaseModel], path: tuple[str, ...] = ()) -> Iterator[BoundedNumber]:
    """All numbers of ``model`` and of the models in it."""
    for name, info in model.model_fields.items():
        here = (*path, info.alias or name)
        yield from _numbers(model, here, info.annotation, _limits(info.metadata))


Limits = Mapping[str, float]


def _numbers(
    model: type[BaseModel], path: tuple[str, ...], annotation: Any, limits: Limits
) -> Iterator[BoundedNumber]:
    origin, args = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Annotated:
        yield from _numbers(model, path, args[0], {**_limits(args[1:]), **limits})
    elif annotation in (int, float):
        least, most = limits.get("ge", limits.get("gt")), limits.get("le", limits.get("lt"))
        yield BoundedNumber(
            model, path, annotation is int, least, most, "gt" in limits, "lt" in limits
        )
    elif isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield from numbers_of(annotation, path)
    elif origin is typing.Literal:
        return
    elif args:
        inner = [arg for arg in args if arg is not Ellipsis]
        collection = isinstance(origin, type)  # a list, tuple or mapping, not a union
        for arg in inner:
            yield from _numbers(model, (*path, "[]") if collection else path, arg, limits)


def _limits(metadata: typing.Iterable[Any]) -> dict[str, float]:
    found: dict[str, float] = {}
    for item in metadata:
        if isinstance(item, FieldInfo):
            found |= _limits(item.metadata)
        for key in ("ge", "gt", "le", "lt"):
            value = getattr(item, key, None)
            if value is not None:
                found[key] = value
    return found
