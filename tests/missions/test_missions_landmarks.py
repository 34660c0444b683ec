"""Landmarks on missions: replay with landmark frames, detections, learning, commands."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from navfw.cli import app
from navfw.errors import MapError
from navfw.missions import learn_landmarks, prepare, write_run
from navfw.recording import RunFolder, load_recording, replay
from navfw.topomap import load_map

SHORT = ["mission.timeout=9"]


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("stacks") / "sees.yaml"
    file.write_text(
        "base: default\nfeatures: {landmarks: }\nlocalizer: {ekf: }\n", encoding="utf-8"
    )
    return file


def test_a_replay_has_the_same_landmark_frames(stack: Path, tmp_path: Path) -> None:
    session = prepare("office", "lobby-to-lab", seed=2, stack=stack, overrides=SHORT)
    result = session.run(record=True)
    with RunFolder(tmp_path / "run") as folder:
        write_run(result, folder)
    assert folder.final is not None
    recording = load_recording(folder.final / "run.mcap")
    taken = [r for r in recording.readings if r.landmark_frame is not None]
    wanted = session.mission.spec.robot.landmark_camera
    assert len(taken) == pytest.approx(result.run.sim_time * wanted.rate, abs=2)
    assert set(session.stack.state.detection_counts)  # the lobby has markers
    again = replay(folder.final)
    assert again.same
    assert result.timings["landmark_frames"] > 0.0


def test_a_stack_without_landmarks_renders_no_landmark_frames(tmp_path: Path) -> None:
    file = tmp_path / "blind.yaml"
    file.write_text("base: default\nfeatures: {none: }\nlocalizer: {dead_reckoning: }\n")
    session = prepare("office", "lobby-to-lab", seed=2, stack=file, overrides=["mission.timeout=3"])
    result = session.run()
    assert "landmark_frames" not in result.timings
    assert session.stack.state.detection_counts == {}


@pytest.mark.slow
def test_landmarks_are_learnt_on_a_drive(tmp_path: Path) -> None:
    file = tmp_path / "learnt.yaml"
    done = CliRunner().invoke(
        app,
        [
            "map",
            "learn-landmarks",
            "office",
            "lobby-to-lab",
            "--out",
            str(file),
            "--least",
            "2",
            "--json",
        ],
    )
    assert done.exit_code == 0, done.output
    answer = json.loads(done.stdout)
    assert answer["learnt"] == len(answer["landmarks"]) >= 5
    assert all(row["error_m"] < 0.4 for row in answer["landmarks"])
    assert load_map(file).landmarks


def test_a_world_without_landmarks_is_an_error() -> None:
    session = prepare("empty", "straight", seed=1, overrides=["mission.timeout=3"])
    with pytest.raises(MapError, match="no landmark was detected 3 times"):
        learn_landmarks(session)


def test_bench_landmarks_prints_its_table() -> None:
    done = CliRunner().invoke(app, ["bench", "landmarks", "--views", "1", "--json"])
    assert done.exit_code == 0, done.output
    answer = json.loads(done.stdout)
    assert set(answer["kinds"]) == {"aruco", "poster"}
    near = [row for row in answer["kinds"]["aruco"]["rows"] if row["distance_m"] <= 2.0]
    assert sum(row["detected"] for row in near) >= 0.8 * len(near)
