"""Tables 2 and 3 of the paper, read anew: every view with everything that OFFIS says of it."""

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
from navfw.reproduce.rendered_views import (
    CheckedPercept,
    RenderedPair,
    ViewRenderer,
    derotated,
    ideal,
    matched,
    not_derotated,
    read,
)
from navfw.robot import RobotModel
from navfw.signals import FlowField, FramePair, Pose
from navfw.sim.worldfile import load_world

__all__ = [
    "FAST",
    "PERIOD",
    "SceneRow",
    "WaypointRow",
    "as_data",
    "checks",
    "table2",
    "table3",
    "timings",
]

PERIOD = 0.15
"""Time between the two images at a waypoint [s]."""
FAST = 3
"""The waypoint of the fast left turn."""
SEARCH = 16
"""Search of the block matching at the waypoints [px]: it holds the fast turn without gyro, too."""


@dataclass(frozen=True, slots=True)
class WaypointRow:
    """A waypoint of Table 2: readings by flow, derotation and mode.

    Keys of ``readings``: (flow, rotation, mode) with flow "ideal" or "block matching", rotation
    "removed" or "left in", mode "normalised" or "raw means".
    """

    waypoint: TrajectoryWaypoint
    moment: TrajectoryPoint
    shot: RenderedPair
    readings: Mapping[tuple[str, str, str], CheckedPercept]


@dataclass(frozen=True, slots=True)
class SceneRow:
    """A situation of Table 3: readings by (flow, mode)."""

    scene: OfficeScene
    shot: RenderedPair
    readings: Mapping[tuple[str, str], CheckedPercept]


def table2(seed: int) -> list[WaypointRow]:
    """Every red waypoint of the trajectory through the paper's room, with and without derotation.

    Images 120 x 160, grid 12 x 16, two layers.
    """
    robot = RobotModel()
    way = drive()
    modes = _modes(robot, SEARCH)
    params = BlockMatching.Params(search=SEARCH)
    rows = []
    with ViewRenderer(load_world(find("world", "paper-room")), robot, START, seed) as eye:
        for waypoint in WAYPOINTS:
            moment = way[round(waypoint.time * 60.0)]
            shot = eye.look(before(moment, PERIOD), moment.pose, PERIOD)
            true = ideal(shot, robot)
            with_gyro = matched(shot, robot, params, gyro=True)
            flows = {
                ("ideal", "removed"): derotated(true, robot, with_refinement=False),
                ("ideal", "left in"): not_derotated(true),
                ("block matching", "removed"): derotated(with_gyro, robot, with_refinement=True),
                ("block matching", "left in"): not_derotated(
                    matched(shot, robot, params, gyro=False)
                ),
            }
            readings = {
                (kind, rotation, mode): read(offis, flow, shot)
                for (kind, rotation), flow in flows.items()
                for mode, offis in modes.items()
            }
            rows.append(WaypointRow(waypoint, moment, shot, readings))
    return rows


def table3(seed: int) -> list[SceneRow]:
    """The three office situations, strictly forward motion, grid 10 x 15, 24 px windows."""
    robot = hand_held()
    modes = _modes(robot)
    params = BlockMatching.Params(rows=ROWS, cols=COLS, window=24)
    rows = []
    for scene in SCENES:
        past = scene.pose.compose(Pose(-STEP, 0.0, 0.0))
        with ViewRenderer(scene.world, robot, scene.pose, seed + scene.number) as eye:
            shot = eye.look(past, scene.pose, STEP / SPEED)
        flows = {
            "ideal": derotated(ideal(shot, robot, ROWS, COLS), robot, with_refinement=False),
            "block matching": derotated(
                matched(shot, robot, params, gyro=True), robot, with_refinement=True
            ),
        }
        readings = {
            (kind, mode): read(offis, flow, shot)
            for kind, flow in flows.items()
            for mode, offis in modes.items()
        }
        rows.append(SceneRow(scene, shot, readings))
    return rows


def _modes(robot: RobotModel, search: int = 8) -> dict[str, Offis]:
    return {
        "normalised": Offis(robot, Offis.Params(longest_flow=search)),
        "raw means": Offis(robot, Offis.Params(mode="paper", longest_flow=search)),
    }


def checks(rows: list[WaypointRow]) -> dict[str, bool]:
    """What the reproduction must show: the fast turn wrong without derotation, right with it."""
    fast = next(row for row in rows if row.waypoint.number == FAST)
    others = [row for row in rows if row is not fast]
    found = {}
    for kind in ("ideal", "block matching"):
        found[f"fast turn right with derotation, {kind} flow"] = fast.readings[
            kind, "removed", "normalised"
        ].right
        for mode in ("normalised", "raw means"):
            found[f"fast turn wrong without derotation, {kind} flow, {mode}"] = not fast.readings[
                kind, "left in", mode
            ].right
    found["other waypoints right with derotation, ideal flow"] = all(
        row.readings["ideal", "removed", "normalised"].right for row in others
    )
    found["other waypoints right without derotation, ideal flow"] = all(
        row.readings["ideal", "left in", "normalised"].right for row in others
    )
    return found


def timings(rows: list[WaypointRow], scenes: list[SceneRow], repeats: int = 30) -> dict[str, float]:
    """Median times [ms] of one OFFIS inference (obstacles and situation), and of one flow field."""
    robot, held = RobotModel(), hand_held()
    offis, other = Offis(robot), Offis(held)
    normal = [(row.readings["ideal", "removed", "normalised"].flow, row.shot) for row in rows]
    small = [(row.readings["block matching", "normalised"].flow, row.shot) for row in scenes]
    matching = BlockMatching(robot)
    pairs = [row.shot.pair for row in rows]
    return {
        "offis_12x16_ms": _offis_time(offis, normal, repeats),
        "offis_10x15_ms": _offis_time(other, small, repeats),
        "block_matching_12x16_ms": _matching_time(matching, pairs, repeats),
    }


def _offis_time(offis: Offis, seen: list[tuple[FlowField, RenderedPair]], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        for flow, shot in seen:
            begun = perf_counter()
            offis.perceive(flow, shot.twist)
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
                "pose": [round(v, 4) for v in (row.moment.pose.x, row.moment.pose.y)]
                + [round(row.moment.pose.yaw, 4)],
                "twist": [round(row.moment.twist.v, 4), round(row.moment.twist.w, 4)],
                "truth": _truth(row.shot),
                "readings": [
                    {"flow": kind, "rotation": rotation, "mode": mode, **_reading(reading)}
                    for (kind, rotation, mode), reading in row.readings.items()
                ],
            }
            for row in rows
        ],
        "table3": [
            {
                "situation": row.scene.number,
                "title": row.scene.title,
                "paper": row.scene.paper,
                "truth": _truth(row.shot),
                "readings": [
                    {"flow": kind, "mode": mode, **_reading(reading)}
                    for (kind, mode), reading in row.readings.items()
                ],
            }
            for row in scenes
        ],
    }


def _truth(shot: RenderedPair) -> dict[str, Any]:
    truth = shot.truth
    return {
        "quadrants": sorted(truth.certain),
        "possible": sorted(truth.possible),
        "term": truth.term,
        "distance_m": round(truth.distance, 3),
        "situations": list(truth.situations),
    }


def _reading(reading: CheckedPercept) -> dict[str, Any]:
    return {
        "sentence": reading.percept.sentence,
        "right": reading.right,
        "quadrant_right": reading.quadrant,
        "distance_right": reading.distance,
        "situation_right": reading.situation,
    }
