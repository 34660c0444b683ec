"""Tables 2 and 3 of the paper: the checked percepts of OFFIS for every view."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from statistics import median
from time import perf_counter
from typing import Any

from navfw.config.lookup import find
from navfw.flow.block_matching import BlockMatching
from navfw.offis.offis import Offis
from navfw.reproduce.office_scenes import COLS, ROWS, SCENES, SPEED, STEP, OfficeScene, hand_held
from navfw.reproduce.paper_trajectory import (
    START,
    WAYPOINTS,
    TrajectoryPoint,
    TrajectoryWaypoint,
    before,
    drive,
)
from navfw.reproduce.percept_verdict import no_situation
from navfw.reproduce.rendered_views import (
    CheckedPercept,
    RenderedPair,
    ViewRenderer,
    checked_percept,
    derotated,
    matched_flow,
    not_derotated,
    true_flow,
)
from navfw.robot import RobotModel
from navfw.signals import FlowField, FramePair, Pose
from navfw.sim.worldfile import load_world

PERIOD = 0.15
"""Time between the two images at a waypoint [s]."""
FAST = 3
"""Number of the waypoint at the fast left turn."""
_SEARCH = 16
"""Search range [px] of block matching at the waypoints: enough for the fast turn without gyro."""


@dataclass(frozen=True, slots=True)
class WaypointRow:
    """A waypoint of Table 2 with its percepts.

    Keys of ``percepts``: (flow, rotation, mode) with flow "ideal" or "block matching", rotation
    "removed" or "left in", mode "normalised" or "raw means".
    """

    waypoint: TrajectoryWaypoint
    point: TrajectoryPoint
    view: RenderedPair
    percepts: Mapping[tuple[str, str, str], CheckedPercept]


@dataclass(frozen=True, slots=True)
class SceneRow:
    """A situation of Table 3; keys of ``percepts``: (flow, mode) as in ``WaypointRow``."""

    scene: OfficeScene
    view: RenderedPair
    percepts: Mapping[tuple[str, str], CheckedPercept]


def table2(seed: int) -> list[WaypointRow]:
    """Every waypoint of the trajectory through the paper's room, with and without derotation.

    Images 120 x 160, grid 12 x 16, two layers.
    """
    robot = RobotModel()
    way = drive()
    modes = _modes(robot, _SEARCH)
    params = BlockMatching.Params(search=_SEARCH)
    rows = []
    with ViewRenderer(load_world(find("world", "paper-room")), robot, START, seed) as renderer:
        for waypoint in WAYPOINTS:
            point = way[round(waypoint.time * 60.0)]
            view = renderer.render(before(point, PERIOD), point.pose, PERIOD)
            true = true_flow(view, robot)
            with_gyro = matched_flow(view, robot, params, gyro=True)
            flows = {
                ("ideal", "removed"): derotated(true, robot, with_refinement=False),
                ("ideal", "left in"): not_derotated(true),
                ("block matching", "removed"): derotated(with_gyro, robot, with_refinement=True),
                ("block matching", "left in"): not_derotated(
                    matched_flow(view, robot, params, gyro=False)
                ),
            }
            percepts = {
                (kind, rotation, mode): checked_percept(offis, flow, view)
                for (kind, rotation), flow in flows.items()
                for mode, offis in modes.items()
            }
            rows.append(WaypointRow(waypoint, point, view, percepts))
    return rows


def table3(seed: int) -> list[SceneRow]:
    """The three office situations, strictly forward motion, grid 10 x 15, 24 px windows."""
    robot = hand_held()
    modes = _modes(robot)
    params = BlockMatching.Params(rows=ROWS, cols=COLS, window=24)
    rows = []
    for scene in SCENES:
        past = scene.pose.compose(Pose(-STEP, 0.0, 0.0))
        with ViewRenderer(scene.world, robot, scene.pose, seed + scene.number) as renderer:
            view = renderer.render(past, scene.pose, STEP / SPEED)
        flows = {
            "ideal": derotated(true_flow(view, robot, ROWS, COLS), robot, with_refinement=False),
            "block matching": derotated(
                matched_flow(view, robot, params, gyro=True), robot, with_refinement=True
            ),
        }
        percepts = {
            (kind, mode): checked_percept(offis, flow, view)
            for kind, flow in flows.items()
            for mode, offis in modes.items()
        }
        rows.append(SceneRow(scene, view, percepts))
    return rows


def _modes(robot: RobotModel, search: int = 8) -> dict[str, Offis]:
    return {
        "normalised": Offis(robot, Offis.Params(longest_flow=search)),
        "raw means": Offis(robot, Offis.Params(mode="paper", longest_flow=search)),
    }


def checks(rows: list[WaypointRow]) -> dict[str, bool]:
    """The checks of the reproduction: the fast turn is wrong without derotation, right with it.

    At the other waypoints the nearest object and its distance have to be right, and the front
    where the geometry forms one of Table 1's situations.
    """
    fast = next(row for row in rows if row.waypoint.number == FAST)
    others = [row for row in rows if row is not fast]
    found = {}
    for kind in ("ideal", "block matching"):
        found[f"fast turn: correct with derotation, {kind} flow"] = fast.percepts[
            kind, "removed", "normalised"
        ].right
        for mode in ("normalised", "raw means"):
            found[f"fast turn: wrong without derotation, {kind} flow, {mode}"] = not fast.percepts[
                kind, "left in", mode
            ].right
    for rotation, name in (("removed", "with"), ("left in", "without")):
        found[
            f"other waypoints: nearest object, and front where Table 1 has it, correct {name}"
            " derotation, ideal flow"
        ] = all(_as_table1(row, rotation) for row in others)
    return found


def _as_table1(row: WaypointRow, rotation: str) -> bool:
    """Whether all is right but the front where the geometry forms no situation of Table 1."""
    statements = row.percepts["ideal", rotation, "normalised"].judgement.statements
    return all(true for name, true in statements.items() if name != "front" or row.view.truth.clear)


def timings(rows: list[WaypointRow], scenes: list[SceneRow], repeats: int = 30) -> dict[str, float]:
    """Median times [ms] of one OFFIS inference (obstacles and situation), and of one flow field."""
    robot, held = RobotModel(), hand_held()
    offis, other = Offis(robot), Offis(held)
    normal = [(row.percepts["ideal", "removed", "normalised"].flow, row.view) for row in rows]
    small = [(row.percepts["block matching", "normalised"].flow, row.view) for row in scenes]
    matching = BlockMatching(robot)
    pairs = [row.view.pair for row in rows]
    return {
        "offis_12x16_ms": _offis_time(offis, normal, repeats),
        "offis_10x15_ms": _offis_time(other, small, repeats),
        "block_matching_12x16_ms": _matching_time(matching, pairs, repeats),
    }


def _offis_time(offis: Offis, seen: list[tuple[FlowField, RenderedPair]], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        for flow, view in seen:
            begun = perf_counter()
            offis.perceive(flow, view.twist)
            times.append(perf_counter() - begun)
    return 1e3 * median(times)


def _matching_time(matching: BlockMatching, pairs: list[FramePair], repeats: int) -> float:
    times = []
    for _ in range(max(repeats // 3, 3)):
        for pair in pairs:
            begun = perf_counter()
            matching.compute(pair)
            times.append(perf_counter() - begun)
    return 1e3 * median(times)


def as_data(rows: list[WaypointRow], scenes: list[SceneRow]) -> dict[str, Any]:
    """Both tables as plain data."""
    return {
        "table2": [
            {
                "waypoint": row.waypoint.number,
                "doing": row.waypoint.doing,
                "pose": [round(v, 4) for v in (row.point.pose.x, row.point.pose.y)]
                + [round(row.point.pose.yaw, 4)],
                "twist": [round(row.point.twist.v, 4), round(row.point.twist.w, 4)],
                "truth": _truth(row.view),
                "readings": [
                    {"flow": kind, "rotation": rotation, "mode": mode, **_reading(checked)}
                    for (kind, rotation, mode), checked in row.percepts.items()
                ],
            }
            for row in rows
        ],
        "table3": [
            {
                "situation": row.scene.number,
                "title": row.scene.title,
                "paper": row.scene.paper,
                "truth": _truth(row.view),
                "readings": [
                    {"flow": kind, "mode": mode, **_reading(checked)}
                    for (kind, mode), checked in row.percepts.items()
                ],
            }
            for row in scenes
        ],
    }


def _truth(view: RenderedPair) -> dict[str, Any]:
    """The truth of a view; ``no_situation`` tells why it shows none, else it is None."""
    truth = view.truth
    return {
        "quadrants": sorted(truth.certain),
        "possible": sorted(truth.possible),
        "term": truth.term,
        "distance_m": round(truth.distance, 3),
        "situations": list(truth.situations) if truth.clear else [],
        "no_situation": no_situation(truth),
    }


def _reading(checked: CheckedPercept) -> dict[str, Any]:
    """A sentence, its verdict, and whether each of its statements is true."""
    return {
        "sentence": checked.percept.sentence,
        "verdict": str(checked.judgement.verdict),
        "statements": dict(checked.judgement.statements),
    }
