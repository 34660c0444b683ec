"""What another installed package adds: commands, and files found by name."""

import json
import os
from pathlib import Path

import pytest
from cli_calls import navfw, put_file
from processes import Done

POINTS = """
[navfw.commands]
survey = site_tools.survey:survey
levels = site_tools.levels:levels
gone = nowhere:gone
broken = site_tools.broken:command
number = site_tools.survey:NUMBER
run = site_tools.survey:survey
[navfw.files]
tools = site_tools
missing = no_such_package
"""
SURVEY = '''"""Survey the site."""
import typer
NUMBER = 3
def survey(rooms: int = 1) -> None:
    """Survey so many rooms."""
    typer.echo(f"surveyed {rooms}")
'''
LEVELS = '''"""Find levels."""
import typer
levels = typer.Typer(help="Find levels.")
@levels.command()
def high() -> None:
    """The highest."""
    typer.echo("high")
@levels.command()
def low() -> None:
    """The lowest."""
'''


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A folder of installed packages with one that adds to navfw."""
    put_file(tmp_path, "site/site_tools-1.2.dist-info/entry_points.txt", POINTS)
    about = "Metadata-Version: 2.1\nName: site-tools\nVersion: 1.2\n"
    put_file(tmp_path, "site/site_tools-1.2.dist-info/METADATA", about)
    put_file(tmp_path, "site/site_tools/__init__.py", "")
    put_file(tmp_path, "site/site_tools/survey.py", SURVEY)
    put_file(tmp_path, "site/site_tools/levels.py", LEVELS)
    put_file(
        tmp_path, "site/site_tools/broken.py", '"""Break."""\nraise RuntimeError("at\\nonce")\n'
    )
    put_file(tmp_path, "site/site_tools/stacks/slow.yaml", "description: slow\nbase: default\n")
    put_file(tmp_path, "site/site_tools/stacks/default.yaml", "nonsense\n")
    return tmp_path / "site"


def called(site: Path, *words: str) -> Done:
    return navfw(*words, PYTHONPATH=f"{site}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")


def test_help_lists_the_commands_of_packages_without_importing_them(site: Path) -> None:
    done = called(site, "--help")
    assert (done.returncode, done.stderr) == (0, "")
    listed = done.stdout.partition("Of installed packages:\n")[2].splitlines()
    rows = [line.split(maxsplit=1) for line in listed]
    for row in (
        ["survey", "Survey the site."],
        ["levels", "Find levels."],
        ["broken", "Break."],
        ["gone", "Broken: there is no module nowhere."],
    ):
        assert row in rows
    assert "run" not in [name for name, _ in rows]


@pytest.mark.parametrize(
    ("words", "printed"),
    [
        ("survey --rooms 3", "surveyed 3\n"),
        ("levels high", "high\n"),
        ("survey --trust", "surveyed 1\n"),
    ],
)
def test_a_command_of_a_package_runs(site: Path, words: str, printed: str) -> None:
    done = called(site, *words.split())
    assert (done.returncode, done.stdout, done.stderr) == (0, printed, "")


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("broken", "RuntimeError: at once"),
        ("gone", "ModuleNotFoundError: No module named 'nowhere'"),
        ("number", ""),
    ],
)
def test_a_broken_command_is_named_in_one_line(site: Path, name: str, reason: str) -> None:
    done = called(site, name)
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    what = f"navfw: the command {name!r} of site-tools 1.2 cannot be used: "
    assert line.startswith(what + reason)


def test_a_mistyped_command_of_a_package_is_proposed(site: Path) -> None:
    assert "Did you mean 'survey'?" in called(site, "survy").stderr


def test_files_of_packages_are_found_after_those_of_navfw(site: Path) -> None:
    done = called(site, "list", "stacks", "--json")
    rows = {row["name"]: row for row in json.loads(done.stdout)}
    assert (rows["slow"]["source"], rows["slow"]["status"]) == ("installed", "ok")
    assert (rows["default"]["source"], rows["default"]["status"]) == ("shipped", "ok")
