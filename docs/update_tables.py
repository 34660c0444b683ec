"""Write the tables of keys in the pages beside this file anew, from the models themselves.

A table stands between ``<!-- keys: module:Class -->`` and ``<!-- end -->``; the kinds of plugins
between ``<!-- kinds -->`` and ``<!-- end -->``, channels of a recording, and topics
likewise. Run it after a change of a model's fields::

    uv run python docs/update_tables.py
"""

from __future__ import annotations

import importlib
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel

from navfw.config.error_location import describe, is_model, parameters_of
from navfw.interfaces import KINDS
from navfw.recording.channel_list import CHANNELS

DOCS = Path(__file__).parent

_KEYS = re.compile(r"(<!-- keys: ([\w.]+):([\w.]+) -->\n).*?(<!-- end -->)", re.DOTALL)
_PATTERN = re.compile(r"(?<=that matches )\^.*?\$")
_NUMBER = re.compile(r"a (whole )?number((?: (?:and )?[<>]=? [^ ]+)+)")
_SHORTER = (
    (re.compile(r"a mapping to values, each .*"), "mapping"),
    (re.compile(r"true or false"), "boolean"),
    (re.compile(r"(?: and)? with length [<>]= \d+(?: and(?= that))?"), ""),
    (re.compile(r"a list of values, each a list of (\d+) numbers"), r"lists of \1 numbers"),
    (re.compile(r"a list of values, each text or a mapping"), "texts or mappings"),
    (re.compile(r"a list of "), ""),
    (re.compile(r"a mapping(?: to \w+)?"), "mapping"),
    (re.compile(r"a whole number"), "integer"),
    (re.compile(r"a number"), "number"),
    (re.compile(r"one of "), ""),
)
"""How a table shortens the words of error messages, in this order."""
_CHANNELS = re.compile(r"(<!-- channels -->\n).*?(<!-- end -->)", re.DOTALL)
_TOPICS = re.compile(r"(<!-- topics: ([\w.]+) -->\n).*?(<!-- end -->)", re.DOTALL)
_KINDS = re.compile(r"(<!-- kinds -->\n).*?(<!-- end -->)", re.DOTALL)


def renewed(text: str) -> str:
    """``text`` with all its tables as the models have them now."""
    text = _KEYS.sub(lambda m: f"{m[1]}{keys_table(_model(m[2], m[3]))}{m[4]}", text)
    text = _CHANNELS.sub(lambda m: f"{m[1]}{channels_table()}{m[2]}", text)
    text = _TOPICS.sub(lambda m: f"{m[1]}{topics_table(m[2])}{m[3]}", text)
    return _KINDS.sub(lambda m: f"{m[1]}{kinds_table()}{m[2]}", text)


def keys_table(model: type[BaseModel]) -> str:
    """A Markdown table of the keys of ``model``, as files have them."""
    rows = ["| key | value | default | meaning |", "|---|---|---|---|"]
    for parameter in parameters_of(model):
        info = model.model_fields[parameter.name]
        cells = (
            f"`{info.alias or parameter.name}`",
            _described(info.annotation, info.metadata),
            "**required**" if parameter.required else _default(parameter.default),
            parameter.description or _about(parameter.name, info.annotation),
        )
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(rows) + "\n"


def channels_table() -> str:
    """A Markdown table of the channels of a recording."""
    rows = ["| channel | schema | rate | content |", "|---|---|---|---|"]
    rows += [f"| `{c}` | `{c.schema}` | {c.rate} | {c.content} |" for c in CHANNELS]
    return "\n".join(rows) + "\n"


def topics_table(module: str) -> str:
    """A Markdown table of the topics of a node of ROS."""
    rows = ["| topic | type | meaning |", "|---|---|---|"]
    topics = importlib.import_module(module).TOPICS.items()
    rows += [f"| `{name}` | `{kind.split('/')[-1]}` | {text} |" for name, (kind, text) in topics]
    return "\n".join(rows) + "\n"


def kinds_table() -> str:
    """A Markdown table of the kinds of plugins, with the first line of each base class."""
    rows = ["| kind | base class in `navfw` | what it does |", "|---|---|---|"]
    for kind, base in KINDS.items():
        does = (base.__doc__ or "").strip().splitlines()[0]
        rows.append(f"| `{kind}` | `{base.__name__}` | {does} |")
    return "\n".join(rows) + "\n"


def _described(annotation: Any, metadata: list[Any]) -> str:
    """The values of a key; null is not named, since it is the same as to leave the key out."""
    text = describe(annotation, metadata).removesuffix(" or null")
    text = _NUMBER.sub(_interval, text)
    for long, short in _SHORTER:
        text = long.sub(short, text)
    return _PATTERN.sub(lambda pattern: f"`{pattern[0]}`", text)


def _interval(number: re.Match[str]) -> str:
    """Bounds as an interval: ``[0, 1]``, ``(0, 1]`` without 0, ``integer [0, 9]``."""
    bounds = re.findall(r"([<>]=?) ([^ ]+)", number[2])
    low = max(((float(value), sign, value) for sign, value in bounds if ">" in sign), default=None)
    high = min(((float(value), sign, value) for sign, value in bounds if "<" in sign), default=None)
    left = "(-inf" if low is None else f"{'[' if '=' in low[1] else '('}{low[2]}"
    right = "inf)" if high is None else f"{high[2]}{']' if '=' in high[1] else ')'}"
    return f"{'integer ' if number[1] else ''}{left}, {right}"


def _default(value: object) -> str:
    """A default as in a file; empty for null, for what is empty, and for keys of its own."""
    if isinstance(value, dict) or value in (None, "", []):
        return ""
    if isinstance(value, float):
        return f"`{value:.6g}`"
    return f"`{json.dumps(value)}`" if not isinstance(value, str) else f"`{value}`"


def _about(name: str, annotation: Any) -> str:
    """What a key without a description is about: the first line of its kind, or of its model."""
    if name in KINDS:
        return "[plugin](plugins.md)"
    lines = [(model.__doc__ or "").strip().splitlines()[0] for model in _models_in(annotation)]
    return lines[0].removesuffix(".") if lines else ""


def _models_in(annotation: Any) -> Iterator[type]:
    if is_model(annotation):
        yield annotation
    for part in get_args(annotation):
        yield from _models_in(part)


def _model(module: str, path: str) -> type[BaseModel]:
    value: Any = importlib.import_module(module)
    for name in path.split("."):
        value = getattr(value, name)
    if not is_model(value):
        raise TypeError(f"{module}:{path} is no pydantic model")
    model: type[BaseModel] = value
    return model


def main() -> int:
    """Rewrite what has changed; tell which pages those were."""
    for page in (*sorted(DOCS.glob("*.md")), DOCS.parent / "examples/ros/README.md"):
        old = page.read_text(encoding="utf-8")
        new = renewed(old)
        if new != old:
            page.write_text(new, encoding="utf-8")
            sys.stdout.write(f"{page.name}: tables renewed\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
