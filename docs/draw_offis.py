"""Draw the figures of ``docs/offis.md`` and write its numbers, from one rendered view.

The view is in the office, in front of the door of the lobby; flow and percept are those of the
default stack. Run it after a change of flow or OFFIS::

    uv run python docs/draw_offis.py
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from navfw_benchmarks.reproduce.paper_tables import SENSORS, RenderedPair, rendered_view

from navfw.config.lookup import find
from navfw.egomotion.refinement import refine
from navfw.interfaces import FlowProcessor, Perception
from navfw.plugins import default_registry
from navfw.robot import RobotModel
from navfw.signals import FlowField, Label, Percept, Pose
from navfw.sim.simulation import Simulation
from navfw.sim.worldfile import load_world
from navfw.stack.stackfile import load_stack

DOCS = Path(__file__).parent

PLACE = Pose(3.0, 2.3, 1.35)
"""Where the robot stands in the office."""

STEP, PERIOD = 0.07, 0.2
"""Way driven between the two images [m], and time [s]."""

CELLS = {"wall": (5, 1), "floor": (10, 8)}
"""The two cells of the grid that the page follows: row and column."""

LABELS = {
    Label.UNKNOWN: "#9e9e9e",
    Label.FLOOR: "#009e73",
    Label.OBSTACLE: "#d55e00",
    Label.DROP: "#cc79a7",
    Label.ABOVE: "#56b4e9",
}
"""Colours of labels, of Okabe and Ito."""

_PART = re.compile(r"(<!-- (cells|inference|sentence) -->\n).*?(<!-- end -->)", re.DOTALL)


class OfficeReading(NamedTuple):
    """The pair of images, its derotated flow, and what OFFIS makes of it."""

    view: RenderedPair
    flow: FlowField
    percept: Percept


def read_office() -> OfficeReading:
    """Render the view and process it as the default stack does."""
    robot = RobotModel()
    stages = load_stack(find("stack", "default"), default_registry()).stages
    flow_processor, offis = (
        stages[name].plugin(robot, stages[name].params) for name in ("flow", "perception")
    )
    past = PLACE.compose(Pose(-STEP, 0.0, 0.0))
    with Simulation(load_world(find("world", "office")), robot, PLACE, 0, SENSORS) as sim:
        view = rendered_view(sim, np.random.default_rng(1), past, PLACE, PERIOD)
    raw = cast(FlowProcessor, flow_processor).compute(view.pair)
    flow = refine(raw, robot.camera).apply(raw, robot.camera)
    return OfficeReading(view, flow, cast(Perception, offis).perceive(flow, view.twist))


# --- figures ---------------------------------------------------------------------------------


def draw_cells(reading: OfficeReading) -> Figure:
    """Image with flow, nearness, and labels."""
    figure = Figure(figsize=(11.0, 3.1), layout="constrained")
    flow, percept = reading.flow, reading.percept
    left, middle, right = figure.subplots(1, 3)
    _show_image(left, reading, "image, and flow three times as long")
    tails = flow.points - 3.0 * flow.vectors
    arrows = np.concatenate([tails, 3.0 * flow.vectors], axis=-1)[flow.confidence > 0.15]
    left.quiver(*arrows.T, angles="xy", scale_units="xy", scale=1.0, color="#ffd54f", width=0.005)
    _show_image(middle, reading, "nearness [1/m]")
    nearness = np.where(percept.confidence > 0.15, percept.nearness, np.nan)
    shown = middle.imshow(
        nearness, extent=_extent(reading), cmap="magma", alpha=0.8, vmin=0.0, vmax=1.5
    )
    figure.colorbar(shown, ax=middle, shrink=0.8)
    _show_image(right, reading, "what each cell shows")
    colors = ListedColormap([LABELS[label] for label in Label])
    right.imshow(
        percept.label, extent=_extent(reading), cmap=colors, alpha=0.6, vmin=-0.5, vmax=4.5
    )
    for label in sorted(set(percept.label.ravel().tolist())):
        known = Label(label)
        right.plot([], [], "s", color=LABELS[known], label=known.name.lower())
    right.legend(loc="lower right", fontsize=8, framealpha=0.9)
    for name, (row, col) in CELLS.items():
        x, y = flow.points[row, col]
        for axes in (left, middle, right):
            axes.plot(x, y, "o", mfc="none", mec="white", mew=2, ms=11)
        right.annotate(name, (x, y), (6, 8), textcoords="offset points", color="white")
    return figure


def draw_inference(reading: OfficeReading) -> Figure:
    """Quadrants with their distances and slopes, and the degrees of what is in front."""
    figure = Figure(figsize=(11.0, 3.1), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.5))
    _show_image(left, reading, "quadrants, distances, slopes")
    low, high, bottom, top = _extent(reading)
    left.axhline(0.0, color="white", lw=1)
    left.axvline(0.0, color="white", lw=1)
    distances = reading.percept.explain()["distance"]
    for name, (x, y) in {
        "P1": (high, top),
        "P2": (low, top),
        "P3": (low, bottom),
        "P4": (high, bottom),
    }.items():
        term = max(reading.percept.quadrants[name].items(), key=lambda item: item[1])[0]
        text = f"{name}: {distances[name]['inputs']['distance']:.2f} m, {term}"
        left.text(x / 2, 0.8 * y, text, ha="center", bbox={"fc": "white", "alpha": 0.85})
    for side, x in (("left", low), ("right", high)):
        code = reading.percept.slopes[side]
        left.text(
            x / 2, 0.0, f"{side} plane {code}", ha="center", va="center", bbox={"fc": "#fff3c4"}
        )
    degrees = {name: value for name, value in reading.percept.situations.items() if value > 0.0}
    names = sorted(degrees, key=lambda name: degrees[name])
    right.barh(names, [degrees[name] for name in names], color="#0072b2")
    for row, name in enumerate(names):
        right.text(min(degrees[name] + 0.02, 0.9), row, f"{degrees[name]:.2f}", va="center")
    right.set(xlim=(0, 1), title="degrees of the situations in front")
    return figure


def _show_image(axes: Axes, reading: OfficeReading, title: str) -> None:
    axes.imshow(reading.view.pair.now.image, cmap="gray", extent=_extent(reading), vmin=0, vmax=255)
    axes.set(title=title, xticks=[], yticks=[])


def _extent(reading: OfficeReading) -> tuple[float, float, float, float]:
    """The image's borders [px, relative to the principal point]: left, right, bottom, top."""
    height, width = reading.view.pair.now.image.shape
    return -0.5 * width, 0.5 * width, 0.5 * height, -0.5 * height


# --- numbers ---------------------------------------------------------------------------------


def renewed(text: str, reading: OfficeReading) -> str:
    """The page with the numbers of ``reading`` between its marks."""
    parts = {
        "cells": cells_table(reading),
        "inference": inference_table(reading.percept.explain()),
        "sentence": f"> {reading.percept.sentence}\n",
    }
    return _PART.sub(lambda match: match[1] + parts[match[2]] + match[3], text)


def cells_table(reading: OfficeReading) -> str:
    """The way from flow to label of the cells that the page follows."""
    flow, percept = reading.flow, reading.percept
    rows = {
        "point of the image [px]": lambda cell: "({:.0f}, {:.0f})".format(*flow.points[cell]),
        "derotated flow [px]": lambda cell: "({:.2f}, {:.2f})".format(*flow.vectors[cell]),
        "nearness [1/m]": lambda cell: f"{percept.nearness[cell]:.2f} ± {percept.sigma[cell]:.2f}",
        "distance ahead [m]": lambda cell: f"{1.0 / percept.nearness[cell]:.2f}",
        "height above the floor [m]": lambda cell: f"{percept.height[cell]:.2f}",
        "label": lambda cell: Label(int(percept.label[cell])).name.lower(),
    }
    lines = ["| | " + " | ".join(CELLS) + " |", "|---|" + "---|" * len(CELLS)]
    for name, value in rows.items():
        lines.append(f"| {name} | " + " | ".join(value(cell) for cell in CELLS.values()) + " |")
    return "\n".join(lines) + "\n"


def inference_table(explanation: Mapping[str, Any]) -> str:
    """The inferences that lead to the sentence: inputs, and rules that fired."""
    inferences = {
        "distance of P2": explanation["distance"]["P2"],
        "slope of the left plane": explanation["slope"]["left"],
        "slope of the right plane": explanation["slope"]["right"],
        "situation": explanation["situation"],
        "front": explanation["front"],
    }
    lines = ["| inference | inputs | rules that fired |", "|---|---|---|"]
    for name, inference in inferences.items():
        inputs = ", ".join(f"`{key}` {value:.2f}" for key, value in inference["inputs"].items())
        lines.append(f"| {name} | {inputs} | {_rules(inference['rules'])} |")
    return "\n".join(lines) + "\n"


def _rules(fired: Sequence[Mapping[str, Any]]) -> str:
    return "<br>".join(f"{rule['strength']:.2f} {rule['rule']}" for rule in fired)


def main() -> None:
    """Write the figures and the page."""
    reading = read_office()
    draw_cells(reading).savefig(DOCS / "images" / "offis-cells.png", dpi=90)
    draw_inference(reading).savefig(DOCS / "images" / "offis-inference.png", dpi=90)
    page = DOCS / "offis.md"
    page.write_text(renewed(page.read_text(encoding="utf-8"), reading), encoding="utf-8")


if __name__ == "__main__":
    main()
