"""Groups of commands: help by panels, and the command that an unknown word may have meant."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, ClassVar

import typer
from typer.core import TyperGroup

MAX_MEANT = 3
"""Largest number of commands that a message proposes."""


def command_group(help_: str, **settings: Any) -> typer.Typer:
    """A group of commands, which is added to another one under its name."""
    return typer.Typer(cls=SuggestingGroup, help=help_, no_args_is_help=True, **settings)


class SuggestingGroup(TyperGroup):
    """Proposes commands in place of an unknown one: its own, and those of groups within it."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that ``args`` begin with; a usage error, with proposals, if there is none."""
        if args[0] not in self.commands and not args[0].startswith("-"):
            meant = meant_by(args[0], dict(_commands(self)))
            hint = f" Did you mean {', '.join(map(repr, meant))}?" if meant else ""
            ctx.fail(f"No such command {args[0]!r}.{hint}")
        return super().resolve_command(ctx, args)


class PanelGroup(SuggestingGroup):
    """Shows its commands under the headings of ``panels``."""

    panels: ClassVar[Mapping[str, Iterable[str]]] = {}

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write a line for each command."""
        del ctx
        width = max(map(len, self.commands))
        for panel, names in self.panels.items():
            with formatter.section(panel):
                formatter.write_dl(
                    [
                        (
                            name.ljust(width),
                            self.commands[name].get_short_help_str(formatter.width - 6 - width),
                        )
                        for name in names
                    ]
                )


def meant_by(word: str, commands: dict[str, str]) -> list[str]:
    """The ``commands``, with their help, that ``word`` may have meant; the most likely first.

    These are the commands called so, or ``word-...``; else those with a similar name; else those
    whose help has the word.

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
