"""Landmarks and situations: frames, detections, places that show them; learnt from drives."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from cli_calls import answer, refusal
from sim_worlds import PERFECT, world_of
from suite_plans import planned

from navfw.config import find
from navfw.errors import InputError, MapError
from navfw.features.recognizers import Aruco
from navfw.localization.place_probabilities import learn_table, load_table, situation_table
from navfw.missions import prepare
from navfw.missions.missionfile import start_candidates
from navfw.missions.run_report import write_run
from navfw.missions.session import Session
from navfw.plugins import default_registry
from navfw.recording import RunFolder
from navfw.recording.run_replay import load_recording, replay
from navfw.robot import RobotModel
from navfw.signals import Frame, Pose
from navfw.sim import Simulation
from navfw.suite.learning_drives import (
    SituationDrive,
    learn_landmarks,
    learn_situations,
    place_accuracy,
    record_situations,
)
from navfw.topomap import Place, TopoMap, load_map


def in_office(folder: Path, stack: str, seconds: float) -> Session:
    """A short drive with these parts in place of those of the default stack."""
    file = folder / "mine.yaml"
    file.write_text(f"base: default\n{stack}\n")
    overrides = [f"mission.timeout={seconds}"]
    return prepare("office", "lobby-to-lab", seed=2, stack=file, overrides=overrides)


def test_a_replay_has_the_same_landmark_frames(tmp_path: Path) -> None:
    session = in_office(tmp_path, "features: {landmarks: }\nlocalizer: {ekf: }", 9.0)
    result = session.run(record=True)
    with RunFolder(tmp_path / "run") as folder:
        write_run(result, folder)
    assert folder.final is not None
    recording = load_recording(folder.final / "run.mcap")
    taken = [r for r in recording.readings if r.landmark_frame is not None]
    wanted = session.mission.spec.robot.landmark_camera
    assert len(taken) == pytest.approx(result.sim_time_s * wanted.rate, abs=2)
    assert set(session.stack.state.detection_counts)  # the lobby has markers
    assert replay(folder.final).same
    assert result.stage_ms["landmark_frames"] > 0.0


def test_a_stack_without_landmarks_renders_no_landmark_frames(tmp_path: Path) -> None:
    session = in_office(tmp_path, "features: {none: }\nlocalizer: {dead_reckoning: }", 3.0)
    assert "landmark_frames" not in session.run().stage_ms
    assert session.stack.state.detection_counts == {}


@pytest.mark.slow
def test_landmarks_are_learnt_on_a_drive(tmp_path: Path) -> None:
    file = tmp_path / "learnt.yaml"
    words = ("learn-landmarks", "office", "lobby-to-lab", "--least", "2", "--out", file)
    done = answer("map", *words)
    assert done["learnt"] == len(done["landmarks"]) >= 5
    assert all(row["error_m"] < 0.4 for row in done["landmarks"])
    assert load_map(file).landmarks


def test_a_world_without_landmarks_is_an_error() -> None:
    session = prepare("empty", "straight", seed=1, overrides=["mission.timeout=3"])
    with pytest.raises(MapError, match="no landmark was detected 3 times"):
        learn_landmarks(session)


def test_bench_landmarks_prints_its_table() -> None:
    done = answer("bench", "landmarks", "--views", "1")
    assert set(done["kinds"]) == {"aruco", "poster"}
    near = [row for row in done["kinds"]["aruco"]["rows"] if row["distance_m"] <= 2.0]
    assert sum(row["detected"] for row in near) >= 0.8 * len(near)


ROBOT = RobotModel()


@pytest.fixture(scope="module")
def hospital() -> TopoMap:
    return load_map(find("map", "hospital"))


@pytest.fixture(scope="module")
def simulation(hospital: TopoMap) -> Iterator[Simulation]:
    camera = ROBOT.model_copy(update={"camera": ROBOT.landmark_view})
    start = hospital.places["lab"]
    world = world_of("hospital", 0)
    with Simulation(world, camera, Pose(start.x, start.y, 0.0), 0, PERFECT) as running:
        yield running


def seen_around(simulation: Simulation, hospital: TopoMap, place: Place) -> set[str]:
    """The markers of the map that are detected in a full turn at ``place``."""
    recognizer = Aruco(ROBOT)
    recognizer.set_map(hospital)
    seen: set[str] = set()
    for yaw in np.arange(12) * math.pi / 6.0:
        image, _ = simulation.render_from(Pose(place.x, place.y, yaw))
        seen |= {detection.identity for detection in recognizer.recognize(Frame(0.0, image))}
    return seen & hospital.landmarks_by_identity.keys()


@pytest.mark.slow
def test_a_marker_is_detected_from_every_start_place(
    simulation: Simulation, hospital: TopoMap
) -> None:
    places = start_candidates(hospital, [])
    blind = [p.name for p in places if not seen_around(simulation, hospital, p)]
    assert blind == []


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
    done = answer("map", "learn-situations", suite, "--seeds", "3:4", "--out", out)
    assert done["drives"] == 2
    assert set(done["accuracy"]) == {"paper-room", "office"}
    assert all(0.0 <= share <= 1.0 for share in done["seen_at"]["room"].values())
    assert done["accuracy"]["office"]["known_right_with"] > 0.5
    table = load_table(out)
    assert table.seen_at["room"].tolist() == pytest.approx(
        list(done["seen_at"]["room"].values()), abs=1e-3
    )
    session = in_office(tmp_path, f"localizer: {{bayes: {{situations: {out}}}}}", 2.0)
    assert session.run().outcome == "timeout"


def test_a_folder_is_no_file_to_write(tmp_path: Path) -> None:
    assert "got a folder" in refusal("map", "learn-situations", "--out", tmp_path)


def test_drives_without_situations_are_an_error(tmp_path: Path) -> None:
    still = "entries: [{world: empty, missions: [straight], set: {mission.timeout: 0.5}}]"
    with pytest.raises(InputError, match="OFFIS reported no situation on 1 drives"):
        learn_situations(planned(tmp_path, still), default_registry())
