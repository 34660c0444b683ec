"""Completion of names in bash, by the script that ``--install-completion`` installs."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import pytest
from cli_calls import navfw
from processes import run

from navfw.config import list_files


def completed(line: str) -> list[str]:
    """The completions of the last word of ``line``, as navfw gives them to bash."""
    last = str(len(line.split(" ")) - 1)
    done = navfw(_NAVFW_COMPLETE="complete_bash", COMP_WORDS=line, COMP_CWORD=last)
    assert done.stderr == ""
    return done.stdout.split()


LINES = {
    "navfw run of": ["office"],
    "navfw run office lobby": ["lobby-to-lab"],
    "navfw run nowhere lo": [],
    "navfw run office patrol --stack land": ["landmarks"],
    "navfw run office patrol --robot hus": ["husky"],
    "navfw run office patrol --set avo": ["avoid.", "avoid_quadrants."],
    "navfw suite bod": ["bodies"],
    "navfw map show pap": ["paper-room"],
}


@pytest.mark.parametrize("line", LINES)
def test_names_are_completed(line: str) -> None:
    assert completed(line) == LINES[line]


def test_every_name_is_offered() -> None:
    for line, kind in {
        "navfw run ": "world",
        "navfw run office patrol --stack ": "stack",
        "navfw suite rooms --robot ": "robot",
    }.items():
        assert completed(line) == [file.name for file in list_files(kind)]


def test_bash_completes_by_the_installed_script(tmp_path: Path) -> None:
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("bash is not installed")
    program = tmp_path / "navfw"
    program.write_text(f"#!{sys.executable}\nfrom navfw.cli import main\nmain()\n")
    program.chmod(0o755)
    path = f"{tmp_path}:{os.environ['PATH']}"
    script = """
    navfw --show-completion bash > script && source script
    COMP_WORDS=(navfw run office lobby) COMP_CWORD=3
    $(complete -p navfw | sed 's/.*-F \\([^ ]*\\).*/\\1/') navfw lobby office
    printf '%s\\n' "${COMPREPLY[@]}"
    """
    environment = {"HOME": str(tmp_path), "PATH": path, "_NAVFW_COMPLETE": None}
    done = run([bash, "-ec", script], env=environment, cwd=tmp_path)
    assert done.stdout.split() == ["lobby-to-lab"], done.stderr
