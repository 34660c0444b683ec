"""A YAML file as plain data, with the line of each of its parts."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

from navfw.config.input_file import read_input_text, shown_path
from navfw.config.yaml_text import Data, KeyPath, key_text, read_yaml_text
from navfw.errors import ConfigError, InputError, locating


@dataclass(frozen=True)
class Origin:
    """The source of a value: a line of a file, or an option of the command line."""

    file: str | None = None
    line: int | None = None
    option: str | None = None


@dataclass(frozen=True)
class YamlDocument:
    """The content of a YAML file and the origin of each of its parts.

    ``data`` is plain: dicts with str keys, lists, and scalars. Mapping keys are text as written, so
    a room called ``101`` stays ``"101"``.
    """

    file: str | None
    data: Data
    origins: Mapping[KeyPath, Origin] = field(default_factory=lambda: MappingProxyType({}))

    def origin_of(self, path: KeyPath) -> Origin:
        """Return the origin of ``path``, or of its nearest enclosing part that is known."""
        for end in range(len(path), -1, -1):
            origin = self.origins.get(path[:end])
            if origin is not None:
                return origin
        return Origin(self.file)

    def line_of(self, path: KeyPath) -> int | None:
        """Return the 1-based line of ``path`` or its nearest enclosing key; None if unknown.

        >>> parse_yaml("rooms: {lobby: 1}", "w.yaml").line_of(("rooms", "lobby", "name"))
        1
        """
        return self.origin_of(tuple(path)).line

    def locating(
        self, path: KeyPath, key: str = "", only: type[InputError] = InputError
    ) -> AbstractContextManager[None]:
        """Context that adds file, line and key of ``path`` to errors of the class ``only``.

        ``key`` is shown instead of the path; if an option has set the value, the option is shown.
        """
        origin = self.origin_of(path)
        shown = origin.option or key or key_text(path)
        return locating(file=origin.file, line=origin.line, key=shown, only=only)

    def at(self, path: KeyPath) -> Data:
        """Return the data at ``path``; None if there is none."""
        node = self.data
        for step in path:
            try:
                node = node[step]
            except (KeyError, IndexError, TypeError):
                return None
        return node


def load_yaml(path: str | Path) -> YamlDocument:
    """Read the YAML mapping in ``path``; nothing in the file is ever executed.

    Raises:
        ConfigError: there is no such readable file, it is too large, not UTF-8, not YAML, empty,
            not a mapping, or it repeats a key.

    """
    return parse_mapping(read_input_text(path), shown_path(Path(path)))


def parse_mapping(text: str, file: str) -> YamlDocument:
    """Parse ``text`` as a document whose root is a mapping; raises the errors of ``load_yaml``."""
    document = parse_yaml(text, file)
    if document.data is None:
        raise ConfigError("the file is empty; expected a mapping ('key: value' lines)", file=file)
    if not isinstance(document.data, dict):
        got = "a list" if isinstance(document.data, list) else f"{document.data!r:.40}"
        got = "XML" if text.lstrip()[:1] == "<" else got
        what = f"expected a mapping ('key: value' lines), got {got}"
        raise ConfigError(what, file=file, line=document.line_of(()))
    return document


def parse_yaml(text: str, file: str | None = None) -> YamlDocument:
    """Parse ``text`` as a document; unlike ``load_yaml`` it accepts any root.

    Raises:
        ConfigError: ``text`` is not YAML (``read_yaml_text``).

    """
    data, lines = read_yaml_text(text, file)
    origins = {path: Origin(file, line) for path, line in lines.items()}
    return YamlDocument(file, data, MappingProxyType(origins))
