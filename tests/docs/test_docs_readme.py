"""The README, typed line by line in a terminal; its pictures are those of the run it shows."""

import os
import re
import shutil
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from cli_calls import put_file
from docs_pages import ROOT, DocBlock, blocks_of
from PIL import Image
from processes import run
from terminals import Terminal

IMAGES = sorted((ROOT / "docs" / "images").glob("office-lobby-to-lab.*"))
NOT_TYPED = {"make test": "these tests themselves"}
REFUSED = "latancy"
"""A word of the line whose mistake the README shows with its message."""


SHELL = ("/bin/bash", "--norc", "--noprofile", "-i")
PATIENCE = 600.0
"""Longest time [s] for one line."""


def typed(terminal: Terminal, line: str) -> tuple[int, str]:
    """The exit code of a line, which the next prompt shows, and what appears up to that."""
    before, deadline = len(terminal.lines()), time.monotonic() + PATIENCE
    terminal.press(f"{line}\n")
    while True:
        terminal.read()
        shown = terminal.lines()[before:]
        ended = re.search(r"<(\d+)>$", shown[-1]) if shown else None
        if ended is not None:
            return int(ended[1]), "\n".join(shown[:-1])
        assert time.monotonic() < deadline, terminal.text()


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Terminal]:
    """In a copy of the clone, with the kernels that are compiled; nothing else is at home."""
    listing = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    files = [*run(listing, cwd=ROOT, check=True).stdout.splitlines()]
    files += [str(file.relative_to(ROOT)) for file in (ROOT / "navfw").rglob("*.nb[ic]")]
    for file in files:
        (tmp_path / "navfw" / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / file, tmp_path / "navfw" / file)
    uv = os.environ.get("UV") or shutil.which("uv")
    if uv is None:
        pytest.skip("needs uv")
    (tmp_path / "navfw/.tools/uv/bin").mkdir(parents=True)
    (tmp_path / "navfw/.tools/uv/bin/uv").symlink_to(uv)
    (tmp_path / "home").mkdir()
    kept = {name: text for name, text in os.environ.items() if "CERT" in name or "PIP" in name}
    cache = run([uv, "cache", "dir"], check=True).stdout.strip()
    path = f"{Path(sys.base_prefix) / 'bin'}:/usr/bin:/bin"
    home = {"HOME": str(tmp_path / "home"), "PATH": path, "UV_CACHE_DIR": cache}
    alone: dict[str, str | None] = dict.fromkeys(os.environ)
    environment = alone | kept | home | {"PS1": "<$?> ", "TERM": "xterm"}
    with Terminal(SHELL, cwd=tmp_path / "navfw", env=environment) as shell:
        shell.wait_for("<0>")
        yield shell


def lines_of(block: DocBlock, folder: Path) -> list[str]:
    """What a reader types for a block of the README."""
    if block.language == "python":
        return [f"python {put_file(folder, 'drive.py', block.text)}"]
    typed = re.findall(r"^\$ (.*)$", block.text, re.MULTILINE)
    return [line for line in typed if line.partition("  ")[0] not in NOT_TYPED]


def hash_in(picture: Path) -> str:
    """The hash of commands that ``docs/draw_run.py`` wrote into a picture."""
    with Image.open(picture) as opened:
        comment = opened.info.get("Comment") or opened.info["comment"]
    return comment.decode() if isinstance(comment, bytes) else str(comment)


@pytest.mark.thorough
def test_the_readme_can_be_followed_from_the_first_to_the_last_line(
    terminal: Terminal, tmp_path: Path
) -> None:
    screens = {}
    for block in blocks_of(ROOT / "README.md"):
        for line in lines_of(block, tmp_path) if block.language in {"console", "python"} else ():
            code, shown = typed(terminal, line)
            assert code == (2 if REFUSED in line else 0), shown
            assert not re.search(r"Traceback|\\x1b|warning", shown), shown
            screens[line.partition("  ")[0]] = shown
    assert len(screens) > 10
    # the pictures are of this run, which the code of the README drives as well
    (command_hash,) = {hash_in(file) for file in IMAGES}
    for line in ("make run", f"python {tmp_path / 'drive.py'}"):
        assert re.findall(r"commands +(\w{16})", screens[line]) == [command_hash[:16]]
    assert "2 passed" in screens["pytest tests"]
