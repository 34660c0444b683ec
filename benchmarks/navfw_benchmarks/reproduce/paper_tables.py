"""Tables 2 and 3 of the paper: the checked percepts of OFFIS for every view."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass, replace
from typing import Any

import numpy as np

from navfw.camera_geometry.rotations import derotate
from navfw.config.lookup import find
from navfw.egomotion.pairing import camera_motion
from navfw.egomotion.refinement import refine
from navfw.flow.block_matching import BlockMatching
from navfw.flow.grid_flow import grid_points
from navfw.offis.offis import Offis
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, FlowField, Frame, FramePair, Percept, Pose, Twist
from navfw.sim.camera import DepthImage
from navfw.sim.sensor_models import SensorParams
from navfw.sim.simulation import Simulation
from navfw.sim.worldfile import load_world
from navfw_benchmarks.bench.fuzzy_reference import median_ms
from navfw_benchmarks.bench.perception_accuracy import judge_percept, no_situation
from navfw_benchmarks.bench.real_labels import Judgement, SentenceVerdict
from navfw_benchmarks.bench.true_pairs import exposed, true_field
from navfw_benchmarks.bench.view_truth import ViewTruth, WallGeometry, truth_of
from navfw_benchmarks.reproduce import paper_scenes


@dataclass(frozen=True, slots=True)
class RenderedPair:
    """A rendered image pair with its ground truth.

    ``depth`` (height, width) [m] belongs to the second image; ``motion`` is the camera's true
    motion, ``twist`` the robot's.
    """

    pair: FramePair
    depth: DepthImage
    motion: CameraMotion
    twist: Twist
    truth: ViewTruth


Flows = Mapping[tuple[str, ...], FlowField]


@dataclass(frozen=True, slots=True)
class PaperRow:
    """A waypoint of Table 2, or a situation of Table 3, with its percepts.

    ``about`` says which, as plain data. Keys of ``flows`` are flow and, in Table 2, rotation; those
    of ``percepts`` have the mode besides: flow "ideal" or "block matching", rotation "removed" or
    "left in", mode "normalised" or "raw means".
    """

    number: int
    about: Mapping[str, Any]
    view: RenderedPair
    flows: Flows
    percepts: Mapping[tuple[str, ...], Percept]

    def judgement(self, *key: str) -> Judgement:
        """The percept of that key, judged by the truth of the view."""
        return judge_percept(self.percepts[key], self.view.truth)

    def right(self, *key: str) -> bool:
        """Whether no statement of that percept is wrong."""
        return self.judgement(*key).verdict is SentenceVerdict.RIGHT

    def as_data(self) -> dict[str, Any]:
        """The row as plain data; ``no_situation`` says why the view shows none, else it is None."""
        truth, readings = self.view.truth, []
        for key, percept in self.percepts.items():
            names = ("flow", "mode") if len(key) == 2 else ("flow", "rotation", "mode")
            judged = self.judgement(*key)
            readings.append(
                {
                    **dict(zip(names, key, strict=True)),
                    "sentence": percept.sentence,
                    "verdict": str(judged.verdict),
                    "statements": dict(judged.statements),
                }
            )
        return {
            **self.about,
            "truth": {
                "quadrants": sorted(truth.certain),
                "possible": sorted(truth.possible),
                "term": truth.term,
                "distance_m": round(truth.distance, 3),
                "situations": list(truth.situations) if truth.clear else [],
                "no_situation": no_situation(truth),
            },
            "readings": readings,
        }


SENSORS = SensorParams(supersample=2)
"""Images are rendered at twice the size and averaged, against aliasing."""


def rendered_view(
    sim: Simulation, rng: np.random.Generator, past: Pose, now: Pose, dt: float
) -> RenderedPair:
    """The images from two poses, ``dt`` [s] apart, with noise by ``rng``."""
    robot = sim.robot
    image_before, _ = sim.render_from(past)
    image_now, depth = sim.render_from(now)
    motion = camera_motion(robot, past, now, dt, slip=0.0)
    step = past.relative(now)
    twist = Twist(float(np.hypot(step.x, step.y)) / dt, step.yaw / dt)
    frames = Frame(0.0, exposed(image_before, rng)), Frame(dt, exposed(image_now, rng))
    truth = truth_of(WallGeometry(sim.world), now, twist.v, depth, robot)
    return RenderedPair(FramePair(*frames, motion), depth, motion, twist, truth)


def true_flow(view: RenderedPair, robot: RobotModel, rows: int = 12, cols: int = 16) -> FlowField:
    """The true flow of ``view``, rotation included: the paper's synthetic mode (sec 6.1)."""
    points, camera = grid_points(robot.camera, rows, cols), robot.camera
    return true_field(points, view.depth, view.motion, camera, view.pair.now.time)


def _refined(flow: FlowField, robot: RobotModel) -> FlowField:
    """``flow`` without its rotational part, that of the gyro refined by the flow."""
    return refine(flow, robot.camera).apply(flow, robot.camera)


def _not_derotated(flow: FlowField) -> FlowField:
    """``flow`` unchanged but labelled as without rotation: the error of the paper's waypoint 3."""
    return replace(flow, motion=_unturned(flow.motion), derotated=True)


def _unturned(motion: CameraMotion) -> CameraMotion:
    return replace(motion, rotation=np.eye(3))


PERIOD = 0.15
"""Time between the two images at a waypoint [s]."""
FAST = 3
"""Number of the waypoint at the fast left turn."""
_SEARCH = 16
"""Search range [px] of block matching at the waypoints: enough for the fast turn without gyro."""


def table2(seed: int) -> list[PaperRow]:
    """Every waypoint of the trajectory through the paper's room, with and without derotation.

    Images 120 x 160, grid 12 x 16, two layers.
    """
    robot = RobotModel()
    trajectory = paper_scenes.drive()
    modes = _modes(robot, _SEARCH)
    matching = BlockMatching(robot, BlockMatching.Params(search=_SEARCH))
    rows = []
    rng = np.random.default_rng(seed)
    with Simulation(
        load_world(find("world", "paper-room")), robot, paper_scenes.START, 0, SENSORS
    ) as sim:
        for number, (time, doing) in enumerate(paper_scenes.WAYPOINTS, start=1):
            point = trajectory[round(time * 60.0)]
            view = rendered_view(sim, rng, point.before(PERIOD), point.pose, PERIOD)
            true = true_flow(view, robot)
            without_gyro = replace(view.pair, motion=_unturned(view.motion))
            flows: Flows = {
                ("ideal", "removed"): derotate(true, robot.camera),
                ("ideal", "left in"): _not_derotated(true),
                ("block matching", "removed"): _refined(matching.compute(view.pair), robot),
                ("block matching", "left in"): _not_derotated(matching.compute(without_gyro)),
            }
            about = {
                "waypoint": number,
                "doing": doing,
                "pose": [round(value, 4) for value in astuple(point.pose)],
                "twist": [round(value, 4) for value in astuple(point.twist)],
            }
            rows.append(_row(number, about, view, flows, modes))
    return rows


def table3(seed: int) -> list[PaperRow]:
    """The three office situations, strictly forward motion, grid 10 x 15, 24 px windows."""
    robot = paper_scenes.hand_held()
    modes = _modes(robot)
    params = BlockMatching.Params(rows=paper_scenes.ROWS, cols=paper_scenes.COLS, window=24)
    matching = BlockMatching(robot, params)
    rows = []
    for scene in paper_scenes.SCENES:
        past = scene.pose.compose(Pose(-paper_scenes.STEP, 0.0, 0.0))
        rng = np.random.default_rng(seed + scene.number)
        with Simulation(scene.world, robot, scene.pose, 0, SENSORS) as sim:
            view = rendered_view(sim, rng, past, scene.pose, paper_scenes.STEP / paper_scenes.SPEED)
        true = true_flow(view, robot, paper_scenes.ROWS, paper_scenes.COLS)
        flows: Flows = {
            ("ideal",): derotate(true, robot.camera),
            ("block matching",): _refined(matching.compute(view.pair), robot),
        }
        about = {"situation": scene.number, "title": scene.title, "paper": scene.paper}
        rows.append(_row(scene.number, about, view, flows, modes))
    return rows


def _row(
    number: int,
    about: Mapping[str, Any],
    view: RenderedPair,
    flows: Flows,
    modes: Mapping[str, Offis],
) -> PaperRow:
    percepts = {}
    for key, flow in flows.items():
        for mode, offis in modes.items():
            offis.reset()
            percepts[*key, mode] = offis.perceive(flow, view.twist)
    return PaperRow(number, about, view, flows, percepts)


def _modes(robot: RobotModel, search: int = 8) -> dict[str, Offis]:
    return {
        "normalised": Offis(robot, Offis.Params(longest_flow=search)),
        "raw means": Offis(robot, Offis.Params(mode="paper", longest_flow=search)),
    }


def checks(rows: list[PaperRow]) -> dict[str, bool]:
    """The checks of the reproduction: the fast turn is wrong without derotation, right with it.

    At the other waypoints the nearest object and its distance have to be right, and the front
    where the geometry forms one of Table 1's situations.
    """
    fast = next(row for row in rows if row.number == FAST)
    results = {}
    for kind in ("ideal", "block matching"):
        right = fast.right(kind, "removed", "normalised")
        results[f"fast turn: correct with derotation, {kind} flow"] = right
        for mode in ("normalised", "raw means"):
            wrong = not fast.right(kind, "left in", mode)
            results[f"fast turn: wrong without derotation, {kind} flow, {mode}"] = wrong
    for rotation, name in (("removed", "with"), ("left in", "without")):
        results[
            f"other waypoints: nearest object, and front where Table 1 has it, correct {name}"
            " derotation, ideal flow"
        ] = all(_as_table1(row, rotation) for row in rows if row is not fast)
    return results


def _as_table1(row: PaperRow, rotation: str) -> bool:
    """Whether all is right but the front where the geometry forms no situation of Table 1."""
    statements = row.judgement("ideal", rotation, "normalised").statements
    return all(true for name, true in statements.items() if name != "front" or row.view.truth.clear)


def timings(rows: list[PaperRow], scenes: list[PaperRow], repeats: int = 30) -> dict[str, float]:
    """Median times [ms] of one OFFIS inference (obstacles and situation), and of one flow field."""
    offis, other = Offis(RobotModel()), Offis(paper_scenes.hand_held())
    matching = BlockMatching(RobotModel())
    normal = [(row.flows["ideal", "removed"], row.view.twist) for row in rows]
    small = [(row.flows["block matching",], row.view.twist) for row in scenes]
    pairs = [row.view.pair for row in rows]
    matched = max(repeats // 3, 3) * len(pairs)
    return {
        "offis_12x16_ms": median_ms(
            lambda k: offis.perceive(*normal[k % len(normal)]), repeats * len(normal)
        ),
        "offis_10x15_ms": median_ms(
            lambda k: other.perceive(*small[k % len(small)]), repeats * len(small)
        ),
        "block_matching_12x16_ms": median_ms(
            lambda k: matching.compute(pairs[k % len(pairs)]), matched
        ),
    }
