"""Write the tables of keys in the pages beside this file anew, from the models themselves.

A table stands between ``<!-- keys: module:Class -->`` and ``<!-- end -->``; the kinds of plugins
between ``<!-- kinds -->`` and ``<!-- end -->``, and the channels of a recording likewise. Run it
after a change of a model's fields::

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

from navfw.config.type_descriptions import describe, is_model, parameters_of
from navfw.interfaces import KINDS
from navfw.recording.channel_list import CHANNELS

DOCS = Path(__file__).parent

_KEYS = re.compile(r"(<!-- keys: ([\w.]+):([\w.]+) -->\n).*?(<!-- end -->)", re.DOTALL)
_NESTED = re.compile(r"a mapping to values, each .*")
_PATTERN = re.compile(r"(?<=that matches )\^.*?\$")
_CHANNELS = re.compile(r"(<!-- channels -->\n).*?(<!-- end -->)", re.DOTALL)
_KINDS = re.compile(r"(<!-- kinds -->\n).*?(<!-- end -->)", re.DOTALL)


def renewed(text: str) -> str:
    """``text`` with all its tables as the models have them now."""
    text = _KEYS.sub(lambda m: f"{m[1]}{keys_table(_model(m[2], m[3]))}{m[4]}", text)
    text = _CHANNELS.sub(lambda m: f"{m[1]}{channels_table()}{m[2]}", text)
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
    rows += [f"| `{c.topic}` | `{c.schema}` | {c.rate} | {c.content} |" for c in CHANNELS]
    return "\n".join(rows) + "\n"


def kinds_table() -> str:
    """A Markdown table of the kinds of plugins, with the first line of each base class."""
    rows = ["| kind | base class in `navfw` | what it does |", "|---|---|---|"]
    for kind, base in KINDS.items():
        does = (base.__doc__ or "").strip().splitlines()[0]
        rows.append(f"| `{kind}` | `{base.__name__}` | {does} |")
    return "\n".join(rows) + "\n"


def _described(annotation: Any, metadata: list[Any]) -> str:
    text = _NESTED.sub("a mapping", describe(annotation, metadata))
    return _PATTERN.sub(lambda pattern: f"`{pattern[0]}`", text)


def _default(value: object) -> str:
    if isinstance(value, dict) and value:
        return "see its keys"
    if isinstance(value, float):
        return f"`{value:.6g}`"
    if value in (None, "", [], {}):
        return "none"
    return f"`{json.dumps(value)}`" if not isinstance(value, str) else f"`{value}`"


def _about(name: str, annotation: Any) -> str:
    """What a key without a description is about: the first line of its kind, or of its model."""
    models = [KINDS[name]] if name in KINDS else list(_models_in(annotation))
    lines = [(model.__doc__ or "").strip().splitlines()[0] for model in models]
    return lines[0] if lines else ""


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
    for page in sorted(DOCS.glob("*.md")):
        old = page.read_text(encoding="utf-8")
        new = renewed(old)
        if new != old:
            page.write_text(new, encoding="utf-8")
            sys.stdout.write(f"{page.name}: tables renewed\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
