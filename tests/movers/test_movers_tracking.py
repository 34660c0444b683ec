"""Multi-object tracking: association, position, velocity, and life time of tracks."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.localmap.occupancy_grid import OccupancyGrid
from navfw.movers.tracking import Track, Tracker, TrackerParams
from navfw.robot import RobotModel
from navfw.signals import MovingObject, OccupiedDisc, Pose

ROBOT = RobotModel()
AHEAD = ROBOT.camera.mount_forward
START = Pose(0.0, 0.0, 0.0)


def detection(
    time: float,
    bearing: float,
    distance: float,
    *,
    width: float = 0.13,
    velocity: tuple[float, float] = (0.0, 0.0),
    certainty: float = 0.0,
) -> MovingObject:
    """A detection with ``velocity`` [m/s] in base_link; ``certainty`` is its information."""
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
def test_an_object_is_centred_behind_its_visible_front(
    x: float, y: float, yaw: float, bearing: float, distance: float, width: float
) -> None:
    tracker, pose = Tracker(ROBOT), Pose(x, y, yaw)
    tracker.update([detection(0.0, bearing, distance, width=width)], pose)
    assert tracker.occupied_discs(0.0) == ()  # one detection confirms nothing
    tracker.update([detection(0.1, bearing, distance, width=width)], pose)
    disc = tracker.occupied_discs(0.1)[0]
    camera = pose.to_parent(AHEAD, 0.0)
    away = math.dist(camera, (disc.x, disc.y))
    assert away - disc.radius == pytest.approx(distance, abs=1e-3)
    local = pose.to_local(disc.x, disc.y)
    assert math.atan2(local[1], local[0] - AHEAD) == pytest.approx(bearing, abs=1e-3)


def cross(tracker: Tracker, velocity: float, seconds: float, certainty: float = 0.0) -> float:
    """Track an object that crosses to the left, 1.5 m ahead; the time [s] of the last detection."""
    time = 0.0
    for k in range(round(10 * seconds)):
        time = 0.1 * k
        y = -0.6 + velocity * time
        bearing, away = math.atan2(y, 1.5), math.hypot(1.5, y)
        crossing = detection(time, bearing, away, velocity=(0.0, velocity), certainty=certainty)
        tracker.update([crossing], START)
    return time


@pytest.mark.parametrize("certainty", [0.0, 200.0])
def test_moving_objects_occupy_the_floor_ahead_of_them_and_standing_ones_do_not(
    certainty: float,
) -> None:
    moving, standing = Tracker(ROBOT), Tracker(ROBOT)
    time = cross(moving, 0.5, 2.0, certainty)
    cross(standing, 0.0, 2.0, certainty)
    (track,) = moving.tracks
    vx, vy = track.velocity
    assert vy == pytest.approx(0.5, abs=0.1)
    assert abs(vx) < 0.15
    farthest = max(disc.y for disc in moving.occupied_discs(time))
    assert farthest == pytest.approx(
        track.predict(time)[1] + vy * moving.params.path_time, abs=0.05
    )
    spread = [disc.y for disc in standing.occupied_discs(time)]
    assert max(spread) - min(spread) < 0.05


def test_the_velocity_is_known_from_the_second_detection() -> None:
    tracker = Tracker(ROBOT)
    cross(tracker, 0.5, 0.2, certainty=200.0)
    (track,) = tracker.tracks
    assert track.hits == 2
    assert track.velocity[1] == pytest.approx(0.5, abs=0.05)


def test_speeds_are_clipped_to_the_largest() -> None:
    tracker = Tracker(ROBOT, TrackerParams(max_speed=0.8))
    cross(tracker, 2.0, 0.3, certainty=1000.0)
    updated = [track for track in tracker.tracks if track.hits > 1]
    assert all(math.hypot(*track.velocity) <= 0.8 + 1e-9 for track in updated)


def test_two_objects_have_a_track_each_and_undetected_tracks_are_dropped() -> None:
    tracker = Tracker(ROBOT, TrackerParams(max_age_in_view=0.5))
    for k in range(5):
        two = [detection(0.1 * k, 0.5, 1.5), detection(0.1 * k, -0.5, 1.5)]
        tracker.update(two, START)
    assert [track.hits for track in tracker.tracks] == [5, 5]
    tracker.prune(0.85, START)
    assert len(tracker.tracks) == 2
    tracker.prune(1.0, START)
    assert tracker.occupied_discs(1.0) == ()


def test_tracks_out_of_view_live_longer_than_tracks_in_view() -> None:
    tracker = Tracker(ROBOT)
    cross(tracker, 0.0, 0.5)
    away = Pose(0.0, 0.0, math.pi)
    tracker.prune(0.4 + tracker.params.max_age_in_view + 0.5, away)
    assert len(tracker.tracks) == 1
    tracker.prune(0.4 + tracker.params.max_age_in_view + 0.5, START)
    assert tracker.tracks == []
    cross(tracker, 0.0, 0.5)
    tracker.prune(0.4 + tracker.params.max_age_out_of_view + 0.1, away)
    assert tracker.tracks == []


def test_a_second_track_of_the_same_object_is_dropped() -> None:
    tracker = Tracker(ROBOT)
    for k in range(3):
        tracker.update([detection(0.1 * k, 0.0, 1.9)], START)
    # from now on the foot point is in view, too far from the predicted place
    for k in range(3, 6):
        tracker.update([detection(0.1 * k, 0.0, 1.2)], START)
    assert len(tracker.tracks) <= 2
    for k in range(6, 12):
        tracker.update([detection(0.1 * k, 0.0, 1.55)], START)
    tracker.prune(1.6, START)
    assert len(tracker.tracks) == 1


def test_a_new_track_near_a_confirmed_one_takes_over_its_hits() -> None:
    tracker = Tracker(ROBOT, TrackerParams(gate=2.0))
    for k in range(5):
        tracker.update([detection(0.1 * k, 0.0, 0.8)], START)
    # only a part of it is in view: outside the gate, within the merge distance
    tracker.update([detection(0.5, 0.25, 0.76, width=0.2)], START)
    (track,) = tracker.tracks
    assert track.hits == 5
    assert tracker.confirmed == (track,)


def test_a_detection_far_from_the_predicted_place_begins_a_track() -> None:
    tracker = Tracker(ROBOT)
    cross(tracker, 1.0, 0.5)
    (left,) = tracker.tracks
    # long after: the covariance of so old a track admits detections from anywhere
    later = left.time + 3.5
    x, y = left.predict(later)
    away = START.to_local(x, y)
    bearing, distance = math.atan2(away[1], away[0]), math.hypot(*away)
    tracker.update([detection(later, bearing + 1.2, distance)], START)
    assert left in tracker.tracks
    assert len(tracker.tracks) == 2
    assert left.time < later


def test_objects_that_pass_each_other_keep_their_tracks() -> None:
    tracker = Tracker(ROBOT)
    start, speed = 0.5, 0.5
    for k in range(21):
        aside = start - speed * 0.1 * k
        two = []
        for side, way in ((aside, -speed), (-aside, speed)):
            bearing, distance = math.atan2(side, 1.2), math.hypot(1.2, side) - 0.22
            there = detection(0.1 * k, bearing, distance, velocity=(0.0, way), certainty=200.0)
            two.append(there)
        tracker.update(sorted(two, key=lambda there: -there.bearing), START)
    rightward, leftward = sorted(tracker.tracks, key=lambda track: track.velocity[1])
    assert rightward.hits == leftward.hits == 21
    assert rightward.velocity[1] == pytest.approx(-speed, abs=0.1)
    assert leftward.velocity[1] == pytest.approx(speed, abs=0.1)


# cost of association: sigmas of position, plus the change of velocity over VELOCITY_SIGMA, bounded


AWAY = 1.22
"""Distance [m] of the tracks below from the camera; those of a detection are to its front."""
ACROSS = math.hypot(0.06 * AWAY, 0.06)
"""Sigma [m] of a detection across its bearing: error of the bearing, and of the shape."""


def placed(aside: float, velocity: float) -> Track:
    """A track AWAY m ahead of the camera and ``aside`` [m, left], with exact state."""
    state = np.array([AHEAD + AWAY, aside, 0.0, velocity])
    return Track(state, 1e-9 * np.eye(4), 0.22, 0.0, 5)


@pytest.mark.parametrize(
    ("change", "sigmas", "other_change", "keeps"),
    [
        # a turn of 0.5 m/s costs 2.5 sigma: more than 2.2 sigma of place, less than 2.8
        (0.5, 2.2, 0.0, False),
        (0.5, 2.8, 0.0, True),
        # ... and no more than the gate, however fast
        (0.9, 2.8, 0.0, False),
        (0.9, 2.8, 0.1, True),
        # the change counts in either direction
        (-0.5, 2.2, 0.0, False),
        (-0.9, 2.8, 0.1, True),
        # beyond the gate no track is associated, whatever its velocity
        (0.9, 3.2, 0.0, True),
    ],
)
@pytest.mark.parametrize("swapped", [False, True])
def test_association_weighs_place_against_velocity(
    swapped: bool, change: float, sigmas: float, other_change: float, keeps: bool
) -> None:
    here = placed(0.0, 0.5 * change)
    other = placed(sigmas * ACROSS, -0.5 * change - math.copysign(other_change, change))
    # at the place of one track, with the velocity of the other but for ``other_change``
    found = detection(0.0, 0.0, AWAY - 0.22, velocity=(0.0, -0.5 * change), certainty=1e6)
    tracker = Tracker(ROBOT)
    tracker.tracks = [here, other] if swapped else [other, here]
    tracker.update([found], START)
    assert (here.hits, other.hits) == ((6, 5) if keeps else (5, 6))


def test_swapped_places_do_not_swap_tracks_of_different_velocities() -> None:
    # two objects pass each other; noise puts each detection where the other track is predicted
    tracker = Tracker(ROBOT)
    leftward, rightward = placed(0.06, 0.5), placed(-0.06, -0.5)
    tracker.tracks = [leftward, rightward]
    aside = math.atan2(0.06, AWAY)
    tracker.update(
        [
            detection(0.0, side * aside, AWAY - 0.22, velocity=(0.0, way), certainty=1e6)
            for side, way in ((1.0, -0.5), (-1.0, 0.5))
        ],
        START,
    )
    assert tracker.tracks == [leftward, rightward]
    assert leftward.hits == rightward.hits == 6
    assert leftward.velocity[1] == pytest.approx(0.5, abs=0.05)
    assert rightward.velocity[1] == pytest.approx(-0.5, abs=0.05)


def test_discs_are_occupied_until_the_next_ones_are_set() -> None:
    occupancy = OccupancyGrid(ROBOT)
    occupancy.update(Pose(0, 0, 0), 0.0)
    cell = occupancy.index(1.0, 0.2)
    before = occupancy.clearance[cell]
    occupancy.set_obstacles((OccupiedDisc(1.0, 0.2, 0.2),))
    assert occupancy.occupied[cell]
    assert occupancy.clearance[cell] == 0.0
    occupancy.set_obstacles(())
    assert occupancy.clearance_with((OccupiedDisc(1.0, 0.2, 0.2),))[cell] == 0.0
    assert occupancy.clearance_with(())[cell] == before
    assert not occupancy.occupied[cell]
    assert occupancy.clearance[cell] == before


def test_an_old_track_that_overlaps_the_robot_is_dropped() -> None:
    tracker = Tracker(ROBOT)
    cross(tracker, 1.0, 0.5)
    (track,) = tracker.tracks
    here = Pose(*track.predict(track.time + 0.5), 0.0)
    tracker.prune(track.time + 0.1, here)
    assert tracker.tracks == [track], "just updated: the object may be beside the robot"
    tracker.prune(track.time + 0.5, here)
    assert tracker.tracks == []
