"""The site, built without warnings; the page on OFFIS, whose numbers are those of its view."""

import inspect
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import cv2
import numpy as np
import pytest
from docs_pages import ROOT, load_module
from processes import run

from navfw.fuzzy import load_rule_base

DOCS = ROOT / "docs"


@pytest.fixture(scope="module")
def builder() -> ModuleType:
    return load_module(DOCS / "build_site.py")


@pytest.fixture(scope="module")
def assembled(builder: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that the generator builds the site from."""
    folder = tmp_path_factory.mktemp("site")
    builder.assemble(folder)
    return folder


def pages_of(entries: list[dict[str, Any]]) -> Iterator[str]:
    """The pages of a navigation, in its order."""
    for entry in entries:
        for target in entry.values():
            if isinstance(target, str):
                yield target
            else:
                yield from pages_of(target)


def test_the_navigation_has_every_page_once(assembled: Path) -> None:
    config = tomllib.loads((assembled / "zensical.toml").read_text(encoding="utf-8"))
    listed = list(pages_of(config["project"]["nav"]))
    pages = assembled / "pages"
    found = {str(page.relative_to(pages)) for page in pages.rglob("*.md")}
    # the page on the architecture leads to the index of the decisions, and that to each of them
    assert "](decisions/README.md)" in (pages / "architecture.md").read_text(encoding="utf-8")
    found -= {name for name in found if name.startswith("decisions/")}
    assert sorted(listed) == sorted(found)


def test_the_readme_is_on_the_site(assembled: Path) -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    page = (assembled / "pages" / "first-run.md").read_text(encoding="utf-8")
    assert page.startswith("# Commands\n")
    commands = re.findall(r"^\| `navfw.*?\|", readme, re.MULTILINE)
    assert re.findall(r"^\| `navfw.*?\|", page, re.MULTILINE) == commands != []
    for made in (assembled / "pages").glob("*.md"):
        assert "](docs/" not in made.read_text(encoding="utf-8"), made.name


def test_the_options_of_every_command_are_on_the_site(assembled: Path) -> None:
    text = (assembled / "pages" / "options.md").read_text(encoding="utf-8")
    assert {"`navfw run`", "`navfw map build`"} <= set(re.findall(r"^#+ (.*)$", text, re.M))
    assert "* `--seed" in text


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(builder: ModuleType, tmp_path: Path) -> None:
    pytest.importorskip("zensical", reason="needs the group docs: uv sync --group docs")
    run([sys.executable, DOCS / "build_site.py", "--out", tmp_path / "site"], check=True)
    api = (tmp_path / "site" / "api.html").read_text(encoding="utf-8")
    anchors = set(re.findall(r'<h3 id="[\w.]+\.(\w+)"', api))
    names = ((module, name) for module in builder.API_MODULES for name in module.__all__)
    values = {name: getattr(module, name) for module, name in names}
    # names of types and of tables have no docstring of their own
    public = {n for n, v in values.items() if inspect.isclass(v) or inspect.isroutine(v)}
    assert len(public) > 80
    assert public - anchors == set()
    # neither fonts nor scripts come from a server
    assert re.findall(r'<(?:script|link)[^>]+(?:src|href)="https?:', api) == []


# --- curves of rules -----------------------------------------------------------------------------


def test_the_curves_are_those_of_the_shipped_rules(tmp_path: Path) -> None:
    drawing = load_module(DOCS / "draw_rules.py")
    for name in drawing.DRAWN:
        base = load_rule_base(DOCS.parent / "behaviors" / f"{name}.yaml")
        drawing.draw_rule_base(base).savefig(tmp_path / "drawn.png", dpi=110)
        drawn, kept = (
            np.asarray(cv2.imread(str(file)), dtype=np.float64)
            for file in (tmp_path / "drawn.png", drawing.picture_of(name))
        )
        assert drawn.shape == kept.shape
        assert np.abs(drawn - kept).mean() < 1.0, "run: uv run python docs/draw_rules.py"


# --- the page on OFFIS ---------------------------------------------------------------------------


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
    for degree in (0.78, 0.22, 0.92, 0.08):
        assert f"{degree}" in drawing.inference_table(explained)
    assert len(text.split()) < 1050


def test_the_figures_are_those_of_the_view(
    drawing: ModuleType, reading: Any, tmp_path: Path
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
    single = {name: value for name, value in percept.situations.items() if " or " not in name}
    assert single["door"] == max(single.values())
    assert dict(percept.slopes) == {"left": "[3 1]", "right": "[1 3]"}
