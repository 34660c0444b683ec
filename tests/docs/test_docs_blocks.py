"""Every fenced block of the README and the docs is run, checked, or listed with the reason.

Examples, pages and templates import public names alone; the cells of the notebook run.
"""

import ast
import importlib
import json
import re
import shutil
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import matplotlib.pyplot as plt
import numpy as np
import pytest
import trimesh
import yaml
from architecture_sources import imports
from cli_calls import put_file
from docs_pages import PAGES, ROOT, DocBlock, blocks_of, execute

from navfw.context import CommandGrid, CommandGridParams
from navfw.fuzzy import load_rule_base
from navfw.fuzzy.rulebase import parse_rule
from navfw.lenses import load_calibration
from navfw.missions.missionfile import load_mission
from navfw.mofis.rules import BehaviorRules
from navfw.plugins import default_registry
from navfw.plugins.built_in import GROUPS
from navfw.robot import RobotModel, load_robot
from navfw.robot.robotfile import RobotSpec
from navfw.sim import load_world
from navfw.stack import load_stack

BLOCKS = [block for page in PAGES for block in blocks_of(page)]

ELSEWHERE = {
    "behaviors.md": "tests/docs/test_docs_examples.py",
    "README.md": "tests/docs/test_docs_readme.py",
    "gym.md": "tests/gym/test_gym_env.py",
    "not-heard.md": "tests/docs/test_docs_examples.py",
    "real-robot.md": "tests/docs/test_docs_real_robot.py",
    "recordings.md": "tests/docs/test_docs_commands.py",
}
"""The tests that run the Python code of a page which is no file."""

PROSE = {
    "README.md": "the chain of stages",
    "architecture.md": "the chain of stages",
    "clusters.md": "needs several machines; tests/suite drives runs on Dask",
}
"""Blocks of text that are neither run nor checked, by page, with what they are."""


def check_mission(text: str) -> None:
    file = Path("worlds/den/missions/next-room.yaml")
    load_mission(put_file(file.parent, "of-the-page.yaml", file.read_text() + text))


def check_stack(text: str) -> None:
    whole = text if text.startswith("base: ") else f"base: default\n{text}"
    load_stack(put_file(Path("stacks"), "of-the-page.yaml", whole), default_registry())


def check_mast(text: str) -> None:
    put_file(Path("robots"), "mast.yaml", text)
    assert load_robot("mast").camera.mount_height == 0.8


def check_urdf(text: str) -> None:
    assert RobotSpec.model_validate(yaml.safe_load(text)).urdf is not None


def check_world(text: str) -> None:
    folder = Path("worlds/furnished")
    shutil.copytree(ROOT / "worlds/lounge/things", folder / "things", dirs_exist_ok=True)
    lamp = trimesh.creation.box((200.0, 1500.0, 200.0)).apply_translation((0.0, 750.0, 0.0))
    lamp.export(folder / "things/lamp.stl")  # in millimetres, y axis up
    (folder / "pictures").mkdir(exist_ok=True)
    picture = np.random.default_rng(0).integers(0, 255, (64, 64, 3), np.uint8)
    cv2.imwrite(str(folder / "pictures/mural.jpg"), picture)
    plain = Path("worlds/hall/world.yaml").read_text()
    load_world(put_file(folder, "world.yaml", plain + text))


def check_lens(text: str) -> None:
    load_calibration(put_file(Path(), "lens.yaml", text))


def check_ini(text: str) -> None:
    options = tomllib.loads(text)["tool"]["pytest"]["ini_options"]
    assert list(Path().glob(options["navfw_missions"][0]))


def check_entry_points(text: str) -> None:
    """Its groups are those that navfw reads."""
    groups = tomllib.loads(text)["project"]["entry-points"]
    assert set(groups) <= {*GROUPS, "navfw.files", "navfw.commands"}
    assert all(re.fullmatch(r"[\w.]+(:\w+)?", name) for g in groups.values() for name in g.values())


DATA: dict[str, Callable[[str], None]] = {
    "robot: {base: default, max_v: 0.4}  # robot: NAME for the robot as it is": check_mission,
    "events:": check_mission,
    "description: a camera on a mast": check_mast,
    "urdf:": check_urdf,
    "base: default": check_stack,
    "behaviors:": check_stack,
    "image_width: 160": check_lens,
    "meshes:": check_world,
    "textures:": check_world,
    "[tool.pytest.ini_options]": check_ini,
    '[project.entry-points."navfw.flows"]        # likewise navfw.behaviors, navfw.fusions, ...': (
        check_entry_points
    ),
}
"""The check of a block of YAML or TOML that is no file, by its first line."""


@pytest.mark.usefixtures("project")
@pytest.mark.parametrize(
    "block",
    [b for b in BLOCKS if b.language in {"yaml", "toml"} and b.file is None],
    ids=lambda block: f"{block.page}: {block.first[:30]}",
)
def test_the_data_of_a_page_are_read(block: DocBlock) -> None:
    assert block.first in DATA, "add its check to DATA"
    DATA[block.first](block.text)


def test_the_sentences_of_the_rule_language_are_parsed() -> None:
    (block,) = (b for b in BLOCKS if b.page == "rules.md" and b.language == "text")
    inputs = {"ahead": {"little"}, "gap": {"too_far"}, "side": {"left", "middle"}}
    outputs = {"speed": {"slow"}, "caution": {"much"}, "turn": {"right"}}
    parsed = [parse_rule(line, inputs, outputs) for line in block.text.splitlines()]
    assert len(parsed) == 3


RULES = """
name: page
inputs:
  bearing: {range: [-90, 90], unit: deg, terms: {any: {trapezoid: [-90, -90, 90, 90]}}}
  distance: {range: [0, 9], unit: m, terms: {any: {trapezoid: [0, 0, 9, 9]}}}
outputs:
  speed: {range: [-0.5, 1.5], terms: {full: {triangle: [0.5, 1.0, 1.5]}}}
  turn: {range: [-1.5, 1.5], terms: {none: {triangle: [-0.5, 0, 0.5]}}}
  caution: {range: [0, 1], terms: {much: {triangle: [0.6, 1, 1.4]}}}
rules:
  - IF bearing IS any AND distance IS any THEN speed IS full, turn IS none, caution IS much
"""
RESERVE = """
name: reserve
inputs: {reserve: {range: [0, 3], terms: {any: {trapezoid: [0, 0, 3, 3]}}}}
outputs: {desire: {range: [0, 1], terms: {much: {triangle: [0.6, 1, 1.4]}}}}
rules: [IF reserve IS any THEN desire IS much]
"""


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.usefixtures("project")
def test_the_code_on_rules_runs() -> None:
    commands = CommandGrid(RobotModel(), CommandGridParams())
    first, second, exchange = (
        b.text for b in BLOCKS if b.page == "rules.md" and b.language == "python"
    )
    for code, rules in ((first, RULES), (second, RESERVE)):
        self = SimpleNamespace(rules=BehaviorRules.parse(rules))
        # of arcs the page needs no more
        arcs = SimpleNamespace(free=commands.zeros() + 0.7)
        names = {"commands": commands, "arcs": arcs, "self": self}
        ended = execute(code, "rules.md", **names)
    assert ended["verdict"].values("desire").shape == commands.shape
    put_file(Path(), "rules.yaml", RULES)
    execute(exchange, "rules.md")
    copied = load_rule_base("copy.yaml").rules
    assert [r.sentence for r in copied] == [r.sentence for r in load_rule_base("rules.yaml").rules]


def test_every_block_is_known() -> None:
    """Data and code by the tests above, files by the project, commands by test_docs_commands."""
    for page in PAGES:
        fences = [line for line in page.read_text().splitlines() if line.startswith("```")]
        assert len(fences) == 2 * len(blocks_of(page)), page.name
    for block in BLOCKS:
        if block.file is None:
            assert block.language in {"console", "python", "text", "toml", "yaml"}, block
        if block.language == "python" and block.file is None:
            assert block.page in {*ELSEWHERE, "rules.md"}, block


def test_the_lists_of_blocks_have_nothing_superfluous() -> None:
    for page, test in ELSEWHERE.items():
        assert page in (ROOT / test).read_text(encoding="utf-8")
        assert [b for b in BLOCKS if b.page == page and b.language == "python" and not b.file]
    assert {b.page for b in BLOCKS if b.language == "text"} == {*PROSE, "rules.md"}
    assert {b.first for b in BLOCKS} >= set(DATA)


# --- public names ------------------------------------------------------------------------------

PUBLIC = ("navfw", "navfw.gym", "navfw.testing")
"""The modules that others import; all else in navfw is inner (docs/decisions/0138)."""

SHOWN = {
    "examples/paper_in_one_file.py": "navfw.fuzzy",
    "docs/rules.md, block 3": "navfw.fuzzy.skfuzzy_exchange",
}
"""The inner module that an example is about."""

TEMPLATES = ROOT / "navfw" / "scaffold" / "templates"


def cells_of(name: str) -> list[str]:
    """The code of a notebook's cells, without the commands of Jupyter."""
    cells = json.loads((ROOT / name).read_text(encoding="utf-8"))["cells"]
    assert [cell for cell in cells if cell.get("outputs")] == [], f"{name}: clear all outputs"
    code = ("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    return [re.sub(r"^%.*", "", text, flags=re.MULTILINE) for text in code]


CELLS = cells_of("docs/python.ipynb")


def sources() -> Iterator[tuple[str, str]]:
    """Code that a user reads, runs or gets as a beginning: where it stands, and its text."""
    scripts = [*(ROOT / "examples").glob("*.py"), *(ROOT / "behaviors").glob("*.py")]
    for path in [*scripts, *TEMPLATES.rglob("*.py.template")]:
        yield path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")
    for page in PAGES:
        for number, block in enumerate(blocks_of(page)):
            if block.language == "python":
                yield f"{page.relative_to(ROOT).as_posix()}, block {number}", block.text
    for name in ("docs/python.ipynb", "examples/first_drive.ipynb"):
        for cell in cells_of(name):
            yield name, cell


def wrong_imports(text: str) -> Iterator[str]:
    for module, name in imports(ast.parse(text)):
        if module.partition(".")[0] != "navfw":
            continue
        if module not in PUBLIC:
            yield f"{module} is an inner module"
        elif name is not None and name not in vars(importlib.import_module(module))["__all__"]:
            yield f"{module} has no public name {name}"


def test_no_inner_module_is_imported() -> None:
    texts = list(sources())
    assert len(texts) > 40
    wrong = [
        f"{where}: {what}"
        for where, text in texts
        for what in wrong_imports(text)
        if what != f"{SHOWN.get(where)} is an inner module"
    ]
    assert wrong == []


def test_the_cells_of_the_notebook_run(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, Any] = {}
    plt.switch_backend("agg")
    try:
        for number, cell in enumerate(CELLS):
            names = execute(cell, f"python.ipynb, cell {number}", **names)
        titles = [axes.get_title() for n in plt.get_fignums() for axes in plt.figure(n).axes]
        assert len(plt.get_fignums()) == 3
        assert "camera and flow" in titles
    finally:
        plt.close("all")
    printed = capsys.readouterr().out
    assert names["tick"].percept.sentence in printed
    paths = [run.log.true for run in names["runs"].values()]
    assert all(len(path) > 100 for path in paths)
    assert names["runs"]["default"].log.command_hash != names["result"].log.command_hash
