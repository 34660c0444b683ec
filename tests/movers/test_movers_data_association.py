"""Detections that are one object: of a track, of tracks that merge, and of adjacent views."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from movers_detections import AHEAD, ROBOT, START, cross, detection

from navfw.movers import Tracker
from navfw.movers.localization import merge_views
from navfw.movers.tracking import Track, TrackerParams
from navfw.robot import RobotModel, SideViews
from navfw.signals import MovingObject


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
    tracker.update([detection(later, math.atan2(y, x) + 1.2, math.hypot(x, y))], START)
    assert left in tracker.tracks
    assert len(tracker.tracks) == 2
    assert left.time < later


def test_objects_that_pass_each_other_keep_their_tracks() -> None:
    tracker = Tracker(ROBOT)
    speed = 0.5
    for k in range(21):
        aside, two = 0.5 - speed * 0.1 * k, []
        for side, way in ((aside, -speed), (-aside, speed)):
            at = math.atan2(side, 1.2), math.hypot(1.2, side) - 0.22
            two.append(detection(0.1 * k, *at, velocity=(0.0, way), certainty=200.0))
        tracker.update(sorted(two, key=lambda one: -one.bearing), START)
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
    near = placed(0.0, 0.5 * change)
    other = placed(sigmas * ACROSS, -0.5 * change - math.copysign(other_change, change))
    # at the place of one track, with the velocity of the other but for ``other_change``
    both = detection(0.0, 0.0, AWAY - 0.22, velocity=(0.0, -0.5 * change), certainty=1e6)
    tracker = Tracker(ROBOT)
    tracker.tracks = [near, other] if swapped else [other, near]
    tracker.update([both], START)
    assert (near.hits, other.hits) == ((6, 5) if keeps else (5, 6))


@pytest.mark.parametrize(("apart", "merged"), [(0.49, True), (0.51, False)])
def test_a_new_track_close_to_an_old_one_is_that_of_who_turned(apart: float, merged: bool) -> None:
    tracker = Tracker(ROBOT, TrackerParams(gate=0.5))
    old = Track(np.array([AHEAD + AWAY, apart, 0.0, 0.0]), 1e-6 * np.eye(4), 0.22, 0.0, 7)
    tracker.tracks = [old]
    tracker.update([detection(0.1, 0.0, AWAY - 0.22)], START)
    new = tracker.tracks[-1]
    assert new is not old
    assert (old in tracker.tracks) != merged
    assert new.hits == (7 if merged else 1)


@pytest.mark.parametrize(("apart", "merged"), [(0.29, True), (0.31, False)])
def test_tracks_closer_than_the_merge_distance_are_one(apart: float, merged: bool) -> None:
    tracker = Tracker(ROBOT)
    old = Track(np.array([AHEAD + AWAY, apart, 0.0, 0.0]), 1e-6 * np.eye(4), 0.22, 0.0, 7)
    tracker.tracks = [old, placed(0.0, 0.0)]
    tracker.update([detection(0.1, 0.0, AWAY - 0.22)], START)
    assert (old in tracker.tracks) != merged


def test_two_detections_are_never_one_track_nor_merged() -> None:
    tracker = Tracker(ROBOT)
    tracker.tracks = [placed(0.0, 0.0)]
    near, nearer = detection(0.0, 0.08, AWAY - 0.22), detection(0.0, -0.04, AWAY - 0.22)
    tracker.update([near, nearer], START)
    assert [track.hits for track in tracker.tracks] == [6, 1]
    assert tracker.tracks[0].state[1] < 0.0, "the nearer detection is associated"


# --- parts of one object in adjacent views are joined, other detections are not -------------------

WIDE = RobotModel(side_views=SideViews())
CAMERAS = (WIDE.camera, *WIDE.side_cameras)
HALF = 0.5 * WIDE.camera.hfov


def part(right: float, left: float, distance: float = 1.0) -> MovingObject:
    """A detection between two bearings [rad] of an object that moves ahead."""
    middle, width = 0.5 * (left + right), 0.5 * (left - right)
    return detection(1.0, middle, distance, width=width, velocity=(0.3, 0.0), certainty=100.0)


@given(
    middle=st.floats(HALF - 0.05, HALF + 0.05),
    width=st.floats(0.15, 0.3),
    distance=st.floats(0.3, 2.0),
    side=st.sampled_from([1, -1]),
)
def test_parts_at_a_border_are_one(middle: float, width: float, distance: float, side: int) -> None:
    # flow ends a little before the border of either image
    inner = part(middle - width, HALF - 0.05, distance)
    outer = part(HALF - 0.02, middle + width, 1.2 * distance)
    if side < 0:
        inner, outer = (
            part(-m.bearing - m.width, -m.bearing + m.width, m.distance) for m in (inner, outer)
        )
    views = [[inner], [outer], []] if side > 0 else [[inner], [], [outer]]
    (joined,) = merge_views(views, CAMERAS)
    assert joined.bearing == pytest.approx(side * middle, abs=1e-9)
    assert joined.width == pytest.approx(width, abs=1e-9)
    assert distance <= joined.distance <= 1.2 * distance
    assert joined.velocity()[0] == pytest.approx(0.3, rel=0.1)
    assert np.allclose(joined.information, 200.0 * np.eye(2))


def test_an_object_across_all_three_views_is_one() -> None:
    views = [
        [part(-HALF + 0.03, HALF - 0.03, 0.3)],
        [part(HALF - 0.05, 1.0, 0.3)],
        [part(-1.0, -HALF + 0.05, 0.3)],
    ]
    (joined,) = merge_views(views, CAMERAS)
    assert joined.width == pytest.approx(1.0)


def test_detections_far_from_the_border_stay_apart() -> None:
    ahead, left, right = [part(0.1, 0.4)], [part(0.7, 0.9), part(1.2, 1.4)], [part(-1.2, -1.0)]
    joined = merge_views([ahead, left, right], CAMERAS)
    assert [round(m.bearing, 2) for m in joined] == [1.3, 0.8, 0.25, -1.1]


def test_parts_at_different_distances_are_two_objects() -> None:
    views = [[part(0.5, HALF - 0.05, 2.0)], [part(HALF - 0.05, 1.0, 0.6)], []]
    assert len(merge_views(views, CAMERAS)) == 2


def test_a_single_view_is_left_as_it_is() -> None:
    ahead = [part(0.5, HALF), part(-0.2, 0.1)]
    assert merge_views([ahead], CAMERAS[:1]) == tuple(ahead)
    assert math.isclose(ahead[0].distance, 1.0)
