"""``navfw suite`` and ``navfw report --text`` as subprocesses."""

import json
import signal
from pathlib import Path

import pytest
from cli_calls import PROGRAM, answer, invoke, put_files, sole_refusal
from killing import Started
from results_samples import suite_folder
from suite_samples import row

from navfw.missions import prepare
from navfw.plugins import default_registry
from navfw.suite import load_suite
from navfw.suite.run_row import columns_of
from navfw.suite.suite_folder import SuiteFolder
from navfw.suite.suite_plan import plan_runs

TINY = "entries: [{world: empty, missions: [straight], set: {mission.timeout: 3}}]"


@pytest.fixture
def folder(workdir: Path) -> Path:
    (workdir / "tiny.yaml").write_text(TINY)
    return workdir


@pytest.mark.thorough
def test_a_suite_runs_and_its_runs_are_those_of_navfw_run(folder: Path) -> None:
    done = invoke("suite", "tiny.yaml", "--seeds", "4:6", "--workers", "2", "--json")
    assert done.exit_code == 0, done.output
    summary, runs = (json.loads(done.stdout)[name] for name in ("summary", "runs"))
    assert (summary["missions"], summary["success"], summary["complete"]) == (2, 0.0, True)
    assert summary["outcomes"] == {"timeout": 2}
    assert summary["causes"] == {"timeout: slow": 2}
    assert set(summary["by_entry"]) == {"empty"}
    assert [tuple(run) for run in runs] == [columns_of([])] * 2  # without the column of variants
    alone = prepare("empty", "straight", seed=5, overrides=["mission.timeout=3"]).run()
    assert runs[1]["command_hash"] == alone.log.command_hash
    assert runs[0]["command_hash"] != runs[1]["command_hash"]
    assert runs[1]["path_length_m"] == pytest.approx(alone.path_length_m, abs=1e-12)
    assert "2 of 2 runs" in done.stderr
    out = folder / "runs" / "tiny-4-6"
    assert summary["table"] == "runs/tiny-4-6/table.csv"
    assert {run["picture"] for run in runs} == {
        f"pictures/{file.name}" for file in (out / "pictures").iterdir()
    }
    assert len(SuiteFolder(out).rows()) == 2


@pytest.mark.thorough
def test_ctrl_c_leaves_a_valid_table_and_no_process(folder: Path) -> None:
    words = ["suite", "tiny.yaml", "--seeds", "0:5000", "--out", "o", "--json", "--keep", "none"]
    started = Started(PROGRAM, words, folder)
    out = SuiteFolder(folder / "o")
    while not (out.journal.file.is_file() and out.rows()):
        assert started.after(0.1), "it ended before it began"
    started.send(signal.SIGINT)
    ended = started.ended()
    assert ended.code == 130
    told = json.loads(ended.stdout)
    assert told["summary"]["complete"] is False
    rows = out.rows()
    assert 1 <= len(rows) == len(told["runs"]) < 5000
    assert {row.outcome for row in rows} == {"timeout"}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["suite", "none.yaml", "--seeds", "0:1"], "none.yaml: there is no such file"),
        (["suite", "ofice", "--seeds", "0:1"], "did you mean 'office'?"),
        (["suite", "tiny.yaml", "--seeds", "5:5"], "--seeds: there is no seed in '5:5'"),
        (["suite", "tiny.yaml", "--seeds", "0..5"], "--seeds: expected A:B"),
        (["suite", "tiny.yaml"], "--seeds"),
        (["suite", "tiny.yaml", "--seeds", "0:1", "--workers", "0"], "--workers"),
        (["suite", "tiny.yaml", "--seeds", "0:1", "--stack", "defalt"], "did you mean 'default'?"),
        (["suite", "tiny.yaml", "--seeds", "0:1", "--set", "a.b=1"], "'a'"),
        (["suite", "tiny.yaml", "--seeds", "0:1", "--out", "tiny.yaml"], "is a file"),
        (["suite", "tiny.yaml", "--seeds", "0:1", "--out", "tiny.yaml/x"], "cannot be written"),
        (["suite", "tiny.yaml", "--seeds", "0:1", "--out", "mine"], "is not empty"),
        (["suite", "tiny.yaml", "--seeds", "0:1", "--resume"], "needs --out"),
        (["suite", "tiny.yaml", "--seeds", "0:1", "--restart"], "needs --out"),
        (["suite", "tiny.yaml", "--seeds", "0:1", "--resume", "--extend"], "cannot go with"),
        (["suite", "tiny.yaml", "--seeds", "0:1", "--worlds", "mine"], "no entry that takes"),
        (["suite", "mine/world.yaml", "--seeds", "0:1"], "entries[1].world: unknown world 'ofice'"),
        (["suite", "mine/mission.yaml", "--seeds", "0:1"], "did you mean 'straight'?"),
        (["suite", "mine/folder.yaml", "--seeds", "0:1"], "there is no such folder"),
        (["suite", "mine/wall.yaml", "--seeds", "0:1"], "mine/wall.yaml:2: entries[0]:"),
        (["report", "--text", "a", "tiny.yaml"], "a: is no folder; expected"),
        (["report", "--text", "a", "b", "--fail-if-worse", "much"], "such as 1% or 0.01"),
        (["report", "--text", "tiny.yaml", "tiny.yaml"], "tiny.yaml: is no folder; expected"),
        (["report", "--text", "mine", "mine"], "mine: has no journal.sqlite"),
    ],
)
def test_bad_input_gives_one_message_and_leaves_no_files(
    words: list[str], message: str, folder: Path
) -> None:
    start = "set: {mission.start: [50, 0, 0]}"
    texts = {
        "world": "entries:\n  - world: empty\n  - world: ofice\n",
        "mission": "entries:\n  - {world: empty, missions: [strait]}\n",
        "folder": "entries:\n  - {worlds: ../nowhere}\n",
        "wall": f"entries:\n  - {{world: empty, missions: [straight], {start}}}\n",
    }
    put_files(folder, {f"mine/{name}.yaml": text for name, text in texts.items()})
    before = sorted(folder.rglob("*"))
    refused = sole_refusal(*words)
    assert message in " ".join(refused.replace("│", " ").split())
    assert sorted(folder.rglob("*")) == before


def test_a_folder_of_worlds_gives_each_world_with_its_missions(folder: Path) -> None:
    for name in ("world-10", "world-2"):
        world = f"name: {name}\nx: [-3, 3]\ny: [-3, 3]\n"
        mission = "start: [0, 0, 0]\ngoals: [{x: 1, y: 1}]\n"
        files = {"world.yaml": world, "missions/cross.yaml": mission}
        put_files(folder / "imported" / name, files)
    (folder / "barn.yaml").write_text("entries: [{worlds: nowhere, name: barn}]")
    suite, registry, imported = load_suite("barn.yaml"), default_registry(), Path("imported")
    plan = plan_runs(suite, range(2), registry, worlds=imported, stacks=["default"])
    assert [case.key[:5] for case in plan.cases] == [
        ("barn", name, "cross", seed, "default")
        for name in ("world-2", "world-10")
        for seed in (0, 1)
    ]


def test_compare_prints_the_paired_numbers(folder: Path) -> None:
    suite_folder(folder / "a", [row(s, "stuck" if s < 6 else "reached") for s in range(9)])
    suite_folder(folder / "b", [row(seed) for seed in range(9)])
    (folder / "a" / "table.md").unlink()
    compared = answer("report", "--text", "a", "b")
    assert (compared["pairs"], compared["success_b"], compared["p"]) == (9, 1.0, 0.03125)
    shown = invoke("report", "--text", "a", "b").stdout
    assert "33.3 % -> 100.0 %" in shown
    assert "p = 0.0312" in shown
    assert "reports    a/table.csv, b/table.md" in shown


@pytest.mark.parametrize(("margin", "code"), [("30%", 0), ("0.2", 1), ("1%", 1)])
def test_compare_fails_if_b_is_worse(margin: str, code: int, folder: Path) -> None:
    suite_folder(folder / "a", [row(seed) for seed in range(8)])
    suite_folder(folder / "b", [row(s, "stuck" if s < 2 else "reached") for s in range(8)])
    done = invoke("report", "--text", "a", "b", "--fail-if-worse", margin)
    assert done.exit_code == code
    assert ("success fell by 25.0 %" in done.stderr) == bool(code)
    assert invoke("report", "--text", "b", "a", "--fail-if-worse", margin).exit_code == 0
