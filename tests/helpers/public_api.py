"""All that is public of navfw, as ``docs/public-api.txt`` lists it; run as a script, it adds.

A line is never taken away by the script. What is to go is deprecated in one minor version, and
removed in a later one: its line then stays, marked by hand with
``  # removed in 0.3.0, deprecated in 0.2.0``, both versions of ``CHANGELOG.md``.
"""

import importlib
import inspect
import re
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from cli_calls import commands

from navfw.cli import PANELS
from navfw.config.file_kinds import FILE_KINDS
from navfw.interfaces import Plugin
from navfw.missions.run_metrics import RunResult
from navfw.plugins.built_in import GROUPS
from navfw.recording.channel_list import CHANNELS
from navfw.testing import pytest_plugin
from navfw.testing.mission_case import MARKER

ROOT = Path(__file__).parents[2]
LIST = ROOT / "docs" / "public-api.txt"
MODULES = ("navfw", "navfw.gym", "navfw.testing")
BASES = {cls.kind: cls for cls in Plugin.__subclasses__() if cls.__module__ == Plugin.__module__}
REMOVED = re.compile(r"  # removed in (\d+\.\d+\.\d+), deprecated in (\d+\.\d+\.\d+)$")


@cache
def public() -> frozenset[str]:
    """What is public now: each its sort, and its name."""
    return frozenset({*_names(), *_commands(), *_documented(), *_keys(), *_plugins(), *_pytest()})


def _names() -> Iterator[str]:
    for module in MODULES:
        for name in importlib.import_module(module).__all__:
            yield f"name {module}.{name}"


def _commands() -> Iterator[str]:
    own = {name for names in PANELS.values() for name in names}
    for words, command in commands():
        if words and words[0] not in own:
            continue  # of another package
        path = " ".join(("navfw", *words))
        yield f"command {path}"
        for param in command.params:
            if param.param_type_name == "argument":
                yield f"argument {path} {param.name}"
            else:
                for option in (*param.opts, *param.secondary_opts):
                    yield f"option {path} {option}"


def _documented() -> Iterator[str]:
    """Keys of JSON, exit codes, topics and parameters, as the tables of the docs have them."""
    for sort, page, heading in (
        ("json", "commands.md", r"key|command \| keys"),
        ("exit code", "commands.md", "exit code"),
        ("ros", "ros2.md", "topic|parameter|service|action"),
    ):
        text = (ROOT / "docs" / page).read_text(encoding="utf-8")
        section = ""
        rows: list[str] = []
        for line in text.splitlines():
            if line.startswith("#"):
                section = line.strip("# `").lower().replace("`", "")
            elif not line.startswith("|"):
                rows = []
            else:
                rows.append(line)
                if len(rows) > 2 and re.match(rf"\| (?:{heading}) \|", rows[0]):
                    cells = [cell.strip() for cell in line.split("|")[1:-1]]
                    yield from _row(sort, section, rows[0], cells)


def _row(sort: str, section: str, head: str, cells: list[str]) -> Iterator[str]:
    if sort == "exit code":
        yield f"exit code {cells[0]}"
    elif "| keys" in head:
        for key in re.findall(r"`(\w+)`", cells[1]):
            yield f"json {cells[0].replace('`', '')}: {key}"
    else:
        kind = head.split("|")[1].strip()
        for name in re.findall(r"`([\w/]+)`", cells[0]):
            yield f"ros {kind} {name}" if sort == "ros" else f"json {section}: {name}"


def _keys() -> Iterator[str]:
    """The keys of files, of ``result.json``, and the channels of recordings."""
    for kind in FILE_KINDS.values():
        schema = kind.schema()
        for key in _paths(schema, schema.get("$defs", {}), ()):
            yield f"key of {kind.name}: {key}"
    for name in RunResult.schema()["properties"]:
        yield f"result {name}"
    for channel in CHANNELS:
        yield f"channel {channel} {channel.schema}"


def _paths(schema: Any, parts: Mapping[str, Any], inside: tuple[str, ...]) -> Iterator[str]:
    """The paths of the keys in a schema, such as ``walls[].height``."""
    if reference := schema.get("$ref"):
        name = reference.rsplit("/", 1)[-1]
        if name not in inside:
            yield from _paths(parts[name], parts, (*inside, name))
    for choice in (*schema.get("anyOf", ()), *schema.get("oneOf", ()), *schema.get("allOf", ())):
        yield from _paths(choice, parts, inside)
    for mark, inner in (("[]", schema.get("items")), (".*", schema.get("additionalProperties"))):
        if isinstance(inner, Mapping):
            yield from (f"{mark}{path}" for path in _paths(inner, parts, inside))
    for key, inner in schema.get("properties", {}).items():
        yield f".{key}"
        yield from (f".{key}{path}" for path in _paths(inner, parts, inside))


def _plugins() -> Iterator[str]:
    """The contracts of the kinds of plugin: methods with their arguments, attributes."""
    yield from (f"entry point {group}" for group in GROUPS)
    for kind, base in BASES.items():
        for cls in (base, Plugin):
            for name, value in vars(cls).items():
                if name.startswith("_"):
                    continue
                called = value.__func__ if isinstance(value, classmethod) else value
                arguments = ""
                if inspect.isfunction(called):
                    arguments = f"({', '.join(inspect.signature(called).parameters)})"
                yield f"plugin {kind}: {name}{arguments}"


def _pytest() -> Iterator[str]:
    """What the plugin of pytest has."""
    for line in re.findall(r'"(--mission-[a-z]+)"|"(navfw_\w+)"', inspect.getsource(pytest_plugin)):
        yield f"pytest {line[0] or line[1]}"
    yield "pytest fixture mission"
    yield f"pytest marker {MARKER.partition(':')[0]}"


def listed() -> dict[str, tuple[str, str] | None]:
    """The names of the list; of removed ones the versions of removal and of deprecation."""
    lines = LIST.read_text(encoding="utf-8").splitlines() if LIST.exists() else []
    names: dict[str, tuple[str, str] | None] = {}
    for line in lines:
        if not line.startswith("#"):
            mark = REMOVED.search(line)
            names[REMOVED.sub("", line)] = (mark[1], mark[2]) if mark else None
    return names


HEAD = """\
# What is public of navfw: one name a line, by its sort, by tests/helpers/public_api.py.
# What is to go is deprecated first (QUALITY_DECLARATION.md, "Version policy").
"""


def main() -> None:
    """Add what is new to the list, and say what has gone."""
    before, now = listed(), public()
    marks = {name: versions for name, versions in before.items() if versions}
    lines = [
        f"{name}  # removed in {marks[name][0]}, deprecated in {marks[name][1]}"
        if name in marks
        else name
        for name in sorted({*before, *now})
    ]
    LIST.write_text(HEAD + "\n".join(lines) + "\n", encoding="utf-8")
    gone = sorted({*before} - {*now} - {*marks})
    sys.stdout.write(f"{len({*now} - {*before})} new, {len(gone)} gone\n")
    sys.stdout.writelines(f"  gone: {name}\n" for name in gone)


if __name__ == "__main__":
    main()
