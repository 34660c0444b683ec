"""Learning the situation model from recorded drives: the drives, and the command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from navfw.bench import learn_situations, place_accuracy
from navfw.cli import app
from navfw.errors import InputError
from navfw.localization import learn_table, load_table, situation_table
from navfw.missions import SituationDrive, prepare, record_situations
from navfw.plugins import default_registry
from navfw.signals import Pose
from navfw.suite import load_suite, plan_runs

SUITE = """\
entries:
  - {world: paper-room, missions: [through-the-door], set: {mission.timeout: 7}}
  - {world: office, missions: [lobby-to-lab], set: {mission.timeout: 7}}
"""


@pytest.fixture(scope="module")
def drive() -> SituationDrive:
    return record_situations(
        prepare("office", "lobby-to-lab", seed=3, overrides=["mission.timeout=12"])
    )


def test_a_drive_has_a_sample_for_each_frame_and_a_spaced_one_for_each_quarter_metre(
    drive: SituationDrive,
) -> None:
    assert drive.outcome == "timeout"
    assert len(drive.samples) == pytest.approx(120, abs=3)
    path = np.array([(s.true.x, s.true.y) for s in drive.samples])
    driven = float(np.hypot(*np.diff(path, axis=0).T).sum())
    spaced = list(drive.observations())
    assert 2.0 < len(spaced) <= driven / 0.25 + 1.0
    assert {kind for kind, _ in spaced} <= {"room", "door", "junction"}
    names = list(drive.topo_map.places)
    assert names[drive.place_at(drive.start)] == "lobby-west"
    assert all(
        names[drive.place_at(Pose(p.x, p.y, 0.0))] == p.name for p in drive.topo_map.places.values()
    )


def test_odometry_from_a_known_start_gives_the_place(drive: SituationDrive) -> None:
    table = learn_table(drive.observations())
    right, probability = place_accuracy(drive, table, known_start=True)
    assert right > 0.8
    assert probability > 0.5
    for heard in (None, situation_table("learnt")):
        _, unknown = place_accuracy(drive, heard, known_start=False)
        assert unknown < 0.7 * probability


@pytest.mark.thorough
def test_the_command_writes_a_table_that_localisers_load(tmp_path: Path) -> None:
    suite, out = tmp_path / "tiny.yaml", tmp_path / "tables" / "mine.yaml"
    suite.write_text(SUITE)
    done = CliRunner().invoke(
        app, ["map", "learn-situations", str(suite), "--seeds", "3:4", "--out", str(out), "--json"]
    )
    assert done.exit_code == 0, done.output
    answer = json.loads(done.stdout)
    assert answer["drives"] == 2
    assert set(answer["accuracy"]) == {"paper-room", "office"}
    assert all(0.0 <= share <= 1.0 for share in answer["seen_at"]["room"].values())
    assert answer["accuracy"]["office"]["known_right_with"] > 0.5
    table = load_table(out)
    assert table.seen_at["room"].tolist() == pytest.approx(
        list(answer["seen_at"]["room"].values()), abs=1e-3
    )
    stack = tmp_path / "heard.yaml"
    stack.write_text(f"base: default\nlocalizer: {{bayes: {{situations: {out}}}}}\n")
    session = prepare("office", "lobby-to-lab", stack=stack, overrides=["mission.timeout=2"])
    assert session.run().outcome == "timeout"


def test_a_folder_is_no_file_to_write(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["map", "learn-situations", "--out", str(tmp_path)])
    assert done.exit_code == 2
    assert "got a folder" in done.output


def test_drives_without_situations_are_an_error(tmp_path: Path) -> None:
    suite = tmp_path / "still.yaml"
    suite.write_text("entries: [{world: empty, missions: [straight], set: {mission.timeout: 0.5}}]")
    plan = plan_runs(load_suite(suite), range(1), default_registry())
    with pytest.raises(InputError, match="OFFIS reported no situation on 1 drives"):
        learn_situations(plan, default_registry())
