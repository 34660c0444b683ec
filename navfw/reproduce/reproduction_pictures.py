"""The pictures of the page: the room with the trajectory, and images with their flow."""

from __future__ import annotations

import dataclasses
import math
from io import BytesIO

import cv2
import numpy as np

from navfw.bench.true_pairs import MovingPose
from navfw.numerics import Image
from navfw.perceive.lettering import write
from navfw.perceive.overlay import draw_flow
from navfw.recording.palette import FURNITURE, WALL
from navfw.reproduce.paper_tables import FAST, SceneRow, WaypointRow
from navfw.signals import FlowField
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.worldspec import WorldSpec

_GAIN = 4
_STRIP = 30
_PAPER, _INK = (255, 255, 255), (40, 40, 40)
_WAYPOINT = "#D00000"


def waypoint_picture(row: WaypointRow) -> Image:
    """The image; its ideal flow without and with rotation; the flow of block matching."""
    image = row.view.pair.now.image
    parts = [_panel(image, None, f"waypoint {row.waypoint.number}")]
    for kind, rotation, title in (
        ("ideal", "removed", "ideal flow, rotation removed"),
        ("ideal", "left in", "ideal flow, rotation left in"),
        ("block matching", "removed", "block matching, rotation removed"),
    ):
        parts.append(_panel(image, row.percepts[kind, rotation, "normalised"].flow, title))
    return np.concatenate([_beside(parts[:2]), _beside(parts[2:])])


def scene_picture(row: SceneRow) -> Image:
    """The image, and the flow of block matching over it, as in the paper's Fig. 18."""
    image = row.view.pair.now.image
    flow = row.percepts["block matching", "normalised"].flow
    return _beside(
        [
            _panel(image, None, f"situation {row.scene.number}"),
            _panel(image, flow, "block matching, 10 x 15"),
        ]
    )


def _panel(image: Image, flow: FlowField | None, title: str) -> Image:
    height, width = image.shape
    size = (_GAIN * width, _GAIN * height)
    large = cv2.resize(image, size, interpolation=cv2.INTER_CUBIC)
    colour = np.asarray(cv2.cvtColor(large, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
    if flow is not None:
        colour = np.asarray(0.45 * colour + 20.0, dtype=np.uint8)
        # all vectors are drawn, also those that OFFIS rejects
        shown = np.maximum(flow.confidence, 0.4 * (flow.sigma < 5.0))
        draw_flow(colour, dataclasses.replace(flow, confidence=shown), float(_GAIN))
    strip = np.full((_STRIP, colour.shape[1], 3), _PAPER, dtype=np.uint8)
    write(strip, title, (4.0, 21.0), 17.0, _INK)
    return np.concatenate([strip, colour])


def _beside(panels: list[Image]) -> Image:
    gap = np.full((panels[0].shape[0], 8, 3), 255, dtype=np.uint8)
    joined = [panels[0]]
    for panel in panels[1:]:
        joined += [gap, panel]
    return np.concatenate(joined, axis=1)


def draw_map(world: WorldSpec, way: list[MovingPose], rows: list[WaypointRow]) -> Image:
    """The room from above with trajectory and waypoints (Fig. 16)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle, Polygon

    plan = SceneGeometry.from_world(world, 2.0)
    figure = Figure(figsize=(9.0, 5.4), dpi=130)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.04, 0.06, 0.94, 0.92))
    for shape, corners in plan.rectangles():
        wall = "wall" in shape.name or "partition" in shape.name
        axes.add_patch(Polygon(corners, facecolor=WALL if wall else FURNITURE))
    for _, disc in plan.circles():
        axes.add_patch(Circle((disc.x, disc.y), disc.radius, facecolor=FURNITURE))
    axes.plot([m.pose.x for m in way], [m.pose.y for m in way], color="#0072B2", linewidth=1.5)
    for row in rows:
        pose = row.point.pose
        fast = row.waypoint.number == FAST
        axes.plot(pose.x, pose.y, "o", color=_WAYPOINT, markersize=9 if fast else 6)
        ahead = 0.4 * math.cos(pose.yaw), 0.4 * math.sin(pose.yaw)
        axes.annotate(
            "",
            (pose.x + ahead[0], pose.y + ahead[1]),
            (pose.x, pose.y),
            arrowprops={"arrowstyle": "->", "color": _WAYPOINT},
        )
        # label beside the trajectory
        side = 14.0 * math.sin(pose.yaw) - 4.0, -14.0 * math.cos(pose.yaw) - 4.0
        axes.annotate(
            f"{row.waypoint.number}{' fast left turn' if fast else ''}",
            (pose.x, pose.y),
            (-34.0, -36.0) if fast else side,
            textcoords="offset points",
            fontsize=10,
        )
    axes.set_xlim(world.x)
    axes.set_ylim(world.y)
    axes.set_aspect("equal")
    axes.tick_params(labelsize=8, colors="#666666", length=2)
    for spine in axes.spines.values():
        spine.set_visible(False)
    code = BytesIO()
    figure.savefig(code, format="png")
    picture = cv2.imdecode(np.frombuffer(code.getvalue(), np.uint8), cv2.IMREAD_COLOR)
    return np.asarray(picture, dtype=np.uint8)
