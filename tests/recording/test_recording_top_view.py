"""Labels, colours and legends of pictures from above."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from navfw.numerics import Array
from navfw.recording import PathLabels, behavior_color, bgr, write_legend

NO_PATH = np.empty((0, 2))


@pytest.fixture
def axes() -> Axes:
    figure = Figure(figsize=(5.0, 5.0))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0.0, 10.0)
    axes.set_ylim(0.0, 10.0)
    return axes


def pixels(axes: Axes, path: Array) -> Array:
    """Points of the path one pixel apart."""
    steps = np.linspace(0.0, 1.0, 501)
    ends = axes.transData.transform(path)
    points: Array = ends[0] + steps[:, None] * (ends[1] - ends[0])
    return points


def test_labels_cover_neither_each_other_nor_the_path(axes: Axes) -> None:
    # just above the places; of its two points none is near a place
    path = np.array([[0.0, 4.8], [10.0, 5.2]])
    labels = PathLabels(axes, path, zorder=1)
    names = {f"place {n}": (1.5 + 0.9 * n, 4.7 + 0.05 * (n % 3)) for n in range(8)}
    written = [name for name, point in names.items() if labels.write(name, point, "black")]
    assert len(written) >= 6
    assert [text.get_text() for text in axes.texts] == written
    boxes = [text.get_window_extent() for text in axes.texts]
    for number, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[:number])
        inside = (pixels(axes, path) > box.min) & (pixels(axes, path) < box.max)
        assert not inside.all(axis=1).any()


def test_labels_keep_off_marks(axes: Axes) -> None:
    labels = PathLabels(axes, NO_PATH, zorder=1)
    mark = (5.15, 5.1)
    labels.keep_clear(mark)
    assert labels.write("lobby", (5.0, 5.0), "black")
    (text,) = axes.texts
    assert not text.get_window_extent().contains(*axes.transData.transform(mark))


def test_a_label_without_room_is_left_out(axes: Axes) -> None:
    labels = PathLabels(axes, NO_PATH, zorder=1)
    assert labels.write("lobby", (5.0, 5.0), "black")
    assert not labels.write("x" * 100, (5.0, 5.0), "black"), "wider than the picture"
    assert [text.get_text() for text in axes.texts] == ["lobby"]


def test_a_label_stays_within_the_picture(axes: Axes) -> None:
    assert PathLabels(axes, NO_PATH, zorder=1).write("corner", (9.9, 9.9), "black")
    (text,) = axes.texts
    box = text.get_window_extent()
    assert axes.bbox.contains(box.x1, box.y1)


def test_labels_keep_off_the_path_in_narrow_axes(axes: Axes) -> None:
    axes.set_xlim(4.5, 5.5)
    axes.set_aspect("equal")
    path = np.array([[5.0, 0.0], [5.0, 10.0]])
    labels = PathLabels(axes, path, zorder=1)
    # ten pixels beside the path, but a hundred if the axes were not narrow
    assert all(labels.write(f"at {y}", (4.8, y), "black") for y in (2.0, 5.0, 8.0))
    figure = axes.figure
    assert isinstance(figure, Figure)
    figure.savefig(BytesIO())
    for text in axes.texts:
        box = text.get_window_extent()
        inside = (pixels(axes, path) > box.min) & (pixels(axes, path) < box.max)
        assert not inside.all(axis=1).any()


def test_the_legend_has_each_label_once(axes: Axes) -> None:
    for _ in range(3):
        axes.plot([0, 1], [0, 1], label="passage")
    axes.plot([0, 1], [0, 1], label="route")
    figure = axes.figure
    assert isinstance(figure, Figure)
    write_legend(figure, axes)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["passage", "route"]


def test_a_behaviour_has_one_colour_by_its_name_alone() -> None:
    assert behavior_color("avoid") == "#E69F00"
    others = [behavior_color(f"behavior_{n}") for n in range(20)]
    assert others == [behavior_color(f"behavior_{n}") for n in range(20)]
    assert len(set(others)) == 20
    assert all(bgr(color) != bgr(behavior_color("")) for color in others)
