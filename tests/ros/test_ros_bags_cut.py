"""Bags that a crash, a full disk or a forgotten file has left: their intact part is read."""

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from bag_samples import Sent, image, imu, write_bag
from cli_calls import answer, refusal
from mcap.writer import CompressionType, Writer
from perceive_calls import APPROACH

from navfw.errors import ConfigError
from navfw.recording import Bag
from navfw.recording.run_folder import is_bag


def sent() -> list[Sent]:
    images = [image("/camera/image", 0.1 * k, each, "mono8") for k, each in enumerate(APPROACH)]
    return [*images, *(imu(0.01 * k, (0.0, 0.0, 0.1)) for k in range(50))]


def cut(path: Path, share: float) -> Path:
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    return path


def the_file(folder: Path) -> Path:
    (file,) = (each for each in folder.iterdir() if each.name != "metadata.yaml")
    return file


@pytest.mark.parametrize("kind", ["mcap", "db3"])
@pytest.mark.parametrize("packed", ["", "chunk"])
def test_the_intact_part_of_a_bag_that_is_cut_off_is_read(
    kind: str, packed: str, tmp_path: Path
) -> None:
    packed = packed if kind == "mcap" else ""
    folder = write_bag(tmp_path / f"a.{kind}", sent(), packed=packed)
    whole = Bag(folder)
    file = cut(the_file(folder), 0.7)
    for path in (file, folder):
        bag = Bag(path)
        assert 2 <= len(bag.images) < len(whole.images)
        assert np.array_equal(bag.images, whole.images[: len(bag.images)])
        assert f"{file.name} was cut off: what is intact is read" in bag.notes
    assert len(answer("perceive", file)) == len(bag.images) - 1


def test_a_file_of_sqlite_that_ends_with_a_page_is_cut_off_as_well(tmp_path: Path) -> None:
    file = the_file(write_bag(tmp_path / "a.db3", sent()))
    whole = Bag(file)
    with file.open("r+b") as stream:
        stream.truncate(file.stat().st_size // 2 // 4096 * 4096)
    assert 2 <= len(Bag(file).images) < len(whole.images)


@pytest.mark.parametrize("packing", list(CompressionType))
def test_chunks_are_unpacked_as_far_as_they_go(packing: CompressionType, tmp_path: Path) -> None:
    from bag_samples import ROS2, message, nanoseconds

    path = tmp_path / "one.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=10_000_000, compression=packing)
        writer.start(profile="ros2")
        topics: dict[str, int] = {}
        for each in sorted(sent(), key=lambda each: each.time):
            if each.topic not in topics:
                schema = writer.register_schema(each.kind, "ros2msg", b"")
                topics[each.topic] = writer.register_channel(each.topic, "cdr", schema)
            data = bytes(ROS2.serialize_cdr(message(ROS2, each), each.kind))
            at = nanoseconds(each.time)
            writer.add_message(topics[each.topic], at, data, at)
        writer.finish()  # type: ignore[no-untyped-call]
    whole = len(Bag(path).gyro)
    assert 0 < len(Bag(cut(path, 0.6)).gyro) < whole
    path.write_bytes(path.read_bytes()[:60])
    assert "has no images to perceive" in refusal("perceive", path)


def test_a_folder_without_its_metadata_is_read(tmp_path: Path) -> None:
    folder = write_bag(tmp_path / "a.mcap", sent())
    whole = Bag(folder)
    for spoil in (Path.unlink, lambda path: path.write_bytes(b"")):
        spoil(folder / "metadata.yaml")
        assert is_bag(folder)
        bag = Bag(folder)
        assert np.array_equal(bag.images, whole.images)
        assert "metadata.yaml is missing or wrong, so each file is read by itself" in bag.notes[0]
        assert "ros2 bag reindex" in bag.notes[0]
    # the second file of the same recording
    (later,) = [each._replace(time=1.0) for each in sent()[:1]]
    rest = the_file(write_bag(tmp_path / "b.mcap", [later]))
    the_file(folder).rename(folder / "a_0.mcap")
    (folder / "metadata.yaml").unlink()
    shutil.copy(rest, folder / "a_1.mcap")
    assert len(Bag(folder).images) == len(whole.images) + 1
    (folder / "a_1.mcap").rename(folder / "other.mcap")
    with pytest.raises(ConfigError, match=r"holds several recordings: give one of a_0\.mcap, oth"):
        Bag(folder)
    (folder / "image.png").write_bytes(b"")
    assert not is_bag(folder)


def test_what_sqlite_has_left_in_its_log_is_read(tmp_path: Path) -> None:
    file = the_file(write_bag(tmp_path / "a.db3", sent()))
    whole = Bag(file)
    with closing(sqlite3.connect(file)) as base:
        base.execute("PRAGMA journal_mode=WAL")
        (topic,) = base.execute("SELECT id FROM topics WHERE name = '/imu'").fetchone()
        again = base.execute("SELECT timestamp, data FROM messages WHERE topic_id = ?", (topic,))
        rows = [(topic, stamp + 5 * 10**9, data) for stamp, data in again.fetchall()[:1]]
        base.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
        base.commit()
        for ending in ("", "-wal"):  # as a process that is killed leaves them
            shutil.copy(f"{file}{ending}", tmp_path / f"killed.db3{ending}")
    assert Bag(tmp_path / "killed.db3").duration > whole.duration + 4.0


def test_a_bag_that_only_its_own_tools_repair_names_them(tmp_path: Path) -> None:
    bag = cut(write_bag(tmp_path / "a.bag", sent()), 0.7)
    assert "rosbag reindex may repair it" in refusal("perceive", bag)
    active = bag.rename(tmp_path / "a.bag.active")
    assert "rosbag reindex may repair it" in refusal("perceive", active)
    file = the_file(write_bag(tmp_path / "a.mcap", sent(), packed="chunk"))
    data = bytearray(file.read_bytes())
    data[len(data) // 3 : len(data) // 2] = bytes(len(data) // 2 - len(data) // 3)
    file.write_bytes(data)
    assert "mcap recover may repair it" in refusal("perceive", file)
