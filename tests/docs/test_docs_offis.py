"""The page on OFFIS: its numbers and figures are those of the view that it follows."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import cv2
import numpy as np
import pytest
from docs_pages import ROOT, load_module

DOCS = ROOT / "docs"


@pytest.fixture(scope="module")
def drawing() -> ModuleType:
    return load_module(DOCS / "draw_offis.py")


@pytest.fixture(scope="module")
def reading(drawing: ModuleType) -> Any:
    return drawing.read_office()


def test_the_numbers_of_the_page_are_those_of_the_view(drawing: ModuleType, reading: Any) -> None:
    text = (DOCS / "offis.md").read_text(encoding="utf-8")
    assert drawing.renewed(text, reading) == text, "run: uv run python docs/draw_offis.py"
    explained = reading.percept.explain()
    assert f"`gap`, {explained['slope']['right']['inputs']['gap']:.2f}:" in text
    for degree in (0.75, 0.25, 0.86, 0.14):
        assert f"{degree}" in drawing.inference_table(explained)
    assert len(text.split()) < 1000


def test_the_figures_are_those_of_the_view(
    drawing: ModuleType, reading: Any, tmp_path: Any
) -> None:
    for name, draw in (("cells", drawing.draw_cells), ("inference", drawing.draw_inference)):
        draw(reading).savefig(tmp_path / "drawn.png", dpi=90)
        drawn, kept = (
            np.asarray(cv2.imread(str(file)), dtype=np.float64)
            for file in (tmp_path / "drawn.png", DOCS / "images" / f"offis-{name}.png")
        )
        assert drawn.shape == kept.shape
        # lettering differs between versions of matplotlib
        assert np.abs(drawn - kept).mean() < 2.0, "run: uv run python docs/draw_offis.py"


def test_the_view_is_read_as_the_page_says(reading: Any) -> None:
    """A door ahead, both planes very sloped; the cells followed are of the wall and the floor."""
    percept = reading.percept
    assert percept.situations["door"] == max(
        value for name, value in percept.situations.items() if " or " not in name
    )
    assert dict(percept.slopes) == {"left": "[3 1]", "right": "[1 3]"}
