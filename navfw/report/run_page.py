"""The report of a run: one HTML file with plan, pictures, ratings, rules and timelines."""

from __future__ import annotations

import base64
import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from navfw.config.input_file import is_file
from navfw.errors import ConfigError
from navfw.numerics import Array
from navfw.recording import palette, top_view
from navfw.recording.recorded_run import RecordedRun, recording_in
from navfw.recording.run_folder import PICTURE, RECORDING, plain_json, read_result
from navfw.report.report_page import picture_source, render_page
from navfw.report.run_moments import (
    Rating,
    RunMoment,
    RunTimeline,
    read_moments,
    read_timeline,
    robot_and_goals,
)

if TYPE_CHECKING:
    from bokeh.plotting import figure


_BLUES = ("#FFFFFF", "#DEEBF7", "#C6DBEF", "#9ECAE1", "#6BAED6", "#4292C6", "#2171B5", "#084594")
_REDS = ("#FFFFFF", "#FEE5D9", "#FCBBA1", "#FC9272", "#FB6A4A", "#EF3B2C", "#CB181D", "#99000D")
_LINES = tuple((color, dash) for dash in ("solid", "dotted") for color in ("#0072B2", "#D55E00"))
"""Colours and dashes of lines over time."""
_PX_PER_PT = 1.25
"""Width of lines and size of marks [px] per point."""


def _figure(**options: Any) -> figure:
    """A figure as wide as its place on the page, without toolbar logo."""
    from bokeh.plotting import figure

    shown = figure(sizing_mode="stretch_width", output_backend="canvas", **options)
    shown.toolbar.logo = None
    shown.background_fill_color = palette.FLOOR
    shown.outline_line_color = None
    return shown


def plan_figure(
    timeline: RunTimeline, goals: Sequence[tuple[float, float]], robot_radius: float
) -> figure:
    """The plan with the true path, coloured by leading behaviour, and the robot on it."""
    from bokeh.models import ColumnDataSource

    plan = _figure(
        height=430,
        match_aspect=True,
        x_axis_label="x [m]",
        y_axis_label="y [m]",
        tools="pan,wheel_zoom,box_zoom,reset",
    )
    plan.grid.grid_line_color = None
    shapes: list[top_view.Shape] = [
        *timeline.outline.shapes(),
        *top_view.led_lines(timeline.true, timeline.leaders),
        top_view.estimated_line(timeline.estimate),
        top_view.goal_marks(goals),
    ]
    for (_, style), group in itertools.groupby(shapes, key=lambda s: (type(s), s.style)):
        _draw(plan, style, list(group))
    way = ColumnDataSource({"x": [], "y": []}, name="way")
    plan.line("x", "y", source=way, color=palette.GOAL, line_dash="dotted", line_width=2)
    robot = ColumnDataSource({"x": [], "y": []}, name="robot")
    body: dict[str, Any] = {"fill_color": "white", "line_color": "black", "line_width": 2}
    plan.circle("x", "y", radius=robot_radius, source=robot, **body)
    return plan


def _draw(plan: figure, style: top_view.Style, shapes: Sequence[Any]) -> None:
    """Draw ``shapes``, all of one kind and ``style``."""
    first, color = shapes[0], style.color
    look: dict[str, Any] = {"fill_color": color, "line_color": style.edge}
    if isinstance(first, top_view.Area):
        xs, ys = ([shape.corners[:, axis].tolist() for shape in shapes] for axis in (0, 1))
        plan.patches(xs, ys, **look)
    elif isinstance(first, top_view.Disc):
        look |= {name: [getattr(disc, name) for disc in shapes] for name in ("x", "y", "radius")}
        plan.circle(**look)
    elif isinstance(first, top_view.Marks):
        look |= {"marker": style.marker, "size": _PX_PER_PT * style.size}
        plan.scatter(*first.points.T.tolist(), **look)
    else:
        dash = "dashed" if style.dashed else "solid"
        look = {"color": color, "line_width": _PX_PER_PT * style.width, "line_dash": dash}
        plan.line(*first.points.T, line_cap="round", **look)


def plan_key(timeline: RunTimeline) -> list[tuple[str, str]]:
    """The leading behaviours, each with its share of the commands, and their colours."""
    total = len(timeline.leaders)
    return [
        (f"{name or 'standing'} ({count / total:.0%})", palette.behavior_color(name))
        for name, count in Counter(timeline.leaders).most_common()
    ]


def timeline_figures(timeline: RunTimeline) -> dict[str, figure]:
    """Speed and turn, clearance, and confidence over time, by name."""
    time, v, w = timeline.time, timeline.commands[:, 0], timeline.commands[:, 1]
    driven = [] if np.isnan(timeline.driven).all() else [*timeline.driven.T]
    first = time_figure(time, [v, w, *driven], "command", "v [m/s], w [rad/s]", None)
    clearance, confidence = timeline.clearance, timeline.confidence
    return {
        "speed": first,
        "clearance": time_figure(time, [clearance], "clearance", "clearance [m]", first),
        "confidence": time_figure(time, [confidence], "confidence", "confidence", first),
    }


def time_figure(
    time: Array, columns: Sequence[Array], name: str, label: str, other: figure | None
) -> figure:
    """Lines over time, on the time axis of ``other``, with a mark for now: ``now-NAME``."""
    from bokeh.models.annotations import Span

    shared: dict[str, Any] = {} if other is None else {"x_range": other.x_range}
    shown = _figure(
        height=150,
        x_axis_label="time [s]",
        y_axis_label=label,
        tools="xpan,xwheel_zoom,reset",
        min_border_left=70,
        **shared,
    )
    for values, (color, dash) in zip(columns, _LINES, strict=False):
        shown.line(time, values, color=color, line_width=2, line_dash=dash)
    mark = Span(location=0.0, dimension="height", line_color=palette.GOAL, name=f"now-{name}")
    shown.add_layout(mark)
    return shown


def rating_figure(rating: Rating) -> figure:
    """A pair of fields for each behaviour: what it desires, and what it prohibits.

    In a field the turn goes from left (left turn) to right, the speed upwards. Sources ``desires``
    and ``forbids`` hold one image each with the fields of all behaviours, the last one lowest.
    """
    from bokeh.models import ColumnDataSource, FixedTicker, LinearColorMapper

    count, speeds, turns = rating.desirability.shape
    high = count * (speeds + 1)
    shown = _figure(
        height=70 + 8 * high // 2,
        x_range=(-1, 2 * turns + 2),
        y_range=(-1, high),
        tools="",
        toolbar_location=None,
    )
    shown.grid.grid_line_color = None
    empty = np.zeros((high, turns), dtype=np.uint8)
    for name, left, colors in (("desires", 0, _BLUES), ("forbids", turns + 1, _REDS)):
        source = ColumnDataSource({"image": [empty]}, name=name)
        mapper = LinearColorMapper(palette=colors, low=0, high=255)
        colored: dict[str, Any] = {"source": source, "color_mapper": mapper}
        shown.image("image", x=left, y=0, dw=turns, dh=high, **colored)
    chosen = ColumnDataSource({"x": [], "y": []}, name="chosen")
    shown.scatter("x", "y", source=chosen, marker="x", size=9, line_color="black", line_width=2)
    middles = [(count - 1 - n) * (speeds + 1) + 0.5 * speeds for n in range(count)]
    shown.yaxis.ticker = FixedTicker(ticks=middles)
    names = dict(zip(middles, rating.names, strict=True))
    shown.yaxis.major_label_overrides = names
    shown.xaxis.ticker = FixedTicker(ticks=[0.5 * turns, 1.5 * turns + 1])
    shown.xaxis.major_label_overrides = {0.5 * turns: "desires", 1.5 * turns + 1: "prohibits"}
    return shown


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
_OF_MOMENTS = ("time", "image", "flow", "cells", "sentence", "rules", "command", "robot", "way")
"""Fields of moments that the page's script reads as they are."""


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
        "notes": result.get("notes", []),
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
    numbers = []
    for key, (name, unit) in _NUMBERS.items():
        value = result.get(key)
        if isinstance(value, int | float):
            text = str(value) if isinstance(value, int) else f"{value:.2f}"
            numbers.append((name, f"{text} {unit}".strip()))
    return numbers


def _recorded(run: RecordedRun, result: Mapping[str, Any]) -> dict[str, Any]:
    from bokeh.embed import components

    radius, goals = robot_and_goals(result)
    timeline = read_timeline(run, radius)
    moments = read_moments(run)
    if not moments and result.get("notes"):
        return {}  # of a bag without images
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
                **{name: getattr(moment, name) for name in _OF_MOMENTS},
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


def _field(rating: Rating | None, shape: Rating | None, layer_name: str) -> str:
    """The fields of all behaviours in one image, lowest row first, as bytes in base64.

    Empty where the moment has no rating of that ``shape``. A left turn is at the left, the first
    behaviour at the top, an empty row above each.
    """
    if rating is None or shape is None:
        return ""
    layers = getattr(rating, layer_name)
    if layers.shape != shape.desirability.shape or rating.names != shape.names:
        return ""
    padded = np.pad(layers[::-1, :, ::-1], ((0, 0), (0, 1), (0, 0)))
    return base64.b64encode(padded.tobytes()).decode("ascii")
