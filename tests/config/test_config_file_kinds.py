"""A kind of file is one entry of the table: all that names, lists or checks files knows it."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import ModuleType

import pytest
from cli_calls import invoke, put_files

from navfw.cli.options import completer_of
from navfw.config import FILE_KINDS, FileKind, StrictModel, find, list_files, load_yaml, validate
from navfw.errors import ConfigError, UnknownNameError


class NoteSpec(StrictModel):
    """The content of a note."""

    text: str


def load_note(path: str) -> NoteSpec:
    """The note in a file."""
    return validate(load_yaml(path), NoteSpec)


@pytest.fixture
def notes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project with files of a kind that navfw does not have."""
    module = ModuleType("notes_of_a_test")
    vars(module).update(NoteSpec=NoteSpec, load_note=load_note)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    kind = FileKind(
        name="note",
        plural="notes",
        pattern="notes/*.yaml",
        key="text",
        model="notes_of_a_test:NoteSpec",
        load="notes_of_a_test:load_note",
    )
    monkeypatch.setitem(FILE_KINDS, "note", kind)
    texts = {"navfw.toml": "", "notes/a.yaml": "text: x\n", "b.yaml": "text: 1\n"}
    put_files(tmp_path, texts)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_further_kind_is_found_completed_checked_and_described(notes: Path) -> None:
    assert [file.name for file in list_files("note")] == ["a"]
    assert find("note", "a") == notes / "notes/a.yaml"
    with pytest.raises(UnknownNameError, match="unknown note 'b': known: a"):
        find("note", "b")
    assert completer_of("note")(None, "") == ["a"]  # type: ignore[arg-type]
    checked = json.loads(invoke("check", "--json", "b.yaml", ".").stdout)
    assert [(row["kind"], row["error"]) for row in checked] == [
        ("note", "b.yaml:1: text: expected text, got 1; quote it to make it text"),
        ("note", None),
    ]
    schema = json.loads(invoke("schema", "note").stdout)
    assert list(schema["properties"]) == ["text"]
    counted = json.loads(invoke("list", "--json").stdout)
    assert {"name": "notes", "count": 1} in counted


def test_a_kind_says_what_is_wrong_in_its_file(notes: Path) -> None:
    (notes / "notes/a.yaml").write_text("txt: x\n")
    with pytest.raises(ConfigError, match=r"notes/a.yaml:1: txt: unknown key"):
        FILE_KINDS["note"].check_file(Path("notes/a.yaml"), None)


@pytest.mark.parametrize("kind", FILE_KINDS.values(), ids=lambda kind: kind.name)
def test_every_kind_has_files_and_what_it_names(kind: FileKind) -> None:
    assert list_files(kind.name)
    assert bool(kind.load) != bool(kind.check)
    assert kind.schema()["type"] == "object"
