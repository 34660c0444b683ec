"""Tracker of movers: where they stand, where they go, and when they are forgotten."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.localmap.occupancy_grid import OccupancyGrid
from navfw.movers.tracking import OccupiedDisc, Tracker, TrackerParams
from navfw.robot import RobotModel
from navfw.signals import MovingObject, Pose

ROBOT = RobotModel()
AHEAD = ROBOT.camera.mount_forward
START = Pose(0.0, 0.0, 0.0)


def seen(
    time: float,
    bearing: float,
    distance: float,
    *,
    width: float = 0.13,
    velocity: tuple[float, float] = (0.0, 0.0),
    certainty: float = 0.0,
) -> MovingObject:
    """A detection whose vectors say ``velocity`` with an information of ``certainty``."""
    information = certainty * np.eye(2)
    return MovingObject(
        time, bearing, width, distance, information, information @ np.array(velocity)
    )


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
    tracks, pose = Tracker(ROBOT), Pose(x, y, yaw)
    tracks.update([seen(0.0, bearing, distance, width=width)], pose)
    assert tracks.occupied_discs(0.0) == ()  # once is no proof
    tracks.update([seen(0.1, bearing, distance, width=width)], pose)
    disc = tracks.occupied_discs(0.1)[0]
    camera = pose.to_parent(AHEAD, 0.0)
    away = math.dist(camera, (disc.x, disc.y))
    assert away - disc.radius == pytest.approx(distance, abs=1e-3)
    local = pose.to_local(disc.x, disc.y)
    assert math.atan2(local[1], local[0] - AHEAD) == pytest.approx(bearing, abs=1e-3)


def walk(tracks: Tracker, velocity: float, seconds: float, certainty: float = 0.0) -> float:
    """Someone crosses from right to left, 1.5 m ahead; returns the time of the last look."""
    time = 0.0
    for k in range(round(10 * seconds)):
        time = 0.1 * k
        y = -0.6 + velocity * time
        bearing, away = math.atan2(y, 1.5), math.hypot(1.5, y)
        mover = seen(time, bearing, away, velocity=(0.0, velocity), certainty=certainty)
        tracks.update([mover], START)
    return time


@pytest.mark.parametrize("certainty", [0.0, 200.0])
def test_who_walks_takes_the_floor_ahead_and_who_stands_does_not(certainty: float) -> None:
    walking, standing = Tracker(ROBOT), Tracker(ROBOT)
    time = walk(walking, 0.5, 2.0, certainty)
    walk(standing, 0.0, 2.0, certainty)
    (track,) = walking.tracks
    vx, vy = track.velocity
    assert vy == pytest.approx(0.5, abs=0.1)
    assert abs(vx) < 0.15
    farthest = max(disc.y for disc in walking.discs(time))
    assert farthest == pytest.approx(
        track.predict(time)[1] + vy * walking.params.path_time, abs=0.05
    )
    spread = [disc.y for disc in standing.discs(time)]
    assert max(spread) - min(spread) < 0.05


def test_vectors_tell_the_velocity_at_the_second_sight() -> None:
    tracks = Tracker(ROBOT)
    walk(tracks, 0.5, 0.2, certainty=200.0)
    (track,) = tracks.tracks
    assert track.hits == 2
    assert track.velocity[1] == pytest.approx(0.5, abs=0.05)


def test_no_mover_is_taken_to_be_faster_than_people_walk() -> None:
    tracks = Tracker(ROBOT, TrackerParams(max_speed=0.8))
    walk(tracks, 2.0, 0.3, certainty=1000.0)
    followed = [track for track in tracks.tracks if track.hits > 1]
    assert all(math.hypot(*track.velocity) <= 0.8 + 1e-9 for track in followed)


def test_two_movers_keep_their_tracks_apart_and_the_unseen_is_forgotten() -> None:
    tracks = Tracker(ROBOT, TrackerParams(max_age_in_view=0.5))
    for k in range(5):
        movers = [seen(0.1 * k, 0.5, 1.5), seen(0.1 * k, -0.5, 1.5)]
        tracks.update(movers, START)
    assert [track.hits for track in tracks.tracks] == [5, 5]
    tracks.prune(0.85, START)
    assert len(tracks.tracks) == 2
    tracks.prune(1.0, START)
    assert tracks.occupied_discs(1.0) == ()


def test_who_has_left_the_view_is_remembered_longer_than_who_should_be_seen() -> None:
    tracks = Tracker(ROBOT)
    walk(tracks, 0.0, 0.5)
    away = Pose(0.0, 0.0, math.pi)
    tracks.prune(0.4 + tracks.params.max_age_in_view + 0.5, away)
    assert len(tracks.tracks) == 1
    tracks.prune(0.4 + tracks.params.max_age_in_view + 0.5, START)
    assert tracks.tracks == []
    walk(tracks, 0.0, 0.5)
    tracks.prune(0.4 + tracks.params.max_age_out_of_view + 0.1, away)
    assert tracks.tracks == []


def test_a_second_track_of_the_same_mover_is_dropped() -> None:
    tracks = Tracker(ROBOT)
    for k in range(3):
        tracks.update([seen(0.1 * k, 0.0, 1.9)], START)
    # from now on its feet are seen where they are, too far off for the old track
    for k in range(3, 6):
        tracks.update([seen(0.1 * k, 0.0, 1.2)], START)
    assert len(tracks.tracks) <= 2
    for k in range(6, 12):
        tracks.update([seen(0.1 * k, 0.0, 1.55)], START)
    tracks.prune(1.6, START)
    assert len(tracks.tracks) == 1


def test_who_is_suddenly_seen_elsewhere_is_still_believed() -> None:
    tracks = Tracker(ROBOT, TrackerParams(gate=2.0))
    for k in range(5):
        tracks.update([seen(0.1 * k, 0.0, 0.8)], START)
    # only a part of it is seen from so near: too far off for the gate, too near for another
    tracks.update([seen(0.5, 0.25, 0.76, width=0.2)], START)
    (track,) = tracks.tracks
    assert track.hits == 5
    assert tracks.confirmed == (track,)


def test_somebody_seen_far_from_where_one_went_is_somebody_else() -> None:
    tracks = Tracker(ROBOT)
    walk(tracks, 1.0, 0.5)
    (left,) = tracks.tracks
    # long after: anywhere would be within the gate of so old a track
    later = left.time + 3.5
    x, y = left.at(later)
    away = START.to_local(x, y)
    bearing, distance = math.atan2(away[1], away[0]), math.hypot(*away)
    tracks.update([seen(later, bearing + 1.2, distance)], START)
    assert left in tracks.tracks
    assert len(tracks.tracks) == 2
    assert left.time < later


def test_those_who_pass_each_other_are_told_apart_by_their_velocities() -> None:
    tracks = Tracker(ROBOT)
    start, speed = 0.5, 0.5
    for k in range(21):
        aside = start - speed * 0.1 * k
        movers = []
        for side, way in ((aside, -speed), (-aside, speed)):
            bearing, distance = math.atan2(side, 1.2), math.hypot(1.2, side) - 0.22
            there = seen(0.1 * k, bearing, distance, velocity=(0.0, way), certainty=200.0)
            movers.append(there)
        tracks.update(sorted(movers, key=lambda mover: -mover.bearing), START)
    rightward, leftward = sorted(tracks.tracks, key=lambda track: track.velocity[1])
    assert rightward.hits == leftward.hits == 21
    assert rightward.velocity[1] == pytest.approx(-speed, abs=0.1)
    assert leftward.velocity[1] == pytest.approx(speed, abs=0.1)


def test_what_movers_take_is_occupied_until_they_are_gone() -> None:
    occupancy = OccupancyGrid(ROBOT)
    occupancy.move(Pose(0, 0, 0), 0.0)
    cell = occupancy.index(1.0, 0.2)
    before = occupancy.clearance[cell]
    occupancy.take((OccupiedDisc(1.0, 0.2, 0.2),))
    assert occupancy.occupied[cell]
    assert occupancy.clearance[cell] == 0.0
    occupancy.take(())
    assert occupancy.beside((OccupiedDisc(1.0, 0.2, 0.2),))[cell] == 0.0
    assert occupancy.beside(())[cell] == before
    assert not occupancy.occupied[cell]
    assert occupancy.clearance[cell] == before


def test_nobody_is_remembered_where_the_robot_stands() -> None:
    tracks = Tracker(ROBOT)
    walk(tracks, 1.0, 0.5)
    (track,) = tracks.tracks
    here = Pose(*track.predict(track.time + 0.5), 0.0)
    tracks.prune(track.time + 0.1, here)
    assert tracks.tracks == [track], "just seen: it may be beside"
    tracks.prune(track.time + 0.5, here)
    assert tracks.tracks == []
