"""Recorded readings are loaded bit by bit; any other file is refused."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from navfw.errors import ConfigError
from navfw.recording.run_replay import compare_commands, replay_commands
from navfw.recording.sensor_recording import MAX_BYTES, SensorRecorder, load_recording
from navfw.robot import RobotModel
from navfw.signals import Encoders, Frame, Inertial, Pose, SensorReading, Waypoint
from navfw.testing.fakes import FakePilot, FakeSimulator

TICKS = 40


def random_readings(seed: int) -> list[SensorReading]:
    random = np.random.default_rng(seed)

    def frame(time: float, height: int) -> Frame:
        size = (height, 2 * height)
        sides = random.integers(0, 256, (2, height, 7), dtype=np.uint8)
        image = random.integers(0, 256, size, dtype=np.uint8)
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


def recorded(readings: list[SensorReading], path: Path, max_bytes: int = MAX_BYTES) -> None:
    recorder = SensorRecorder(max_bytes)
    for number, reading in enumerate(readings):
        recorder.add(reading, 0.1 * number, -0.1 * number)
    recorder.save(path)


def same_frame(a: Frame | None, b: Frame | None) -> bool:
    if a is None or b is None:
        return a is b
    return a.time == b.time and all(
        np.array_equal(one, other)
        for one, other in zip((a.image, *a.sides), (b.image, *b.sides), strict=True)
    )


def test_readings_are_loaded_as_recorded(tmp_path: Path) -> None:
    path = tmp_path / "recording.npz"
    readings = random_readings(1)
    recorded(readings, path)
    recording = load_recording(path)
    back = list(recording.readings())
    assert recording.complete
    assert len(back) == TICKS
    for before, after in zip(readings, back, strict=True):
        assert (after.time, after.inertial, after.encoders) == (
            before.time,
            before.inertial,
            before.encoders,
        )
        assert same_frame(before.frame, after.frame)
        assert same_frame(before.landmark_frame, after.landmark_frame)
    assert np.array_equal(recording.commands[:, 0], 0.1 * np.arange(TICKS))


def test_an_empty_recording_can_be_loaded(tmp_path: Path) -> None:
    recorded([], tmp_path / "empty.npz")
    assert list(load_recording(tmp_path / "empty.npz").readings()) == []


def test_a_recorder_keeps_its_size_limit(tmp_path: Path) -> None:
    path = tmp_path / "recording.npz"
    recorded(random_readings(2), path, max_bytes=3000)
    recording = load_recording(path)
    assert not recording.complete
    assert 0 < len(recording) < TICKS


def test_the_size_is_checked_before_unpacking(tmp_path: Path) -> None:
    path = tmp_path / "recording.npz"
    recorded(random_readings(3), path)
    size = path.stat().st_size
    with pytest.raises(ConfigError, match="file is too large: at most 1000 bytes"):
        load_recording(path, max_bytes=1000)
    with pytest.raises(ConfigError, match=f"exceeds {size}"):
        load_recording(path, max_bytes=size)


def broken_files(folder: Path) -> list[Path]:
    good = folder / "good.npz"
    recorded(random_readings(4), good)
    with np.load(good) as data:
        arrays = {name: data[name] for name in data.files}
    text = folder / "text.npz"
    text.write_text("no archive")
    cut = folder / "cut.npz"
    cut.write_bytes(good.read_bytes()[:-200])
    variants = {
        "fewer": {name: array for name, array in arrays.items() if name != "ticks"},
        "typed": arrays | {"sensors": arrays["sensors"].astype(np.float32)},
        "pickled": arrays | {"sensors": np.array([{"a": 1}], dtype=object)},
        "short": arrays | {"ticks": arrays["ticks"][:-1]},
        "astray": arrays | {"frames_at": arrays["frames_at"] + 1},
        "narrow": arrays | {"sensors": arrays["sensors"][:, :5]},
    }
    files = [text, cut, folder / "missing.npz"]
    for name, content in variants.items():
        np.savez(folder / f"{name}.npz", **content)
        files.append(folder / f"{name}.npz")
    other = folder / "other.npz"
    with zipfile.ZipFile(other, "w") as archive:
        archive.writestr("../evil.npy", b"x")
    return [*files, other]


def test_a_file_that_is_no_recording_is_refused_with_its_name(tmp_path: Path) -> None:
    for path in broken_files(tmp_path):
        with pytest.raises(ConfigError, match=path.name):
            load_recording(path)


def test_a_pilot_gives_the_same_commands_to_recorded_readings(tmp_path: Path) -> None:
    robot, start = RobotModel(), Pose(0.0, 0.0, 0.3)
    goals = [Waypoint(1.0, 0.5, 0.2, "there", "goal", True)]
    simulator, pilot, recorder = FakeSimulator(start), FakePilot(), SensorRecorder()
    pilot.start(start, goals)
    while not pilot.state.finished:
        reading = simulator.read()
        twist = pilot.step(reading)
        recorder.add(reading, twist.v, twist.w)
        simulator.drive(*robot.wheel_speeds(twist))
        simulator.advance(1.0 / robot.control_rate)
    recorder.save(tmp_path / "recording.npz")
    recording = load_recording(tmp_path / "recording.npz")

    again = compare_commands(recording, replay_commands(FakePilot(), recording, start, goals))
    assert again.same
    assert again.first_difference is None
    misled = compare_commands(
        recording, replay_commands(FakePilot(yaw_error=0.2), recording, start, goals)
    )
    assert not misled.same
    assert misled.first_difference == 0


def members(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def rewritten(path: Path, name: str, content: bytes) -> Path:
    parts = members(path) | {name: content}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for member, data in parts.items():
            archive.writestr(member, data)
    return path


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data.replace(b"(40, 6)", b"(1<<9,)"), "not a recording"),
        (lambda data: data.replace(b"(40, 6)", b"(4**9,)"), "not a recording"),
        (lambda data: data.replace(b"(40, 6), }   ", b"(99999, 9999)"), "not a recording"),
        (lambda data: data.replace(b"(40, 6)", b"(41, 6)"), "not that of its shape"),
        (lambda data: data.replace(b"\x01\x00", b"\x03\x00", 1), "another version"),
        (lambda data: data[:-40] + b"\0\0\0\0\0\0\xf8\x7f" + data[-32:], ""),
        (lambda data: data[:100], "not a recording"),
        (lambda data: data[:128] + data[176:224] + data[128:176] + data[224:], "do not increase"),
    ],
)
def test_an_array_with_a_damaged_header_is_refused_unread(
    change: Callable[[bytes], bytes], message: str, tmp_path: Path
) -> None:
    path = tmp_path / "recording.npz"
    recorded(random_readings(5), path)
    rewritten(path, "sensors.npy", change(members(path)["sensors.npy"]))
    if not message:  # a reading that is not a number is a fault of a sensor, and replayed as such
        load_recording(path)
        return
    with pytest.raises(ConfigError, match=message):
        load_recording(path)


def test_every_flipped_byte_gives_a_recording_or_a_located_error(tmp_path: Path) -> None:
    good = tmp_path / "good.npz"
    recorded(random_readings(6)[:3], good)
    content = good.read_bytes()
    bad = tmp_path / "bad.npz"
    refused = 0
    for at in range(0, len(content), 7):
        bad.write_bytes(content[:at] + bytes([content[at] ^ 0xFF]) + content[at + 1 :])
        try:
            load_recording(bad)
        except ConfigError as error:
            assert error.file == str(bad)
            refused += 1
    assert refused > 100


@pytest.mark.parametrize(
    ("name", "column", "value", "message"),
    [
        ("sensors", 3, 1e300, "a rate is above"),
        ("sensors", 4, -1e192, "times of gyro or encoders"),
        ("sensors", 5, np.nan, "times of gyro or encoders"),
        ("frames_time", None, -1e192, "the time of an image"),
        ("frames_time", None, np.inf, "the time of an image"),
        ("landmarks_time", None, 1e3, "the time of an image"),
    ],
)
def test_times_and_rates_that_no_sensor_has_are_refused(
    name: str, column: int | None, value: float, message: str, tmp_path: Path
) -> None:
    path = tmp_path / "recording.npz"
    recorded(random_readings(7), path)
    with np.load(path) as data:
        arrays = {key: data[key] for key in data.files}
    arrays[name][1 if column is None else (7, column)] = value
    np.savez(path, **arrays)
    with pytest.raises(ConfigError, match=message):
        load_recording(path)
