"""Results of ``navfw.bench.flow_accuracy`` as Markdown tables and a plot."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

SIGMA_BINS = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8, np.inf)
"""Limits [px] of the intervals of sigma in the calibration table."""


def table(result: dict[str, Any]) -> str:
    """Tables of all processors, of their errors by motion, and of the calibration of sigma."""
    processors: dict[str, dict[str, Any]] = result["processors"]
    head = ["processor", "trusted", "median", "95 %", "> 0.5 px", "within 2 sigma", "ms"]
    lines = [
        f"End-point errors [px] on {result['pairs']} rendered pairs"
        f" ({', '.join(result['worlds'])}), of vectors with confidence"
        f" {result['trusted_from']} or more:",
        "",
        *_rows(
            head,
            (
                [
                    name,
                    f"{100 * p['coverage']:.0f} %",
                    _number(p["epe_median"]),
                    _number(p["epe_p95"]),
                    _percent(p["over_half_px"]),
                    _percent(p["within_2_sigma"]),
                    _number(p["ms"]),
                ]
                for name, p in processors.items()
            ),
        ),
        "",
        "Median / 95 % by motion between the frames:",
        "",
        *_rows(
            ["motion", *processors],
            (
                [
                    motion,
                    *(
                        f"{_number(p['by_motion'][motion]['epe_median'])} /"
                        f" {_number(p['by_motion'][motion]['epe_p95'])}"
                        for p in processors.values()
                    ),
                ]
                for motion in result["motions"]
            ),
        ),
        "",
        "Root mean square error of the components [px], and the share within two sigma, by"
        " the processor's sigma:",
        "",
        *_rows(["sigma [px]", *processors], _calibration_rows(processors)),
    ]
    return "\n".join(lines) + "\n"


def _calibration_rows(processors: dict[str, dict[str, Any]]) -> Iterable[list[str]]:
    for low, high in itertools.pairwise(SIGMA_BINS):
        cells = []
        for p in processors.values():
            found = [row for row in p["calibration"] if row["sigma_from"] == low]
            cells.append(
                f"{found[0]['rms']:.2f}, {_percent(found[0]['within_2_sigma'])}" if found else "-"
            )
        yield [f"{low:g} to {high:g}" if np.isfinite(high) else f"above {low:g}", *cells]


def _rows(head: Sequence[str], body: Iterable[Sequence[str]]) -> list[str]:
    lines = [head, ["---"] * len(head), *body]
    return ["| " + " | ".join(cells) + " |" for cells in lines]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f} %"


def plot(result: dict[str, Any], path: str | Path) -> None:
    """Plot error over time, errors by motion, and calibration into the file ``path``."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    processors: dict[str, dict[str, Any]] = result["processors"]
    figure = Figure(figsize=(13.0, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    cost, motion, calibration = figure.subplots(1, 3)
    colours = {name: f"C{k}" for k, name in enumerate(processors)}
    for name, p in processors.items():
        if p["epe_median"] is None:
            continue
        low, high = p["epe_median"], p["epe_p95"]
        cost.plot([p["ms"]] * 2, [low, high], "-", color=colours[name], linewidth=1)
        cost.plot(p["ms"], low, "o", color=colours[name], label=name)
        cost.plot(p["ms"], high, "_", color=colours[name], markersize=10)
        values = [p["by_motion"][m]["epe_p95"] for m in result["motions"]]
        motion.plot(range(len(values)), values, "o-", color=colours[name], markersize=3)
        rows = [row for row in p["calibration"] if row["sigma_to"] and row["n"] >= 50]
        calibration.plot(
            [0.5 * (row["sigma_from"] + row["sigma_to"]) for row in rows],
            [row["rms"] for row in rows],
            "o-",
            color=colours[name],
            markersize=3,
        )
    cost.set(
        xlabel="CPU time [ms]",
        ylabel="end-point error [px]: median to 95 %",
        xscale="log",
        yscale="log",
    )
    cost.legend(fontsize=7)
    motion.set_xticks(range(len(result["motions"])), result["motions"], rotation=60, fontsize=7)
    motion.set(ylabel="95 % of errors below [px]")
    limits = [0.02, 1.0]
    calibration.plot(limits, limits, "k--", linewidth=0.8)
    calibration.set(xlabel="sigma of the processor [px]", ylabel="root mean square error [px]")
    calibration.set(xscale="log", yscale="log")
    for axes in (cost, motion, calibration):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)
