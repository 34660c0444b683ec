"""The notebook: its cells run in order, and draw what they say."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import pytest

NOTEBOOK = Path(__file__).parents[2] / "docs" / "python.ipynb"


def test_the_cells_of_the_notebook_run(capsys: pytest.CaptureFixture[str]) -> None:
    book = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    cells = ["".join(c["source"]) for c in book["cells"] if c["cell_type"] == "code"]
    assert [c for c in book["cells"] if c.get("outputs")] == [], "clear all outputs"
    names: dict[str, Any] = {}
    plt.switch_backend("agg")
    try:
        for number, cell in enumerate(cells):
            exec(compile(cell, f"{NOTEBOOK.name}, cell {number}", "exec"), names)  # noqa: S102
        titles = [axes.get_title() for n in plt.get_fignums() for axes in plt.figure(n).axes]
        assert len(plt.get_fignums()) == 3
        assert "camera and flow" in titles
    finally:
        plt.close("all")
    printed = capsys.readouterr().out
    assert names["tick"].percept.sentence in printed
    paths = [run.run.log.true for run in names["runs"].values()]
    assert all(len(path) > 100 for path in paths)
    assert names["runs"]["default"].run.log.command_hash != names["result"].run.log.command_hash
