"""``navfw reproduce``: render, interpret, compare, time, and write the folder."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from navfw.bench.real_labels import FrameLabel
from navfw.config.lookup import find
from navfw.plugins import default_registry
from navfw.process.atomic import AtomicFolder
from navfw.process.work_progress import ProgressCallback, silent
from navfw.recording.run_folder import plain_json
from navfw.reproduce.metric_comparison import compare_metrics
from navfw.reproduce.paper_tables import (
    SceneRow,
    WaypointRow,
    as_data,
    checks,
    table2,
    table3,
    timings,
)
from navfw.reproduce.paper_trajectory import drive
from navfw.reproduce.real_scenes import RealScene, chosen_frames, real_as_data, real_scenes
from navfw.reproduce.reproduction_page import write_page
from navfw.reproduce.reproduction_pictures import draw_map, scene_picture, waypoint_picture
from navfw.reproduce.reproduction_summary import summary
from navfw.signals import Image
from navfw.sim.worldfile import load_world

_PAPER_TIMES = {"obstacles_s": 0.16, "situation_synthetic_s": 0.58, "situation_real_s": 0.62}
"""Times of OFFIS [s] in the paper, on an Athlon XP 2600+ at 2.09 GHz."""

_OURS = re.compile(r"index\.html|result\.json")


def reproduce(
    out: Path,
    seed: int,
    views: int,
    data: Path | None = None,
    report: ProgressCallback = silent,
) -> dict[str, Any]:
    """Write the reproduction to the folder ``out``, atomically; returns the result as plain data.

    ``views`` is the number of views in the comparison of section 4.3; ``data`` is the folder of
    the recordings for Table 3 on photographs, None to leave them out. Everything except
    ``timings`` depends on these and ``seed`` only; ``digest`` is the SHA-256 of it. ``report`` is
    called with each part.

    Raises:
        InputError: ``out`` holds other files, or cannot be written; ``data`` lacks recordings.

    """
    with AtomicFolder(out, _OURS, "--out") as folder:
        # first, since it can fail
        real = {} if data is None else real_scenes(data, default_registry(), report)
        report("Table 2: the trajectory")
        rows = table2(seed)
        report("Table 3: the office")
        scenes = table3(seed)
        found = {
            "seed": seed,
            **as_data(rows, scenes),
            "real": None if data is None else real_as_data(real),
            "metrics": compare_metrics(views, seed, report),
            "checks": checks(rows),
        }
        result = plain_json({**found, "summary": summary(found)})
        digest = hashlib.sha256(json.dumps(result, sort_keys=True).encode()).hexdigest()
        report("times")
        times = {**timings(rows, scenes), "paper": dict(_PAPER_TIMES)}
        result |= {"digest": digest, "timings": times}
        report("pictures")
        page = write_page(result, _pictures(rows, scenes, real))
        (folder.path / "index.html").write_text(page, encoding="utf-8")
        text = json.dumps(result, indent=2, allow_nan=False)
        (folder.path / "result.json").write_text(text + "\n", encoding="utf-8")
    return dict(result)


def _pictures(
    rows: list[WaypointRow], scenes: list[SceneRow], real: Mapping[FrameLabel, RealScene]
) -> dict[str, Image]:
    """The pictures of the page by name; frames that may not be shown have none."""
    shown = [(k, real[label].picture) for k, label in enumerate(chosen_frames(list(real)))]
    return {
        "map": draw_map(load_world(find("world", "paper-room")), drive(), rows),
        **{f"waypoint-{row.waypoint.number}": waypoint_picture(row) for row in rows},
        **{f"scene-{row.scene.number}": scene_picture(row) for row in scenes},
        **{f"real-{k}": picture for k, picture in shown if picture is not None},
    }
