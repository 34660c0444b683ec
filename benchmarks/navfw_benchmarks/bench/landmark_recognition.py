"""Detection rate, errors and time of landmark recognition over distance and viewing angle."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Iterator, Mapping
from itertools import product
from typing import Any

import numpy as np

from navfw.features.recognizers import Aruco
from navfw.interfaces import FeatureRecognizer
from navfw.numerics import Image
from navfw.process.result_table import Column, ResultTable
from navfw.process.work_progress import ProgressCallback, silent, with_progress
from navfw.robot import RobotModel
from navfw.signals import Frame, LandmarkDetection, Pose
from navfw.sim.sensor_models import SensorParams
from navfw.sim.simulation import Simulation
from navfw.sim.worldspec import LandmarkPlateSpec, WallSpec, WorldSpec
from navfw.topomap import Landmark, Place, TopoMap
from navfw_benchmarks.bench.true_pairs import exposed
from navfw_benchmarks.plugins.posters import Posters

DISTANCES = (1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0)
"""Distances [m] from camera to landmark."""
_ANGLES = (0, 25, 45, 60)
"""Angles [deg] between the landmark's normal and the direction to the camera."""
_SIZES: Mapping[str, float] = {"aruco": 0.25, "poster": 0.5}
"""Side lengths [m]."""
_ON_MAP = 10
"""Number of landmarks on the map: with a single one none could be mistaken for another."""
_MAX_BEARING = 0.55
"""Largest bearing [rad] of the landmark in the image."""


def view_of(
    simulation: Simulation, mark: LandmarkPlateSpec, distance: float, angle: float, aside: float
) -> tuple[Image, float, float]:
    """The image of a landmark, and its true bearing [rad] and range [m] in base_link.

    ``distance`` [m] from the camera, ``angle`` [rad] between the landmark's normal and the
    direction to the camera, ``aside`` [rad] its bearing in the image.
    """
    camera = simulation.robot.camera
    eye = Pose(*mark.at, mark.yaw + angle).to_parent(distance, 0.0)
    yaw = mark.yaw + angle + math.pi - aside
    pose = Pose(*Pose(*eye, yaw).to_parent(-camera.mount_forward, 0.0), yaw)
    image, _ = simulation.render_from(pose)
    ahead, left = pose.to_local(*mark.at)
    return image, math.atan2(left, ahead), math.hypot(ahead, left)


def bench_landmarks(views: int, seed: int = 0, report: ProgressCallback = silent) -> dict[str, Any]:
    """Detection rate, errors and time by kind, distance and angle; plain data.

    ``views`` images are rendered for each kind, distance and angle. ``report`` is called with
    each view.
    """
    robot = RobotModel()
    recognizers: Mapping[str, FeatureRecognizer] = {
        "aruco": Aruco(robot),
        "poster": Posters(robot),
    }
    kinds = {}
    for kind, recognizer in recognizers.items():
        rng = np.random.default_rng(seed)
        kinds[kind] = _bench_kind(kind, recognizer, robot, views, rng, report)
    wanted = robot.landmark_camera
    return {
        "image": [wanted.width, wanted.height],
        "rate_hz": wanted.rate,
        "views": views,
        "seed": seed,
        "kinds": kinds,
    }


def _bench_kind(
    kind: str,
    recognizer: FeatureRecognizer,
    robot: RobotModel,
    views: int,
    rng: np.random.Generator,
    report: ProgressCallback,
) -> dict[str, Any]:
    world = _hall(kind)
    size = _SIZES[kind]
    marks = [Landmark(f"mark-{i}", kind, i, 0.0, 0.0, 0.0, size=size) for i in range(_ON_MAP)]
    recognizer.set_map(TopoMap("hall", [Place("start", 2.0, 6.0)], [], landmarks=marks))
    large = robot.model_copy(update={"camera": robot.landmark_view})
    rows, false, chi = [], 0, []
    spent = rendered = 0.0
    mark = world.landmarks[0]
    with Simulation(world, large, Pose(2.0, 6.0, 0.0), 0, SensorParams.preset("perfect")) as sim:
        for distance, angle in with_progress(
            [*product(DISTANCES, _ANGLES)], f"positions: {kind}", report
        ):
            errors = []
            for _ in range(views):
                begun = clock.perf_counter()
                turn = math.radians(angle) * float(rng.choice((-1.0, 1.0)))
                aside = float(rng.uniform(-_MAX_BEARING, _MAX_BEARING))
                clean, bearing, away = view_of(sim, mark, distance, turn, aside)
                rendered += clock.perf_counter() - begun
                image = exposed(clean, rng)
                begun = clock.perf_counter()
                seen = recognizer.recognize(Frame(0.0, image))
                spent += clock.perf_counter() - begun
                false += sum(s.identity != f"{kind}-{mark.id}" for s in seen)
                errors += [_error(s, bearing, away) for s in seen if s.identity.endswith("-0")]
            chi += [error[2] for error in errors]
            rows.append(_row(distance, angle, views, errors))
    total = len(rows) * views
    return {
        "size_m": size,
        "rows": rows,
        "false_per_frame": false / total,
        "chi_square_mean": float(np.mean(chi)) if chi else None,
        "chi_square_within_95": float(np.mean(np.array(chi) < 5.99)) if chi else None,
        "recognize_ms": 1e3 * spent / total,
        "render_ms": 1e3 * rendered / total,
    }


def _error(detection: LandmarkDetection, bearing: float, away: float) -> tuple[float, float, float]:
    """Bearing error [rad], range error [m], and their squared Mahalanobis distance."""
    error = np.array([detection.bearing - bearing, detection.range - away])
    chi = float(error @ np.linalg.solve(detection.covariance, error))
    return float(error[0]), float(error[1]), chi


def _row(
    distance: float, angle: int, views: int, errors: list[tuple[float, float, float]]
) -> dict[str, Any]:
    measured = np.array(errors).reshape(-1, 3)
    seen = len(measured) > 0
    return {
        "distance_m": distance,
        "angle_deg": angle,
        "detected": len(measured) / views,
        "bearing_rms_deg": math.degrees(_rms(measured[:, 0])) if seen else None,
        "range_rms_m": _rms(measured[:, 1]) if seen else None,
    }


def _rms(values: np.ndarray[Any, np.dtype[np.float64]]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _hall(kind: str) -> WorldSpec:
    """A hall with one landmark in the middle of its end wall."""
    outline = ((0.05, 0.05), (9.95, 0.05), (9.95, 11.95), (0.05, 11.95), (0.05, 0.05))
    mark = LandmarkPlateSpec(
        name="mark", kind=kind, id=0, at=(9.9, 6.0), yaw=math.pi, size=_SIZES[kind]
    )
    return WorldSpec(
        name="hall",
        x=(0.0, 10.0),
        y=(0.0, 12.0),
        ceiling="ceiling",
        walls=(WallSpec(name="wall", points=outline),),
        landmarks=(mark,),
    )


def tables(result: dict[str, Any]) -> Iterator[ResultTable]:
    """A table of each kind of landmark: the detection rate by distance (rows) and angle."""
    for kind, measured in result["kinds"].items():
        columns = [
            Column("distance [m]", "distance_m", "g"),
            *(Column(f"{angle} deg", f"{angle} deg", ".2f") for angle in _ANGLES),
            Column("range error [m]", "range_rms_m", ".3f"),
        ]
        by_distance = []
        for distance in DISTANCES:
            views = [row for row in measured["rows"] if row["distance_m"] == distance]
            errors = [row["range_rms_m"] for row in views if row["range_rms_m"] is not None]
            rates = {f"{row['angle_deg']} deg": row["detected"] for row in views}
            error = _rms(np.array(errors)) if errors else None
            by_distance.append({"distance_m": distance, **rates, "range_rms_m": error})
        title = (
            f"{kind}, {measured['size_m']:g} m: detection rate;"
            f" {measured['recognize_ms']:.1f} ms per frame"
            f" ({measured['render_ms']:.1f} ms to render it),"
            f" {measured['false_per_frame']:.4f} false detections per frame"
        )
        yield ResultTable(title, columns, by_distance)
