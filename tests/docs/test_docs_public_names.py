"""Examples, pages and templates import public names alone; the cells of the notebook run."""

from __future__ import annotations

import ast
import importlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import pytest
from architecture_sources import imports
from docs_pages import PAGES, ROOT, blocks_of

PUBLIC = ("navfw", "navfw.gym", "navfw.testing")
"""The modules that others import; all else in navfw is inner (docs/decisions/0138)."""

TEMPLATES = ROOT / "navfw" / "scaffold" / "templates"


def sources() -> Iterator[tuple[str, str]]:
    """Code that a user reads, runs or gets as a beginning: where it stands, and its text."""
    scripts = [*(ROOT / "examples").glob("*.py"), *(ROOT / "behaviors").glob("*.py")]
    for path in [*scripts, *TEMPLATES.rglob("*.py.template")]:
        yield path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")
    for page in PAGES:
        for number, block in enumerate(blocks_of(page)):
            if block.language == "python":
                yield f"{page.relative_to(ROOT).as_posix()}, block {number}", block.text
    for cell in json.loads((ROOT / "docs" / "python.ipynb").read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            yield "docs/python.ipynb", "".join(cell["source"])


def wrong_imports(text: str) -> Iterator[str]:
    for module, name in imports(ast.parse(text)):
        if module.partition(".")[0] != "navfw":
            continue
        if module not in PUBLIC:
            yield f"{module} is an inner module"
        elif name is not None and name not in vars(importlib.import_module(module))["__all__"]:
            yield f"{module} has no public name {name}"


def test_no_inner_module_is_imported() -> None:
    texts = list(sources())
    assert len(texts) > 40
    wrong = [f"{where}: {what}" for where, text in texts for what in wrong_imports(text)]
    assert wrong == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("from navfw.stack import Stack", "navfw.stack is an inner module"),
        ("import navfw.signals", "navfw.signals is an inner module"),
        ("def f():\n    from navfw import Stuck", "navfw has no public name Stuck"),
    ],
)
def test_an_inner_import_is_found(text: str, message: str) -> None:
    assert list(wrong_imports(text)) == [message]
    assert list(wrong_imports("import navfw.gym\nfrom navfw import Stack\nimport numpy")) == []


def test_the_public_names_are_those_of_the_stubs() -> None:
    for module in PUBLIC:
        stub = Path(importlib.import_module(module).__file__ or "").with_suffix(".pyi")
        listed = [
            alias
            for node in ast.parse(stub.read_text(encoding="utf-8")).body
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        ]
        assert all(alias.name == alias.asname for alias in listed), module
        names = [alias.name for alias in listed]
        assert sorted(set(names)) == sorted(names)
        assert all(getattr(importlib.import_module(module), name) is not None for name in names)


# --- the notebook --------------------------------------------------------------------------------


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
