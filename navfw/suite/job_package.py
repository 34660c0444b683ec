"""What runs on other machines need: the files of the project and of its worlds, with their hash.

What ships with navfw does not travel: workers have the same version of it (``worker_identity``).
"""

from __future__ import annotations

import hashlib
import io
import platform
import tempfile
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Self

from navfw.config.extras import pybullet_version
from navfw.config.input_file import read_input, real_path
from navfw.config.lookup import project_folder, shipped_folder
from navfw.errors import InputError
from navfw.plugins.built_in import GROUPS
from navfw.recording.provenance import code_fingerprint, files_of
from navfw.suite.case import Case, Job

_MAX_PACKAGE = 200_000_000
"""Largest size of all files that travel [byte]."""

_PROJECT_PARTS = ("worlds", "maps", "stacks", "robots", "behaviors", "plugins")
_PACKAGE = Path(__file__).parents[1]
_LIBRARIES = ("numpy", "numba", "opencv-python-headless", "scipy")
_PATHS = ("world", "mission", "stack")
_OUTSIDE = "outside-"


@dataclass(frozen=True)
class JobPackage:
    """Files as a zip archive, and the local folders that their names stand for.

    Inside the archive, the project is ``project``; what lies outside of it, folders of worlds, and
    missions and stacks, is ``outside-2``, ``outside-3``, ... ``key`` is the hash of the archive.
    """

    archive: bytes
    folders: tuple[tuple[str, str], ...]

    @classmethod
    def of(cls, cases: Sequence[Case]) -> Self:
        """The package of ``cases`` and of the project around the working folder.

        Raises:
            InputError: a file cannot be read, or all together are larger than ``_MAX_PACKAGE``.

        """
        project = project_folder()
        if project is not None and real_path(project) == shipped_folder():
            project = None
        roots = {"shipped": shipped_folder(), "package": _PACKAGE}
        if project is not None:
            roots["project"] = project
        worlds = [Path(case.world).parent for case in cases if case.world]
        files = [Path(file) for case in cases for file in (case.mission, case.stack) if file]
        for path in dict.fromkeys([*worlds, *files]):
            if not any(path.is_relative_to(root) for root in roots.values()):
                suffix = path.suffix if path.is_file() else ""
                roots[f"{_OUTSIDE}{len(roots)}{suffix}"] = path
        stream, total = io.BytesIO(), 0
        entry = zipfile.ZipInfo  # without a time: the same files give the same hash
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(entry("project/"), b"")
            if project is not None:
                archive.writestr(entry("project/navfw.toml"), b"")
            for name, file in _travelling(roots):
                content = read_input(file, _MAX_PACKAGE)
                total += len(content)
                if total > _MAX_PACKAGE:
                    what = f"the files of the project exceed {_MAX_PACKAGE // 1_000_000} MB"
                    raise InputError(f"{what}; move what no run needs", file=project or file)
                archive.writestr(entry(name), content)
        return cls(stream.getvalue(), tuple((name, str(root)) for name, root in roots.items()))

    @property
    def key(self) -> str:
        """The SHA-256 of the archive, its first 16 digits."""
        return hashlib.sha256(self.archive).hexdigest()[:16]

    def packed(self, job: Job) -> Job:
        """``job`` with names of the package instead of local paths."""
        changed: dict[str, str] = {}
        for place in _PATHS:
            path = getattr(job.case, place)
            within = [item for item in self.folders if path and Path(path).is_relative_to(item[1])]
            if within:  # the innermost: the package may lie inside of what is shipped
                name, root = max(within, key=lambda item: len(item[1]))
                changed[place] = f"{name}:{Path(path).relative_to(root).as_posix()}"
        return replace(job, case=replace(job.case, **changed))  # type: ignore[arg-type]

    def unpacked(self, job: Job, folder: Path) -> Job:
        """``job`` with the paths of this machine; ``folder`` is that of the unpacked files."""
        changed: dict[str, str] = {}
        for place in _PATHS:
            name, colon, rest = getattr(job.case, place).partition(":")
            if colon:
                root = {"shipped": shipped_folder(), "package": _PACKAGE}.get(name, folder / name)
                changed[place] = str(root / rest)
        return replace(job, case=replace(job.case, **changed))  # type: ignore[arg-type]

    def unpack(self, folder: Path) -> Path:
        """The folder with the files, inside ``folder``; written once.

        Raises:
            OSError: it cannot be written.

        """
        target = folder / f"navfw-{self.key}"
        if not target.exists():
            temporary = Path(tempfile.mkdtemp(dir=folder))
            with zipfile.ZipFile(io.BytesIO(self.archive)) as archive:
                archive.extractall(temporary)
            temporary.rename(target)
        return target


@cache
def worker_identity() -> dict[str, str]:
    """What has to be the same on all machines: versions, navfw's own files, and its plugins.

    ``plugins`` are those of other installed packages, as ``kind name``.
    """
    versions = {name: metadata.version(name) for name in _LIBRARIES}
    plugins = {
        f"{kind} {point.name}"
        for group, kind in GROUPS.items()
        for point in metadata.entry_points(group=group)
    }
    return {
        "navfw": f"{metadata.version('navfw')} ({code_fingerprint()[:12]})",
        "python": platform.python_version(),
        **versions,
        "pybullet": pybullet_version(),
        "plugins": ", ".join(sorted(plugins)),
    }


def _travelling(roots: Mapping[str, Path]) -> Iterator[tuple[str, Path]]:
    """The files of the project's parts, and those outside of it, by name."""
    own = {name: root for name, root in roots.items() if name.startswith(_OUTSIDE)}
    if "project" in roots:
        own |= {f"project/{name}": roots["project"] / name for name in _PROJECT_PARTS}
    return files_of(own)
