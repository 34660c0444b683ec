"""Files found by kind and name, shipped and of a project; projects; kinds of files."""

import json
import os
import sys
from pathlib import Path
from types import ModuleType

import pytest
from cli_calls import answer, invoke, output, put_file, put_files

from navfw.cli.options import completer_of
from navfw.config import lookup
from navfw.config.document import load_yaml
from navfw.config.file_kinds import FILE_KINDS, FileKind
from navfw.config.strict_model import StrictModel
from navfw.config.yamlfile import validate
from navfw.errors import ConfigError, UnknownNameError


@pytest.fixture
def shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A shipped folder of the test's own, and a working folder outside of any project."""
    folder = tmp_path / "shipped"
    missions = ("office/missions/to-lab", "office/missions/patrol", "empty/missions/ahead")
    for name in ("office/world", "empty/world", *missions, "suites/all"):
        write(folder / "worlds" / f"{name}.yaml")
    write(folder / "maps/office.yaml")
    for path in (folder / "behaviors", tmp_path / "work"):
        path.mkdir()
    monkeypatch.chdir(tmp_path / "work")
    monkeypatch.setattr(lookup, "shipped_folder", lambda: folder)
    return folder


@pytest.fixture
def project(shipped: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user's project around the working folder."""
    folder = tmp_path / "project"
    write(folder / "navfw.toml", "")
    (folder / "deep" / "inside").mkdir(parents=True)
    monkeypatch.chdir(folder / "deep" / "inside")
    return folder


def write(path: Path, text: str = "description: a thing\n") -> Path:
    return put_file(path.parent, path.name, text)


def names(files: list[lookup.NamedFile]) -> list[str]:
    return [f"{file.name} ({file.source})" for file in files]


def test_shipped_files_are_found_by_name(shipped: Path) -> None:
    assert names(lookup.list_files("world")) == ["empty (shipped)", "office (shipped)"]
    assert names(lookup.list_missions("office")) == ["patrol (shipped)", "to-lab (shipped)"]
    assert lookup.find("world", "office") == shipped / "worlds/office/world.yaml"
    assert lookup.find("map", "office") == shipped / "maps/office.yaml"
    assert lookup.find("mission", "office/to-lab") == lookup.find_mission("office", "to-lab")
    assert lookup.plugin_folders() == [shipped / "behaviors"]


@pytest.mark.parametrize(
    ("kind", "name", "near"),
    [
        ("world", "ofice", "office"),
        ("map", "offic", "office"),
        ("stack", "defalt", "default"),
        ("robot", "defalt", "default"),
        ("mission", "office/to-lap", "to-lab"),
        ("mission", "offise/to-lab", "office"),
        ("mission", "office-to-lab", "office/to-lab"),
    ],
)
def test_unknown_names_get_the_nearest(shipped: Path, kind: str, name: str, near: str) -> None:
    with pytest.raises(UnknownNameError, match=f"did you mean '{near}'"):
        lookup.find(kind, name)


def test_outside_of_a_project_the_working_folders_files_come_last(shipped: Path) -> None:
    made = write(Path("maps/house.yaml"))
    write(Path("maps/office.yaml"))
    assert names(lookup.list_files("map")) == ["house (project)", "office (shipped)"]
    assert lookup.find("map", "house") == made


def test_a_project_adds_files_and_takes_precedence(shipped: Path, project: Path) -> None:
    own = write(project / "worlds/office/world.yaml")
    write(project / "worlds/barn/world.yaml")
    write(project / "worlds/_draft/world.yaml")
    write(project / "stacks/mine.yaml")
    worlds = ["barn (project)", "empty (shipped)", "office (project)"]
    assert names(lookup.list_files("world")) == worlds
    assert lookup.find("world", "office") == own
    assert {"mine (project)", "default (shipped)"} <= set(names(lookup.list_files("stack")))
    robot = write(project / "robots/default.yaml")
    assert "default (project)" in names(lookup.list_files("robot"))
    assert lookup.find("robot", "default") == robot


def test_a_project_adds_missions_to_a_shipped_world(shipped: Path, project: Path) -> None:
    mine = write(project / "worlds/office/missions/mine.yaml")
    own = write(project / "worlds/office/missions/patrol.yaml")
    expected = ["mine (project)", "patrol (project)", "to-lab (shipped)"]
    assert names(lookup.list_missions("office")) == expected
    assert lookup.find_mission("office", "mine") == mine
    assert lookup.find_mission("office", "patrol") == own


def test_plugins_of_the_project_come_after_the_shipped_ones(shipped: Path, project: Path) -> None:
    assert lookup.plugin_folders() == [shipped / "behaviors"]
    (project / "behaviors").mkdir()
    assert lookup.plugin_folders() == [shipped / "behaviors", project / "behaviors"]
    (project / "plugins").mkdir()
    assert lookup.plugin_folders()[2:] == [project / "plugins"]


def test_the_checkout_is_not_its_own_second_project(shipped: Path) -> None:
    os.chdir(write(shipped / "navfw.toml", "").parent)  # the fixture returns to where it was
    assert lookup.plugin_folders() == [shipped / "behaviors"]
    assert names(lookup.list_files("world")) == ["empty (shipped)", "office (shipped)"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[tool.navfw]\n", True),
        ("[tool.navfw.runs]\nout = 'x'\n", True),
        ("[tool.other]\n", False),
        ("[project]\ndependencies = ['navfw']\n", False),
        ("tool = 3\n# navfw\n", False),
        ("not toml, navfw", False),
    ],
)
def test_a_pyproject_table_marks_a_project(shipped: Path, text: str, expected: bool) -> None:
    folder = Path.cwd()
    write(folder / "pyproject.toml", text)
    assert lookup.project_folder(folder) == (folder if expected else None)


def test_a_removed_working_folder_has_no_project(shipped: Path) -> None:
    gone = Path.cwd() / "gone"
    gone.mkdir()
    os.chdir(gone)
    gone.rmdir()
    assert lookup.project_folder() is None


def test_paths_are_used_unchanged(shipped: Path, tmp_path: Path) -> None:
    file = write(tmp_path / "elsewhere/hall/world.yaml")
    write(tmp_path / "elsewhere/hall/missions/cross.yaml")
    assert lookup.find("world", str(file)) == file
    assert lookup.find("world", file.parent) == file
    assert names(lookup.list_missions(file)) == ["cross (project)"]
    assert lookup.find_mission(file.parent, "cross") == file.parent / "missions/cross.yaml"
    mission = write(tmp_path / "m.yaml")
    assert lookup.find_mission("office", mission) == mission
    assert lookup.find("map", "m.yaml", base=tmp_path) == mission


def test_a_missing_path_names_the_nearest_file(shipped: Path, tmp_path: Path) -> None:
    write(tmp_path / "hall.yaml")
    with pytest.raises(ConfigError, match=r"hal\.yaml: there is no such file; .*'hall\.yaml'"):
        lookup.find("map", str(tmp_path / "hal.yaml"))
    with pytest.raises(ConfigError, match="expected a file, got a folder"):
        lookup.find("map", f"{tmp_path}/")
    with pytest.raises(UnknownNameError, match="unknown world 'nowhere'"):
        lookup.find_mission("nowhere", tmp_path / "hall.yaml")


def test_an_installed_package_contains_the_shipped_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "navfw" / "shipped").mkdir(parents=True)
    monkeypatch.setattr(lookup, "_PACKAGE", tmp_path / "navfw")
    assert lookup.shipped_folder() == tmp_path / "navfw" / "shipped"


# --- a kind of file is one entry of the table: all that names, lists or checks files knows it -----


class NoteSpec(StrictModel):
    text: str


def load_note(path: str) -> NoteSpec:
    return validate(load_yaml(path), NoteSpec)


@pytest.fixture
def notes(workdir: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
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
    put_files(workdir, {"navfw.toml": "", "notes/a.yaml": "text: x\n", "b.yaml": "text: 1\n"})
    return workdir


def test_a_further_kind_is_found_completed_checked_and_described(notes: Path) -> None:
    assert [file.name for file in lookup.list_files("note")] == ["a"]
    assert lookup.find("note", "a") == notes / "notes/a.yaml"
    with pytest.raises(UnknownNameError, match="unknown note 'b': known: a"):
        lookup.find("note", "b")
    assert completer_of("note")(None) == ["a"]  # type: ignore[arg-type]
    checked = json.loads(invoke("check", "--json", "b.yaml", ".").stdout)
    assert [(row["kind"], row["error"]) for row in checked] == [
        ("note", "b.yaml:1: text: expected text, got 1; quote it to make it text"),
        ("note", None),
    ]
    assert list(json.loads(output("schema", "note"))["properties"]) == ["text"]
    assert {"name": "notes", "count": 1} in answer("list")


def test_a_kind_says_what_is_wrong_in_its_file(notes: Path) -> None:
    write(notes / "notes/a.yaml", "txt: x\n")
    with pytest.raises(ConfigError, match=r"notes/a.yaml:1: txt: unknown key"):
        FILE_KINDS["note"].check_file(Path("notes/a.yaml"), None)


@pytest.mark.parametrize("kind", FILE_KINDS.values(), ids=lambda kind: kind.name)
def test_every_kind_has_files_and_what_it_names(kind: FileKind) -> None:
    assert lookup.list_files(kind.name)
    assert bool(kind.load) != bool(kind.check)
    assert kind.schema()["type"] == "object"
