"""Convert the stack's percepts, beliefs and decisions to messages of Foxglove's schemas.

Frames are those of docs/architecture.md; z is up in ``map``, ``odom`` and ``base_link``. Image
points count from the image's upper left corner [px].
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from foxglove import messages as fox
from foxglove.messages import Timestamp

from navfw.localmap.occupancy_grid import OccupancyGrid
from navfw.movers.tracking import Track
from navfw.numerics import Array
from navfw.recording import palette
from navfw.recording.ros_messages import in_space
from navfw.recording.top_view import Area, Disc, Line, Shape, mover_shapes
from navfw.robot import CameraModel
from navfw.signals import Belief, FlowField, Label, Percept, Pose, Proposal, Twist, Waypoint

_LINE_LIFT, _LINE_WIDTH = 0.1, 0.05
"""Height and width of lines in a scene [m]."""
_LEVELS = 255
"""Byte for a degree of 1; degrees in [0, 1] are packed into bytes."""


def flow_message(flow: FlowField, camera: CameraModel, stamp: Timestamp) -> fox.ImageAnnotations:
    """Draw flow vectors with any confidence as lines from the points' old to new positions."""
    measured = flow.confidence > 0.0
    ends = camera.reduction * flow.points[measured] + _centre(camera)
    starts = ends - camera.reduction * flow.vectors[measured]
    pairs = np.stack([starts, ends], axis=1).reshape(-1, 2)
    lines = fox.PointsAnnotationType.LineList
    return _annotations(stamp, [(lines, pairs, _color(palette.FLOW), 1.0)])


def cells_message(percept: Percept, camera: CameraModel, stamp: Timestamp) -> fox.ImageAnnotations:
    """Draw the cells of the percept as points, coloured by their label."""
    points = camera.reduction * percept.points + _centre(camera)
    kind = fox.PointsAnnotationType.Points
    groups = []
    for label, color in palette.CELLS.items():
        shown = _color(color, 0.5 if label == Label.UNKNOWN else 1.0)
        groups.append((kind, points[percept.label == label], shown, 2.0))
    return _annotations(stamp, groups)


def _color(color: str, alpha: float = 1.0) -> fox.Color:
    red, green, blue = palette.rgb(color)
    return fox.Color(r=red / 255.0, g=green / 255.0, b=blue / 255.0, a=alpha)


def _annotations(
    stamp: Timestamp, groups: Iterable[tuple[fox.PointsAnnotationType, Array, fox.Color, float]]
) -> fox.ImageAnnotations:
    """Make annotations of groups of points (n, 2) [px], with kind, colour and thickness [px]."""
    return fox.ImageAnnotations(
        timestamp=stamp,
        points=[
            fox.PointsAnnotation(
                timestamp=stamp,
                type=kind,
                # to a sixteenth of a pixel: what is not seen would not compress
                points=[fox.Point2(x=x, y=y) for x, y in (np.rint(16.0 * points) / 16.0).tolist()],
                outline_color=color,
                thickness=thickness,
            )
            for kind, points, color, thickness in groups
        ],
    )


def _centre(camera: CameraModel) -> tuple[float, float]:
    """Return the principal point [px] from the upper left corner of the image."""
    return 0.5 * camera.width, 0.5 * camera.height


def local_map_message(grid: OccupancyGrid, stamp: Timestamp) -> fox.Grid:
    """Encode the local map in ``odom``: field ``occupancy`` in percent, 50 if nothing is known."""
    cell = grid.params.cell
    x, y = grid.origin
    percent = np.rint(100.0 / (1.0 + np.exp(-grid.log_odds))).astype(np.uint8)
    return fox.Grid(
        timestamp=stamp,
        frame_id="odom",
        pose=_pose3(Pose(x - 0.5 * cell, y - 0.5 * cell, 0.0)),
        column_count=percent.shape[1],
        cell_size=fox.Vector2(x=cell, y=cell),
        row_stride=percent.shape[1],
        cell_stride=1,
        fields=[_byte_field("occupancy", 0)],
        data=percent.tobytes(),
    )


def proposals_message(
    proposals: Mapping[str, Proposal], v: Array, w: Array, stamp: Timestamp
) -> fox.Grid:
    """Encode how each behaviour rates the commands: a cell per speed (column) and turn (row).

    Fields ``NAME.desirability`` and ``NAME.prohibition``, 255 for a degree of 1. ``pose`` is the
    command of the first cell, v [m/s] along x and w [rad/s] along y.
    """
    names = [f"{name}.{part}" for name in proposals for part in ("desirability", "prohibition")]
    # rows of cells with their fields side by side, as the grid is read
    data = np.empty((len(w), len(v), len(names)), dtype=np.uint8)
    layers = (x for p in proposals.values() for x in (p.desirability, p.prohibition))
    for field, layer in enumerate(layers):
        data[..., field] = (_LEVELS * layer + 0.5).T
    return fox.Grid(
        timestamp=stamp,
        frame_id="command",
        pose=_pose3(Pose(float(v[0]), float(w[0]), 0.0)),
        column_count=len(v),
        cell_size=fox.Vector2(x=_step(v), y=_step(w)),
        row_stride=len(v) * len(names),
        cell_stride=len(names),
        fields=[_byte_field(name, offset) for offset, name in enumerate(names)],
        data=data.tobytes(),
    )


def _step(values: Array) -> float:
    return float(values[-1] - values[0]) / max(len(values) - 1, 1)


def _byte_field(name: str, offset: int) -> fox.PackedElementField:
    kind = fox.PackedElementFieldNumericType.Uint8
    return fox.PackedElementField(name=name, offset=offset, type=kind)


def obstacles_message(tracks: Sequence[Track], time: float, stamp: Timestamp) -> fox.SceneUpdate:
    """Draw confirmed moving obstacles in ``odom`` at ``time`` [s], and their next second."""
    shapes: list[Shape] = []
    for track in tracks:
        at = np.array(track.predict(time))
        ends = np.array([at, at + track.velocity])
        shapes += mover_shapes(ends, (at[0], at[1]), track.radius, opacity=0.8)
    return scene_message(shapes, "odom", "moving", stamp)


def scene_message(
    shapes: Iterable[Shape], frame: str, name: str, stamp: Timestamp
) -> fox.SceneUpdate:
    """Draw rectangles as cubes, discs as cylinders, lines just above the floor."""
    cubes, cylinders, lines = [], [], []
    for shape in shapes:
        style = shape.style
        color, height = _color(style.color, style.opacity), style.height
        if isinstance(shape, Area):
            cubes.append(_cube(shape.corners, height, color))
        elif isinstance(shape, Disc):
            size = fox.Vector3(x=2.0 * shape.radius, y=2.0 * shape.radius, z=height)
            pose = _pose3(Pose(shape.x, shape.y, 0.0), 0.5 * height)
            cylinders.append(
                fox.CylinderPrimitive(
                    pose=pose, size=size, bottom_scale=1.0, top_scale=1.0, color=color
                )
            )
        elif isinstance(shape, Line):
            points = [fox.Point3(x=x, y=y, z=_LINE_LIFT) for x, y in shape.points.tolist()]
            kind = fox.LinePrimitiveLineType.LineStrip
            lines.append(
                fox.LinePrimitive(type=kind, thickness=_LINE_WIDTH, points=points, color=color)
            )
    entity = fox.SceneEntity(
        timestamp=stamp, frame_id=frame, id=name, cubes=cubes, cylinders=cylinders, lines=lines
    )
    return fox.SceneUpdate(entities=[entity])


def _cube(corners: Array, height: float, color: fox.Color) -> fox.CubePrimitive:
    """Return the upright block over a rectangle with ``corners`` (4, 2) [m]."""
    along, across = corners[1] - corners[0], corners[2] - corners[1]
    x, y = corners.mean(axis=0).tolist()
    yaw = math.atan2(along[1], along[0])
    size = fox.Vector3(x=math.hypot(*along), y=math.hypot(*across), z=height)
    return fox.CubePrimitive(pose=_pose3(Pose(x, y, yaw), 0.5 * height), size=size, color=color)


def pose_message(belief: Belief, twist: Twist, stamp: Timestamp) -> fox.Odometry:
    """Encode the estimated pose in ``map``, with covariance (x, y, z, roll, pitch, yaw; 6 x 6)."""
    return fox.Odometry(
        timestamp=stamp,
        frame_id="map",
        body_frame_id="base_link",
        pose=_pose3(belief.pose),
        linear_velocity=fox.Vector3(x=twist.v, y=0.0, z=0.0),
        angular_velocity=fox.Vector3(x=0.0, y=0.0, z=twist.w),
        pose_covariance=in_space(belief.covariance).tolist(),
    )


def pose_in_message(frame: str, pose: Pose, stamp: Timestamp) -> fox.PoseInFrame:
    """Encode ``pose``, given in ``frame``."""
    return fox.PoseInFrame(timestamp=stamp, frame_id=frame, pose=_pose3(pose))


def path_message(belief: Belief, path: Sequence[Waypoint], stamp: Timestamp) -> fox.PosesInFrame:
    """Encode the route ahead in ``map``: the estimated position, and the planner's waypoints."""
    ahead = [_pose3(Pose(waypoint.x, waypoint.y, 0.0)) for waypoint in path]
    return fox.PosesInFrame(timestamp=stamp, frame_id="map", poses=[_pose3(belief.pose), *ahead])


def _pose3(pose: Pose, z: float = 0.0) -> fox.Pose:
    turn = fox.Quaternion(x=0.0, y=0.0, z=math.sin(0.5 * pose.yaw), w=math.cos(0.5 * pose.yaw))
    return fox.Pose(position=fox.Vector3(x=pose.x, y=pose.y, z=z), orientation=turn)
