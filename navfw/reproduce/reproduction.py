"""``navfw reproduce``: render, interpret, compare, time, and write the folder."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2

from navfw.atomic import AtomicFolder
from navfw.config.lookup import find
from navfw.recording.run_folder import plain_json
from navfw.reproduce.metric_comparison import compare_metrics
from navfw.reproduce.paper_tables import as_data, checks, table2, table3, timings
from navfw.reproduce.paper_trajectory import drive
from navfw.reproduce.reproduction_page import PAPER_TIMES, write_page
from navfw.reproduce.reproduction_pictures import draw_map, scene_picture, waypoint_picture
from navfw.signals import Image
from navfw.sim.worldfile import load_world

__all__ = ["reproduce"]

_OURS = re.compile(r"index\.md|result\.json|map\.png|(waypoint|scene)-[0-9]+\.png")


def reproduce(
    out: Path, seed: int, views: int, report: Callable[[str], None] = lambda _: None
) -> dict[str, Any]:
    """Write the reproduction to the folder ``out``, atomically; returns the result as plain data.

    ``views`` is the number of views in the comparison of section 4.3. Everything except
    ``timings`` depends on ``seed`` and ``views`` only; ``digest`` is the SHA-256 of it.
    ``report`` is called with a status text at each step.

    Raises:
        InputError: ``out`` holds other files, or cannot be written.

    """
    with AtomicFolder(out, _OURS, "--out") as folder:
        report("Table 2: the trajectory")
        rows = table2(seed)
        report("Table 3: the office")
        scenes = table3(seed)
        report(f"section 4.3: {views} views")
        metrics = compare_metrics(views, seed)
        report("times")
        times = timings(rows, scenes)
        shown = checks(rows)
        result = plain_json(
            {"seed": seed, **as_data(rows, scenes), "metrics": metrics, "checks": shown}
        )
        digest = hashlib.sha256(json.dumps(result, sort_keys=True).encode()).hexdigest()
        result |= {"digest": digest, "timings": {**times, "paper": dict(PAPER_TIMES)}}
        report("pictures")
        world = load_world(find("world", "paper-room"))
        draw_map(folder.path / "map.png", world, drive(), rows)
        for row in rows:
            name = f"waypoint-{row.waypoint.number}.png"
            (folder.path / name).write_bytes(_png(waypoint_picture(row)))
        for scene in scenes:
            name = f"scene-{scene.scene.number}.png"
            (folder.path / name).write_bytes(_png(scene_picture(scene)))
        page = write_page(seed, rows, scenes, metrics, times, shown)
        (folder.path / "index.md").write_text(page, encoding="utf-8")
        text = json.dumps(result, indent=2, allow_nan=False)
        (folder.path / "result.json").write_text(text + "\n", encoding="utf-8")
    return dict(result)


def _png(picture: Image) -> bytes:
    """The picture as PNG; OpenCV's own writing of files tells no reason when it fails."""
    return cv2.imencode(".png", picture)[1].tobytes()
