"""Reading of an XML file from elsewhere: no document type, no entities, bounded size and depth."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from navfw.config.input_file import MAX_DEPTH, read_input, shown_path
from navfw.errors import ConfigError

_LINE = "navfw-line"
"""Attribute with the line of an element."""


def read_xml(path: Path, max_bytes: int, what: str, *, doctype: bool = False) -> Element:
    """The root element of the file; ``line_of`` gives the line of each element.

    A document type, with ``doctype``, may be named, but declares no entities and is not read.

    Raises:
        ConfigError: the file cannot be read, is larger than ``max_bytes``, nested too deep, or not
            XML; the message says that ``what`` was expected, as in "an SDF world".

    """
    return parse_xml(read_input(path, max_bytes), shown_path(path), what, doctype=doctype)


def parse_xml(content: bytes, name: str, what: str, *, doctype: bool = False) -> Element:
    """The root element of ``content``, that of the file ``name``; see ``read_xml``."""
    parser = expat.ParserCreate()
    builder = TreeBuilder()
    depth = 0

    def refuse(*_: object) -> None:
        message = "document types and entities are not allowed; write the text itself"
        raise ConfigError(message, file=name, line=parser.CurrentLineNumber)

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise ConfigError("is nested too deep", file=name, line=parser.CurrentLineNumber)
        builder.start(tag, {**attributes, _LINE: str(parser.CurrentLineNumber)})

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    if not doctype:
        parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.StartElementHandler = start
    parser.EndElementHandler = end
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
    """The line [from 1] of an element in its file."""
    return int(element.get(_LINE, "1"))
