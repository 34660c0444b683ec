"""Multi-object tracking: position, velocity, and life time of tracks."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from movers_detections import AHEAD, ROBOT, START, cross, detection

from navfw.movers import Tracker
from navfw.movers.tracking import Track, TrackerParams
from navfw.signals import Pose

ACCELERATION_SIGMA = 0.5
BEARING_SIGMA = 0.06
MAX_AGE_OUT_OF_VIEW = 4.0
PATH_TIME = 0.6
SPEED_SIGMA = 0.4

POSES = st.builds(Pose, st.floats(-3, 3), st.floats(-3, 3), st.floats(-3.1, 3.1))


@settings(max_examples=50, deadline=None)
@given(POSES, st.floats(-0.7, 0.7), st.floats(0.5, 2.5), st.floats(0.02, 0.4))
def test_an_object_is_centred_behind_its_visible_front(
    pose: Pose, bearing: float, distance: float, width: float
) -> None:
    tracker = Tracker(ROBOT)
    tracker.update([detection(0.0, bearing, distance, width=width)], pose)
    assert tracker.occupied_discs(0.0) == ()  # one detection confirms nothing
    tracker.update([detection(0.1, bearing, distance, width=width)], pose)
    disc = tracker.occupied_discs(0.1)[0]
    camera = pose.to_parent(AHEAD, 0.0)
    away = math.dist(camera, (disc.x, disc.y))
    assert away - disc.radius == pytest.approx(distance, abs=1e-3)
    local = pose.to_local(disc.x, disc.y)
    assert math.atan2(local[1], local[0] - AHEAD) == pytest.approx(bearing, abs=1e-3)


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
    assert farthest == pytest.approx(track.predict(time)[1] + vy * PATH_TIME, abs=0.05)
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
    tracker.prune(0.4 + MAX_AGE_OUT_OF_VIEW + 0.1, away)
    assert tracker.tracks == []


@pytest.mark.parametrize(("change", "confirmed"), [(0.1, True), (0.6, False)])
def test_detections_confirm_a_track_if_their_velocities_agree(
    change: float, confirmed: bool
) -> None:
    tracker = Tracker(ROBOT)
    for k in range(6):
        velocity = 0.3 + 0.5 * change * (-1) ** k
        crossing = detection(0.1 * k, 0.0, 1.2, velocity=(0.0, velocity), certainty=1e3)
        tracker.update([crossing], START)
        tracker.prune(0.1 * k, START)
    assert bool(tracker.confirmed) is confirmed


# --- the filter -----------------------------------------------------------------------------------


def test_the_covariance_of_tracks_is_that_of_their_errors() -> None:
    # normalised errors of 4 states over many runs: 4 in the mean, if model and filter agree
    rng = np.random.default_rng(0)
    p = TrackerParams(gate=20.0, max_speed=9.0, distance_sigma=0.08, min_hits=1)
    pose, dt, squares = Pose(0.5, -0.3, 0.7), 0.1, []
    camera = np.array(pose.to_parent(AHEAD, 0.0))
    for _ in range(150):
        away, aside = rng.uniform(1.2, 1.8), rng.uniform(-0.4, 0.4)
        place = camera + away * np.array([math.cos(pose.yaw + aside), math.sin(pose.yaw + aside)])
        velocity = rng.normal(0.0, SPEED_SIGMA, 2)
        tracker = Tracker(ROBOT, p)
        for k in range(8):
            off = place - camera
            away, bearing = math.hypot(*off), math.atan2(off[1], off[0]) - pose.yaw
            front = away - p.radius[0]
            noise = rng.normal(0.0, [math.hypot(p.distance_sigma * front, 0.06), 1.0, 1.0, 1.0])
            bearing += math.hypot(BEARING_SIGMA * away, 0.06) / away * noise[1]
            c, s = math.cos(pose.yaw), math.sin(pose.yaw)
            ahead, left = np.array([[c, s], [-s, c]]) @ velocity + 0.15 * noise[2:]
            seen = detection(
                k * dt, bearing, front + noise[0], velocity=(ahead, left), certainty=0.15**-2
            )
            tracker.update([seen], pose)
            (track,) = tracker.tracks
            error = track.state - np.concatenate([place, velocity])
            squares.append(error @ np.linalg.solve(track.covariance, error))
            push = rng.normal(0.0, ACCELERATION_SIGMA, 2)
            place = place + velocity * dt + 0.5 * push * dt * dt
            velocity = velocity + push * dt
    assert np.mean(squares) == pytest.approx(4.0, rel=0.12)


@pytest.mark.parametrize(("width", "radius"), [(0.05, 0.22), (0.28, math.tan(0.28)), (0.6, 0.35)])
def test_the_radius_follows_the_width_within_its_bounds(width: float, radius: float) -> None:
    tracker = Tracker(ROBOT)
    tracker.update([detection(0.0, 0.0, 1.0, width=width)], START)
    assert tracker.tracks[0].radius == pytest.approx(radius)
    # a correction takes half of the difference
    tracker.update([detection(0.1, 0.0, 1.0, width=0.6)], START)
    assert tracker.tracks[0].radius == pytest.approx(0.5 * (radius + 0.35))


def test_the_path_of_a_track_is_covered_by_discs() -> None:
    tracker = Tracker(ROBOT)
    moving = Track(np.array([1.0, 0.2, 0.6, -0.8]), 1e-4 * np.eye(4), 0.22, 2.0, 2)
    tracker.tracks = [moving]
    discs = tracker.occupied_discs(2.5)
    assert (discs[0].x, discs[0].y) == pytest.approx((1.3, -0.2))
    # 1 m/s over the path time of 0.6 s
    assert (discs[-1].x, discs[-1].y) == pytest.approx((1.3 + 0.36, -0.2 - 0.48))
    gaps = [math.dist((a.x, a.y), (b.x, b.y)) for a, b in itertools.pairwise(discs)]
    assert max(gaps) <= 0.22 + 1e-9
    assert len(discs) == 4
    assert {disc.radius for disc in discs} == {0.22}
    moving.hits = 1
    assert tracker.occupied_discs(2.5) == ()


@pytest.mark.parametrize(
    ("away", "bearing", "in_view"),
    [
        (1.0, 0.0, True),
        (1.0, math.radians(37.0), True),
        (1.0, math.radians(39.0), False),
        (1.0, math.radians(-37.0), True),
        (1.0, math.radians(-39.0), False),
        (1.95, 0.0, True),
        (2.05, 0.0, False),
        # the floor in view begins 0.47 m before the camera
        (0.5, 0.0, True),
        (0.44, 0.0, False),
    ],
)
def test_where_tracks_are_in_view(away: float, bearing: float, in_view: bool) -> None:
    tracker, pose = Tracker(ROBOT), Pose(-1.0, 2.0, 2.0)
    x, y = pose.to_parent(AHEAD + away * math.cos(bearing), away * math.sin(bearing))
    # where the track is predicted to be counts, not where it was
    state = np.array([x - 0.3, y, 0.2, 0.0])
    for age, kept in ((1.5, not in_view), (0.99, True)):
        state[0] = x - 0.2 * age
        tracker.tracks = [Track(state.copy(), 1e-4 * np.eye(4), 0.22, 0.0, 5)]
        tracker.prune(age, pose)
        assert bool(tracker.tracks) == kept


@pytest.mark.parametrize(("away", "kept"), [(0.36, False), (0.38, True)])
def test_old_tracks_that_overlap_the_robot_are_dropped(away: float, kept: bool) -> None:
    # rims of 0.18 m and 0.22 m that overlap by 3 cm, where the track is predicted to be
    for age in (0.1, 0.24, 0.26, 0.5):
        tracker = Tracker(ROBOT)
        state = np.array([away - 0.8 * age, 0.0, 0.8, 0.0])
        tracker.tracks = [Track(state, np.eye(4), 0.22, 0.0, 5)]
        tracker.prune(age, START)
        # one just updated may be beside the robot
        assert bool(tracker.tracks) == (kept or age < 0.25)


def test_a_track_out_of_view_ends_at_a_wall_and_not_in_its_own_cells() -> None:
    tracker = Tracker(ROBOT)
    track = Track(np.array([0.0, 1.5, 0.0, 0.5]), np.eye(4), 0.22, 0.0, 5)
    tracker.tracks = [track]

    def occupied(x: float, y: float) -> bool:
        return y < 1.95 or y > 2.4  # its own cells, and a wall

    for tenth in range(31):
        tracker.prune(0.1 * tenth, START, occupied)
    assert track.predict(3.0) == track.predict(2.0) == pytest.approx((0.0, 2.45), abs=0.06)


def test_reset_drops_all_tracks() -> None:
    tracker = Tracker(ROBOT)
    cross(tracker, 0.5, 0.3)
    tracker.reset()
    assert tracker.tracks == []
    assert tracker.confirmed == ()
