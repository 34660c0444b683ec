"""The site of the documentation: built without warnings, with every page and every public name."""

from __future__ import annotations

import inspect
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from docs_pages import ROOT, load_module
from processes import run

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
    assert "](docs/" not in "".join(
        made.read_text(encoding="utf-8") for made in (assembled / "pages").glob("*.md")
    )


def test_the_options_of_every_command_are_on_the_site(assembled: Path) -> None:
    text = (assembled / "pages" / "options.md").read_text(encoding="utf-8")
    assert {"`navfw run`", "`navfw map build`"} <= set(re.findall(r"^#+ (.*)$", text, re.M))
    assert "* `--seed" in text


def test_the_site_is_built_without_a_warning(builder: ModuleType, tmp_path: Path) -> None:
    pytest.importorskip("zensical", reason="needs the group docs: uv sync --group docs")
    command = [sys.executable, str(DOCS / "build_site.py"), "--out", str(tmp_path / "site")]
    done = run(command)
    assert done.returncode == 0, done.stdout + done.stderr
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
