"""The figures of a run's report, made with Bokeh: plan, ratings of all commands, timelines.

Data sources named ``robot``, ``way``, ``desires``, ``forbids``, ``chosen`` and the lines named
``now-NAME`` are those that the page's script changes with its slider.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from navfw.recording import palette
from navfw.report.run_moments import Rating
from navfw.report.run_timeline import RunTimeline
from navfw.signals import Array

if TYPE_CHECKING:
    from bokeh.plotting import figure

_BLUES = ("#FFFFFF", "#DEEBF7", "#C6DBEF", "#9ECAE1", "#6BAED6", "#4292C6", "#2171B5", "#084594")
_REDS = ("#FFFFFF", "#FEE5D9", "#FCBBA1", "#FC9272", "#FB6A4A", "#EF3B2C", "#CB181D", "#99000D")


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
    outline = timeline.outline
    for polygons, fill, edge in (
        (outline.furniture, palette.FURNITURE, palette.EDGE),
        (outline.walls, palette.WALL, palette.WALL),
    ):
        xs = [corners[:, 0].tolist() for corners in polygons]
        ys = [corners[:, 1].tolist() for corners in polygons]
        plan.patches(xs, ys, fill_color=fill, line_color=edge)
    if outline.discs:
        discs = outline.discs
        plan.circle(
            x=[d.x for d in discs],
            y=[d.y for d in discs],
            radius=[d.radius for d in discs],
            fill_color=palette.FURNITURE,
            line_color=palette.EDGE,
        )
    for name, points in _led_paths(timeline).items():
        color = palette.behavior_color(name)
        plan.line(points[:, 0], points[:, 1], color=color, line_width=4, line_cap="round")
    plan.line(*timeline.estimate.T, color=palette.ESTIMATE, line_dash="dashed", line_width=1)
    if goals:
        xs, ys = [x for x, _ in goals], [y for _, y in goals]
        plan.scatter(xs, ys, marker="star", size=15, fill_color=palette.GOAL, line_color="white")
    way = ColumnDataSource({"x": [], "y": []}, name="way")
    plan.line("x", "y", source=way, color=palette.GOAL, line_dash="dotted", line_width=2)
    robot = ColumnDataSource({"x": [], "y": []}, name="robot")
    body: dict[str, Any] = {"fill_color": "white", "line_color": "black", "line_width": 2}
    plan.circle("x", "y", radius=robot_radius, source=robot, **body)
    return plan


def _led_paths(timeline: RunTimeline) -> Mapping[str, Array]:
    """For each leader the points (k, 2) [m] of the path that it led, its pieces parted by nan."""
    gap = np.full(2, np.nan)
    found: dict[str, list[Array]] = {}
    for start, end, leader in zip(
        timeline.true[:-1], timeline.true[1:], timeline.leaders[1:], strict=True
    ):
        found.setdefault(leader, []).extend((start, end, gap))
    return {name: np.array(points) for name, points in found.items()}


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
    first = _timeline(time, [v, w], "command", "v [m/s], w [rad/s]", None)
    clearance, confidence = timeline.clearance, timeline.confidence
    return {
        "speed": first,
        "clearance": _timeline(time, [clearance], "clearance", "clearance [m]", first),
        "confidence": _timeline(time, [confidence], "confidence", "confidence", first),
    }


def _timeline(
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
    for values, color in zip(columns, ("#0072B2", "#D55E00"), strict=False):
        shown.line(time, values, color=color, line_width=2)
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
