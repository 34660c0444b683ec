"""One YAML file as plain data, with the line of each of its parts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias, cast

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError

from navfw.config.input_file import INPUT_BOUNDS, MAX_DEPTH, read_input_text, shown_path
from navfw.config.yaml_compose import compose_quickly
from navfw.errors import ConfigError, InputError, locating

KeyPath: TypeAlias = tuple[str | int, ...]
"""The path of a value in a document: mapping keys and list indices, outermost first."""

Data: TypeAlias = Any
"""Data of a YAML file: None, bool, int, float, str, lists of these and dicts with str keys."""

MAX_NODES = INPUT_BOUNDS["YAML"].items
"""Largest number of keys and values in a file, except for maps.

A value counts again for each alias that repeats it: with nested aliases, a file of a megabyte can
describe billions of values ("billion laughs").
"""

_TAG = "tag:yaml.org,2002:"
_CONSTRUCTOR = YAML(typ="safe", pure=True).constructor
_FURTHER_ERRORS = (ValueError, ArithmeticError, AssertionError, LookupError)
"""What ruamel raises for some malformed input besides YAMLError, AttributeError and TypeError."""


@dataclass(frozen=True)
class Origin:
    """Where a value comes from: a line of a file, or an option of the command line."""

    file: str | None = None
    line: int | None = None
    option: str | None = None


@dataclass(frozen=True)
class YamlDocument:
    """The content of a YAML file and the origin of each of its parts.

    ``data`` is plain: dicts with str keys, lists, and scalars. Mapping keys are text as written,
    so a room called ``101`` stays ``"101"``.
    """

    file: str | None
    data: Data
    origins: Mapping[KeyPath, Origin] = field(default_factory=lambda: MappingProxyType({}))

    def origin_of(self, path: KeyPath) -> Origin:
        """The origin of ``path``, or of its nearest enclosing part that is known."""
        for end in range(len(path), -1, -1):
            origin = self.origins.get(path[:end])
            if origin is not None:
                return origin
        return Origin(self.file)

    def line_of(self, path: KeyPath) -> int | None:
        """The 1-based line of ``path`` or its nearest enclosing key; None where no line is known.

        >>> parse_yaml("rooms: {lobby: 1}", "w.yaml").line_of(("rooms", "lobby", "name"))
        1
        """
        return self.origin_of(tuple(path)).line

    def locating(
        self, path: KeyPath, key: str = "", only: type[InputError] = InputError
    ) -> AbstractContextManager[None]:
        """Give errors in the block, ``only`` those of a class, the place of ``path`` in the file.

        ``key`` is shown instead of the path, an option that has set the value instead of both.
        """
        origin = self.origin_of(path)
        shown = origin.option or key or key_text(path)
        return locating(file=origin.file, line=origin.line, key=shown, only=only)

    def at(self, path: KeyPath) -> Data:
        """The data at ``path``; None where there is nothing."""
        node = self.data
        for step in path:
            try:
                node = node[step]
            except (KeyError, IndexError, TypeError):
                return None
        return node


def key_text(path: KeyPath) -> str:
    """``path`` as error messages show it: ``rooms[3].name``."""
    text = ""
    for step in path:
        text += f"[{step}]" if isinstance(step, int) else f".{step}" if text else step
    return text


def load_yaml(path: str | Path, kind: str = "YAML") -> YamlDocument:
    """Read the YAML mapping in ``path``; nothing in the file is ever executed.

    Raises:
        ConfigError: there is no such readable file, it is larger than ``kind`` allows, not UTF-8,
            not YAML, empty, not a mapping, it repeats a key, or has too many keys and values.

    """
    bounds = INPUT_BOUNDS[kind]
    text = read_input_text(path, bounds.max_bytes)
    return parse_mapping(text, shown_path(Path(path)), bounds.items)


def parse_mapping(text: str, file: str, max_nodes: int = MAX_NODES) -> YamlDocument:
    """``text`` as a document whose root is a mapping; raises as ``load_yaml``."""
    document = parse_yaml(text, file, max_nodes)
    if document.data is None:
        raise ConfigError("the file is empty; expected a mapping ('key: value' lines)", file=file)
    if not isinstance(document.data, dict):
        got = "a list" if isinstance(document.data, list) else f"{document.data!r:.40}"
        what = f"expected a mapping ('key: value' lines), got {got}"
        raise ConfigError(what, file=file, line=document.line_of(()))
    return document


def parse_yaml(text: str, file: str | None = None, max_nodes: int = MAX_NODES) -> YamlDocument:
    """``text`` as a document; unlike ``load_yaml`` it accepts any root.

    Raises:
        ConfigError: it is not YAML, repeats a key, has tags, endless aliases or more than
            ``max_nodes`` keys and values.

    """
    root = compose_quickly(text, max_nodes) or _compose(text, file, max_nodes)
    if root is None:
        return YamlDocument(file, None)
    builder = _NodeConverter(file, max_nodes)
    data = builder.build(root, (), root.start_mark.line + 1)
    return YamlDocument(file, data, MappingProxyType(builder.origins))


def _compose(text: str, file: str | None, max_nodes: int) -> Node | None:
    """The root node of ``text`` by ruamel.yaml, whose errors are worded for people."""
    yaml = YAML(typ="safe", pure=True)  # pure: the C scanner words its errors differently
    yaml.Composer = partial(_BoundedComposer, file, max_nodes)  # type: ignore[assignment]
    yaml.composer.warn_double_anchors = False
    try:
        return cast(Node | None, yaml.compose(text))
    except MarkedYAMLError as error:
        # for an unclosed bracket or quote, the line where it was opened
        unclosed = "end" in str(error.problem) and error.context_mark is not None
        mark = error.context_mark if unclosed else error.problem_mark or error.context_mark
        line = None if mark is None else mark.line + 1
        raise ConfigError(_syntax_message(error), file=file, line=line) from None
    except ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise ConfigError(
            f"the character U+{error.character:04X} is not allowed", file=file, line=line
        ) from None
    except RecursionError:
        raise ConfigError("nested too deeply", file=file) from None
    except (YAMLError, AttributeError, TypeError, *_FURTHER_ERRORS) as error:
        detail = str(error).splitlines() or [type(error).__name__]
        raise ConfigError(f"not valid YAML: {detail[0]}", file=file) from None


class _BoundedComposer(Composer):
    """Composes the nodes of a text, and stops at a number of them."""

    def __init__(self, file: str | None, max_nodes: int, loader: Any) -> None:
        super().__init__(loader)
        self._file = file
        self._max_nodes = max_nodes
        self._nodes = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        """The next node; raises ConfigError if there are too many."""
        self._nodes += 1
        if self._nodes > self._max_nodes:
            line = self.parser.peek_event().start_mark.line + 1
            raise ConfigError(_too_much(self._max_nodes), file=self._file, line=line)
        return super().compose_node(parent, index)


def _too_much(max_nodes: int) -> str:
    return f"too much content: more than {max_nodes} keys and values"


class _NodeConverter:
    """Turns composed nodes into plain data; records lines and rejects unsafe or ambiguous input."""

    def __init__(self, file: str | None, max_nodes: int) -> None:
        self._max_nodes = max_nodes
        self._file = file
        self._nodes = 0
        self._open: set[int] = set()
        self._scalars: dict[int, Data] = {}
        self.origins: dict[KeyPath, Origin] = {}

    def build(self, node: Node, path: KeyPath, line: int) -> Data:
        self._nodes += 1
        if self._nodes > self._max_nodes:
            raise self._error(_too_much(self._max_nodes), node, path)
        if len(path) > MAX_DEPTH:
            raise self._error(f"nested too deeply: more than {MAX_DEPTH} levels", node, ())
        self.origins[path] = Origin(self._file, line)
        if isinstance(node, ScalarNode):
            if id(node) not in self._scalars:  # aliases repeat nodes
                self._scalars[id(node)] = self._scalar(node, path)
            return self._scalars[id(node)]
        if id(node) in self._open:
            raise self._error("an alias (*) inside its own anchor (&)", node, path)
        self._open.add(id(node))
        try:
            if isinstance(node, MappingNode):
                return self._mapping(node, path)
            if isinstance(node, SequenceNode) and node.tag == _TAG + "seq":
                return [
                    self.build(item, (*path, index), item.start_mark.line + 1)
                    for index, item in enumerate(node.value)
                ]
        finally:
            self._open.discard(id(node))
        raise self._error(f"the tag {_tag_text(node.tag)} is not supported", node, path)

    def _mapping(self, node: MappingNode, path: KeyPath) -> dict[str, Data]:
        if node.tag != _TAG + "map":
            raise self._error(f"the tag {_tag_text(node.tag)} is not supported", node, path)
        result: dict[str, Data] = {}
        for key_node, value_node in node.value:
            if not isinstance(key_node, ScalarNode):
                raise self._error("expected text as a key, got a list or mapping", key_node, path)
            if key_node.tag == _TAG + "merge":
                raise self._error("merge keys (<<) are not supported", key_node, path)
            key = str(key_node.value)
            self._check_text(key, key_node, path)
            inner = (*path, key)
            line = key_node.start_mark.line + 1
            if key in result:
                first = self.origins[inner].line
                raise self._error(f"duplicate key; first given in line {first}", key_node, inner)
            result[key] = self.build(value_node, inner, line)
        return result

    def _scalar(self, node: ScalarNode, path: KeyPath) -> Data:
        tag = str(node.tag).removeprefix(_TAG)
        text = str(node.value)
        try:
            match tag:
                case "null":
                    return None
                case "bool":
                    return bool(_CONSTRUCTOR.construct_yaml_bool(node))
                case "int":
                    return int(_CONSTRUCTOR.construct_yaml_int(node))
                case "float":
                    number = float(_CONSTRUCTOR.construct_yaml_float(node))
                    if math.isinf(number) and "inf" not in text.lower():
                        raise ValueError
                    return number
                # "timestamp": no data file has dates, so a name that looks like one stays text
                case "str" | "timestamp":
                    self._check_text(text, node, path)
                    return text
        except (ValueError, KeyError, LookupError, AssertionError):
            shown = text if len(text) <= 40 else text[:37] + "..."
            raise self._error(f"expected a readable {tag}, got {shown!r}", node, path) from None
        raise self._error(f"the tag {_tag_text(node.tag)} is not supported", node, path)

    def _check_text(self, text: str, node: Node, path: KeyPath) -> None:
        try:
            text.encode()
        except UnicodeEncodeError:
            raise self._error("an unpaired surrogate is not valid text", node, path) from None

    def _error(self, message: str, node: Node, path: KeyPath) -> ConfigError:
        line = node.start_mark.line + 1
        return ConfigError(message, file=self._file, line=line, key=key_text(path) or None)


def _syntax_message(error: MarkedYAMLError) -> str:
    problem = str(error.problem or error.context or "not valid YAML")
    if "'\\t'" in problem:
        return "a tab; indent and separate with spaces in YAML"
    if problem.startswith("but found another document"):
        return "expected one document, got a second one ('---')"
    if problem.startswith("mapping values are not allowed"):
        return "not valid YAML: a second ':' in this place; quote texts that contain ': '"
    if error.context and str(error.context) != problem:
        problem = f"{problem} ({error.context})"
    return f"not valid YAML: {problem}"


def _tag_text(tag: object) -> str:
    text = str(tag)
    return text.replace(_TAG, "!!") if text.startswith(_TAG) else text
