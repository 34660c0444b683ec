"""Texts composed from libyaml's events are those that ruamel.yaml composes."""

from __future__ import annotations

import string
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode

from navfw.config import MAX_NESTING, compose_quickly

ROOT = Path(__file__).parents[2]
FILES = sorted(
    path
    for folder in ("worlds", "maps", "behaviors", "navfw")
    for path in (ROOT / folder).rglob("*.yaml")
)
PLAIN_WORDS = """
    yes no on null ~ true False 0o17 017 1:30 1_000 0x1F +1 1. -.inf .nan 1e3 2020-01-01 << *a | >-
    '' 'a''b' "\\u00e9" [ ] { } , --- ...
"""
WORDS = [
    *PLAIN_WORDS.split(),
    *("!!str 1", "&a b", "? ", "- ", ": ", "# c", "\n", "\n  ", "\r\n"),
    *("\t", "\x85", "\u2028", "%YAML 1.1\n", "\ufeff"),
]


def plain(node: Node) -> object:
    """Tags, texts and lines of a node and all within it; what is empty has no line."""
    line = node.start_mark.line if node.value != "" else None
    if isinstance(node, ScalarNode):
        return str(node.tag), node.value, line
    if isinstance(node, MappingNode):
        return str(node.tag), [(plain(key), plain(value)) for key, value in node.value], line
    return str(node.tag), [plain(item) for item in node.value], line


def by_ruamel(text: str) -> Node | None:
    return YAML(typ="safe", pure=True).compose(text)  # type: ignore[no-any-return]


def test_shipped_files_are_composed_quickly_and_alike() -> None:
    for path in FILES:
        text = path.read_text(encoding="utf-8")
        quick, slow = compose_quickly(text, 100_000), by_ruamel(text)
        assert quick is not None, path
        assert slow is not None, path
        assert plain(quick) == plain(slow), path


@settings(max_examples=300)
@given(
    st.lists(st.sampled_from([*WORDS, *string.ascii_lowercase[:3], " ", "a: ", "b"]), max_size=12)
)
def test_any_text_is_composed_alike_or_left_to_ruamel(parts: list[str]) -> None:
    text = "".join(parts)
    quick = compose_quickly(text, 1000)
    if quick is None:
        return
    try:
        slow = by_ruamel(text)
    except YAMLError as error:
        raise AssertionError(f"ruamel.yaml refuses {text!r}") from error
    assert slow is not None
    assert plain(quick) == plain(slow)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a: b: c",
        "a: [1",
        "a\tb: 1",
        "x: !!int 3",
        "x: &a: 1",
        "--- 1",
        "[1, 2, 3, 4, 5]",
        "[" * (MAX_NESTING + 2) + "]" * (MAX_NESTING + 2),
    ],
)
def test_what_is_not_ordinary_is_left_to_ruamel(text: str) -> None:
    assert compose_quickly(text, 5) is None
