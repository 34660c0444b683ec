"""Describes how a robot failed to notice a walker that it touched; for evaluation only."""

from __future__ import annotations

import math
from itertools import repeat
from typing import Any

import numpy as np

from navfw.numerics import Array
from navfw.signals import Pose

_LOOKED, _PAUSE = 6.0, 0.3
"""Time [s] before a contact that is examined; time for which a walker may be out of view."""

_SAME = 0.4
"""Largest distance [m] from a walker of a track that is taken to be its own."""

_FAR = 2.0
"""Largest distance [m] of a track that may be the walker's with a wrong prediction."""


def how_missed(result: Any, name: str) -> str:
    """Say in words how the walker ``name`` of the ``MissionResult`` was missed.

    It says whether the walker was in view before the contact, and where the stack had tracked it:
    from the log of true poses, the walkers' true positions, and the stack's tracks at the end.
    """
    log, stack = result.log, result.session.stack
    late = log.time > log.contacts[0].time - _LOOKED
    times, poses, index = log.time[late], log.true[late], result.movers.names.index(name)
    radius = float(result.movers.radii[index])
    walker = result.movers.at(times)[:, index]
    half = 0.5 * stack.robot.camera.hfov
    rims = [_rim(Pose(*pose), at, radius) for pose, at in zip(poses.tolist(), walker, strict=True)]
    clear = map(result.session.plan.straight_path_free, poses[:, :2], walker, repeat(0.01))
    shown = (np.array(rims) < half) & list(clear)
    newest = times > times[-1] - _PAUSE
    gone = np.flatnonzero(~shown & ~newest)
    in_view = float(times[-1] - (times[gone[-1]] if len(gone) else times[0]))
    now, odometry = Pose(*poses[-1].tolist()), stack.state.odometry
    place = odometry.pose.to_parent(*now.to_local(*walker[-1].tolist()))
    tracks = [math.dist(place, track.predict(odometry.time)) for track in stack.tracker.confirmed]
    nearest = min(tracks, default=math.inf)
    seen = f"in view for the last {in_view:.1f} s" if shown[newest].any() else "out of view"
    if nearest <= _SAME:
        return f"{seen} and tracked"
    if nearest <= _FAR:
        return f"{seen}, was taken to be {nearest:.1f} m from where it was"
    return f"{seen}, was not known to be there"


def _rim(robot: Pose, at: Array, radius: float) -> float:
    """Return the bearing [rad] of the edge of a disc that is nearest to straight ahead."""
    ahead, aside = robot.to_local(*at.tolist())
    away = max(math.hypot(ahead, aside), radius)
    return abs(math.atan2(aside, ahead)) - math.asin(radius / away)
