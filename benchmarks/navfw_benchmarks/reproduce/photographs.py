"""Table 3 on photographs: OFFIS on the labelled frames of recordings, judged by the labels.

All labelled frames are judged as ``navfw bench real`` does; some are shown. For each recording and
each label of the front it is the middle one of the frames with it, of those of the test split where
there are any: the sentence plays no part in the choice. Single photographs do not count in the
total: nothing should be said about them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from navfw.config.input_file import is_folder
from navfw.errors import ConfigError
from navfw.numerics import Image
from navfw.perceive.overlay import draw
from navfw.perceive.pair_result import PairResult
from navfw.perceive.perceiver_options import PerceiverOptions
from navfw.plugins import Registry
from navfw.process.work_progress import ProgressCallback
from navfw_benchmarks.bench.real_benchmark import (
    RECORDINGS,
    judge_result,
    labelled_parts,
    open_part,
)
from navfw_benchmarks.bench.real_labels import FrameLabel, SentenceVerdict


def chosen_frames(labels: Sequence[FrameLabel]) -> list[FrameLabel]:
    """The frames to show: one for each recording and each label of the front, see above."""
    groups: dict[tuple[str, str], list[FrameLabel]] = {}
    for label in labels:
        groups.setdefault((label.folder, label.front), []).append(label)
    chosen = []
    for group in groups.values():
        tested = [label for label in group if label.split == "test"] or group
        chosen.append(tested[len(tested) // 2])
    return chosen


def real_scenes(
    data: Path, registry: Registry, report: ProgressCallback
) -> tuple[dict[FrameLabel, dict[str, Any]], dict[FrameLabel, Image]]:
    """What is said of every labelled frame in ``data``, as plain data; pictures of chosen ones.

    A frame that may not be shown has no picture.

    Raises:
        ConfigError: there are no recordings in ``data``, or a labelled image is missing.
        InputError: images cannot be read.

    """
    if not is_folder(data):
        raise ConfigError("there is no such folder of recordings", file=data, key="--data")
    parts = {
        part: labels
        for part, labels in labelled_parts("all").items()
        if is_folder(data / labels[0].folder)
    }
    if not parts:
        expected = ", ".join(RECORDINGS)
        raise ConfigError(
            f"has none of the labelled recordings; expected at least one of: {expected}",
            file=data,
            key="--data",
        )
    chosen = set(chosen_frames([label for labels in parts.values() for label in labels]))
    scenes: dict[FrameLabel, dict[str, Any]] = {}
    pictures: dict[FrameLabel, Image] = {}
    for part, labels in parts.items():
        report(f"Table 3 on photographs: {part}")
        named = {label.file: label for label in labels}
        scenes |= {label: _said(None, label) for label in labels}
        perceiver, _ = open_part(data, labels, PerceiverOptions().flow, registry)
        for item, result in perceiver.results():
            label = named.get(Path(item.name).name)
            if label is None:
                continue
            scenes[label] = _said(result, label)
            shown = label in chosen and RECORDINGS[label.folder].licence is not None
            if shown and perceiver.size is not None:
                pictures[label] = draw(item.image, result, perceiver.size)
    return scenes, pictures


def _said(result: PairResult | None, label: FrameLabel) -> dict[str, Any]:
    """The sentence of a frame, judged; silent without a result."""
    judged = judge_result(result, label)
    return {
        "sentence": "" if result is None else result.percept.sentence,
        "notes": [] if result is None else list(result.notes),
        "verdict": str(judged.verdict),
        "statements": dict(judged.statements),
    }


def real_as_data(scenes: Mapping[FrameLabel, dict[str, Any]]) -> dict[str, Any]:
    """The verdicts of all frames by recording, and the chosen frames, as plain data."""
    folders = {label.folder for label in scenes}
    return {
        "flow": PerceiverOptions().flow,
        "missing": [folder for folder in RECORDINGS if folder not in folders],
        "recordings": [
            {
                "folder": folder,
                "what": recording.what,
                "source": recording.source,
                "licence": recording.licence,
                "single": any(s.single for s in scenes if s.folder == folder),
                "verdicts": _verdicts(scenes[s] for s in scenes if s.folder == folder),
            }
            for folder, recording in RECORDINGS.items()
            if folder in folders
        ],
        "total": _verdicts(scenes[s] for s in scenes if not s.single),
        "scenes": [_about(label) | scenes[label] for label in chosen_frames(list(scenes))],
    }


def _verdicts(scenes: Iterable[Mapping[str, Any]]) -> dict[str, int]:
    counts = Counter(scene["verdict"] for scene in scenes)
    return {str(verdict): counts[verdict] for verdict in SentenceVerdict}


def _about(label: FrameLabel) -> dict[str, Any]:
    return {
        "folder": label.folder,
        "file": label.file,
        "split": label.split,
        "label": {
            "nearest": sorted(label.nearest),
            "nearest_also": sorted(label.nearest_also),
            "floor_in_front": label.floor_in_front,
            "front": label.front,
            "front_also": sorted(label.front_also),
        },
    }
