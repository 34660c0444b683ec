"""Tracks of movers: where they stand, where they go, and when they are forgotten."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.mofis.egomap import EgoMap
from navfw.mofis.tracks import Disc, TrackParams, Tracks
from navfw.robot import RobotModel
from navfw.signals import Mover, Pose

ROBOT = RobotModel()
AHEAD = ROBOT.camera.mount_forward


@settings(max_examples=50, deadline=None)
@given(
    st.floats(-3, 3),
    st.floats(-3, 3),
    st.floats(-3.1, 3.1),
    st.floats(-0.7, 0.7),
    st.floats(0.5, 2.5),
    st.floats(0.02, 0.4),
)
def test_a_mover_stands_behind_its_visible_front(
    x: float, y: float, yaw: float, bearing: float, distance: float, width: float
) -> None:
    tracks, pose = Tracks(ROBOT), Pose(x, y, yaw)
    tracks.see([Mover(bearing, width, distance)], pose, 0.0)
    assert tracks.discs(0.0) == ()  # once is no proof
    tracks.see([Mover(bearing, width, distance)], pose, 0.1)
    (disc,) = tracks.discs(0.1)
    camera = pose.to_parent(AHEAD, 0.0)
    away = math.dist(camera, (disc.x, disc.y))
    assert away - disc.radius == pytest.approx(distance)
    local = pose.to_local(disc.x, disc.y)
    assert math.atan2(local[1], local[0] - AHEAD) == pytest.approx(bearing, abs=1e-9)


def walk(tracks: Tracks, velocity: float, seconds: float) -> float:
    """Someone crosses from right to left, 1.5 m ahead; returns the time of the last look."""
    time = 0.0
    for k in range(round(10 * seconds)):
        time = 0.1 * k
        y = -0.6 + velocity * time
        bearing, away = math.atan2(y, 1.5), math.hypot(1.5, y)
        tracks.see([Mover(bearing, math.atan(0.2 / away), away)], Pose(0, 0, 0), time)
    return time


def test_who_walks_takes_the_floor_ahead_and_who_stands_does_not() -> None:
    walking, standing = Tracks(ROBOT), Tracks(ROBOT)
    time = walk(walking, 0.5, 2.0)
    walk(standing, 0.0, 2.0)
    (track,) = walking.tracks
    assert track.vy == pytest.approx(0.5, abs=0.1)
    assert abs(track.vx) < 0.15
    farthest = max(disc.y for disc in walking.discs(time))
    expected = track.y + 0.5 * walking.params.foresight
    assert farthest == pytest.approx(expected, abs=0.2)
    spread = [disc.y for disc in standing.discs(time)]
    assert max(spread) - min(spread) < 0.05


def test_two_movers_keep_their_tracks_apart_and_the_unseen_is_forgotten() -> None:
    tracks = Tracks(ROBOT, TrackParams(linger=0.5))
    for k in range(5):
        movers = [Mover(0.5, 0.1, 1.5), Mover(-0.5, 0.1, 1.5)]
        tracks.see(movers, Pose(0, 0, 0), 0.1 * k)
    assert [track.seen for track in tracks.tracks] == [5, 5]
    tracks.forget(0.85)
    assert len(tracks.tracks) == 2
    tracks.forget(1.0)
    assert tracks.discs(1.0) == ()


def test_what_movers_take_is_occupied_until_they_are_gone() -> None:
    egomap = EgoMap(ROBOT)
    egomap.move(Pose(0, 0, 0), 0.0)
    cell = egomap.index(1.0, 0.2)
    before = egomap.clearance[cell]
    egomap.take((Disc(1.0, 0.2, 0.2),))
    assert egomap.occupied[cell]
    assert egomap.clearance[cell] == 0.0
    egomap.take(())
    assert not egomap.occupied[cell]
    assert egomap.clearance[cell] == before
