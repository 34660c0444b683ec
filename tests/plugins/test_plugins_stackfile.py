"""Errors of stack files that choose plugins wrongly."""

from __future__ import annotations

from pathlib import Path

import pytest

from navfw.config import find
from navfw.errors import InputError
from navfw.plugins import default_registry
from navfw.stack import load_stack


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("flow:\n", "flow:\n  dis:\n", "flow: expected one plugin, as 'name: {parameters}' or"),
        ("flow:\n", "flow:\n  dis:\n", "; got dis, block_matching"),
        ("planner:\n  papfis:\n", "planner:\n", "planner: expected one plugin, "),
        ("planner:\n  papfis:\n", "planner: papfis\n", "'name:'; got none"),
        ("planner:\n  papfis:\n", "", "planner: missing"),
        (
            "  peek:\n",
            "  peak:\n",
            "behaviors: unknown behavior plugin 'peak': did you mean 'peek'",
        ),
        ("  peek:\n", "  peek: 3\n", "behaviors.peek: expected a mapping or null, got 3"),
        ("  peek:\n", "  peek: {depht: 3}\n", "behaviors.peek.depht: unknown key"),
        ("behaviors:\n", "behaviors:\nextra:\n", "behaviors: expected plugins, each as 'name: {"),
        ("fusion:\n", "fussion:\n", "fussion: unknown key; did you mean 'fusion'?"),
    ],
)
def test_errors_name_the_wrong_choice(old: str, new: str, says: str, tmp_path: Path) -> None:
    text = find("stack", "default").read_text(encoding="utf-8")
    assert old in text
    file = tmp_path / "mine.yaml"
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_stack(file, default_registry())
    assert "mine.yaml:" in str(caught.value)
    assert says in str(caught.value)


def test_the_default_stack_has_the_plugins_of_its_file() -> None:
    config = load_stack(find("stack", "default"), default_registry())
    assert config.stages["flow"].name == "block_matching"
    assert "peek" in config.behaviors
