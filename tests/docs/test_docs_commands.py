"""The commands of the README and the docs: all can be typed, the quick ones do what is shown."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer.main
from cli_calls import invoke
from docs_pages import PAGES, ROOT, blocks_of, load_module, table
from typer.testing import Result

from navfw.cli import app
from navfw.recording import palette

QUICK = (
    "map plan ",
    "map show hospital",
    "map check",
    "map build",
    "map convert",
    "list plugins",
    "explain ",
    "replay ",
    "run empty straight --record",
)
"""Beginnings of the commands that are run here; the others take longer, or need files."""

BLOCK = re.compile(r"^```console\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def commands_and_output(page: Path) -> Iterator[tuple[str, list[str]]]:
    """The commands of navfw on a page, each with the lines that are shown below it."""
    for block in BLOCK.findall(page.read_text(encoding="utf-8")):
        for command in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            line, *shown = command.splitlines()
            words = re.match(r"(?:uv run )?navfw (.+?)(?:  +#.*)?$", line)
            if words is not None:
                yield words[1], [row for row in shown if row.strip() not in ("", "...")]


ALL = [
    pytest.param(command, shown, id=f"{page.name}: {command[:40]}")
    for page in PAGES
    for command, shown in commands_and_output(page)
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The working folder of the commands; their /tmp/... is within it."""
    path = tmp_path_factory.mktemp("commands")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(path)
        typed("run empty straight --record --out /tmp/straight", path)
        yield path


def typed(command: str, folder: Path) -> Result:
    return invoke(*shlex.split(command.replace("/tmp/", f"{folder}/")))  # noqa: S108 - replaced


def test_the_commands_and_their_options_exist() -> None:
    for line, _ in (parameters.values for parameters in ALL):
        words = shlex.split(str(line))
        command: Any = typer.main.get_command(app)
        while hasattr(command, "commands"):
            command = command.commands[words.pop(0)]
        options = {option for parameter in command.params for option in parameter.opts}
        assert [word for word in words if word.startswith("--") and word not in options] == [], line


@pytest.mark.parametrize(
    ("command", "shown"), [p for p in ALL if str(p.values[0]).startswith(QUICK)]
)
def test_a_quick_command_succeeds_and_prints_what_is_shown(
    command: str, shown: list[str], folder: Path
) -> None:
    result = typed(command, folder)
    assert result.exit_code == 0, result.output
    printed = [row.rstrip() for row in result.output.splitlines()]
    assert [row for row in shown if row not in printed] == []


def test_the_picture_of_a_run_shows_camera_and_path(folder: Path) -> None:
    drawing = load_module(ROOT / "docs" / "draw_run.py")
    view, path = drawing.draw_view(folder / "straight", 3.0), drawing.draw_path(folder / "straight")
    assert view.shape == (drawing.HEIGHT, drawing.WIDTH, 3)
    assert path.shape[0] == drawing.HEIGHT
    flow = (view == palette.bgr(palette.FLOW)).all(axis=2)
    assert flow[: drawing.HEIGHT // 2].sum() > 100  # arrows
    (image,) = re.findall(r"docs/images/[\w-]+\.png", (ROOT / "README.md").read_text())
    assert (ROOT / image).stat().st_size < 500_000


def test_the_code_that_reads_a_recording_runs(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (block,) = (b for b in blocks_of(ROOT / "docs" / "recordings.md") if b.language == "python")
    names: dict[str, Any] = {}
    code = block.text.replace("/tmp/", f"{folder}/")  # noqa: S108 - replaced
    exec(compile(code, block.page, "exec"), names)  # noqa: S102 - our own page
    assert names["image"].shape == (120, 160)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 30
    assert re.fullmatch(r"\d+\.\d s \w+", lines[-1])


@pytest.mark.parametrize(
    ("command", "heading"),
    [
        ("map plan hospital reception ward-3", "## Plan"),
        ("map show office", "## Maps"),
        ("map check office", "## Maps"),
        ("map build office --out draft.yaml", "## Maps"),
        ("map convert office office.geojson", "## Maps"),
    ],
)
def test_the_keys_of_the_json_are_documented(command: str, heading: str, folder: Path) -> None:
    result = typed(f"{command} --json", folder)
    assert result.exit_code == 0, result.output
    documented = re.findall(r"`(\w+)`", table(ROOT / "docs" / "commands.md", heading))
    assert set(json.loads(result.stdout)) - set(documented) == set()


def test_the_readme_shows_a_mistake_with_its_message() -> None:
    ((command, shown),) = (
        pair for pair in commands_and_output(ROOT / "README.md") if "latancy" in pair[0]
    )
    result = invoke(*shlex.split(command))
    assert result.exit_code == 2
    assert result.stderr.splitlines() == shown
