"""Pydantic's validation errors in our words: where, what was expected, what is there instead."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sized
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from navfw.config.describe import choices_of, members_of
from navfw.config.document import KeyPath, Origin, YamlDocument, key_text
from navfw.config.locate import Place, Wanted, locate
from navfw.errors import ConfigError, did_you_mean

__all__ = ["Problem", "config_error", "explain"]


@dataclass(frozen=True)
class Problem:
    """One thing wrong in a document."""

    path: KeyPath
    message: str
    origin: Origin

    def error(self) -> ConfigError:
        """It alone as an error."""
        return ConfigError(
            self.message, file=self.origin.file, line=self.origin.line, key=self.key or None
        )

    @property
    def key(self) -> str:
        """The key, after the option of the command line that it comes from, if any."""
        return self.origin.option or key_text(self.path)


def config_error(problems: list[Problem]) -> ConfigError:
    """One error for all ``problems`` (at least one), in the order of the file, one a line."""
    ordered = sorted(problems, key=lambda p: (p.origin.option is not None, p.origin.line or 0))
    first, *others = ordered
    message = "\n".join([first.message, *(str(other.error()) for other in others)])
    return ConfigError(
        message, file=first.origin.file, line=first.origin.line, key=first.key or None
    )


def explain(
    error: ValidationError, document: YamlDocument, model: type[BaseModel], at: KeyPath = ()
) -> list[Problem]:
    """The problems of the part of ``document`` at ``at``, which failed to become a ``model``."""
    data = document.at(at)
    found: list[tuple[ErrorDetails, Place]] = [
        (detail, locate(detail["loc"], {} if data is None else data, model))
        for detail in error.errors(include_url=False)
        if not _is_echo(detail)
    ]
    problems: list[Problem] = []
    for detail, place in _decide_unions(found):
        path = (*at, *place.path)
        if detail["type"] == "union_tag_invalid":
            path = (*path, place.tag_key)
        message = _message(detail, place)
        origin = document.origin_of(path)
        if origin.option is not None:
            shown = key_text(path)
            given = origin.option.removeprefix("--set ").partition("=")[0]
            message = message if given == shown else f"{shown}: {message}"
        else:
            message += _blame(document, path, detail)
        problem = Problem(path, message, origin)
        if problem not in problems:
            problems.append(problem)
    return problems


def _is_echo(detail: ErrorDetails) -> bool:
    """Whether a list is called short only since pydantic does not count its bad items."""
    return (
        detail["type"] == "too_short"
        and len(detail["input"]) >= detail.get("ctx", {})["min_length"]
    )


def _message(detail: ErrorDetails, place: Place) -> str:
    given = detail["input"]
    context: Mapping[str, Any] = detail.get("ctx", {})
    wanted = place.wanted
    match detail["type"]:
        case "missing":
            text = f"missing; expected {wanted}"
        case "extra_forbidden":
            text = f"unknown key; {did_you_mean(str(place.path[-1]), place.known_keys)}"
        case "union_tag_not_found":
            text = f"missing {place.tag_key!r}; expected one of {', '.join(place.tags)}"
        case "union_tag_invalid":
            tag = str(context.get("tag", ""))
            text = f"unknown {place.tag_key} {tag!r}: {did_you_mean(tag, place.tags)}"
        case "value_error" | "assertion_error":
            text = str(context.get("error") or detail["msg"])
        case "too_short" | "too_long" if place.certain and isinstance(given, Sized):
            text = f"expected {wanted}, got {len(given)} items"
        case _ if not place.certain:
            text = f"{detail['msg'][:1].lower()}{detail['msg'][1:]}, got {shown(given)}"
        case _:
            text = f"expected {wanted}, got {shown(given)}{_hint(detail, wanted)}"
    return text


def _hint(detail: ErrorDetails, wanted: Wanted) -> str:
    given = detail["input"]
    choices = [c for member in members_of(wanted.annotation) for c in choices_of(member)]
    if choices and isinstance(given, str):
        return f"; {did_you_mean(given, choices)}"
    if detail["type"] == "string_type" and isinstance(given, bool | int | float):
        return "; quote it to make it text"
    return ""


def shown(value: object) -> str:
    """A value as a person would call it; long ones shortened."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f"the text {_short(repr(value))}"
    if isinstance(value, Mapping):
        return "a mapping" if value else "an empty mapping"
    if isinstance(value, list | tuple):
        return "an empty list" if not value else f"the list {_short(repr(list(value)))}"
    return _short(repr(value))


def _short(text: str) -> str:
    return text if len(text) <= 60 else text[:57] + "..."


def _blame(document: YamlDocument, path: KeyPath, detail: ErrorDetails) -> str:
    """The options that reach into a part that is wrong as a whole."""
    if detail["type"] not in {"value_error", "assertion_error"}:
        return ""
    options = {
        origin.option
        for known, origin in document.origins.items()
        if origin.option is not None and known[: len(path)] == path
    }
    return f" (with {', '.join(sorted(options))})" if options else ""


def _decide_unions(
    found: list[tuple[ErrorDetails, Place]],
) -> Iterator[tuple[ErrorDetails, Place]]:
    """Pydantic tells the errors of every member of a union; keep those of the best-fitting one.

    A member that accepts the outer form and fails deeper inside was meant, rather than one that
    refuses the form at once. When all refuse at once, one error names all members.
    """
    unions: dict[KeyPath, dict[str, list[int]]] = {}
    for index, (_, place) in enumerate(found):
        for union, (label, _whole) in place.unions.items():
            unions.setdefault(union, {}).setdefault(label, []).append(index)
    dropped: set[int] = set()
    merged: dict[int, Place] = {}
    for union, by_label in unions.items():
        deep = {
            label: indices
            for label, indices in by_label.items()
            if all(_is_deep(*found[i], union) for i in indices)
        }
        if deep:
            meant = min(deep, key=lambda label: len(deep[label]))
            for label, indices in by_label.items():
                dropped.update(indices if label != meant else ())
        elif len(by_label) > 1:
            indices = sorted(i for group in by_label.values() for i in group)
            dropped.update(indices[1:])
            place = found[indices[0]][1]
            merged[indices[0]] = Place(union, place.unions[union][1], certain=True)
    for index, (detail, place) in enumerate(found):
        if index in merged:
            yield {**detail, "type": "union"}, merged[index]
        elif index not in dropped:
            yield detail, place


def _is_deep(detail: ErrorDetails, place: Place, union: KeyPath) -> bool:
    return len(place.path) > len(union) or not detail["type"].endswith(("_type", "_parsing"))
