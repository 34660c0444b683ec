"""Recorded readings are loaded bit by bit; any other file is refused."""

from dataclasses import replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap_rewriting import Change, rewrite
from scripted_run import FakeSimulator

from navfw.errors import ConfigError
from navfw.recording import RunRecorder, deserialize_cdr, ros_message
from navfw.recording import channel_list as topics
from navfw.recording.channel_list import (
    CAMERA_IMAGE,
    LANDMARK_IMAGE,
    READING,
    RIGHT_IMAGE,
    SCHEMA_NAME,
)
from navfw.recording.recorded_run import RecordedRun
from navfw.recording.ros_messages import message_types, reading_message
from navfw.recording.run_replay import load_recording, replay_by
from navfw.signals import Encoders, Frame, Inertial, Pose, SensorReading, Twist

TICKS = 40
HERE = Pose(0.0, 0.0, 0.0)
GIF = ros_message("sensor_msgs/msg/CompressedImage", {"data": np.frombuffer(b"GIF", np.uint8)}, 0)


def random_readings(seed: int) -> list[SensorReading]:
    random = np.random.default_rng(seed)

    def frame(time: float, height: int) -> Frame:
        sides = random.integers(0, 256, (2, height, 7), dtype=np.uint8)
        image = random.integers(0, 256, (height, 2 * height), dtype=np.uint8)
        return Frame(time, image, tuple(sides) if height == 12 else ())

    def reading(tick: int) -> SensorReading:
        time = tick / 60.0
        left, right = random.integers(-(2**40), 2**40, 2).tolist()
        return SensorReading(
            time=time,
            inertial=Inertial(time - 1e-3, *random.normal(size=3).tolist()),
            encoders=Encoders(time - 2e-3, left, right),
            frame=frame(time, 12) if tick % 6 == 0 else None,
            landmark_frame=frame(time, 24) if tick % 15 == 3 else None,
        )

    return [reading(tick) for tick in range(TICKS)]


def recorded(readings: list[SensorReading], path: Path) -> Path:
    recorder = RunRecorder({"world": "none"})
    for number, reading in enumerate(readings):
        recorder.observe(reading, Twist(0.1 * number, -0.1 * number), HERE)
    recorder.save(path)
    return path


@pytest.fixture
def good(tmp_path: Path) -> Path:
    return recorded(random_readings(5), tmp_path / "good.mcap")


def measured(reading: SensorReading) -> tuple[object, ...]:
    return reading.time, reading.inertial, reading.encoders


def same_frame(a: Frame | None, b: Frame | None) -> bool:
    if a is None or b is None:
        return a is b
    images = zip((a.image, *a.sides), (b.image, *b.sides), strict=True)
    return a.time == b.time and all(np.array_equal(*pair) for pair in images)


def test_readings_are_loaded_as_recorded(tmp_path: Path) -> None:
    readings = random_readings(1)
    recording = load_recording(recorded(readings, tmp_path / "run.mcap"))
    back = list(recording.readings)
    assert recording.complete
    assert len(back) == TICKS
    for before, after in zip(readings, back, strict=True):
        assert measured(after) == measured(before)
        assert same_frame(before.frame, after.frame)
        assert same_frame(before.landmark_frame, after.landmark_frame)
    assert np.array_equal(recording.commands[:, 0], 0.1 * np.arange(TICKS))


def test_a_reading_that_is_not_a_number_is_kept() -> None:
    """It is a fault of a sensor, and replayed as such."""
    inertial = Inertial(0.0, float("nan"), -0.0, float("inf"))
    reading = SensorReading(0.0, inertial, Encoders(0.0, 0, 0))
    row = deserialize_cdr(reading_message(reading, Twist(1.0, 0.0)), SCHEMA_NAME)
    assert np.isnan(row.roll_rate)
    assert (str(row.pitch_rate), row.yaw_rate) == ("-0.0", float("inf"))


def test_a_recorder_keeps_its_size_limit_and_may_be_empty(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(topics, "MAX_BYTES", 6000)
        limited = recorded(random_readings(2), tmp_path / "run.mcap")
    recording = load_recording(limited)
    assert not recording.complete
    assert 0 < len(recording) < TICKS
    assert list(load_recording(recorded([], tmp_path / "empty.mcap")).readings) == []
    monkeypatch.setattr(topics, "MAX_BYTES", 1000)
    with pytest.raises(ConfigError, match="file is too large: at most 1000 bytes"):
        load_recording(limited)


def test_of_a_cut_file_the_intact_part_is_used(good: Path, tmp_path: Path) -> None:
    path = rewrite(good, tmp_path / "run.mcap", chunk_size=2000)
    whole = load_recording(path)
    content = path.read_bytes()
    for share in (0.4, 0.6):
        path.write_bytes(content[: int(share * len(content))])
        recording = load_recording(path)
        assert not recording.complete
        assert 3 < len(recording) < TICKS
        assert np.array_equal(recording.commands, whole.commands[: len(recording)])
        for cut, reading in zip(recording.readings, whole.readings, strict=False):
            assert measured(cut) == measured(reading)
    path.write_bytes(content[:1500])
    with pytest.raises(ConfigError, match="cut off before its first reading"):
        load_recording(path)


def other_message(topic: str, data: bytes) -> Change:
    return lambda of, content: data if of == topic else content


def left_out(topic: str) -> Change:
    return lambda of, content: None if of == topic else content


def with_row(**fields: Any) -> Change:
    """The reading of tick 6, which has a frame, with other fields."""
    numbers = count()

    def change(topic: str, data: bytes) -> bytes:
        if topic != READING or next(numbers) != 6:
            return data
        row = replace(deserialize_cdr(data, SCHEMA_NAME), **fields)
        return bytes(message_types().serialize_cdr(row, SCHEMA_NAME))

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (left_out(CAMERA_IMAGE), "images of /camera/image are missing"),
        (left_out(RIGHT_IMAGE), "images of /camera/right/image are missing"),
        (other_message(READING, b"\0" * 9), "a message of .* is damaged"),
        (other_message(LANDMARK_IMAGE, b"\xff\xff"), "a message of /camera/landmarks/image"),
        (other_message(LANDMARK_IMAGE, GIF), "is not a readable image"),
        (with_row(pictures=0), "an image belongs to no reading"),
        (with_row(pictures=7), "images of /camera/landmarks/image are missing"),
    ],
)
def test_missing_and_damaged_messages_are_told(
    change: Change, message: str, good: Path, tmp_path: Path
) -> None:
    bad = rewrite(good, tmp_path / "bad.mcap", change)
    with pytest.raises(ConfigError, match=message) as caught:
        load_recording(bad)
    assert "bad.mcap" in str(caught.value)


def test_a_foreign_file_and_one_of_another_version_are_refused(good: Path, tmp_path: Path) -> None:
    for profile in ("ros2", "", "navfw-0"):
        message = f"profile '{profile}', this navfw reads 'navfw-2'; record the run again"
        with pytest.raises(ConfigError, match=message):
            load_recording(rewrite(good, tmp_path / "other.mcap", profile=profile))
    fewer = rewrite(good, tmp_path / "fewer.mcap", schema=lambda schema: schema.data[:-30])
    with pytest.raises(ConfigError, match="not of this version"):
        load_recording(fewer)
    text = tmp_path / "text.mcap"
    text.write_text("no recording")
    with pytest.raises(ConfigError, match="expected an MCAP file"):
        load_recording(text)


def test_a_pilot_gives_the_same_commands_to_recorded_readings(tmp_path: Path) -> None:
    def step(reading: SensorReading, v: float = 0.2) -> Twist:
        return Twist(v + 1e-4 * reading.encoders.left, 0.1 - 0.5 * reading.inertial.yaw_rate)

    simulator, recorder = FakeSimulator(Pose(0.0, 0.0, 0.3)), RunRecorder()
    for _ in range(60):
        twist = step(reading := simulator.read())
        recorder.observe(reading, twist, simulator.true_pose())
        simulator.drive(*simulator.robot.wheel_speeds(twist))
        simulator.advance(1.0 / simulator.robot.control_rate)
    recorder.save(tmp_path / "run.mcap")
    recording = load_recording(tmp_path / "run.mcap")
    for v, first_difference in ((0.2, None), (0.3, 0)):
        replayed = replay_by(partial(step, v=v), recording)
        assert replayed.same is (first_difference is None)
        assert replayed.first_difference == first_difference


def test_every_flipped_byte_gives_a_recording_or_a_located_error(tmp_path: Path) -> None:
    bad = recorded(random_readings(7)[:3], tmp_path / "bad.mcap")
    content = bad.read_bytes()
    refused = 0
    for at in range(0, len(content), 7):
        bad.write_bytes(content[:at] + bytes([content[at] ^ 0xFF]) + content[at + 1 :])
        try:
            load_recording(bad)
        except ConfigError as error:
            assert str(bad) in str(error)
            refused += 1
    assert refused > 100


def test_the_recording_tells_of_its_run(good: Path) -> None:
    run = RecordedRun(good)
    assert run.metadata == {"world": "none"}
    assert run.topics[CAMERA_IMAGE] == "sensor_msgs/msg/CompressedImage"
    assert run.image_at(-1.0) is None
    image, frame = run.image_at(0.15), random_readings(5)[6].frame
    assert image is not None and frame is not None
    assert np.array_equal(image, frame.image)
