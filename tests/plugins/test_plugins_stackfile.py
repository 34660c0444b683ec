"""Stack files: choices of plugins, bases, and the shipped stacks."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.config import find, layered, list_files, parse_yaml
from navfw.errors import InputError
from navfw.plugins import default_registry
from navfw.stack import load_stack

REGISTRY = default_registry()


def shipped(name: str) -> dict[str, object]:
    return load_stack(find("stack", name), REGISTRY).as_data()


def differing(name: str) -> set[str]:
    default, other = shipped("default"), shipped(name)
    return {key for key in default if default[key] != other[key]}


@pytest.mark.parametrize("name", [file.name for file in list_files("stack")])
def test_every_shipped_stack_loads(name: str) -> None:
    assert shipped(name)["behaviors"]


def test_variations_of_the_default_stack_differ_in_few_keys() -> None:
    assert differing("oracle") == {"flow", "oracle"}
    assert differing("poles") == {"stixels", "warmup", "commands"}
    assert differing("pedestrians") == {"commands"}
    assert differing("patrol") == {"composite", "behaviors"}
    assert differing("search") == {"composite", "behaviors", "planner"}
    assert list(shipped("default")["flow"]) == ["block_matching"]  # type: ignore[call-overload]
    behaviors = shipped("default")["behaviors"]
    assert shipped("patrol")["behaviors"] == {**behaviors, "cruise": {"weight": 0.5}}  # type: ignore[dict-item]


def test_only_two_shipped_stacks_use_the_simulators_truth() -> None:
    oracles = {file.name for file in list_files("stack") if shipped(file.name)["oracle"]}
    assert oracles == {"oracle", "navground"}


def test_stages_are_replaced_and_settings_and_behaviours_joined(tmp_path: Path) -> None:
    (tmp_path / "one.yaml").write_text(
        "base: default\nflow: {dis: }\nbehaviors: {avoid: {weight: 0.3}, cruise: }\n"
        "local_map: {margin: 0.1}\n"
    )
    (tmp_path / "two.yaml").write_text("base: ./one.yaml\nlocal_map: {occupancy: {decay: 9}}\n")
    stack = load_stack(tmp_path / "two.yaml", REGISTRY)
    assert stack.stages["flow"].name == "dis"
    assert stack.behaviors["avoid"].params.model_dump()["weight"] == 0.3
    assert {"go_to_xy", "cruise"} <= set(stack.behaviors)
    assert (stack.settings.local_map.margin, stack.settings.local_map.occupancy.decay) == (0.1, 9.0)
    over = load_stack(tmp_path / "two.yaml", REGISTRY, ["occupancy.decay=7", "cruise.weight=0.1"])
    assert over.settings.local_map.occupancy.decay == 7.0


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("base: defalt\n", r"mine\.yaml:1: base: unknown stack 'defalt': did you mean 'default'"),
        ("base: ./mine.yaml\n", r"mine\.yaml:1: base: the stack is based on itself"),
        ("base: ./none.yaml\n", r"mine\.yaml:1: base: .*no such file"),
        ("base: 3\n", r"mine\.yaml:1: base: expected text"),
        ("base: default\n\nsafety: {gop: 1}\n", r"mine\.yaml:3: safety\.gop: .*'gap'"),
        ("base: default\nbehaviors: {avoid: {wait: 1}}\n", r"mine\.yaml:2: .*wait"),
        ("base: default\nflow: {ideal: }\n", r"mine\.yaml:2: flow: .*oracle: true"),
    ],
)
def test_errors_name_the_file_and_line_of_the_upper_stack(
    tmp_path: Path, text: str, says: str
) -> None:
    (tmp_path / "mine.yaml").write_text(text)
    with pytest.raises(InputError, match=says):
        load_stack(tmp_path / "mine.yaml", REGISTRY)


def test_errors_in_the_base_name_the_line_of_the_base(tmp_path: Path) -> None:
    base = find("stack", "default").read_text().replace("go_to_xy:", "go_to_xi:")
    (tmp_path / "mine.yaml").write_text("base: ./below.yaml\n")
    (tmp_path / "below.yaml").write_text(base)
    line = base.splitlines().index("  go_to_xi:") + 1
    with pytest.raises(InputError, match=rf"below\.yaml:{line}: .*'go_to_xy'"):
        load_stack(tmp_path / "mine.yaml", REGISTRY)


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
    with pytest.raises(InputError, match=rf"mine\.yaml:.*{re.escape(says)}"):
        load_stack(file, REGISTRY)


LEAVES = st.integers(0, 9)
TREES = st.dictionaries(
    st.sampled_from("abc"), st.one_of(LEAVES, st.dictionaries(st.sampled_from("xyz"), LEAVES))
)


@given(TREES, TREES)
def test_layers_are_merged_and_the_upper_one_takes_precedence(
    low: dict[str, object], high: dict[str, object]
) -> None:
    lower, upper = (parse_yaml(repr(tree), name) for tree, name in ((low, "l"), (high, "h")))
    joined = layered(lower, upper, replaced={"c"})
    for key in low | high:
        one, other = low.get(key), high.get(key)
        both = isinstance(one, dict) and isinstance(other, dict) and key != "c"
        expected = {**one, **other} if both else other if key in high else one  # type: ignore[dict-item]
        assert joined.data[key] == expected
        if key in high:
            assert joined.origin_of((key,)).file == "h"
    assert set(joined.data) == set(low) | set(high)
    assert lower.data == low, "the layers stay as they are"
