"""What a result was measured with: revision and fingerprint of the code, kind of machine."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, Self

from navfw.config.input_file import read_input, real_path
from navfw.config.lookup import own_folders, owned_by_user, project_folder, shipped_folder
from navfw.errors import ConfigError
from navfw.process.process_resources import usable_cores

_SHIPPED = ("worlds", "maps", "behaviors")
"""The folders that ship with navfw beside its code."""

DIRTY = "-dirty"
"""Suffix of a revision whose tracked files have uncommitted changes."""

_GIT_TIMEOUT = 5.0
"""Largest time [s] that git may take."""

_MAX_SYMBOLIC_REFS = 5
"""Largest number of refs that lead to each other, as in git."""

_HASH = re.compile(r"[0-9a-f]{40}(?:[0-9a-f]{24})?")
_SHA256_CONFIG = "[core]\n\trepositoryformatversion = 1\n[extensions]\n\tobjectformat = sha256\n"


def code_revision() -> str:
    """The git revision of the project around the working folder, else of navfw's own source.

    Without git, navfw's version, as in ``navfw 0.1.0``.
    """
    source = Path(__file__).parents[1] / "__init__.py"
    project = project_folder()
    if project is not None:
        revision = git_revision(project)
    else:
        # an installed copy may lie inside another repository, which does not track it
        checkout = GitCheckout.around(source.parent)
        tracked = checkout is not None and checkout.tracks(source)
        revision = git_revision(source.parent) if tracked else None
    return revision or f"navfw {metadata.version('navfw')}"


def git_revision(folder: Path) -> str | None:
    """The commit checked out around ``folder``; None without git, or if another user owns a part.

    ``-dirty`` is appended when tracked files have uncommitted changes, except those in ``docs`` at
    the top of the repository: no run reads them, and results are written there between runs.
    """
    checkout = GitCheckout.around(folder)
    if checkout is None:
        return None
    revision, changed = checkout.head(), checkout.changed(":(top)", ":(top,exclude)docs")
    if revision is None or changed is None:
        return None
    return revision + (DIRTY if changed else "")


def provenance(command: str, options: Mapping[str, object]) -> dict[str, Any]:
    """Command line with ``options`` spelt out, seed, revision and kind of machine; plain data.

    >>> provenance("navfw bench loop", {"world": "office", "seed": [0, 1]})["command"]
    'navfw bench loop --world office --seed 0 --seed 1'
    """
    items = {name: v if isinstance(v, list) else [v] for name, v in options.items()}
    words = (word for name in items for item in items[name] for word in (f"--{name}", str(item)))
    return {
        "command": f"{command} {shlex.join(words)}".rstrip(),
        "seeds": str(options.get("seed", "")),
        "revision": code_revision(),
        "machine": machine_kind(),
    }


def machine_kind() -> dict[str, Any]:
    """Processor model, usable cores, Python version and operating system; no host name."""
    about = Path("/proc/cpuinfo")
    lines = about.read_text(encoding="utf-8").splitlines() if about.is_file() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return {
        "processor": (models or [platform.processor()])[0] or platform.machine(),
        "cores": usable_cores(),
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
    }


def fingerprint(value: Any) -> str:
    """The SHA-256 (hex) of plain data."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def files_fingerprint(files: Iterable[tuple[str, Path]]) -> str:
    """The fingerprint of files by name.

    Raises:
        ConfigError: one of them cannot be read.

    """
    return fingerprint({name: hashlib.sha256(read_input(file)).hexdigest() for name, file in files})


def files_in(folder: Path) -> Iterator[tuple[Path, Path]]:
    """Each file below ``folder`` and its path inside of it, sorted, but for caches of Python."""
    for file in sorted(folder.rglob("*")):
        inside = file.relative_to(folder)
        if "__pycache__" not in inside.parts and file.is_file():
            yield file, inside


def files_of(places: Mapping[str, Path]) -> Iterator[tuple[str, Path]]:
    """The name and the path of each file in ``places``, files and folders by their names."""
    for name, place in places.items():
        if place.is_file():
            yield name, place
        for file, inside in files_in(place):
            yield f"{name}/{inside.as_posix()}", file


def navfw_files() -> dict[str, Path]:
    """The folders of navfw's own code and files that results depend on, by name."""
    shipped = {name: shipped_folder() / name for name in _SHIPPED}
    return {"navfw": real_path(__file__).parents[1], **shipped}


@cache
def code_fingerprint() -> str:
    """The fingerprint of ``navfw_files``."""
    return files_fingerprint(files_of(navfw_files()))


@dataclass(frozen=True)
class GitCheckout:
    """A git checkout with its files in ``top``.

    ``private`` holds its HEAD and index, ``common`` objects and refs. The two differ only in a
    worktree.

    A repository that somebody else has prepared can name programs in its configuration: a file
    system monitor, filters, hooks, external diffs, aliases, the ssh command, further files to
    include. Nothing of it is executed: HEAD and refs are read as files, and ``git`` compares the
    files through a git folder of our own with an empty configuration, which borrows the
    repository's objects and index. A checkout of which another user owns a part is not looked at.
    """

    top: Path
    private: Path
    common: Path

    @classmethod
    def around(cls, folder: Path) -> Self | None:
        """The checkout that ``folder`` lies in; None if there is none that is this user's alone."""
        for top in own_folders(real_path(folder)):
            link = top / ".git"
            if os.path.lexists(link):
                private = link if link.is_dir() else _linked(link, "gitdir: ")
                common = private and (_linked(private / "commondir") or private)
                if private is None or common is None:
                    return None
                parts = (link, private, common, common / "objects")
                return cls(top, private, common) if all(map(owned_by_user, parts)) else None
        return None

    def head(self) -> str | None:
        """The hash of the commit that is checked out; None before the first commit."""
        text = _read(self.private / "HEAD").strip()
        for _ in range(_MAX_SYMBOLIC_REFS):
            if _HASH.fullmatch(text):
                return text
            name = text.removeprefix("ref: ")
            if not name.startswith("refs/") or ".." in name:
                return None
            text = self._ref(name)
        return None

    def changed(self, *paths: str) -> bool | None:
        """Whether tracked files below ``paths`` (git's pathspecs) differ from the commit.

        Changes inside a submodule do not count, another commit of it does. None if git is not
        installed or cannot tell.
        """
        words = ("status", "--porcelain", "--untracked-files=no", "--ignore-submodules=dirty")
        changes = self._git(*words, "--", *paths)
        return None if changes is None else bool(changes)

    def tracks(self, file: Path) -> bool:
        """Whether ``file`` is one of the tracked files."""
        return self._git("ls-files", "--error-unmatch", "--", str(real_path(file))) is not None

    def _ref(self, name: str) -> str:
        for folder in (self.private, self.common):
            text = _read(folder / name).strip()
            if text:
                return text
        packed = (line.partition(" ") for line in _read(self.common / "packed-refs").splitlines())
        return next((commit for commit, _, packed_name in packed if packed_name == name), "")

    def _git(self, *words: str) -> str | None:
        """What git prints about the checkout, in a configuration that is empty."""
        git, head = shutil.which("git"), self.head()
        if git is None or not Path(git).is_absolute() or head is None:
            return None
        try:
            with self._neutral_environment(head) as environment:
                done = subprocess.run(  # noqa: S603 - fixed words, no shell
                    [git, *words],
                    cwd=self.top,
                    env=environment,
                    capture_output=True,
                    timeout=_GIT_TIMEOUT,
                    check=True,
                )
        except (OSError, subprocess.SubprocessError):
            return None
        return os.fsdecode(done.stdout).strip()

    @contextmanager
    def _neutral_environment(self, head: str) -> Iterator[dict[str, str]]:
        """Environment variables that point git to a temporary git folder, its home as well.

        That folder has no configuration, no hooks and no attributes. The index stays unchanged:
        git takes no optional locks.
        """
        with tempfile.TemporaryDirectory(prefix="navfw-git-") as name:
            folder = Path(name)
            (folder / "refs").mkdir()
            (folder / "HEAD").write_text(f"{head}\n", encoding="ascii")
            if len(head) > 40:
                (folder / "config").write_text(_SHA256_CONFIG, encoding="ascii")
            for shared in self.private.glob("sharedindex.*"):  # the base of a split index
                (folder / shared.name).symlink_to(shared)
            kept = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")}
            yield kept | {
                "HOME": name,
                "XDG_CONFIG_HOME": name,
                "GIT_CONFIG_NOSYSTEM": "1",
                "GIT_ATTR_NOSYSTEM": "1",
                "GIT_DIR": name,
                "GIT_WORK_TREE": str(self.top),
                "GIT_INDEX_FILE": str(self.private / "index"),
                "GIT_OBJECT_DIRECTORY": str(self.common / "objects"),
                "GIT_OPTIONAL_LOCKS": "0",
                "GIT_NO_LAZY_FETCH": "1",
                "GIT_TERMINAL_PROMPT": "0",
            }


def _linked(file: Path, prefix: str = "") -> Path | None:
    """The folder that a file like ``.git`` of a worktree names, relative to the file's own."""
    text = _read(file).strip()
    name = text.removeprefix(prefix)
    return file.parent / name if text.startswith(prefix) and name and "\0" not in name else None


def _read(file: Path) -> str:
    """The text of a regular file of bounded size; empty for anything else."""
    try:
        return read_input(file).decode("utf-8", "replace")
    except ConfigError:
        return ""
