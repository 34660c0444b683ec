"""Read and save a file of rules that a page edits, and find the plugin that reads it."""

from __future__ import annotations

import difflib
import sys
from dataclasses import dataclass
from pathlib import Path

from navfw.config.input_file import is_file, read_input, read_input_text, real_path, shown_path
from navfw.config.lookup import own_project, shipped_folder
from navfw.errors import InputError
from navfw.mofis.rules import RuledBehavior, RuledComposite
from navfw.plugins import default_registry
from navfw.plugins.verification import source_file
from navfw.process.atomic import atomic_file


class ChangedFileError(InputError):
    """The file has changed since the page read it; its text is ``now``.

    ``difference`` is the unified diff from it to the page's text.
    """

    def __init__(self, file: Path, now: str, text: str) -> None:
        lines = now.splitlines(), text.splitlines(), shown_path(file), "this page"
        self.now, self.difference = now, "\n".join(difflib.unified_diff(*lines, n=2, lineterm=""))
        super().__init__("has changed since this page read it, and is not replaced", file=file)


@dataclass
class RulesFile:
    """A file of rules at ``path``; after ``save`` the project's copy if one was made.

    ``plugin`` is the Python file that reads it, None if none does.
    """

    path: Path
    plugin: Path | None = None

    def read(self) -> str:
        """Return the text with line feeds only; raises ConfigError if it cannot be read."""
        return read_input_text(self.path).replace("\r\n", "\n")

    def target(self) -> Path:
        """Return the path that ``save`` writes: this file, or the project's copy of it.

        A file of a plugin that ships with navfw, or is in no project, is copied into the project's
        ``behaviors``, where it is used in place of the original.

        Raises:
            InputError: there is no project, or no plugin for a copy.

        """
        file, project = real_path(self.path), own_project()
        installed = {real_path(place) for place in (sys.prefix, shipped_folder())}
        if own_project(file.parent) is not None and installed.isdisjoint(file.parents):
            return self.path
        if project is not None and self.plugin is not None:
            return project / "behaviors" / self.path.name
        why = "there is no project here: navfw new project DIR, then navfw rules in DIR"
        why = why if project is None else "no behaviour would read a copy in this project"
        raise InputError(f"is not the user's own, and {why}", file=shown_path(self.path))

    def save(self, text: str, read: str) -> str:
        """Write ``text`` to ``target``, if the file still contains the text ``read`` before.

        Returns a sentence that says where it was saved.

        Raises:
            ChangedFileError: the file contains something else.
            InputError: it has no ``target``, or cannot be written.

        """
        target = self.target()
        source = target if is_file(target) else self.path
        with atomic_file(target, parents=True) as part:
            now = RulesFile(source).read()
            if now != read:
                raise ChangedFileError(source, now, text)
            feed = "\r\n" if b"\r\n" in read_input(source) else "\n"
            part.write_bytes(text.replace("\n", feed).encode())
        self.path = target
        return f"saved: {shown_path(target)}{', a copy for this project' * (source != target)}"


def find_rules(name: str) -> RulesFile:
    """Find the rules of the behaviour or composite ``name``, or in the file of that path.

    Raises:
        InputError: there is no such plugin or file, or the plugin has no file of rules.

    """
    path = Path(name)
    if path.suffix in {".yaml", ".yml"} or path.parent != Path():
        beside = path.with_suffix(".py"), shipped_folder() / "behaviors" / f"{path.stem}.py"
        return RulesFile(path, next(filter(is_file, beside), None))
    registry = default_registry()
    cls = registry.get("composite" if name in registry.names("composite") else "behavior", name)
    file = cls.rules_file() if issubclass(cls, RuledBehavior | RuledComposite) else None
    if file is None or not is_file(file):
        raise InputError(f"{name!r} has no rules in a YAML file beside it", key="FILE|BEHAVIOR")
    return RulesFile(file, source_file(cls))
