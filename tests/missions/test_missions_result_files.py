"""A result for other tools: trajectories of TUM, and JSON by ``navfw schema result``."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_calls import invoke, output
from jsonschema import Draft202012Validator

import navfw
from navfw.missions.run_metrics import RunResult
from navfw.missions.run_report import write_run, write_tum
from navfw.recording import RunFolder, plain_json, read_result
from navfw.recording.run_folder import ESTIMATED, TRUTH

ROOT = Path(__file__).parents[2]


def wrong(data: Any) -> list[str]:
    schema = RunResult.schema()
    Draft202012Validator.check_schema(schema)
    return [error.message for error in Draft202012Validator(schema).iter_errors(data)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    events = [{"at": 1, "behavior": {"name": "go_to_xy", "does": "raises"}, "lasting": 1}]
    short = {"mission.timeout": 3.0, "mission.events": events}
    result = navfw.run("paper-room", "through-the-door", set=short)
    with RunFolder(tmp_path_factory.mktemp("runs") / "o") as target:
        assert write_run(result, target) == ()
    assert wrong(plain_json({**result.summary(), "run_folder": "o"})) == []
    return target.target


def test_a_result_is_as_its_schema_says(folder: Path) -> None:
    result = read_result(folder)
    assert result["events"]
    assert wrong(result) == []
    assert wrong(result | {"outcome": "arrived"})
    del result["spl"]
    assert wrong(result) == ["'spl' is a dependency of 'command_hash'"]
    del result["command_hash"]  # ended from outside
    assert wrong(result) == []


def test_an_exploration_without_obstacles_is_as_well() -> None:
    result = navfw.run("empty", None, set={"mission.timeout": 1.0})
    summary = plain_json(result.summary())
    assert (summary["min_clearance_m"], summary["map_changes"]) == (None, [])
    assert summary["exploration"]["unexplored"]
    assert wrong(summary) == []


def test_the_schema_has_the_keys_of_the_docs() -> None:
    text = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    table = text.partition("### The keys of `navfw run --json`")[2].partition("\n#")[0]
    rows = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    documented = {key for row in rows for key in re.findall(r"`(\w+)`", row)}
    assert set(json.loads(output("schema", "result"))["properties"]) == documented


def test_trajectories_have_the_poses_of_the_run(folder: Path) -> None:
    tables = [np.loadtxt(folder / name) for name in (ESTIMATED, TRUTH)]
    assert np.array_equal(tables[0][:, 0], tables[1][:, 0])
    assert np.allclose(np.diff(tables[0][:, 0]), 0.1)
    error = np.hypot(*(tables[0] - tables[1])[:, 1:3].T)
    assert 0.0 < error.max() < 0.5
    assert error[-1] == pytest.approx(read_result(folder)["estimate_error_m"], abs=1e-5)


def test_an_attitude_is_a_unit_quaternion_about_z(tmp_path: Path) -> None:
    poses = np.array([[1.0, 2.0, 0.0], [1.5, 2.0, np.pi / 2], [2.0, -2.0, -np.pi / 3]])
    write_tum(tmp_path / "t.tum", np.array([0.0, 0.1, 0.2]), poses)
    table = np.loadtxt(tmp_path / "t.tum")
    assert table[:, 1:3].tolist() == poses[:, :2].tolist()
    assert np.allclose(2.0 * np.arctan2(table[:, 6], table[:, 7]), poses[:, 2], atol=1e-5)
    assert np.allclose(np.linalg.norm(table[:, 4:], axis=1), 1.0, atol=1e-6)


@pytest.mark.slow
def test_evo_measures_the_errors_that_navfw_measured(folder: Path) -> None:
    evo = pytest.importorskip("evo.tools.file_interface", reason="evo is not installed")
    from evo.core.metrics import APE, PoseRelation

    estimate, truth = (evo.read_tum_trajectory_file(folder / name) for name in (ESTIMATED, TRUTH))
    error = APE(PoseRelation.translation_part)
    error.process_data((truth, estimate))
    expected = read_result(folder)["estimate_error_p50_m"]
    assert error.get_all_statistics()["median"] == pytest.approx(expected, abs=1e-4)


def test_an_unknown_kind_is_answered_by_the_known_ones() -> None:
    ended = invoke("schema", "resul")
    assert ended.exit_code == 2
    assert "did you mean 'result'" in ended.stderr
