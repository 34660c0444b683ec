"""The nodes of a YAML text, composed from the events of libyaml's scanner.

Seven times as fast as ruamel.yaml, whose resolver of YAML 1.2 it uses. A text that libyaml refuses,
or that has tags or directives, gives no nodes: ruamel.yaml reads it and words the error.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import yaml
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.resolver import VersionedResolver
from ruamel.yaml.tag import Tag

MAX_NESTING = 100
"""Largest depth of nesting of a text that is composed here."""

_TAG = "tag:yaml.org,2002:"
_LOADER: Any = getattr(yaml, "CSafeLoader", None)
"""None where PyYAML has been built without libyaml."""

_READ_DIFFERENTLY = re.compile("[\t\x85\u2028\u2029\ufeff]|[&*][\\w-]*[^\\s\\w,}\\]-]")
"""What YAML 1.1, and so libyaml, reads otherwise than YAML 1.2: characters, ends of anchors."""


class _UnusualTextError(Exception):
    """The text has something that is left to ruamel.yaml."""


def compose_quickly(text: str, max_nodes: int) -> Node | None:
    """The root node of ``text``; None if it is to be read by ruamel.yaml.

    Tags are texts such as ``tag:yaml.org,2002:int``. Lines are those of ``start_mark``.
    """
    if _LOADER is None or _READ_DIFFERENTLY.search(text):
        return None
    try:
        return _Composer(yaml.parse(text, Loader=_LOADER), max_nodes).document()
    except (yaml.YAMLError, _UnusualTextError, ValueError, RecursionError):
        return None


class _Composer:
    def __init__(self, events: Iterator[Any], max_nodes: int) -> None:
        self._events = events
        self._left = max_nodes
        self._anchors: dict[str, Node] = {}
        self._implicit = VersionedResolver(version=(1, 2)).versioned_resolver

    def document(self) -> Node:
        """The root of the only document."""
        next(self._events)  # the beginning of the stream
        start = next(self._events)
        if not isinstance(start, yaml.DocumentStartEvent) or start.explicit:
            raise _UnusualTextError
        root = self._node(next(self._events), 0)
        next(self._events)  # the end of the document
        if not isinstance(next(self._events), yaml.StreamEndEvent):
            raise _UnusualTextError
        return root

    def _node(self, event: Any, depth: int) -> Node:
        self._left -= 1
        if self._left < 0 or depth > MAX_NESTING:
            raise _UnusualTextError
        if type(event) is yaml.AliasEvent:
            if event.anchor not in self._anchors:
                raise _UnusualTextError
            return self._anchors[event.anchor]
        if event.tag is not None:
            raise _UnusualTextError
        node = self._new(event, type(event), depth)
        if event.anchor is not None:
            self._anchors[event.anchor] = node
        return node

    def _new(self, event: Any, kind: type[Any], depth: int) -> Node:
        if kind is yaml.ScalarEvent:
            return ScalarNode(_tag(self._tag_of(event)), event.value, event.start_mark)
        if kind is yaml.SequenceStartEvent:
            items = [self._node(item, depth + 1) for item in self._until(yaml.SequenceEndEvent)]
            return SequenceNode(_tag(_TAG + "seq"), items, event.start_mark)
        pairs = [
            (self._node(key, depth + 1), self._node(next(self._events), depth + 1))
            for key in self._until(yaml.MappingEndEvent)
        ]
        return MappingNode(_tag(_TAG + "map"), pairs, event.start_mark)

    def _until(self, end: type[Any]) -> Iterator[Any]:
        while type(event := next(self._events)) is not end:
            yield event

    def _tag_of(self, event: Any) -> str:
        """The tag of a scalar without one: by its text, if that is plain."""
        if event.implicit[0]:
            value = event.value
            for tag, pattern in self._implicit.get(value[:1], ()):
                if pattern.match(value):
                    return str(tag)
        return _TAG + "str"


@lru_cache(maxsize=16)
def _tag(text: str) -> Tag:
    """One object for all nodes with a tag: it decodes its text once."""
    return Tag(suffix=text)
