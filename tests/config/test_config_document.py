"""YAML files: what is read with which lines, what is refused, and what is written."""

import contextlib
import math
import re
from pathlib import Path

import pytest
import yaml as pyyaml
from cli_calls import put_file
from hypothesis import example, given, settings
from hypothesis import strategies as st

from navfw.config import yaml_text
from navfw.config.document import load_yaml, parse_yaml
from navfw.config.yaml_text import MAX_DEPTH, KeyPath, key_text, write_yaml_text
from navfw.errors import ConfigError


def load(folder: Path, text: str | bytes, name: str = "world.yaml") -> ConfigError:
    """The error that this text raises when loaded from a file."""
    with pytest.raises(ConfigError) as caught:
        load_yaml(put_file(folder, name, text))
    return caught.value


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("a: 1\nb: 2\na: 3\n", 3, "a: duplicate key; first given in line 1"),
        ("a:\n  b: 1\n  c: 2\n  b: 3\n", 4, "a.b: duplicate key; first given in line 2"),
        ("a: {b: 1, b: 2}\n", 1, "a.b: duplicate key"),
        ("a: 1\n\tb: 2\n", 2, "a tab; indent and separate with spaces"),
        ("a:\n\t- 1\n", 2, "a tab; indent and separate with spaces"),
        ("a: [1\nb: 2\n", 2, "not valid YAML: expected ',' or ']'"),
        ("a: 'x\n", 1, "found unexpected end of stream"),
        ("a: b: c\n", 1, "a second ':'"),
        ("- 1\n- 2\n", 1, "expected a mapping ('key: value' lines), got a list"),
        ("# only this\n\njust words\n", 3, "expected a mapping"),
        ("a: 1\n---\nb: 2\n", 2, "expected one document"),
        ("a: *nothing\n", 1, "undefined alias"),
        ("a: &x [*x]\n", 1, "an alias (*) inside its own anchor (&)"),
        ("a: 1\nb: !!python/object/apply:os.system ['true']\n", 2, "!!python/object/apply"),
        ("a: !mine 3\n", 1, "the tag !mine is not supported"),
        ("a: !!python/name:os.system x\n", 1, "is not supported"),
        ("x: &x {a: 1}\nb:\n  <<: *x\n", 3, "merge keys (<<) are not supported"),
        ("? [1, 2]\n: 3\n", 1, "expected text as a key"),
        ("a: 1\nb: \x01\n", 2, "U+0001 is not allowed"),
        (b"a: 1\nb: \xff\n", 2, "expected UTF-8 text, got byte 0xff"),
        ("a: " + "9" * 5000 + "\n", 1, "expected a readable int"),
        ("a: 1e999\n", 1, "expected a readable float, got '1e999'"),
    ],
)
def test_errors_name_file_line_and_problem(
    tmp_path: Path, text: str | bytes, line: int, message: str
) -> None:
    error, file = load(tmp_path, text), str(tmp_path / "world.yaml")
    assert (error.file, error.line) == (file, line)
    assert message in str(error)
    assert str(error).startswith(f"{file}:{line}: ")


@pytest.mark.parametrize("text", ["", "\n\n", "# nothing but words\n", "---\n", "null\n"])
def test_empty_file(tmp_path: Path, text: str) -> None:
    assert "the file is empty; expected a mapping" in str(load(tmp_path, text))


def test_a_file_too_large_or_missing(tmp_path: Path) -> None:
    with put_file(tmp_path, "office.yaml", "a: x").open("r+b") as stream:
        stream.truncate(50_000_001)
    with pytest.raises(ConfigError, match="too large: at most 50000000 bytes"):
        load_yaml(tmp_path / "office.yaml")
    with pytest.raises(ConfigError, match=r"offise.yaml: there is no such file; .*'office.yaml'"):
        load_yaml(tmp_path / "offise.yaml")
    with pytest.raises(ConfigError, match=r"there is no such file$"):
        load_yaml(tmp_path / "nowhere" / "x.yaml")


def test_files_below_the_working_folder_are_shown_relative(workdir: Path) -> None:
    assert str(load(workdir, "a: 1\na: 2", "maps/m.yaml")).startswith("maps/m.yaml:2: a: ")


def test_alias_bombs_are_rejected_quickly() -> None:
    rows = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    rows += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 12)]
    with pytest.raises(ConfigError, match="aliases repeat more than"):
        parse_yaml("\n".join(rows))


@pytest.mark.parametrize(
    "text",
    [
        "[\n" * 5_000,
        "- " * 20_000,
        "{a: " * 20_000,
        f"a: &x {'[' * 50}{']' * 50}\nb: [{'[' * 12}*x",
    ],
)
def test_deep_nesting_is_rejected(text: str) -> None:
    with pytest.raises(ConfigError, match="nested too deeply"):
        parse_yaml(text)


def test_nesting_up_to_the_limit_is_read() -> None:
    data = parse_yaml("[" * MAX_DEPTH + "]" * MAX_DEPTH).data
    for _ in range(MAX_DEPTH - 1):
        (data,) = data
    assert data == []


def test_an_alias_may_repeat_a_part() -> None:
    document = parse_yaml("a: &x {b: 1}\nc: *x\n")
    assert document.data["a"] is not document.data["c"]
    assert document.data == {"a": {"b": 1}, "c": {"b": 1}}
    assert document.line_of(("c",)) == 2
    assert document.line_of(("c", "b")) == 1  # where it is written


def test_scalars_are_those_of_yaml_1_2() -> None:
    text = "[yes, on, 017, 0o17, 0x1F, 1_000, 1e-3, .inf, -.inf, ~, true, 2024-01-01, '5', 12:30]"
    inf = math.inf
    want = ["yes", "on", 17, 15, 31, 1000, 1e-3, inf, -inf, None, True, "2024-01-01", "5", "12:30"]
    assert parse_yaml(text).data == want


def test_keys_are_text_as_written_and_a_byte_order_mark_is_ignored(tmp_path: Path) -> None:
    assert list(parse_yaml("{101: a, 0x1F: b, true: c, ~: d}").data) == ["101", "0x1F", "true", "~"]
    assert load_yaml(put_file(tmp_path, "a.yaml", "\ufeffa: ü\n")).data == {"a": "ü"}


def test_lines_of_keys_and_items() -> None:
    document = parse_yaml(
        "name: office\nrooms:\n- name: lobby\n  size: [3,\n    4]\n- {name: lab, size: [1, 2]}\n",
        "office.yaml",
    )
    lines: dict[KeyPath, int] = {
        (): 1,
        ("rooms",): 2,
        ("rooms", 0): 3,
        ("rooms", 0, "size"): 4,
        ("rooms", 0, "size", 1): 5,
        ("rooms", 1): 6,
        ("rooms", 1, "size", 0): 6,
        ("rooms", 1, "colour"): 6,  # unknown: the nearest enclosing key
        ("light", "sun"): 1,
    }
    assert {path: document.line_of(path) for path in lines} == lines


def test_parts_by_path_and_the_text_of_a_path() -> None:
    document = parse_yaml("a: [{b: 3}]")
    assert document.at(("a", 0, "b")) == 3
    assert document.at(("a", 1)) is None
    assert document.at(("a", "b", "c")) is None
    assert key_text(("rooms", 3, "name")) == "rooms[3].name"
    assert key_text((0, "a")) == "[0].a"


@settings(max_examples=150)
@given(st.text("ab:-[]{}#&*!|>'\"%@`,?\n \t0.<~\\\0é", max_size=25))
@example("%YAML 9.9\n---\na: 1")
@example("%TAG ! x\n---\na: !b")
@example("a: !<x> 1")
@example('a: "\\ud800"')
@example('a: "\\UFFFFFFFF"')
@example("a: !!int x")
@example("a: !!float ''")
@example("a: !!bool maybe")
@example("a: !!int ''")
@example("!!set {a, b}")
def test_any_text_is_read_or_raises_config_error(text: str) -> None:
    with contextlib.suppress(ConfigError):
        parse_yaml(text, "a.yaml")


PLAIN_WORDS = """
    yes no on null ~ true False 0o17 017 1:30 1_000 0x1F +1 1. -.inf .nan 1e3 2020-01-01 << *a | >-
    '' 'a''b' "\\u00e9" [ ] { } , --- ... 0b11 - + . _ = 1e 0x
"""


@settings(max_examples=300)
@given(st.lists(st.sampled_from([*PLAIN_WORDS.split(), " ", "a: ", "b"]), max_size=6).map("".join))
def test_any_text_that_is_written_is_read_again(text: str) -> None:
    numbers = [0, -(10**12), 1e-7, -2.5e300, math.inf, None, True]
    for data in (text, [text], {"key": [{text or "a": text}]}, numbers):
        assert parse_yaml(write_yaml_text(data)).data == data
        assert pyyaml.safe_load(write_yaml_text(data)) == data  # by YAML 1.1 as well


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("a:\n  b: 1\n c: 2\n", 3, "indented unlike the lines above"),
        ("a: [[1]\nb: 2\n", 2, "(while parsing a flow sequence from line 1 on)"),
        ("a: [1, 2\n", 1, "but got '<stream end>' (while parsing a flow sequence)"),
        ('a: "x\\q"\n', 1, "unknown escape character 'q'"),
    ],
)
def test_errors_say_what_was_found_where(
    text: str, line: int, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for loader in (yaml_text._LOADER, pyyaml.SafeLoader):  # with libyaml, and without
        monkeypatch.setattr(yaml_text, "_LOADER", loader)
        with pytest.raises(ConfigError, match=re.escape(message)) as caught:
            parse_yaml(text)
        assert caught.value.line == line
