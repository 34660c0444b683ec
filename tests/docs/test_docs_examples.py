"""The examples of the README and the docs are true: they are written to a project and run."""

import itertools
import re
from pathlib import Path

import pytest
from cli_calls import output
from docs_pages import PAGES, ROOT, blocks_of, commands, execute, files_of, load_module, table

from navfw.config.overrides import parse_override
from navfw.missions import MissionResult, prepare
from navfw.missions.outcome import Outcome
from navfw.scaffold.new_files import write_part, write_project
from navfw.testing import check_behavior
from navfw.worldgen import generate

WITH_RUNS = [page for page in PAGES if any(words[0] == "run" for words in commands(page))]


@pytest.mark.usefixtures("project")
def test_the_files_of_all_pages_are_sound() -> None:
    """Behaviours and composites keep their contracts: ``check`` tries them in scenes."""
    assert int(output("check").split()[-4]) > 15


@pytest.mark.parametrize(
    "file", sorted((ROOT / "examples/duties").glob("*.py")), ids=lambda f: f.stem
)
def test_the_recipe_of_a_duty_keeps_the_contract(file: Path) -> None:
    classes = (value for value in vars(load_module(file)).values() if isinstance(value, type))
    check_behavior(next(cls for cls in classes if cls.__module__ == file.stem))


@pytest.mark.parametrize(("kind", "name"), [("flow", "there_and_back"), ("fusion", "largest_sum")])
def test_the_page_on_plugins_shows_the_parts_that_navfw_new_writes(
    kind: str, name: str, workdir: Path
) -> None:
    (workdir / "navfw.toml").touch()
    write_part(kind, name)
    file = f"plugins/{name}.py"
    assert Path(file).read_text(encoding="utf-8") == files_of(ROOT / "docs/plugins.md")[file]


def test_the_pages_show_the_behavior_and_the_world_of_a_new_project(tmp_path: Path) -> None:
    write_project(tmp_path / "mine")
    pages = (ROOT / "docs" / name for name in ("first-behavior.md", "worlds.md"))
    shown = {name: text for page in pages for name, text in files_of(page).items()}
    written = {name: tmp_path / "mine" / name for name in shown}
    same = {n for n, file in written.items() if file.is_file() and file.read_text() == shown[n]}
    assert same == {
        "behaviors/cautious.py",
        "behaviors/cautious.yaml",
        "maps/den.yaml",
        "stacks/careful.yaml",
        "worlds/den/world.yaml",
    }


@pytest.mark.usefixtures("project")
def test_the_flow_processor_and_the_fusion_drive() -> None:
    result = prepare("empty", "straight", seed=1, stack="mine").run()
    assert result.outcome is Outcome.REACHED, result.reason
    assert not list(result.faults)


@pytest.mark.usefixtures("project")
def test_the_landmark_kind_and_the_event_take_part_in_a_mission() -> None:
    session = prepare("hall", "rush", seed=1)
    result = session.run()
    assert result.outcome is Outcome.REACHED, result.reason
    assert set(session.stack.state.detection_counts) == {"apriltag-7", "apriltag-8"}
    assert session.stack.state.belief is not None
    assert session.stack.state.belief.updates > 0
    begun = [set(record.event) - {"at", "lasting"} for record in result.events]
    assert begun == [{"light"}, {"obstacle"}, {"obstacle"}]


@pytest.mark.usefixtures("project")
def test_the_family_of_worlds_is_generated_and_driven(tmp_path: Path) -> None:
    for seed, difficulty in ((1, 0.0), (2, 1.0)):
        made, again = (generate("columns", seed, difficulty) for _ in range(2))
        assert len(made.world.cylinders) >= 4
        assert again.world == made.world
    result = prepare(str(made.write(tmp_path / "columns")), "cross", seed=1).run()
    assert result.outcome is Outcome.REACHED, result.reason


@pytest.fixture(scope="module")
def driven(project: Path) -> MissionResult:
    del project
    return prepare("empty", "straight", seed=1, stack="careful").run()


def test_the_behaviour_drives_and_explains_itself(driven: MissionResult) -> None:
    assert driven.outcome is Outcome.REACHED, driven.reason
    assert not list(driven.faults)
    proposals = driven.session.stack.state.proposals
    assert proposals is not None
    assert "known to be free" in proposals["cautious"].reason
    assert proposals["cautious"].explain(0, 0)[0]["rule"].startswith("IF ahead IS ")


def test_the_page_of_commands_has_all_keys_of_the_json(driven: MissionResult) -> None:
    rows = table(ROOT / "docs" / "commands.md", "### The keys of `navfw run --json`")
    missing = {"run_folder", *driven.summary()} - set(re.findall(r"`(\w+)`", rows))
    assert not missing, f"the table of JSON keys lacks {sorted(missing)}"


@pytest.mark.usefixtures("project")
def test_the_world_can_be_driven_from_room_to_room() -> None:
    """World, map and mission fit each other, and the stack plans through the door."""
    session = prepare("den", "next-room", seed=0, overrides=["mission.timeout=4"])
    assert session.shortest > 6.0
    result = session.run()
    assert result.outcome is Outcome.TIMEOUT
    ahead = [waypoint.place for waypoint in session.stack.state.path]
    assert {"door", "east"} <= set(ahead)
    assert result.collisions == 0


def test_the_tests_of_the_behaviour_pass(project: Path) -> None:
    for name in ("test_cautious", "test_slow_before_a_wall"):
        defined = vars(load_module(project / "tests" / f"{name}.py"))
        (test,) = (value for key, value in defined.items() if key.startswith("test_"))
        test()


def test_the_mission_test_asks_for_the_mission_of_the_readme(project: Path) -> None:
    test = load_module(project / "tests" / "test_den.py").test_the_robot_gets_to_the_next_room
    (marker,) = test.pytestmark
    assert marker.name == "mission"
    assert marker.kwargs == {"world": "den", "mission": "next-room", "seeds": [0, 1]}


@pytest.mark.usefixtures("project")
def test_the_code_that_asks_why_runs(capsys: pytest.CaptureFixture[str]) -> None:
    blocks = blocks_of(ROOT / "docs" / "behaviors.md")
    (code,) = (b.text for b in blocks if b.language == "python" and b.file is None)
    execute(code, "behaviors.md")
    assert re.search(r"^go_to_xy 0\.\d+ .*'rule': 'IF ", capsys.readouterr().out, re.MULTILINE)


@pytest.mark.usefixtures("project")
def test_the_ways_to_be_heard_have_the_effects_of_the_table(
    capsys: pytest.CaptureFixture[str],
) -> None:
    page = ROOT / "docs" / "not-heard.md"
    (code,) = (b.text for b in blocks_of(page) if b.language == "python" and b.file is None)
    execute(code, page.name)
    assert "\n| --- | --- | --- |\n" + capsys.readouterr().out in page.read_text(encoding="utf-8")


@pytest.mark.thorough
@pytest.mark.usefixtures("project")
@pytest.mark.parametrize("page", WITH_RUNS, ids=lambda page: page.name)
def test_worlds_missions_stacks_and_values_of_commands_exist(page: Path) -> None:
    for words in (words for words in commands(page) if words[:2] == ["world", "new"]):
        output(*words)
    for words in (words for words in commands(page) if words[0] == "run"):
        world, mission = words[1:3]
        if mission == "--goal":
            x, y = map(float, words[3].split(","))
            prepare(world, (x, y))
            continue
        if mission.startswith("--"):  # to explore, and to drive on the map made so
            prepare(world, None)
            continue
        options = list(itertools.pairwise(words[3:]))
        overrides = [value for option, value in options if option == "--set"]
        stack = next((value for option, value in options if option == "--stack"), "default")
        try:
            prepare(world, mission, stack=stack, overrides=overrides)
        except Exception as error:
            if not any(parse_override(o).path[-1] == "latancy" for o in overrides):
                raise
            # the README shows this mistake with the message that it gives
            assert f"navfw: {error}\n" in page.read_text(encoding="utf-8")
