"""The log of a run; labels and colours of pictures."""

import hashlib
import struct
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from navfw.numerics import Array
from navfw.recording import hash_commands
from navfw.recording.palette import behavior_color, bgr
from navfw.recording.plan_picture import PathLabels
from navfw.recording.run_observers import Contact, RunLog, RunLogger
from navfw.signals import Pose, Twist, Waypoint

finite = st.floats(allow_nan=False, allow_infinity=False)


@given(st.lists(st.tuples(finite, finite, finite), max_size=20))
def test_the_hash_is_of_little_endian_doubles(rows: list[tuple[float, float, float]]) -> None:
    expected = hashlib.sha256(b"".join(struct.pack("<3d", *row) for row in rows)).hexdigest()
    assert hash_commands(np.array(rows, dtype=np.float64).reshape(-1, 3)) == expected


def curved_log(ticks: int = 300) -> RunLog:
    recorder = RunLogger()
    for tick in range(ticks):
        x, y = 0.01 * tick, 0.5 * np.sin(0.02 * tick)
        leader = "avoid" if 100 <= tick < 200 else "go_to_xy"
        estimate = Pose(x, y + 0.001 * tick, 0.0)
        recorder.add(tick / 60, Pose(x, y, 0.0), estimate, Twist(0.3, 0.0), leader, tick == 7)
    for _ in range(2):
        recorder.add_waypoints((Waypoint(1.0, 0.0, 0.3, "door", "door", False),))
    recorder.contacts.append(Contact(5.0, 3.0, 0.0, "column"))
    return recorder.log()


@pytest.mark.parametrize(
    ("routes", "changes"),
    [
        (["abc", "abc", "bc", "c", ""], 0),
        (["abc", "adc", "dc"], 1),
        (["abc", "bc", "abc", "c"], 1),
        (["abc", "bd", "ec"], 2),
    ],
)
def test_a_route_changes_where_it_is_not_what_was_left_of_it(
    routes: list[str], changes: int
) -> None:
    logger = RunLogger()
    for route in routes:
        logger.add_waypoints(tuple(Waypoint(0.0, 0.0, 0.3, name, "room", False) for name in route))
    assert logger.log().route_changes == changes


def test_a_log_keeps_what_was_added() -> None:
    log = curved_log()
    assert log.ticks == 300
    assert log.leaders == ("go_to_xy", "avoid")
    assert log.leader.tolist() == [0] * 100 + [1] * 100 + [0] * 100
    assert np.flatnonzero(log.emergency).tolist() == [7]
    assert len(log.waypoints) == 1
    assert log.command_stream.shape == (300, 3)


NO_PATH = np.empty((0, 2))


@pytest.fixture
def axes() -> Axes:
    figure = Figure(figsize=(5.0, 5.0))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0.0, 10.0)
    axes.set_ylim(0.0, 10.0)
    return axes


def covered(axes: Axes, path: Array) -> bool:
    """Whether a text covers one of the points of the path that are one pixel apart."""
    ends = axes.transData.transform(path)
    points = ends[0] + np.linspace(0.0, 1.0, 501)[:, None] * (ends[1] - ends[0])
    boxes = [text.get_window_extent() for text in axes.texts]
    return any(((points > box.min) & (points < box.max)).all(axis=1).any() for box in boxes)


def test_labels_cover_neither_each_other_nor_the_path(axes: Axes) -> None:
    # just above the places; of its two points none is near a place
    path = np.array([[0.0, 4.8], [10.0, 5.2]])
    labels = PathLabels(axes, path, zorder=1)
    names = {f"place {n}": (1.5 + 0.9 * n, 4.7 + 0.05 * (n % 3)) for n in range(8)}
    written = [name for name, point in names.items() if labels.write(name, point, "black")]
    assert len(written) >= 6
    assert [text.get_text() for text in axes.texts] == written
    boxes = [text.get_window_extent() for text in axes.texts]
    assert not any(box.overlaps(other) for box, other in combinations(boxes, 2))
    assert not covered(axes, path)


def test_labels_keep_off_marks_and_are_left_out_without_room(axes: Axes) -> None:
    labels = PathLabels(axes, NO_PATH, zorder=1)
    mark = (5.15, 5.1)
    labels.keep_clear(mark)
    assert labels.write("lobby", (5.0, 5.0), "black")
    (text,) = axes.texts
    assert not text.get_window_extent().contains(*axes.transData.transform(mark))
    assert not labels.write("x" * 100, (5.0, 5.0), "black"), "wider than the picture"
    assert [text.get_text() for text in axes.texts] == ["lobby"]


def test_a_behaviour_has_one_colour_by_its_name_alone() -> None:
    assert behavior_color("avoid") == "#E69F00"
    others = [behavior_color(f"behavior_{n}") for n in range(20)]
    assert others == [behavior_color(f"behavior_{n}") for n in range(20)]
    assert len(set(others)) == 20
    assert all(bgr(color) != bgr(behavior_color("")) for color in others)
