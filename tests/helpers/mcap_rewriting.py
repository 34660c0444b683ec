"""Copies of recordings with one thing changed, written by the library ``mcap``."""

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mcap.records import Channel, Header, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

Change = Callable[[str, bytes], bytes | None]
"""Of topic and content of a message: its new content, or None to leave it out."""


def unchanged(topic: str, data: bytes) -> bytes | None:
    return data


def rewrite(source: Path, target: Path, change: Change = unchanged, **options: Any) -> Path:
    """Write ``source`` to ``target``, changed as ``rewritten`` does."""
    target.write_bytes(rewritten(source.read_bytes(), change, **options))
    return target


def rewritten(
    content: bytes,
    change: Change = unchanged,
    *,
    profile: str | None = None,
    schema: Callable[[Schema], bytes] = lambda schema: schema.data,
    compression: CompressionType = CompressionType.ZSTD,
    chunk_size: int = 1 << 18,
) -> bytes:
    """A recording with its messages, profile, schemas or chunks changed."""
    out = io.BytesIO()
    writer = Writer(out, compression=compression, chunk_size=chunk_size)
    channels: dict[int, tuple[int, str]] = {}
    schemas: dict[int, int] = {}
    for record in StreamReader(io.BytesIO(content)).records:
        if isinstance(record, Header):
            writer.start(profile if profile is not None else record.profile, "test")
        elif isinstance(record, Schema) and record.id not in schemas:
            schemas[record.id] = writer.register_schema(
                record.name, record.encoding, schema(record)
            )
        elif isinstance(record, Channel) and record.id not in channels:
            number = writer.register_channel(
                record.topic, record.message_encoding, schemas[record.schema_id]
            )
            channels[record.id] = number, record.topic
        elif isinstance(record, Metadata):
            writer.add_metadata(record.name, record.metadata)
        elif isinstance(record, Message):
            number, topic = channels[record.channel_id]
            data = change(topic, record.data)
            if data is not None:
                writer.add_message(number, record.log_time, data, record.publish_time)
    writer.finish()  # type: ignore[no-untyped-call]
    return out.getvalue()
