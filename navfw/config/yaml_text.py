"""Converts YAML 1.2 text from and to plain data: libyaml scans it, and each value keeps its line.

If libyaml refuses a text, PyYAML's own scanner words the error, as it says more about the cause.
"""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Callable, Iterator
from typing import Any, TypeAlias

import yaml

from navfw.errors import ConfigError

KeyPath: TypeAlias = tuple[str | int, ...]
"""The path of a value in a document: mapping keys and list indices, outermost first."""

Data: TypeAlias = Any
"""Data of a YAML file: None, bool, int, float, str, lists of these and dicts with str keys."""

MAX_VALUES = 300_000
"""Largest number of keys and values that aliases may expand a text to ("billion laughs")."""

MAX_DEPTH = 60
"""Deepest nesting of lists, mappings and elements, in files of all kinds."""

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""PyYAML's own loader if it was built without libyaml."""

_REFUSED = (yaml.YAMLError, UnicodeEncodeError, OverflowError)
"""Exceptions of the scanners; the latter two are for characters that do not exist."""

_TAG = "tag:yaml.org,2002:"
_NULL = dict.fromkeys(("", "~", "null", "Null", "NULL"))
_BOOL = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_INT = re.compile(r"[-+]?(?:0b[01_]+|0o[0-7_]+|0x[0-9a-fA-F_]+|[0-9][0-9_]*)\Z")
_FLOAT = re.compile(
    r"(?:[-+]?(?:[0-9][0-9_]*(?:\.[0-9_]*)?|\.[0-9][0-9_]*)(?:[eE][-+]?[0-9]+)?"
    r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))\Z"
)
_FIRST_OF_NUMBERS = frozenset("+-.0123456789")


def read_yaml_text(text: str, file: str | None = None) -> tuple[Data, dict[KeyPath, int]]:
    """Parse ``text``: its data, None if it is empty, and the 1-based line of each of its parts.

    Mapping keys are text as written, so a room called ``101`` stays ``"101"``.

    Raises:
        ConfigError: it is not YAML, repeats a key, has tags other than those of YAML's own scalars,
            merge keys, an alias inside its anchor, or more levels than ``MAX_DEPTH``.

    """
    reader = _TextReader(file)
    data = reader.document(text)
    return data, {path: line for path, line, _ in reader.parts}


def scalar_spans(text: str) -> dict[KeyPath, tuple[int, int]]:
    """Positions of each scalar of ``text``: its first character, and the one after its last.

    Parts of an alias have the positions of its anchor.

    Raises:
        ConfigError: ``text`` is not YAML (``read_yaml_text``).

    """
    reader = _TextReader(None)
    reader.document(text)
    return {path: span for path, _, span in reader.parts if span is not None}


def write_yaml_text(data: Data, width: int = 100) -> str:
    """Format ``data`` as YAML: the innermost collections inline, all others as blocks."""
    text: str = yaml.dump(
        data,
        Dumper=_Dumper,
        default_flow_style=None,
        sort_keys=False,
        allow_unicode=True,
        width=width,
    )
    return text


class _TextReader:
    """Builds plain data from the events of a scanner; refuses what is unsafe or ambiguous."""

    def __init__(self, file: str | None) -> None:
        self._file = file
        self._events: Iterator[Any] = iter(())
        self._anchors: dict[str, tuple[Data, int, int] | None] = {}
        """The data of an anchor, and the range of its ``parts``; None until it is complete."""
        self.parts: list[tuple[KeyPath, int, tuple[int, int] | None]] = []
        """The path and the line of each part; of a scalar also its first and last position."""

    def document(self, text: str) -> Data:
        """Return the data of the only document in ``text``."""
        self._events = yaml.parse(text, Loader=_LOADER)
        try:
            return self._document(self._events)
        except _REFUSED as error:
            raise _syntax_error(text, self._file, error) from None

    def _document(self, events: Iterator[Any]) -> Data:
        next(events)  # the beginning of the stream
        if isinstance(next(events), yaml.StreamEndEvent):
            return None
        data = self._value(next(events), ())
        next(events)  # the end of the document
        further = next(events)
        if not isinstance(further, yaml.StreamEndEvent):
            raise self._error("expected one document, got a second one ('---')", further, ())
        return data

    def _value(self, event: Any, path: KeyPath, line: int | None = None) -> Data:
        if len(path) > MAX_DEPTH:
            raise self._too_deep(event)
        first, kind, begin = len(self.parts), type(event), event.start_mark
        span = (begin.index, event.end_mark.index) if kind is yaml.ScalarEvent else None
        self.parts.append((path, line or begin.line + 1, span))
        if kind is yaml.AliasEvent:
            return self._repeated(event, path)
        if event.anchor is not None:
            self._anchors[event.anchor] = None
        if kind is yaml.ScalarEvent:
            data = self._scalar(event, path)
        elif event.tag is not None:
            raise self._unsupported(event, path)
        elif kind is yaml.SequenceStartEvent:
            data = []
            while type(item := next(self._events)) is not yaml.SequenceEndEvent:
                data.append(self._value(item, (*path, len(data))))
        else:
            data = self._mapping(path)
        if event.anchor is not None:
            self._anchors[event.anchor] = data, first, len(self.parts)
        return data

    def _mapping(self, path: KeyPath) -> dict[str, Data]:
        data: dict[str, Data] = {}
        while type(event := next(self._events)) is not yaml.MappingEndEvent:
            if type(event) is not yaml.ScalarEvent:
                raise self._error("expected text as a key, got a list or mapping", event, path)
            key = self._text(event, path)
            if key == "<<" and event.implicit[0]:
                raise self._error("merge keys (<<) are not supported", event, path)
            inner = (*path, key)
            if key in data:
                first = next(line for known, line, _ in self.parts if known == inner)
                raise self._error(f"duplicate key; first given in line {first}", event, inner)
            data[key] = self._value(next(self._events), inner, event.start_mark.line + 1)
        return data

    def _repeated(self, event: Any, path: KeyPath) -> Data:
        """Return the data of an alias; its inner parts have the lines where they are written."""
        if event.anchor not in self._anchors:
            raise self._error(f"not valid YAML: found undefined alias {event.anchor!r}", event, ())
        anchor = self._anchors[event.anchor]
        if anchor is None:
            raise self._error("an alias (*) inside its own anchor (&)", event, path)
        data, first, end = anchor
        if len(self.parts) + end - first > MAX_VALUES:
            raise self._error(f"aliases repeat more than {MAX_VALUES} values", event, path)
        above, _, span = self.parts[first]
        self.parts[-1] = *self.parts[-1][:2], span
        inner = [
            ((*path, *at[len(above) :]), line, span)
            for at, line, span in self.parts[first + 1 : end]
        ]
        if any(len(at) > MAX_DEPTH for at, _, _ in inner):
            raise self._too_deep(event)
        self.parts += inner
        return copy.deepcopy(data)

    def _scalar(self, event: Any, path: KeyPath) -> Data:
        text = self._text(event, path)
        if event.tag is not None:
            kind = event.tag.removeprefix(_TAG)
        else:
            kind = _kind_of(text) if event.implicit[0] else "str"  # quoted
        read = _READERS.get(kind)
        if read is None:
            raise self._unsupported(event, path)
        try:
            return read(text)
        except (ValueError, KeyError):
            shown = text if len(text) <= 40 else text[:37] + "..."
            raise self._error(f"expected a readable {kind}, got {shown!r}", event, path) from None

    def _text(self, event: Any, path: KeyPath) -> str:
        text = str(event.value)
        try:
            text.encode()
        except UnicodeEncodeError:
            raise self._error("an unpaired surrogate is not valid text", event, path) from None
        return text

    def _unsupported(self, event: Any, path: KeyPath) -> ConfigError:
        tag = event.tag
        shown = tag.replace(_TAG, "!!") if tag.startswith(_TAG) else tag
        return self._error(f"the tag {shown} is not supported", event, path)

    def _too_deep(self, event: Any) -> ConfigError:
        return self._error(f"nested too deeply: more than {MAX_DEPTH} levels", event, ())

    def _error(self, message: str, event: Any, path: KeyPath) -> ConfigError:
        line = event.start_mark.line + 1
        return ConfigError(message, file=self._file, line=line, key=key_text(path) or None)


def key_text(path: KeyPath) -> str:
    """Format ``path`` as error messages show it: ``rooms[3].name``."""
    text = ""
    for step in path:
        text += f"[{step}]" if isinstance(step, int) else f".{step}" if text else step
    return text


def _kind_of(text: str) -> str:
    """What a plain scalar is by YAML 1.2: the name of its tag."""
    if text[:1] in _FIRST_OF_NUMBERS:
        if _INT.match(text):
            return "int"
        if _FLOAT.match(text):
            return "float"
    elif text in _BOOL:
        return "bool"
    elif text in _NULL:
        return "null"
    return "str"


def _integer(text: str) -> int:
    with_prefix = text.lstrip("+-")[1:2].isalpha()
    return int(text.replace("_", ""), 0 if with_prefix else 10)


def _number(text: str) -> float:
    words = text.lower()
    number = float(words.replace("_", "").replace(".inf", "inf").replace(".nan", "nan"))
    if math.isinf(number) and "inf" not in words:
        raise ValueError
    return number


_READERS: dict[str, Callable[[str], Data]] = {
    "str": str,
    "int": _integer,
    "float": _number,
    "bool": _BOOL.__getitem__,
    "null": _NULL.__getitem__,
}


def _syntax_error(text: str, file: str | None, error: Exception) -> ConfigError:
    """Return the error for a text that libyaml refuses for ``error``."""
    try:
        for _ in yaml.parse(text, Loader=yaml.SafeLoader):
            pass
    except _REFUSED as worded:
        error = worded
    if isinstance(error, yaml.reader.ReaderError):
        line = text.count("\n", 0, error.position) + 1
        what = f"the character U+{int(error.character):04X} is not allowed"
        return ConfigError(what, file=file, line=line)
    if not isinstance(error, yaml.MarkedYAMLError):
        return ConfigError(f"not valid YAML: {error}", file=file)
    begun, mark = error.context_mark, error.problem_mark or error.context_mark
    # for an unclosed bracket or quote, the line where it was opened
    place = begun if begun is not None and "stream" in str(error.problem) else mark
    since = begun.line + 1 if begun and place and begun.line < place.line else None
    at = None if place is None else place.line + 1
    return ConfigError(_syntax_message(error, since), file=file, line=at)


def _syntax_message(error: yaml.MarkedYAMLError, since: int | None) -> str:
    """Return the message of ``error``; what it is about began in the line ``since``."""
    problem = str(error.problem or error.context)
    if "'\\t'" in problem or " tab " in problem:
        return "a tab; indent and separate with spaces in YAML"
    if problem.startswith("expected '<document start>'"):
        return "expected one document, got a second one ('---')"
    if problem.startswith("mapping values are not allowed"):
        return "not valid YAML: a second ':' in this place; quote texts that contain ': '"
    if problem.startswith("expected <block end>, but found '<block "):
        return "indented unlike the lines above; indent all entries of a list or mapping alike"
    if error.context and str(error.context) != problem:
        problem += f" ({error.context}{'' if since is None else f' from line {since} on'})"
    return f"not valid YAML: {problem}"


class _Dumper(yaml.SafeDumper):  # type: ignore[misc]  # PyYAML has no types
    """Quotes what YAML 1.2 or 1.1 would read as anything but text."""


_Dumper.add_implicit_resolver(_TAG + "int", _INT, [*_FIRST_OF_NUMBERS])
_Dumper.add_implicit_resolver(_TAG + "float", _FLOAT, [*_FIRST_OF_NUMBERS])
