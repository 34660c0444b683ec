"""The report of a run: one HTML file with plan, pictures, ratings, rules and timelines."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from navfw.config.input_file import is_file
from navfw.errors import ConfigError
from navfw.recording import palette
from navfw.recording.recorded_run import RecordedRun, recording_in
from navfw.recording.run_folder import PICTURE, RECORDING, plain_json, read_result
from navfw.report.report_page import picture_source, render_page
from navfw.report.run_moments import Rating, RunMoment, read_moments
from navfw.report.run_timeline import read_timeline, robot_and_goals

_NUMBERS = {
    "sim_time_s": ("time", "s"),
    "path_length_m": ("path", "m"),
    "shortest_path_m": ("shortest path", "m"),
    "min_clearance_m": ("smallest clearance", "m"),
    "mean_speed_m_s": ("mean speed", "m/s"),
    "estimate_error_p95_m": ("error of the position, 95 %", "m"),
    "collisions": ("collisions", ""),
    "emergencies": ("emergencies", ""),
}
"""Results on the page, each with its name and unit."""


def run_report(folder: Path) -> str:
    """The report of the run in ``folder`` as HTML; without a recording, its result and picture.

    Raises:
        ConfigError: it is not a run folder, or its files are damaged.

    """
    result = read_result(folder)
    content: dict[str, Any] = {
        "title": f"{result.get('world', '?')} / {result.get('mission', '?')},"
        f" seed {result.get('seed', '?')}",
        "outcome": str(result.get("outcome", "")),
        "reason": str(result.get("reason", "")),
        "numbers": _numbers(result),
        "picture": None,
        "figures": {},
        "moments": None,
        "cells": palette.camera_key(),
    }
    if is_file(folder / RECORDING):
        content |= _recorded(RecordedRun(recording_in(folder)), result)
    elif is_file(folder / PICTURE):
        content["picture"] = picture_source(folder / PICTURE)
    return render_page("run_page.html", **content)


def _numbers(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    found = []
    for key, (name, unit) in _NUMBERS.items():
        value = result.get(key)
        if isinstance(value, int | float):
            text = str(value) if isinstance(value, int) else f"{value:.2f}"
            found.append((name, f"{text} {unit}".strip()))
    return found


def _recorded(run: RecordedRun, result: Mapping[str, Any]) -> dict[str, Any]:
    """What the page shows of a recording."""
    from bokeh.embed import components

    from navfw.report.run_figures import plan_figure, plan_key, rating_figure, timeline_figures

    radius, goals = robot_and_goals(result)
    timeline = read_timeline(run, radius)
    moments = read_moments(run)
    if not moments:
        raise ConfigError("has no camera images; record the run again", file=run.path)
    if not len(timeline.time):
        return {"moments": _script_data(moments, None), "complete": run.complete, "figures": {}}
    rating = next((moment.rating for moment in moments if moment.rating is not None), None)
    figures: dict[str, Any] = {
        "plan": plan_figure(timeline, goals, radius),
        **timeline_figures(timeline),
    }
    if rating is not None:
        figures["rating"] = rating_figure(rating)
    script, places = components(figures)
    data = _script_data(moments, rating)
    return {
        "moments": data,
        "complete": run.complete,
        "figures": places,
        "script": script,
        "key": plan_key(timeline),
    }


def _script_data(moments: Sequence[RunMoment], rating: Rating | None) -> dict[str, Any]:
    """The moments as the page's script reads them; ratings as bytes in base64."""
    data: dict[str, Any] = {
        "size": moments[0].size,
        "flow_color": palette.FLOW,
        "first": next((n for n, moment in enumerate(moments) if moment.rules), 0),
        "moments": [
            {
                "time": moment.time,
                "image": moment.image,
                "flow": moment.flow,
                "cells": moment.cells,
                "sentence": moment.sentence,
                "rules": moment.rules,
                "command": moment.command,
                "robot": moment.true,
                "way": moment.path,
                "desires": _field(moment.rating, rating, "desirability"),
                "forbids": _field(moment.rating, rating, "prohibition"),
            }
            for moment in moments
        ],
    }
    if rating is not None:
        count, speeds, turns = rating.desirability.shape
        data["grid"] = {
            "count": count,
            "speeds": speeds,
            "turns": turns,
            "v": rating.v,
            "w": rating.w,
        }
    return dict(plain_json(data))


def _field(rating: Rating | None, shape: Rating | None, part: str) -> str:
    """The fields of all behaviours in one image, lowest row first, as bytes in base64.

    Empty where the moment has no rating of that ``shape``. A left turn is at the left, the first
    behaviour at the top, an empty row above each.
    """
    if rating is None or shape is None:
        return ""
    layers = getattr(rating, part)
    if layers.shape != shape.desirability.shape or rating.names != shape.names:
        return ""
    padded = np.pad(layers[::-1, :, ::-1], ((0, 0), (0, 1), (0, 0)))
    return base64.b64encode(padded.tobytes()).decode("ascii")
