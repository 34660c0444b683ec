"""Each file that a run reads counts when a suite or a study is resumed; where it lies does not."""

import shutil
from pathlib import Path

import pytest
from cli_calls import invoke, put_files
from suite_plans import planned

from navfw.config.lookup import shipped_folder

WHEEL = """<link name="{side}"><collision><origin rpy="1.5707963 0 0"/>
  <geometry><cylinder radius="0.07" length="0.03"/></geometry></collision>
  <inertial><mass value="0.3"/></inertial></link>
<joint name="{side}_joint" type="continuous"><parent link="base"/><child link="{side}"/>
  <origin xyz="0 {y} 0.07"/><axis xyz="0 1 0"/></joint>
"""
ROBOT = """<robot name="bot"><link name="base">
  <collision><origin xyz="0 0 0.15"/><geometry><box size="0.3 0.2 0.1"/></geometry></collision>
  <collision><origin xyz="0 0 0.15"/><geometry><mesh filename="bump.obj"/></geometry></collision>
  <inertial><mass value="5"/></inertial></link>
"""
ROBOT += WHEEL.format(side="left", y=0.14) + WHEEL.format(side="right", y=-0.14) + "</robot>\n"
OBJ = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 3\n"
FILES = {
    "robots/bot.yaml": "urdf: {file: urdf/bot.urdf}\ncamera: {mount_height: 0.3}\n"
    "footprint: {front: 0.2, rear: 0.2, width: 0.34}\n",
    "behaviors/_tables.py": "STEPS = 3\n",
    "robots/urdf/bot.urdf": ROBOT,
    "robots/urdf/bump.obj": OBJ,
}
WORLD = "worlds/salon"
SUITE = "entries: [{world: salon, missions: [go], stack: careful, robot: bot}]\n"
"""The world is a copy of the lounge: meshes, a mesh in a URDF, a picture on a wall."""


@pytest.fixture
def project(workdir: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = workdir / "first"
    assert invoke("new", "project", str(folder)).exit_code == 0
    put_files(folder, FILES)
    worlds = shipped_folder() / "worlds"
    shutil.copytree(worlds / "lounge", folder / WORLD)
    shutil.copytree(worlds / "pictures", folder / "worlds" / "pictures")
    missions = folder / WORLD / "missions"
    (missions / "to-the-hall.yaml").rename(missions / "go.yaml")
    monkeypatch.chdir(folder)
    return folder


def content(folder: Path) -> tuple[str, dict[str, str]]:
    """The fingerprint of the suite's only run, and those of its parts."""
    plan = planned(folder, SUITE)
    (case,) = plan.cases
    return case.content, dict(plan.content)


@pytest.mark.thorough
def test_every_changed_file_is_noticed_by_name(project: Path) -> None:
    changed = {
        f"{WORLD}/things/armchair.obj": ("v ", "v  "),
        f"{WORLD}/things/side-table.urdf": ("0.53", "0.54"),
        f"{WORLD}/world.yaml": ("contrast: 20", "contrast: 21"),
        f"{WORLD}/missions/go.yaml": ("timeout: 90", "timeout: 91"),
        "robots/bot.yaml": ("0.3}", "0.31}"),
        "robots/urdf/bot.urdf": ('mass value="5"', 'mass value="6"'),
        "robots/urdf/bump.obj": ("0.1", "0.12"),
        "stacks/careful.yaml": ("base:", "base: "),
        "behaviors/cautious.py": ("0.3", "0.4"),
        "behaviors/cautious.yaml": ("\n", "\n\n"),
        "behaviors/_tables.py": ("3", "4"),
    }
    before, parts = content(project)
    assert (before, parts) == content(project)
    for name, (old, new) in changed.items():
        text = (project / name).read_text()
        assert old in text, name
        (project / name).write_text(text.replace(old, new))
        after, others = content(project)
        differing = {part for part in {**parts, **others} if parts.get(part) != others.get(part)}
        assert name in differing and after != before, name
        before, parts = after, others
    picture = project / WORLD / "things" / "tapestry.png"
    picture.write_bytes(picture.read_bytes() + b"\0")
    assert (
        content(project)[1][f"{WORLD}/things/tapestry.png"] != parts[f"{WORLD}/things/tapestry.png"]
    )


def test_a_moved_project_has_the_same_inputs(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = content(project)
    assert not any(str(project) in name for name in before[1])
    moved = project.rename(project.with_name("second"))
    monkeypatch.chdir(moved)
    assert content(moved) == before


def test_other_files_of_the_project_do_not_count(project: Path) -> None:
    before = content(project)
    put_files(project, {"pyproject.toml": "[project]\n", "worlds/salon/notes.txt": "x"})
    put_files(project, {"behaviors/unused.py": "", "behaviors/unused.yaml": ""})
    assert content(project) == before
