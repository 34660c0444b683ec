"""Arguments and options shared by several commands, completion of names, and command groups.

Completers list files and execute no code of a project: a behaviour has the name of its file. If
anything is wrong, nothing is completed, so that no error appears in the middle of a line. Groups
show help by panels, and suggest the commands that an unknown word may have meant.
"""

from __future__ import annotations

import difflib
import inspect
import json
import math
import re
from collections.abc import Callable, Iterable, Iterator
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_type_hints

import typer
from typer.core import TyperGroup

from navfw.config.lookup import (
    find,
    list_files,
    list_missions,
    plugin_files,
    plugin_folders,
    project_folder,
)
from navfw.errors import InputError, locating
from navfw.process.atomic import output_file

OptionsT = TypeVar("OptionsT")
Names = Callable[[typer.Context], Iterable[str]]

_PARTS_OF_MISSION = ("mission.", "robot.", "sensors.")
"""Prefixes of ``--set`` besides the names of behaviours."""


def _completer(names: Names) -> Callable[[typer.Context], list[str]]:
    """Make a function that gives typer all ``names``, of which it takes those that fit."""

    def complete(ctx: typer.Context) -> list[str]:
        try:
            return list(names(ctx))
        except (InputError, OSError):
            return []

    return complete


def completer_of(kind: str) -> Callable[[typer.Context], list[str]]:
    """Make a function that completes the names of files of a kind of ``FILE_KINDS``."""
    return _completer(lambda _: (file.name for file in list_files(kind)))


@_completer
def complete_mission(ctx: typer.Context) -> Iterable[str]:
    """Complete the missions of the world that was typed before."""
    world = ctx.params.get("world")
    return (mission.name for mission in list_missions(world)) if world else ()


@_completer
def complete_setting(_: typer.Context) -> Iterable[str]:
    """Complete the first part of ``--set``: behaviours, and parts of the mission."""
    folders = (folder for folder in plugin_folders() if folder.name == "behaviors")
    behaviors = {f"{file.stem}." for folder in folders for file in plugin_files(folder)}
    return sorted({*behaviors, *_PARTS_OF_MISSION})


def option(default: Any, text: str, *names: str, kind: str = "", **settings: Any) -> Any:
    """Declare an option of a command, in its signature or its dataclass, with its help ``text``.

    A ``default`` of ``...`` makes it required; in ``Annotated`` it stands for that of the command.
    Names of files of a ``kind`` are completed; ``settings`` are those of ``typer.Option``.
    """
    if kind:
        settings["autocompletion"] = completer_of(kind)
    return typer.Option(default, *names, help=text, **settings)


def argument(default: Any, text: str, *, kind: str = "", **settings: Any) -> Any:
    """Declare an argument of a command as ``option`` does an option."""
    if kind:
        settings["autocompletion"] = completer_of(kind)
    return typer.Argument(default, help=text, **settings)


World = Annotated[str, argument(..., "Name or file of a world.", kind="world", metavar="WORLD")]
Mission = Annotated[
    str,
    argument(
        ...,
        "Name of a mission of that world, or a file.",
        autocompletion=complete_mission,
        metavar="MISSION",
    ),
]
Map = Annotated[str, argument(..., "Name or file of a map.", kind="map", metavar="MAP")]
Recorded = Annotated[
    Path, argument(..., "Run folder written by navfw run --record.", metavar="RUN_FOLDER")
]
Suite = Annotated[str, argument(..., "Name or file of a suite.", kind="suite", metavar="SUITE")]
Stack = Annotated[str, option(..., "Name or file of a stack.", kind="stack")]
Robot = Annotated[
    str | None,
    option(
        ..., "Name or file of a robot [default: that of the mission, or default].", kind="robot"
    ),
]
NoiseSeed = Annotated[int, option(..., "Seed of all noise.", min=0)]
Json = Annotated[bool, option(..., "Print one JSON object on stdout, and nothing else.", "--json")]
JsonList = Annotated[bool, option(..., "Print a JSON list of objects, and nothing else.", "--json")]
Video = Annotated[
    Path | None,
    option(
        ..., "MP4 file to write: the camera with flow and percept beside the plan.", metavar="FILE"
    ),
]
Topic = Annotated[
    str | None, option(..., "Topic of a bag's images; by default that with the most.")
]
LivePort = Annotated[int, option(..., "Port of --live; 0: a free one.", min=0, max=65535)]
ImuAxes = Annotated[
    str | None,
    option(
        ...,
        "Axes of the gyro that point ahead, left, up, such as z,-x,-y; by default from /tf_static,"
        " the frame's name or the turns of the wheels, else x,y,z.",
        metavar="AHEAD,LEFT,UP",
    ),
]
EngineKind = Literal["processes", "dask"]
"""Where a suite's runs are driven."""
Workers = Annotated[int, option(..., "Processes, each with one thread.", min=1, max=256)]
Limit = Annotated[float, option(..., "Largest wall time of a run [s].", min=1.0)]
Memory = Annotated[float, option(..., "Largest memory of a run's process [MB].", min=100.0)]
EngineName = Annotated[
    EngineKind, option(..., "Processes of this machine, or a cluster of Dask.", "--engine")
]
Scheduler = Annotated[
    str | None,
    option(..., "With --engine dask: tls://HOST:PORT, or tcp://.", metavar="ADDRESS"),
]


def of_robot(name: str | None) -> tuple[str, ...]:
    """Convert the option ``--robot`` to arguments of ``--set``; none if it was not given.

    Raises:
        UnknownNameError: there is no robot of that name.
        ConfigError: ``name`` is a path, and no such file exists, or it is a broken URDF.

    """
    if name is None:
        return ()
    with locating(key="--robot"):
        file = find("robot", name)
        if file.suffix.lower() == ".urdf":
            from navfw.robot.urdf import read_urdf

            read_urdf(file)  # what is wrong with it is no part of the mission
    return (f"robot={json.dumps(name if file.stem == name else str(file.absolute()))}",)


def check_engine(engine: EngineKind, scheduler: str | None) -> None:
    """Raise typer.BadParameter unless an address is given for Dask, and only for Dask."""
    if (engine == "dask") != (scheduler is not None):
        what = "needs --engine dask" if scheduler else "needs --scheduler tcp://HOST:PORT"
        raise typer.BadParameter(what, param_hint="--scheduler" if scheduler else "--engine dask")


def numbers_of(option: str, text: str | None, names: tuple[str, ...]) -> tuple[float, ...] | None:
    """Parse an option such as ``--goal 1.5,-2``; None if it is not given, InputError if wrong."""
    if text is None:
        return None
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != len(names) or not all(math.isfinite(number) for number in numbers):
        raise InputError(f"expected {','.join(names)}, got {text!r}", key=option)
    return tuple(numbers)


def from_options(command: Callable[[OptionsT], None]) -> Callable[..., None]:
    """Make a typer command of a function whose only argument is a dataclass of its options."""
    cls: Any = get_type_hints(command)["options"]

    @wraps(command)
    def with_options(**values: Any) -> None:
        command(cls(**values))

    parameters = inspect.signature(cls, eval_str=True)
    with_options.__signature__ = parameters  # type: ignore[attr-defined]
    return with_options


MAX_MEANT = 3
"""Largest number of commands that a message suggests."""


def command_group(help_: str, **settings: Any) -> typer.Typer:
    """Make a group of commands, to be added to another group under its name."""
    return typer.Typer(cls=SuggestingGroup, help=help_, no_args_is_help=True, **settings)


_WHOLE = 1000
"""Longest short help [characters]: it is wrapped, not cut."""


class SuggestingGroup(TyperGroup):
    """Suggests commands instead of an unknown one: its own, and those of groups within it."""

    @property
    def panels(self) -> dict[str, Any]:
        """The commands by their heading in the help."""
        return {"Commands": self.commands}

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the first sentence on each command, under the headings of ``panels``."""
        width = max(map(len, self.list_commands(ctx)))
        for panel, names in self.panels.items():
            with formatter.section(panel):
                formatter.write_dl([(name.ljust(width), self.summary(name)) for name in names])

    def summary(self, name: str) -> str:
        """Return the first sentence on a command."""
        text: str = self.commands[name].get_short_help_str(_WHOLE)
        return text

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the command that ``args`` begin with; fail with suggestions if there is none."""
        if args[0] not in self.list_commands(ctx) and not args[0].startswith("-"):
            known = dict.fromkeys(self.list_commands(ctx), "") | dict(_commands(self))
            meant = meant_by(args[0], known)
            hint = f" Did you mean {', '.join(map(repr, meant))}?" if meant else ""
            ctx.fail(f"No such command {args[0]!r}.{hint}")
        return super().resolve_command(ctx, args)


def meant_by(word: str, commands: dict[str, str]) -> list[str]:
    """Guess which of ``commands`` (with their help) ``word`` may mean; the most likely first.

    These are the commands with that name, or ``word-...``; else those with a similar name; else
    those whose help contains the word.

    >>> meant_by("maps", {"list maps": "List the maps.", "map": "Show maps."})
    ['list maps']
    >>> meant_by("generate", {"world new": "Generate a world.", "run": "Drive."})
    ['world new']
    """
    last_words = {name: name.split()[-1] for name in commands}
    similar = difflib.get_close_matches(word, set(last_words.values()), n=MAX_MEANT)
    in_help = re.compile(rf"\b{re.escape(word)}\b", re.IGNORECASE)
    meant = (
        [name for name, last in last_words.items() if word in {last, last.split("-")[0]}]
        or [name for like in similar for name, last in last_words.items() if last == like]
        or [name for name, text in commands.items() if in_help.search(text)]
    )
    return meant[:MAX_MEANT]


def _commands(group: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """All commands of a group and of groups within it, with the help of those that are no group."""
    for name, command in group.commands.items():
        if isinstance(command, TyperGroup):
            yield f"{path}{name}", ""
            yield from _commands(command, f"{path}{name} ")
        else:
            yield f"{path}{name}", command.help or ""


def own_map(name: str) -> Path:
    """Return the path of the project's own map of that name; the file need not exist."""
    return (project_folder() or Path()) / "maps" / f"{name}.yaml"


def map_file(name: str, option: str, force: bool) -> Path:
    """Resolve the map file to write from a name or path: a bare name is in the project's ``maps``.

    Raises:
        InputError: the file exists and ``force`` is not set, or is not named as a map.

    """
    file = Path(name)
    if file.suffix not in {".yaml", ".yml"}:
        if len(file.parts) != 1:
            raise InputError(f"expected a name, or a .yaml file, got {file}", key=option)
        file = own_map(name)
    if file.exists() and not force:
        raise InputError(f"exists; choose another {option}, or give --force", file=file)
    output_file(file, option)
    return file
