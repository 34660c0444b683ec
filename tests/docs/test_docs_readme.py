"""The README, typed line by line in a terminal; its pictures are those of the run it shows."""

import os
import pty
import re
import select
import shutil
import sys
import termios
from collections.abc import Iterator
from pathlib import Path

import pytest
from cli_calls import put_file
from docs_pages import ROOT, DocBlock, blocks_of, load_module
from PIL import Image
from processes import run

IMAGES = sorted((ROOT / "docs" / "images").glob("office-lobby-to-lab.*"))
NOT_TYPED = {"make test": "these tests themselves"}
REFUSED = "latancy"
"""A word of the line whose mistake the README shows with its message."""


class Terminal:
    """A shell on a pseudo-terminal of 80 columns, whose prompt is the last exit code."""

    def __init__(self, folder: Path, environment: dict[str, str]) -> None:
        shell = ["/bin/bash", "--norc", "--noprofile", "-i"]
        self._pid, self._end = pty.fork()
        if self._pid == 0:
            os.chdir(folder)
            os.execve(shell[0], shell, environment | {"PS1": "<$?> ", "TERM": "xterm"})  # noqa: S606
        termios.tcsetwinsize(self._end, (24, 80))
        self.read()

    def read(self) -> tuple[int, str]:
        """What appears up to the next prompt, and the exit code in that."""
        shown = b""
        while (ended := re.search(rb"<(\d+)> $", shown)) is None:
            assert select.select([self._end], [], [], 600.0)[0], shown.decode()
            shown += os.read(self._end, 4096)
        return int(ended[1]), shown[: ended.start()].decode()

    def type(self, line: str) -> tuple[int, str]:
        """The exit code of a line, and what it shows."""
        os.write(self._end, f"{line}\n".encode())
        return self.read()

    def close(self) -> None:
        """End the shell."""
        os.close(self._end)
        os.waitpid(self._pid, 0)


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
    shell = Terminal(tmp_path / "navfw", kept | home)
    yield shell
    shell.close()


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
            code, shown = terminal.type(line)
            assert code == (2 if REFUSED in line else 0), shown
            assert not re.search(r"Traceback|\\x1b|warning", shown), shown
            screens[line.partition("  ")[0]] = shown
    assert len(screens) > 10
    # the pictures are of this run, which the code of the README drives as well
    (command_hash,) = {hash_in(file) for file in IMAGES}
    for line in ("make run", f"python {tmp_path / 'drive.py'}"):
        assert re.findall(r"commands +(\w{16})", screens[line]) == [command_hash[:16]]
    assert "2 passed" in screens["pytest tests"]


def test_make_run_drives_the_mission_of_the_pictures() -> None:
    mission = load_module(ROOT / "docs" / "draw_run.py").MISSION
    assert f"navfw run {' '.join(mission)}\n" in (ROOT / "Makefile").read_text(encoding="utf-8")
