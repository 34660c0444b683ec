"""Text that is safe to show: it contains nothing that moves, hides or reorders other text."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

MAX_LINE = 10_000
"""Longest line on a terminal [characters]."""

_CONTROLS = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u00ad\u034f\u061c\u115f\u1160\u17b4\u17b5\u180b-\u180f\u200b-\u200f"
    "\u2028-\u202e\u2060-\u206f\u3164\ufe00-\ufe0f\ufeff\uffa0\ufff0-\ufffb\ud800-\udfff\U000e0000-\U000e0fff]"
)
"""Characters that no screen shows by themselves, except tab and line feed: controls, escapes, marks
of direction, characters without width, lone surrogates, tags."""
_REST = re.compile(rf"([^\n]{{{MAX_LINE}}})[^\n]+")


def printable(text: str, *, cut: bool = False) -> str:
    r"""Replace invisible characters in ``text`` by ``\x1b`` and the like; ``cut`` long lines.

    >>> printable("a\x1b[31m\u202eb")
    'a\\x1b[31m\\u202eb'
    """
    text = _CONTROLS.sub(lambda found: ascii(found[0])[1:-1], text)
    return _REST.sub(r"\1...", text) if cut else text


def printable_data(value: Any) -> Any:
    """Return ``value``, nested mappings, lists and scalars, with all its texts ``printable``."""
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, Mapping):
        return {printable_data(key): printable_data(item) for key, item in value.items()}
    return [printable_data(item) for item in value] if isinstance(value, list | tuple) else value
