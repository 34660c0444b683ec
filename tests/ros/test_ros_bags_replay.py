"""A bag is replayed to its end, and what the stack would have commanded is told honestly."""

import html
import json
import math
import os
import warnings
from importlib import import_module
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from bag_samples import Sent, image, imu, joints, odometry, twist, write_bag
from cli_calls import answer, invoke, output, refusal
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader

from navfw.missions import prepare
from navfw.missions.run_report import write_run
from navfw.perceive import camera_contradiction
from navfw.recording import Bag, RunFolder, read_result
from navfw.recording import channel_list as topics
from navfw.recording.recorded_run import RecordedRun, open_run
from navfw.ros import driven_map

DATA = os.environ.get("NAVFW_DATA", "")
"""The folder of recordings that are not part of the repository."""
NOISE = np.random.default_rng(1).integers(0, 256, (300, 700), np.uint8)
WALL = np.asarray(cv2.GaussianBlur(NOISE, (5, 5), 2), np.uint8)
STILL = "the camera does not move with the robot: its flow contradicts the wheels"


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a recorded run of ten seconds."""
    session = prepare("paper-room", "through-the-door", overrides=["mission.timeout=10"])
    with RunFolder(tmp_path_factory.mktemp("bags") / "run") as folder:
        assert write_run(session.run(record=True), folder) == ()
    return folder.target


@pytest.fixture(scope="module")
def exported(driven: Path) -> Path:
    answer("export", driven, "--to", driven.parent / "bag")
    return driven.parent / "bag"


def page_of(folder: Path) -> str:
    """The report of a run."""
    output("report", folder, "--quiet")
    return html.unescape((folder / "report.html").read_text(encoding="utf-8"))


def test_an_exported_run_is_read_as_it_was_driven(driven: Path, exported: Path) -> None:
    bag, run = Bag(exported), open_run(driven)
    rows = [m.content for m in run.messages(topics.READING)]
    turn = 2.0 * math.pi / read_result(driven)["config"]["mission"]["robot"]["ticks_per_turn"]
    assert np.array_equal(bag.joints[:, 1:], turn * np.array([(r.left, r.right) for r in rows]))
    assert np.array_equal(bag.gyro[:, 3], [row.yaw_rate for row in rows])
    assert np.array_equal(bag.commands[:, 1:], [(row.v, row.w) for row in rows])
    assert np.allclose(bag.images[:, 0], [row.frame_time for row in rows if row.pictures & 1])
    assert bag.matrix[0] == pytest.approx(80.0)


def test_an_exported_run_replays_on_its_map_with_its_commands(
    driven: Path, exported: Path, tmp_path: Path
) -> None:
    start = ",".join(map(str, read_result(driven)["config"]["mission"]["start"]))
    words = ("replay", exported, "--map", "paper-room", "--goal", "annex", "--start", start)
    done = answer(*words, "--out", tmp_path / "r", "--quiet")
    run, was = (RecordedRun(folder / "run.mcap") for folder in (tmp_path / "r", driven))
    own, before = (np.array([(m.content.v, m.content.w) for m in r.messages(topics.READING)])
                   for r in (run, was))  # fmt: skip
    assert np.abs(own - before).mean(axis=0).max() < 0.02
    assert np.abs(own[:, 0]).max() > 0.3
    assert done["notes"][-1].startswith("the stack would have stood for")
    # a replay is a run like any other
    assert answer("replay", tmp_path / "r")["same"]
    assert answer("explain", tmp_path / "r", "--at", 8)["behaviors"]
    page = page_of(tmp_path / "r")
    assert all(note in page for note in done["notes"])


def test_other_readers_read_an_exported_bag(driven: Path, exported: Path) -> None:
    standard = {kind for kind in open_run(driven).topics.values() if "/msg/" in kind}
    for file in exported.glob("*.mcap"):
        with file.open("rb") as stream:
            reader = make_reader(stream, decoder_factories=[DecoderFactory()])
            found = {
                schema.name if schema else "": decoded
                for schema, _, _, decoded in reader.iter_decoded_messages()
            }
        assert set(found) == standard - {topics.SCHEMA_NAME, topics.DECISION_NAME}
        assert found["sensor_msgs/msg/CompressedImage"].format == "png"


def test_the_messages_of_an_exported_bag_are_those_of_rclpy(exported: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # on modules of Python that rclpy uses
        ros = pytest.importorskip("rclpy.serialization", reason="rclpy is not installed")
        read = 0
        with Reader(exported) as reader:
            for each, _, data in reader.messages():
                package, _, name = each.msgtype.split("/")
                if package not in {"tf2_msgs", "rcl_interfaces"}:
                    kind = getattr(import_module(f"{package}.msg"), name)
                    back = ros.serialize_message(ros.deserialize_message(data, kind))
                    # bytes of alignment may be any
                    sent, same = (ros.deserialize_message(b, kind) for b in (data, back))
                    assert same == sent
                    read += 1
    assert read > 1000


def test_an_export_replaces_bags_alone(driven: Path, tmp_path: Path) -> None:
    target = tmp_path / "bag"
    for _ in range(2):
        assert sum(answer("export", driven, "--to", target)["messages"].values()) > 1000
    (target / "thesis.txt").write_text("all of it")
    assert "contains 'thesis.txt'" in refusal("export", driven, "--to", target)
    said = refusal("export", tmp_path, "--to", tmp_path / "b")
    assert "contains no sensor readings; run again with --record" in said
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["bag"]


def test_messages_in_json_are_of_their_schema(driven: Path) -> None:
    run = open_run(driven)
    schemas = json.loads((Path(topics.__file__).parent / "json_schemas.json").read_text())
    checked = set()
    for each in run.messages(topics.PERCEPT, topics.COMMAND, topics.RULES, topics.RULE_BASES):
        schema, contents = schemas[run.topics[each.topic]], [each.content]
        if each.topic == topics.RULE_BASES:  # of each behaviour
            schema, contents = schema["additionalProperties"], list(each.content.values())
        assert contents
        assert all(set(content) <= set(schema["properties"]) for content in contents)
        checked.add(run.topics[each.topic])
    assert checked == set(schemas)


def test_the_layout_shows_channels_that_there_are(driven: Path) -> None:
    layout = json.loads((driven / "foxglove_layout.json").read_text())
    known = {*topics.CHANNELS, topics.DRIVEN}
    shown = {text for text in strings(layout["configById"]) if text.startswith("/")}
    assert len(shown) > 10
    assert {text.partition(".")[0] for text in shown} <= known
    panels = {text for text in strings(layout["layout"]) if "!" in text}
    assert panels == set(layout["configById"])


def strings(value: Any) -> list[str]:
    """All texts and keys in plain data."""
    if isinstance(value, dict):
        return [text for key, item in value.items() for text in (key, *strings(item))]
    if isinstance(value, list):
        return [text for item in value for text in strings(item)]
    return [value] if isinstance(value, str) else []


def turning(rate: float, seen: float, *, gyro: bool = True) -> list[Sent]:
    """Eight seconds of a robot that swings by ``rate`` [rad/s], and its camera by ``seen``."""
    sent = []
    for k in range(160):
        time = 0.05 * k
        yaw = rate * math.sin(time)
        sent += [odometry(time, 0.0, 0.0, yaw), twist(time, 0.0, rate * math.cos(time))]
        sent += [imu(time, (0.0, 0.0, rate * math.cos(time)))] if gyro else []
        if k % 2 == 0:
            at = 270 + round(80.0 * seen * math.sin(time))
            view = np.ascontiguousarray(WALL[90:210, at : at + 160])
            sent.append(image("/camera/image_raw", time, view, "mono8"))
    return sent


@pytest.mark.parametrize(("seen", "told"), [(-1.0, ""), (0.0, f"{STILL}, 100%"), (1.0, STILL)])
def test_a_camera_that_does_not_turn_with_the_wheels_is_told(
    seen: float, told: str, tmp_path: Path
) -> None:
    bag = write_bag(tmp_path / "swing.mcap", turning(1.0, seen))
    assert camera_contradiction(Bag(bag)).startswith(told) is True
    assert bool(camera_contradiction(Bag(bag))) is bool(told)
    result = answer("replay", bag, "--out", tmp_path / "out", "--quiet")
    assert (result["notes"][0].startswith(STILL)) is bool(told)
    assert (result["outcome"], result["sim_time_s"]) == ("replayed", pytest.approx(7.95, abs=0.02))
    # the wheels never follow the stack, which is no fault in a replay
    assert not any("do not follow" in note or "do not count" in note for note in result["notes"])


def test_what_is_missing_stops_the_stack_and_is_told(tmp_path: Path) -> None:
    sent = turning(1.0, -1.0)
    for number, (without, said) in enumerate(
        (
            ({"/camera/image_raw"}, "there are no images"),
            ({"/cmd_vel"}, "the bag has no commands to compare with"),
            ({"/imu"}, "there is no gyro: turns are those of the wheels"),
            ({"/odom"}, "the wheels are silent for the last 8.0 s"),
        )
    ):
        kept = [each for each in sent if each.topic not in without]
        bag = write_bag(tmp_path / f"b{number}.db3", kept)
        result = answer("replay", bag, "--out", tmp_path / f"o{number}", "--quiet")
        assert said in "\n".join(result["notes"])
        assert answer("replay", tmp_path / f"o{number}")["same"]
        assert said in page_of(tmp_path / f"o{number}")
    stood = answer("replay", tmp_path / "b0-db3", "--out", tmp_path / "o0", "--quiet")["notes"][-1]
    assert "stood for 100% of the time" in stood
    assert "the camera is silent" in stood


def test_the_way_that_was_driven_is_the_map(tmp_path: Path) -> None:
    sent = [odometry(0.1 * k, 5.0, 7.0 + 0.05 * k, 0.5 * math.pi) for k in range(101)]
    topo_map = driven_map(Bag(write_bag(tmp_path / "way.bag", sent)))
    points = np.array([(place.x, place.y) for place in topo_map.places.values()])
    assert np.allclose(points, [(0.0, 0.0), (2.0, 0.0), (4.0, 0.0), (5.0, 0.0)], atol=0.06)
    assert [(p.a, p.b) for p in topo_map.passages][-1] == ("driven-2", "driven-3")
    still = write_bag(tmp_path / "still.bag", [joints(0.1 * k, 0.0, 0.0) for k in range(9)])
    assert len(driven_map(Bag(still)).places) == 2


def test_options_of_bags_are_refused_for_runs_and_wrong_ones_for_bags(
    driven: Path, tmp_path: Path
) -> None:
    bag = write_bag(tmp_path / "b.mcap", turning(1.0, -1.0)[:60])
    out = ("--out", tmp_path / "out")
    assert "is for a bag" in invoke("replay", driven, "--map", "office").output
    assert "--goal: --map needs a place to drive to: " in refusal("replay", bag, "--map", "office")
    said = refusal("replay", bag, "--map", "office", "--goal", "loby", *out)
    assert "did you mean 'lobby'" in said
    assert "unknown robot" in refusal("replay", bag, "--robot", "huskie", *out)
    wide = write_bag(tmp_path / "w.mcap", [image("/i", 0.1 * k, WALL, "mono8") for k in range(3)])
    assert "images of 700 x 300 have another shape" in refusal("replay", wide, *out)
    assert not (tmp_path / "out").exists()


@pytest.mark.skipif(not DATA, reason="NAVFW_DATA names no folder of recordings")
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("neato_wall_follow", (STILL, "camera_info is empty", "there is no gyro")),
        ("neato_drive_square_imu", ("there are no images", "the wheels are silent for the last 7")),
    ],
)
def test_bags_of_other_peoples_robots_replay_to_the_end(
    name: str, said: tuple[str, ...], tmp_path: Path
) -> None:
    bag = Path(DATA) / "bags" / f"{name}.bag"
    result = answer("replay", bag, "--out", tmp_path / "out", "--quiet")
    told = "\n".join(result["notes"])
    assert [text for text in said if text not in told] == []
    assert result["sim_time_s"] > 0.98 * Bag(bag).duration
    page = page_of(tmp_path / "out")
    assert [text for text in said if text not in page] == []
