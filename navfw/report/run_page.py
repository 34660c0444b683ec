"""The HTML page of a run, while it goes on and after it.

A report has plan, pictures, ratings, rules and timelines. The page of a run that still goes on has
what does not change; ``live_page.js`` shows the rest.
"""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from navfw.config.image_file import read_image
from navfw.config.input_file import is_file
from navfw.errors import ConfigError
from navfw.features.landmark_appearance import check_landmark_kind
from navfw.mapping import MapChange
from navfw.numerics import Array
from navfw.recording import palette, top_view
from navfw.recording.channel_list import Chase, SeenRun
from navfw.recording.recorded_rules import recorded_rule_bases
from navfw.recording.recorded_run import RecordedRun, located_damage, open_run
from navfw.recording.run_folder import MAP, PICTURE, RECORDING, plain_json, read_result
from navfw.recording.what_if import WhatIf, what_if_lines
from navfw.report import run_timeline
from navfw.report.report_page import reduced_source, render_page
from navfw.report.run_moments import read_moments
from navfw.report.run_story import read_story, why_so
from navfw.topomap import TopoMap, load_map


def live_page(title: str, seen: SeenRun, goals: list[tuple[float, float]]) -> str:
    """Render the page that ``LiveServer`` serves of a run to ``goals`` (x, y) [m, ``map``]."""
    stack, outline = seen.stack, seen.outline
    named = _places(stack.topo_map)
    bounds = outline.bounds(0.2, np.array([*goals, *((x, y) for _, x, y in named)]))
    shapes = (*outline.shapes(), top_view.goal_marks(goals))
    data = {
        **plan_data(shapes, bounds, named, stack.mofis.behaviors),
        "discs": stack.robot.discs,
        "flow": palette.FLOW,
        "v": [stack.mofis.commands.v.min(), stack.mofis.commands.v.max()],
        "w": [stack.mofis.commands.w.min(), stack.mofis.commands.w.max()],
    }
    shown = plain_json(data)
    return render_page("live_page.html", title=title, data=shown, cells=palette.camera_key())


def _places(topo_map: TopoMap) -> list[tuple[str, float, float]]:
    """Name, x and y [m] of the places; the rooms first."""
    places = sorted(topo_map.places.values(), key=lambda place: place.kind != "room")
    return [(place.name, place.x, place.y) for place in places]


def plan_data(
    shapes: Iterable[top_view.Shape],
    bounds: tuple[Array, Array],
    places: Sequence[tuple[str, float, float]],
    behaviors: Iterable[str],
) -> dict[str, Any]:
    """Return the data from which ``page_drawing.js`` draws a plan: ``shapes``, ``places``.

    ``bounds`` are the lowest and highest x, y [m]; ``behaviors`` are given their colours.
    """
    return {
        "bounds": [*bounds[0], *bounds[1]],
        "shapes": [_drawn(shape) for shape in shapes],
        "places": places,
        "colors": {name: palette.behavior_color(name) for name in ("none", *behaviors)},
        "goal": palette.GOAL,
        "estimate": palette.ESTIMATE,
        "moving": palette.MOVING,
        "contact": palette.CONTACT,
    }


def _drawn(shape: top_view.Shape) -> dict[str, Any]:
    """Return a shape as the page's script draws it."""
    style = shape.style
    drawn: dict[str, Any] = {"fill": style.color, "edge": style.edge, "width": style.width}
    if isinstance(shape, top_view.Disc):
        return drawn | {"discs": [(shape.x, shape.y, shape.radius)]}
    points = shape.corners if isinstance(shape, top_view.Area) else shape.points
    return drawn | {"marks" if isinstance(shape, top_view.Marks) else "area": points.tolist()}


_NUMBERS = {
    "sim_time_s": ("time", "s"),
    "path_length_m": ("path", "m"),
    "shortest_path_m": ("shortest path", "m"),
    "shortest_with_room_m": ("shortest path with 0.15 m beside the body", "m"),
    "min_clearance_m": ("smallest clearance", "m"),
    "mean_speed_m_s": ("mean speed", "m/s"),
    "estimate_error_p95_m": ("error of the position, 95 %", "m"),
    "collisions": ("collisions", ""),
    "emergencies": ("emergencies", ""),
}
"""Results on the page, each with its name and unit."""

_OF_ROUTES = "shortest_path_m", "shortest_with_room_m"
"""Results that an exploration lacks: it has no goal to take the shortest path to."""


@dataclass(frozen=True, slots=True)
class ChangedRun:
    """The commands that a stack with ``changes`` would have given in a recorded run (what if)."""

    changes: str
    result: WhatIf


def run_report(folder: Path, chase: Chase | None = None, changed: ChangedRun | None = None) -> str:
    """Render the report of the run in ``folder`` as HTML; without a recording, only the result.

    ``chase`` draws the robot from behind, if its world is known. The commands of a ``changed``
    stack are shown beside those of the run.

    Raises:
        ConfigError: ``folder`` is not a run folder, or its files are damaged.

    """
    result = read_result(folder)
    content: dict[str, Any] = {
        "title": f"{result.get('world', '?')} / {result.get('mission', '?')},"
        f" seed {result.get('seed', '?')}",
        "outcome": str(result.get("outcome", "")),
        "reason": why_so(result),
        "numbers": _numbers(result),
        "notes": _notes(result),
        "of_bag": bool(result.get("notes")) and isinstance(result["notes"], list),
        "picture": None,
        "explored": result.get("exploration"),
        "what_if": None,
        "data": None,
        "cells": palette.camera_key(),
    }
    if is_file(folder / RECORDING):
        on_map = is_file(folder / MAP)
        places = _places(load_map(folder / MAP, check_landmark_kind)) if on_map else []
        content |= _recorded(open_run(folder, chase), result, places)
        if changed is not None and content["data"] is not None and "rows" in content["data"]:
            rows, run = content["data"]["rows"], changed.result
            content["what_if"] = changed.changes, "\n".join(what_if_lines(run))
            at = np.searchsorted(run.times, np.array(rows["time"]) - 1e-6).clip(
                max=len(run.times) - 1
            )
            rows |= dict(zip(("if_v", "if_w"), run.twists[at].T.round(3).tolist(), strict=True))
    if is_file(folder / PICTURE) and (content["explored"] or content["data"] is None):
        picture = np.asarray(read_image(folder / PICTURE), dtype=np.uint8)
        content["picture"] = reduced_source(picture, 1600, quality=85)
    return render_page("run_page.html", **content)


def _notes(result: Mapping[str, Any]) -> list[str]:
    """The sentences on the page: notes of the run, or of a bag; how the building has changed."""
    notes = result.get("notes") or []
    changes = [str(MapChange(**change)) for change in result.get("map_changes", ())]
    if result.get("exploration"):
        return changes  # the page has a table of what was left
    return [*([notes] if isinstance(notes, str) else notes), *changes]


def _numbers(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    numbers = []
    for key, (name, unit) in _NUMBERS.items():
        value = None if key in _OF_ROUTES and result.get("exploration") else result.get(key)
        if isinstance(value, int | float):
            text = str(value) if isinstance(value, int) else f"{value:.2f}"
            numbers.append((name, f"{text} {unit}".strip()))
    slower = result.get("why_slower")
    if isinstance(slower, Mapping) and slower:
        shares = [f"{100.0 * share:.0f} % {why}" for why, share in slower.items() if share >= 0.01]
        numbers.append(("below the top speed", "; ".join(shares)))
    return numbers


def _recorded(
    run: RecordedRun, result: Mapping[str, Any], places: list[tuple[str, float, float]]
) -> dict[str, Any]:
    radius, goals = run_timeline.robot_and_goals(result)
    timeline = run_timeline.read_timeline(run, radius)
    named = {name: (x, y) for name, x, y in places}
    story = read_story(run, result, named, lines=run_timeline.MAX_EVENTS)
    events = run_timeline.run_events(timeline, story) if len(timeline.time) else []
    moments = read_moments(run, events)
    if not moments and isinstance(result.get("notes"), list):
        return {}  # of a bag without images
    if not moments:
        raise ConfigError("has no camera images; record the run again", file=run.path)
    ruled = next((moment["time"] for moment in moments if moment["rules"]), 0.0)
    first = min(events, key=run_timeline.event_rank).time if events else ruled
    data: dict[str, Any] = {"events": [asdict(event) for event in events], "first": first}
    with located_damage(run.path, "the configuration in its result"):
        data |= _moments_data(moments, result["config"].get("stack", {}))
        bases = recorded_rule_bases(run)
        data["inputs"] = {name: base["inputs"] for name, base in bases.items()}
    if len(timeline.time):
        data["rows"] = _columns(timeline)
        ends = np.array([*goals, *((x, y) for _, x, y in places), *timeline.true.tolist()])
        shapes = (*timeline.outline.shapes(), top_view.goal_marks(goals))
        names = (*timeline.leaders, *(data["grid"]["names"] if "grid" in data else ()))
        data |= plan_data(shapes, timeline.outline.bounds(0.2, ends), places, names)
        data["discs"] = [(0.0, 0.0, radius)]
    leaders = Counter(timeline.leaders)
    key = [
        (name, count / leaders.total(), palette.behavior_color(name))
        for name, count in leaders.most_common()
    ]
    return {"data": plain_json(data), "complete": run.complete, "key": key}


_ROWS = "time clearance confidence x y believed_x believed_y v w driven_v driven_w"


def _columns(timeline: run_timeline.RunTimeline) -> dict[str, Any]:
    """Return the timeline by columns, in thousandths; of the leaders their names."""
    single = timeline.time, timeline.clearance, timeline.confidence
    pairs = timeline.true, timeline.estimate, timeline.commands, timeline.driven
    table = np.round(np.column_stack([*single, *pairs]), 3)
    return {**dict(zip(_ROWS.split(), table.T, strict=True)), "leader": timeline.leaders}


def _moments_data(moments: list[dict[str, Any]], stack: Mapping[str, Any]) -> dict[str, Any]:
    """Return the moments of a run with the ``stack`` as the page's script reads them.

    The ratings of a moment are bytes in base64, of its map there is the number among ``maps``.
    """
    maps = list(dict.fromkeys(moment["map"][0] for moment in moments if moment["map"] is not None))
    data: dict[str, Any] = {"size": moments[0]["size"], "flow": palette.FLOW, "maps": maps}
    data["moments"] = moments
    for moment in moments:
        rating = moment.pop("rating")
        if moment["map"] is not None:
            moment["map"] = (maps.index(moment["map"][0]), *moment["map"][1:])
        if rating is None:
            continue
        if "grid" not in data:
            fusion, settings = next(iter(stack.get("fusion", {}).items()), ("", {}))
            v, w = rating.commands(int(stack.get("commands", {}).get("reverse", 0)))
            data["fusion"] = {**settings, "name": fusion}
            data["grid"] = {"names": rating.names, "v": v, "w": w}
        for name in ("desirability", "prohibition"):
            moment[name] = base64.b64encode(getattr(rating, name).tobytes()).decode("ascii")
    return data
