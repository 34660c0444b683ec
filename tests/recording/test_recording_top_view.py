"""Names of places in pictures: without overlaps, in the given order."""

from __future__ import annotations

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from navfw.recording.top_view import draw_names


def test_an_overlapping_name_is_left_out() -> None:
    figure = Figure(figsize=(5.0, 5.0))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0.0, 10.0)
    axes.set_ylim(0.0, 10.0)
    places = {"lobby": (2.0, 2.0), "beside the lobby": (2.1, 2.1), "lab": (7.0, 7.0)}
    draw_names(axes, places, "black", zorder=1)
    assert [text.get_text() for text in axes.texts] == ["lobby", "lab"]
