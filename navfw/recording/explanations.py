"""Explain recorded commands at any moment of a recording.

A recording has the explanation of every decision, found by the index at its end. The rest (the
inference behind the sentence, explanations in a file that is cut off or older) is computed again by
the stack, run on the readings from the start.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from navfw.config.extras import extra_imports
from navfw.config.input_file import open_input
from navfw.errors import InputError
from navfw.recording import channel_list as topics
from navfw.recording.run_folder import plain_json, recording_in

_AFTER = 1.0
"""Time [s] after the last reading for which its command counts as in force."""


def explain_at(folder: str | Path, time: float, *, inference: bool = False) -> dict[str, Any]:
    """Explain why the command in force at ``time`` [s] of a recorded run was given, as JSON data.

    It has each behaviour's proposal, the rules that fired with their strengths, and OFFIS's percept
    (keys of ``Stack.explain``); with ``inference`` also the rules by which OFFIS inferred it. Only
    if the recording ends before its run is there a key ``complete``, which is False.

    Raises:
        InputError: the folder is not that of a run with ``--record``, or is damaged; or no command
            was in force at that time.

    """
    recorded = None if inference else _recorded(folder, time)
    if recorded is None:
        from navfw.recording.run_replay import repeat_until

        recorded = repeat_until(folder, time)
    explanation: dict[str, Any] = plain_json(recorded[0], topics.DIGITS)
    last = recorded[1]
    if not 0.0 <= time <= last + _AFTER or not explanation:
        raise InputError(
            f"no command was in force at {time:g} s; expected a time within the run's "
            f"{last:.1f} s, after its first command",
            file=folder,
            key="--at",
        )
    return explanation


def _recorded(folder: str | Path, time: float) -> tuple[dict[str, Any], float] | None:
    """Return the recorded explanation at ``time`` [s], and the time of the last reading [s].

    None if the file does not have it or is cut off: then all of it is read, which finds the fault.
    """
    with extra_imports("record"):
        from mcap.exceptions import McapError
        from mcap.reader import SeekingReader

    file = recording_in(folder)
    try:
        with open_input(file, topics.MAX_BYTES) as stream:
            reader = SeekingReader(stream, validate_crcs=True)
            whole = reader.get_header().profile == f"{topics.PROFILE}{topics.FORMAT_VERSION}"
            summary = reader.get_summary()
            if summary is None or summary.statistics is None or not whole:
                return None
            if not any(index.name == topics.END for index in summary.metadata_indexes):
                return None
            last = 1e-9 * summary.statistics.message_end_time
            before = topics.nanoseconds(min(max(0.0, time), 1e6)) + 1
            wanted = (topics.RULES, topics.COMMAND)
            decided = 0
            for _, channel, message in reader.iter_messages(
                wanted, ending_before=before, reverse=True
            ):
                decided = max(decided, message.log_time)
                if channel.topic == topics.RULES:
                    return (json.loads(message.data), last) if message.log_time == decided else None
    except (McapError, OSError, ValueError, LookupError):
        return None
    return None if decided else ({}, last)
