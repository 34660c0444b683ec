"""Validates a YAML file as a pydantic model; one error lists all its problems.

>>> world = validate(load_yaml("worlds/office/world.yaml"), WorldSpec)  # doctest: +SKIP

Pydantic's errors are reworded: file, line, key, expected value, and actual value.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Mapping, Sequence, Sized
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from navfw.config.document import Origin, YamlDocument
from navfw.config.error_location import ErrorLocation, ExpectedType, choices_of, locate, members_of
from navfw.config.yaml_text import KeyPath, key_text
from navfw.errors import ConfigError, did_you_mean

MAX_LISTED = 50
"""Largest number of problems that one error lists; the rest is counted."""


@dataclass(frozen=True)
class FileProblem:
    """An error in a document: the path of the key, the message, and the value's origin."""

    path: KeyPath
    message: str
    origin: Origin

    def error(self) -> ConfigError:
        """Make the error for this problem only."""
        return ConfigError(
            self.message, file=self.origin.file, line=self.origin.line, key=self.key or None
        )

    @property
    def key(self) -> str:
        """The command-line option that set the value, or else the key in the file."""
        return self.origin.option or key_text(self.path)


def config_error(problems: Sequence[FileProblem]) -> ConfigError:
    """Make one error for ``problems`` (at least one), one per line, in the order of the file.

    The first ``MAX_LISTED`` are listed, the others counted.
    """
    ordered = sorted(problems, key=_order)
    first, *others = ordered[:MAX_LISTED]
    lines = [first.message, *(str(other.error()) for other in others)]
    if len(ordered) > MAX_LISTED:
        lines.append(f"and {len(ordered) - MAX_LISTED} more")
    return dataclasses.replace(first, message="\n".join(lines)).error()


@contextmanager
def rewording(what: str = "", prefix: str = "", file: str | Path | None = None) -> Iterator[None]:
    """Context that turns a ValidationError into a ConfigError on the first wrong key of ``file``.

    ``what`` begins its message, ``prefix`` the key. Use it for data that have no lines.
    """
    try:
        yield
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = prefix + key_text(first["loc"])
        raise ConfigError(f"{what}{first['msg']}", file=file, key=key or None) from None


def _order(problem: FileProblem) -> tuple[bool, int]:
    """Return the order in which problems are listed: by lines of the file, then options."""
    return problem.origin.option is not None, problem.origin.line or 0


def _with_option(document: YamlDocument, problem: FileProblem, detail: ErrorDetails) -> FileProblem:
    """Return ``problem`` with the option of the command line that is its cause."""
    option, message, key = problem.origin.option, problem.message, key_text(problem.path)
    if option is None:
        message += _responsible_options(document, problem.path, detail)
    elif option.removeprefix("--set ").partition("=")[0] != key:
        message = f"{key}: {message}"
    return dataclasses.replace(problem, message=message)


def _is_echo(detail: ErrorDetails) -> bool:
    """Whether a list counts as too short only because pydantic leaves out its invalid items."""
    return (
        detail["type"] == "too_short"
        and len(detail["input"]) >= detail.get("ctx", {})["min_length"]
    )


def _message(detail: ErrorDetails, location: ErrorLocation) -> str:
    value = detail["input"]
    context: Mapping[str, Any] = detail.get("ctx", {})
    expected = location.expected
    match detail["type"]:
        case "missing":
            text = f"missing; expected {expected}"
        case "extra_forbidden":
            text = f"unknown key; {did_you_mean(str(location.path[-1]), location.known_keys)}"
        case "value_error" | "assertion_error":
            text = str(context.get("error") or detail["msg"])
        case "too_short" | "too_long" if location.certain and isinstance(value, Sized):
            text = f"expected {expected}, got {len(value)} items"
        case _ if not location.certain:
            text = f"{detail['msg'][:1].lower()}{detail['msg'][1:]}, got {shown(value)}"
        case _:
            text = f"expected {expected}, got {shown(value)}{_hint(detail, expected)}"
    return text


def _hint(detail: ErrorDetails, expected: ExpectedType) -> str:
    value = detail["input"]
    choices = [c for member in members_of(expected.annotation) for c in choices_of(member)]
    if choices and isinstance(value, str):
        return f"; {did_you_mean(value, choices)}"
    if detail["type"] == "string_type" and isinstance(value, bool | int | float):
        return "; quote it to make it text"
    return ""


def shown(value: object) -> str:
    """Format a value as error messages show it; long ones are shortened."""
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


def _responsible_options(document: YamlDocument, path: KeyPath, detail: ErrorDetails) -> str:
    """Return the command line options inside a part that is invalid as a whole, as a suffix."""
    if detail["type"] not in {"value_error", "assertion_error"}:
        return ""
    options = {
        origin.option
        for part, origin in document.origins.items()
        if origin.option is not None and part[: len(path)] == path
    }
    return f" (with {', '.join(sorted(options))})" if options else ""


def _resolve_unions(
    errors: list[tuple[ErrorDetails, ErrorLocation]],
) -> Iterator[tuple[ErrorDetails, ErrorLocation]]:
    """Keep, of the errors that pydantic reports for each member of a union, those of one member.

    A member that accepts the outer form and fails deeper inside is preferred; of several, the one
    with the fewest errors. When all members fail at once, one error names them all.
    """
    unions: dict[KeyPath, dict[str, list[int]]] = {}
    for index, (_, location) in enumerate(errors):
        for union, (label, _) in location.unions.items():
            unions.setdefault(union, {}).setdefault(label, []).append(index)
    dropped: set[int] = set()
    merged: dict[int, ErrorLocation] = {}
    for union, by_label in unions.items():
        deep = {
            label: indices
            for label, indices in by_label.items()
            if all(
                len(errors[i][1].path) > len(union)
                or not errors[i][0]["type"].endswith(("_type", "_parsing"))
                for i in indices
            )
        }
        if deep:
            meant = min(deep, key=lambda label: len(deep[label]))
            for label, indices in by_label.items():
                dropped.update(indices if label != meant else ())
        elif len(by_label) > 1:
            indices = sorted(i for group in by_label.values() for i in group)
            dropped.update(indices[1:])
            expected = errors[indices[0]][1].unions[union][1]
            merged[indices[0]] = ErrorLocation(None, expected, union)
    for index, (detail, location) in enumerate(errors):
        if index in merged:
            yield {**detail, "type": "union"}, merged[index]
        elif index not in dropped:
            yield detail, location


ModelT = TypeVar("ModelT", bound=BaseModel)


def validate(document: YamlDocument, model: type[ModelT], at: KeyPath = ()) -> ModelT:
    """Validate the part of ``document`` at path ``at`` as a ``model``; null counts as empty.

    Raises:
        ConfigError: the message lists every problem with file, line and key.

    """
    result, problems = check(document, model, at)
    if result is None:
        raise config_error(problems)
    return result


def check(
    document: YamlDocument, model: type[ModelT], at: KeyPath = ()
) -> tuple[ModelT | None, list[FileProblem]]:
    """Validate like ``validate``, but return the problems, in the order of the file."""
    data = document.at(at)
    data = {} if data is None else data
    try:
        # Strict: text is not converted to a number, nor a truth value to 1. Through JSON, because
        # strict JSON mode accepts a list for a tuple and text for an enum.
        return model.model_validate_json(json.dumps(data), strict=True), []
    except ValidationError as error:
        located: list[tuple[ErrorDetails, ErrorLocation]] = [
            (detail, locate(detail["loc"], data, model))
            for detail in error.errors(include_url=False)
            if not _is_echo(detail)
        ]
    problems: dict[FileProblem, None] = {}  # an ordered set
    for detail, location in _resolve_unions(located):
        path = (*at, *location.path)
        problem = FileProblem(path, _message(detail, location), document.origin_of(path))
        problems[_with_option(document, problem, detail)] = None
    return None, sorted(problems, key=_order)
