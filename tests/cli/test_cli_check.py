"""``navfw check``: all errors of a project at once, each with its place and remedy."""

import json
import re
import sys
from pathlib import Path

import pytest
import yaml
from cli_calls import invoke, output, put_file, put_files, refusal, sole_refusal
from docs_pages import ROOT
from processes import run

CAUTIOUS = ROOT / "navfw/scaffold/templates/project/behaviors/cautious"


def code(name: str) -> str:
    text = CAUTIOUS.with_suffix(".py.template").read_text(encoding="utf-8")
    return text.replace("cautious", name).replace("Cautious", name.title())


def rules(name: str, covering: bool = True) -> str:
    text = CAUTIOUS.with_suffix(".yaml").read_text(encoding="utf-8").replace("cautious", name)
    return text if covering else re.sub(r".*IF ahead IS plenty.*\n", "", text)


GOOD = {
    "navfw.toml": "",
    "behaviors/sound.py": code("sound"),
    "behaviors/sound.yaml": rules("sound"),
    "stacks/mine.yaml": "base: default\nbehaviors: {sound: }\n",
    "worlds/empty/missions/own.yaml": (
        "map: empty\nstart: [0, 0, 0]\ngoals: [east]\nstack: mine\ntimeout: 30\n"
    ),
    "robots/slow.yaml": "max_v: 0.2\n",
}

BAD = {
    "behaviors/lonely.py": code("lonely"),
    "behaviors/open.py": code("open"),
    "behaviors/open.yaml": rules("open", covering=False),
    "behaviors/typo.py": code("typo"),
    "behaviors/typos.yaml": rules("typo"),
    "behaviors/_helper.yaml": "",
    "stacks/wrong.yaml": "base: default\nbehaviors: {sound: {wait: 1}}\n",
    "robots/torn.yaml": "radius: wide\n",
    "worlds/suites/torn.yaml": "entries: []\n",
    "worlds/empty/missions/far.yaml": (
        "map: empty\nstart: [0, 0, 0]\ngoals: [centr]\nstack: mine\ntimeout: 30\n"
    ),
}

SIMULATES = GOOD["behaviors/sound.py"] + "\nimport pybullet\n"


@pytest.fixture
def sound(folder: Path) -> Path:
    """A sound project, trusted, in the working folder."""
    put_files(folder, GOOD)
    return folder


def test_a_sound_project_passes(sound: Path) -> None:
    assert output("check") == "4 checked, 0 wrong\n"


def test_every_error_is_told_at_once(sound: Path) -> None:
    put_files(sound, BAD)
    done = invoke("check")
    assert done.exit_code == 2
    for words in (
        "behaviors/lonely.yaml: there is no such file",
        "behaviors/open.yaml",
        "no rule",
        "behaviors/typo.yaml: there is no such file; did you mean 'typos.yaml'?",
        "stacks/wrong.yaml:2: behaviors.sound.wait: unknown key",
        "robots/torn.yaml:1: radius",
        "worlds/suites/torn.yaml:1: entries",
        "worlds/empty/missions/far.yaml:3: goals[0]: unknown place 'centr'",
        "did you mean 'centre'?",
        "12 checked, 7 wrong",
    ):
        assert words in done.stdout


def test_plugins_lists_a_behaviour_without_covering_rules_as_broken(sound: Path) -> None:
    put_files(sound, BAD)
    done = invoke("list", "plugins", "--kind", "behavior", "--json")
    status = {row["name"]: row["status"] for row in json.loads(done.stdout)}
    assert done.exit_code == 2
    assert {name for name in status if status[name] == "broken"} == {"lonely", "open", "typo"}


def test_what_a_run_would_refuse_is_refused_and_told_once(project: Path) -> None:
    """A map without its door's edge, which two missions use; a behaviour that returns nothing."""
    behavior = (project / "behaviors/cautious.py").read_text()
    head, _, _ = behavior.partition("    def propose")
    missions = project / "worlds/den/missions"
    own_map = (project / "maps/den.yaml").read_text()
    texts = {
        "behaviors/silent.py": head.replace("Cautious", "Silent").replace('"cautious"', '"silent"')
        + "    def propose(self, context: Context) -> Proposal:\n        return None\n",
        "behaviors/silent.yaml": (project / "behaviors/cautious.yaml").read_text(),
        "maps/den.yaml": "".join(
            line for line in own_map.splitlines(True) if "from: door-west" not in line
        ),
        "worlds/den/missions/again.yaml": (missions / "next-room.yaml").read_text(),
    }
    put_files(project, texts)
    done = invoke("check")
    assert done.exit_code == 2
    assert done.stdout.count("the map does not connect the start") == 1
    assert "also: 2 files that use it: worlds/den/missions/again.yaml" in done.stdout
    assert done.stdout.count("and 14 more propose returned NoneType, not a Proposal") == 1


SLIPS = yaml.safe_load(Path(__file__).with_name("slips.yaml").read_text(encoding="utf-8"))


@pytest.mark.slow
@pytest.mark.parametrize("slip", SLIPS, ids=[slip["slip"] for slip in SLIPS])
def test_a_slip_gets_one_verdict_with_its_cause_once(slip: dict[str, str], project: Path) -> None:
    text = (project / slip["file"]).read_text(encoding="utf-8")
    assert slip["old"] in text
    put_file(project, slip["file"], text.replace(slip["old"], slip["new"], 1))
    checked, driven = invoke("check"), invoke("run", "den", "next-room", "--quiet")
    tested = run([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"], cwd=project)
    said = {"check": checked.output, "run": driven.output, "pytest": tested.stdout}
    assert all((checked.exit_code, driven.exit_code, tested.returncode)), said
    assert [by for by, text in said.items() if slip["says"] not in text] == [], said
    assert len(re.findall(r"^[\w/.-]+(?::\d+)?: ", said["check"], re.MULTILINE)) == 1, said


def test_single_files_are_checked_by_their_folder_or_keys(sound: Path) -> None:
    put_files(
        sound, BAD | {"elsewhere.yaml": rules("open", covering=False), "other.yaml": "x: 1\n"}
    )
    done = invoke("check", "--json", "elsewhere.yaml", "other.yaml", "behaviors/sound.py", "robots")
    rows = {row["source"]: row for row in json.loads(done.stdout)}
    kinds = [row["kind"] for row in rows.values()]
    assert kinds == ["behavior", "rule base", None, "robot", "robot"]
    assert rows["robots/slow.yaml"]["error"] is None
    assert "no file of navfw" in rows["other.yaml"]["error"]
    assert done.exit_code == 2


def test_use_of_the_simulator_is_noted(sound: Path) -> None:
    put_files(sound, {"behaviors/sound.py": SIMULATES})
    assert "note: behaviors/sound.py:34: imports pybullet" in output("check", "behaviors")


@pytest.mark.usefixtures("folder")
def test_outside_a_project_files_must_be_named() -> None:
    assert "no project here" in refusal("check")
    missing = invoke("check", "nothing.yaml")
    assert (missing.exit_code, "there is no such file" in missing.output) == (2, True)


def test_loops_of_links_are_named_and_end_no_command(sound: Path) -> None:
    for name in ("behaviors/a.py", "loop", "worlds/w/world.yaml"):
        file = put_file(sound, name, "")
        file.unlink()
        file.symlink_to(file.name)
    said = invoke("check").stdout
    assert "behaviors/a.py: cannot be imported: " in said
    assert "Too many levels of symbolic links" in said
    assert "sound" in invoke("list", "plugins").output
    for words in (("trust", "loop"), ("trust", "--remove", "loop"), ("world", "import", "loop")):
        sole_refusal(*words, *(("--out", "new") if "world" in words else ()))
    sole_refusal("run", "w", "own")
    assert "loop" in sole_refusal("run", "empty", "own", "--out", "loop")
