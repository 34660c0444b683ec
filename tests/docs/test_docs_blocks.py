"""Every fenced block of the README and the docs is run, checked, or listed with the reason."""

from __future__ import annotations

import shutil
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import trimesh
import yaml
from docs_pages import PAGES, ROOT, DocBlock, blocks_of

from navfw.context import CommandGrid, CommandGridParams
from navfw.fuzzy import parse_rule
from navfw.missions import load_mission
from navfw.mofis import BehaviorRules
from navfw.perceive import load_calibration
from navfw.plugins import default_registry
from navfw.robot import RobotModel, RobotSpec, load_robot
from navfw.sim import load_world
from navfw.stack import load_stack

BLOCKS = [block for page in PAGES for block in blocks_of(page)]

ELSEWHERE = {
    "behaviors.md": "tests/docs/test_docs_examples.py",
    "gym.md": "tests/gym/test_gym_env.py",
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


# --- data ------------------------------------------------------------------------------------


def check_mission(text: str) -> None:
    file = Path("worlds/den/missions/next-room.yaml")
    again = file.with_name("of-the-page.yaml")
    again.write_text(file.read_text() + text)
    load_mission(again)


def check_stack(text: str) -> None:
    file = Path("stacks/of-the-page.yaml")
    file.write_text(text if text.startswith("base: ") else f"base: default\n{text}")
    load_stack(file, default_registry())


def check_mast(text: str) -> None:
    file = Path("robots/mast.yaml")
    file.write_text(text)
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
    (folder / "world.yaml").write_text(plain + text)
    load_world(folder / "world.yaml")


def check_lens(text: str) -> None:
    file = Path("lens.yaml")
    file.write_text(text)
    load_calibration(file)


def check_ci(text: str) -> None:
    steps = yaml.safe_load(text)["steps"]
    commands = [step["run"].split()[0] for step in steps]
    assert commands == ["navfw", "pytest"]


def check_ini(text: str) -> None:
    options = tomllib.loads(text)["tool"]["pytest"]["ini_options"]
    assert list(Path().glob(options["navfw_missions"][0]))


DATA: dict[str, Callable[[str], None]] = {
    "robot: {base: default, max_v: 0.4}  # robot: NAME for the robot as it is": check_mission,
    "events:": check_mission,
    "description: a camera on a mast": check_mast,
    "urdf:": check_urdf,
    "base: default": check_stack,
    "behaviors:": check_stack,
    "image_width: 160": check_lens,
    'env: {NAVFW_TRUST: "1"}': check_ci,
    "meshes:": check_world,
    "textures:": check_world,
    "[tool.pytest.ini_options]": check_ini,
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


# --- rules and code --------------------------------------------------------------------------


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


class RulesHolder:
    """What ``self`` is in a behaviour, as far as rules need it."""

    def __init__(self, text: str) -> None:
        self.rules = BehaviorRules.parse(text)


class ArcsOfPage:
    """What ``arcs`` is in a behaviour, as far as the page needs it."""

    def __init__(self, commands: CommandGrid) -> None:
        self.free = commands.zeros() + 0.7


def test_the_code_on_rules_runs() -> None:
    robot = RobotModel()
    commands = CommandGrid(robot, CommandGridParams())
    names: dict[str, Any] = {"commands": commands, "arcs": ArcsOfPage(commands)}
    first, second = (b for b in BLOCKS if b.page == "rules.md" and b.language == "python")
    run(first, names | {"self": RulesHolder(RULES)})
    ended = run(second, names | {"self": RulesHolder(RESERVE)})
    assert ended["verdict"].values("desire").shape == commands.shape


def run(block: DocBlock, names: dict[str, Any]) -> dict[str, Any]:
    """``names`` after the code of a page was executed with them."""
    exec(compile(block.text, block.page, "exec"), names)  # noqa: S102 - our own page
    return names


# --- all of them -----------------------------------------------------------------------------


def test_every_block_is_known() -> None:
    """Data and code by the tests above, files by the project, commands by test_docs_console."""
    for page in PAGES:
        fences = [line for line in page.read_text().splitlines() if line.startswith("```")]
        assert len(fences) == 2 * len(blocks_of(page)), page.name
    for block in BLOCKS:
        if block.file is None:
            assert block.language in {"console", "python", "text", "toml", "yaml"}, block
        if block.language == "python" and block.file is None:
            assert block.page in {*ELSEWHERE, "rules.md"}, block
        if block.language == "text":
            assert block.page in {*PROSE, "rules.md"}, block


def test_the_lists_of_blocks_have_nothing_superfluous() -> None:
    for page, test in ELSEWHERE.items():
        assert page in (ROOT / test).read_text(encoding="utf-8")
        assert [b for b in BLOCKS if b.page == page and b.language == "python" and not b.file]
    assert {b.page for b in BLOCKS if b.language == "text"} == {*PROSE, "rules.md"}
    assert {b.first for b in BLOCKS} >= set(DATA)
