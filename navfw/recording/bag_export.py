"""A recorded run as a bag of ROS 2: its standard messages, byte for byte, under the usual names."""

from __future__ import annotations

import re
from pathlib import Path

from navfw.config.extras import extra_imports
from navfw.process.atomic import AtomicFolder
from navfw.recording import channel_list as topics
from navfw.recording.recorded_run import open_run
from navfw.recording.ros_messages import message_types

with extra_imports("bags"):
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

_FILES = re.compile(r"metadata\.yaml|.*\.(mcap|db3)")
"""What a bag's folder holds."""


def export_bag(folder: Path, target: Path) -> dict[str, int]:
    """Write the recording in a run ``folder`` as the bag ``target``, a folder; atomically.

    Returns the number of messages by topic. Times are simulated, images are ``CompressedImage``.

    Raises:
        InputError: there is no recording, or it is damaged; the target holds other files, or cannot
            be written.

    """
    run = open_run(folder)
    kinds = {
        topic: kind
        for topic, kind in run.topics.items()
        if topic != topics.READING and kind in message_types().types
    }
    counts = dict.fromkeys(map(_name, kinds), 0)
    with AtomicFolder(target, _FILES, "--to") as atomic:
        inner = atomic.path / target.name
        writer = Writer(inner, version=9, storage_plugin=StoragePlugin.MCAP)
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with writer:
            links = {
                topic: writer.add_connection(_name(topic), kind, typestore=message_types())
                for topic, kind in kinds.items()
            }
            for topic, log_time, data in run.packed(*kinds):
                writer.write(links[topic], log_time, data)
                counts[_name(topic)] += 1
        for file in inner.iterdir():
            file.rename(atomic.path / file.name)
        inner.rmdir()
    return counts


def _name(topic: str) -> str:
    """The name of ``topic`` in a bag: images as ``image_transport`` calls packed ones."""
    return f"{topic}/compressed" if topic in topics.IMAGES else topic
