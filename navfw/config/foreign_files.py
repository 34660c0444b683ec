"""Reads XML files from other programs, with the file and line of each element."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from navfw.config.input_file import MAX_TEXT, read_input, shown_path
from navfw.errors import ConfigError

_FILE, _LINE = "navfw-file", "navfw-line"
"""Attributes with the file and the line of an element."""


def read_xml(path: Path, what: str) -> Element:
    """Read the root element of the file; each element knows its file and line.

    Raises:
        ConfigError: the file cannot be read, is too large, or not XML; the message says that
            ``what`` was expected, as in "an SDF world".

    """
    return parse_xml(read_input(path, MAX_TEXT), shown_path(path), what)


def parse_xml(content: bytes, name: str, what: str) -> Element:
    """Parse ``content``, that of the file ``name``, and return its root element; see ``read_xml``.

    The lines of an expanded xacro file are not those of the file.
    """
    parser, builder = expat.ParserCreate(), TreeBuilder()

    def start(tag: str, attributes: dict[str, str]) -> None:
        attributes[_FILE] = name
        if not name.endswith(".xacro"):
            attributes[_LINE] = str(parser.CurrentLineNumber)
        builder.start(tag, attributes)

    parser.StartElementHandler = start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(content, True)
        root: Element = builder.close()
    except expat.ExpatError as error:
        reason = expat.errors.messages.get(error.code, "malformed")
        raise ConfigError(
            f"expected {what}, but it is not XML: {reason}", file=name, line=error.lineno
        ) from None
    except (LookupError, ValueError) as error:  # the declared encoding
        raise ConfigError(
            f"cannot be decoded: {error}; save it as UTF-8", file=name, line=1
        ) from None
    return root


def line_of(element: Element) -> int:
    """Return the line of an element in its file, counted from 1."""
    return int(element.get(_LINE, "1"))


def file_of(element: Element) -> Path:
    """Return the file that contains an element."""
    return Path(element.get(_FILE, ""))


def element_error(element: Element, message: str, key: str | None = None) -> ConfigError:
    """Make the error about an element, with its file and line."""
    line = int(element.get(_LINE, "0")) or None
    return ConfigError(message, file=element.get(_FILE), line=line, key=key)


def numbers_in(
    element: Element, text: str, count: int, key: str, most: float = math.inf
) -> list[float]:
    """Read ``count`` numbers, of magnitudes below ``most``, in a text of an element.

    Raises:
        ConfigError: it has others; the message has ``key``.

    """
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(abs(number) < most for number in numbers):
        what = f"expected {count} number{'s' if count > 1 else ''}, got {' '.join(text.split())!r}"
        raise element_error(element, what, key)
    return numbers
