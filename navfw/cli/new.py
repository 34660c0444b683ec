"""``navfw new project``, and ``navfw new KIND NAME``: templates that pass ``navfw check``."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

from navfw.cli.options import argument, command_group, option
from navfw.cli.output import echo
from navfw.scaffold.part_kinds import PARTS

_Name = Annotated[
    str, argument(..., "Its name: slow_down for code, east-wing for files.", metavar="NAME")
]
_STARTS = PARTS["behavior"].starts


group = command_group("Begin a project, or a part of one.")


@group.command()
def project(
    folder: Path = argument(..., "Folder to write; new, or empty.", metavar="DIR"),
) -> None:
    """Write a project: behaviour, rules, stack, world, map, mission and tests.

    All of it passes its checks. Existing files are not overwritten. The project is trusted: its
    plugins are those just written.
    """
    from navfw.config.project_trust import trust
    from navfw.scaffold.new_files import activation, write_project

    written = write_project(folder)
    trust(folder)
    echo("\n  ".join([f"wrote {folder}, and trusts it:", *written]))
    first = filter(None, (activation(), f"cd {shlex.quote(str(folder))}"))
    then = "navfw run den next-room", "navfw check", "pytest tests"
    echo("\n  ".join(["next, type:", *first, *then]))


def _writer(kind: str) -> Callable[..., None]:
    def write(
        name: _Name,
        start: str = option(
            PARTS[kind].starts[0], f"What it begins as: {', '.join(_STARTS)}.", metavar="START"
        ),
    ) -> None:
        from navfw.scaffold.new_files import write_part

        written, then = write_part(kind, name, start)
        echo("\n  ".join(["wrote:", *written]))
        echo(f"next: navfw check && {then}")

    def write_only(name: _Name) -> None:
        write(name, PARTS[kind].starts[0])

    return write if kind == "behavior" else write_only


for _kind, _part in PARTS.items():
    _help = f"{_part.help} They go into the current project."
    group.command(_kind, help=_help)(_writer(_kind))
