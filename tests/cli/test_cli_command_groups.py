"""The commands by panels, and the command that is proposed in place of an unknown one."""

from __future__ import annotations

import pytest
import typer.main
from typer.testing import CliRunner

from navfw.cli import PANELS, app


def test_every_command_is_in_one_panel() -> None:
    listed = [command for panel in PANELS.values() for command in panel]
    assert sorted(listed) == sorted(typer.main.get_command(app).commands)  # type: ignore[attr-defined]
    assert len(listed) <= 18


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["rnu"], "'run'"),
        (["worlds"], "'list worlds'"),
        (["pulgins"], "'list plugins'"),
        (["missions", "office"], "'list missions'"),
        (["generate", "rooms"], "'world new'"),
        (["import", "a.sdf"], "'world import'"),
        (["plan", "office"], "'map plan'"),
        (["compare", "a", "b"], "'report'"),
        (["learn", "situations"], "'map learn-landmarks', 'map learn-situations'"),
        (["map", "learn"], "'learn-landmarks', 'learn-situations'"),
        (["list", "wrlds"], "'worlds'"),
    ],
)
def test_an_unknown_command_is_answered_by_the_nearest(words: list[str], meant: str) -> None:
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 2
    unknown = next(word for word in words if word not in {"list", "map"})
    message = f"No such command {unknown!r}. Did you mean {meant}?"
    assert message in " ".join(done.stderr.split())


def test_nothing_is_proposed_for_a_word_that_no_command_has() -> None:
    done = CliRunner().invoke(app, ["xyzzy"])
    assert done.stderr.endswith("Error: No such command 'xyzzy'.\n")
