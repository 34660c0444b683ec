"""The pages of the README and the docs: links, tables, lengths, decisions, glossary."""

import ast
import importlib
import re
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from docs_pages import PAGES, ROOT, anchors, links, load_module, table, without_code
from pydantic import BaseModel

from navfw import Context, Proposal
from navfw.signals import Conflicts
from navfw.testing import SCENES, contexts_of

DOCS = ROOT / "docs"
DECISIONS = sorted((DOCS / "decisions").glob("[0-9]*.md"))
NO_CONFLICTS = Conflicts(np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)), 0.0)
PARTS = ("Context", "Decision", "Rejected", "Measured")


def test_every_link_leads_somewhere() -> None:
    all_links = ((page, link) for page in PAGES for link in links(page))
    assert [(p.name, link) for p, link in all_links if not _leads_somewhere(p, link)] == []


def test_the_tables_of_keys_are_those_of_the_models() -> None:
    tables = load_module(DOCS / "update_tables.py")
    for page in sorted(DOCS.glob("*.md")):
        text = page.read_text(encoding="utf-8")
        assert tables.renewed(text) == text, "run: uv run python docs/update_tables.py"


def test_every_path_that_a_page_names_exists() -> None:
    named = r"`(navfw/[\w./-]*)`"
    missing = [
        (page.name, name)
        for page in PAGES
        for name in re.findall(named, without_code(page.read_text(encoding="utf-8")))
        if not (ROOT / name).exists()
    ]
    assert missing == []


def test_the_page_on_the_architecture_is_short() -> None:
    architecture = (DOCS / "architecture.md").read_text(encoding="utf-8")
    assert len(architecture.split()) <= 1200


def test_the_architecture_has_every_room() -> None:
    rows = table(DOCS / "architecture.md", "## The rooms").splitlines()
    named = re.findall(r"`([\w/.]+)`", "\n".join(row.split("|")[1] for row in rows))
    assert [name for name in named if not (ROOT / name).exists()] == []
    rooms = {f"navfw/{path.parent.name}/" for path in (ROOT / "navfw").glob("*/__init__.py")}
    assert rooms - set(named) == set()


def test_the_page_on_stack_files_has_every_stack() -> None:
    page = (DOCS / "stack-file.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`.*?`) \| (?!`)", page[page.index("| stack | what it is |") :], re.M)
    listed = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    stacks = {file.stem for file in (ROOT / "navfw" / "stack" / "stacks").glob("*.yaml")}
    assert stacks - listed == set()


def test_the_guide_to_behaviours_has_all_that_they_know_and_return() -> None:
    knows, returns = "## What a behaviour may know: Context", "## What it returns: Proposal"
    for kind, heading in ((Context, knows), (Proposal, returns)):
        rows = table(DOCS / "behaviors.md", heading).splitlines()
        first = set(re.findall(r"`(\w+)`", "\n".join(row.split("|")[1] for row in rows)))
        assert first == {field.name for field in fields(kind)} | (first & vars(kind).keys())
    scene = next(scene for scene in SCENES if scene.name == "open floor")
    context = replace(contexts_of(scene)[-1], conflicts=NO_CONFLICTS)
    rows = table(DOCS / "behaviors.md", knows).splitlines()
    parts = set(re.findall(r"`(\w+)\.(\w+)[`(]", "\n".join(rows)))
    assert len(parts) > 25
    for name, part in parts:
        assert hasattr(getattr(context, name), part), f"{name}.{part}"


@pytest.mark.parametrize(
    "name",
    ["commands.md", "behaviors.md", "rules.md", "mission-tests.md", "plugins.md", "worlds.md"],
)
def test_the_keys_and_names_of_a_guide_occur_in_the_code(name: str) -> None:
    text = without_code((DOCS / name).read_text(encoding="utf-8"))
    named = set(re.findall(r"`([a-z]+(?:_[a-z]+)*)`", text))
    folders = ("navfw", "benchmarks", "behaviors", "worlds", "maps")
    files = [file for folder in folders for file in (ROOT / folder).rglob("*.[py]*")]
    known = set(re.findall(r"\w+", "\n".join(_text(file) for file in files if file.is_file())))
    assert sorted(named - known) == []


def _text(file: Path) -> str:
    return file.read_text(encoding="utf-8") if file.suffix in {".py", ".yaml"} else ""


def test_every_section_of_a_file_has_its_table_of_keys() -> None:
    text = "".join(
        (DOCS / name).read_text(encoding="utf-8") for name in ("files.md", "stack-file.md")
    )
    documented = {
        getattr(importlib.import_module(module), name)
        for module, name in re.findall(r"<!-- keys: ([\w.]+):(\w+) -->", text)
    }
    nested = {part for model in documented for part in _models_below(model)}
    assert len(nested) > 20
    # a table of a model has the keys of those that it extends
    shown = {base for model in documented for base in model.__mro__}
    assert {model.__name__ for model in nested - shown} == set()


def _models_below(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    """The models of the keys of ``model``."""
    waiting: list[Any] = [field.annotation for field in model.model_fields.values()]
    while waiting:
        annotation = waiting.pop()
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            yield annotation
        waiting += get_args(annotation)


def test_the_glossary_is_in_order_and_complete_in_every_line() -> None:
    rows = [[cell.strip() for cell in row.split("|")[1:-1]] for row in _glossary()]
    assert {len(row) for row in rows} == {4}
    terms = [row[0].strip("`").lower() for row in rows]
    assert terms == sorted(terms)
    assert len(terms) == len(set(terms)) > 80
    assert [term for term, meaning, *_ in rows if not meaning] == []


def test_the_classes_and_functions_of_the_glossary_exist() -> None:
    named = set(re.findall(r"\(`(\w+)`(?:, `(\w+)`)*\)", "\n".join(_glossary())))
    names = {name for pair in named for name in pair if name}
    assert len(names) > 40
    assert names - _definitions() == set()


def _glossary() -> list[str]:
    text = (DOCS / "glossary.md").read_text(encoding="utf-8")
    return re.findall(r"^\| (?!term |---)(?=.*\|).*$", text, re.MULTILINE)


def _definitions() -> set[str]:
    """The names of all classes and functions of navfw."""
    return {
        node.name
        for file in (ROOT / "navfw").rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef | ast.FunctionDef)
    }


def test_every_decision_is_in_the_index_by_its_title() -> None:
    index = (DOCS / "decisions" / "README.md").read_text(encoding="utf-8")
    listed = re.findall(r"^- \[(\d{4})\]\((\S+)\) (.+)$", index, re.MULTILINE)
    records = []
    for page in DECISIONS:
        number, title = page.name[:4], page.read_text(encoding="utf-8").splitlines()[0]
        assert title.startswith(f"# {int(number)}. ")
        records.append((number, page.name, title.split(". ", 1)[1]))
    assert len(records) > 30
    # the index lists them by subject; a number that is missing was merged into another record
    assert sorted(listed) == records


def test_every_decision_that_code_or_text_names_is_a_record() -> None:
    numbers = {int(page.name[:4]) for page in DECISIONS}
    folders = ("navfw", "behaviors", "worlds", "examples", "tests", "docs")
    files = [file for folder in folders for file in (ROOT / folder).rglob("*")]
    files += [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "pyproject.toml"]
    missing = []
    for file in files:
        if file.suffix in {".py", ".md", ".yaml", ".toml", ".ipynb"}:
            named = re.findall(r"[Dd]ecision\s+(\d+)\b", file.read_text(encoding="utf-8"))
            missing += [(file.name, number) for number in named if int(number) not in numbers]
    assert missing == []


def test_decisions_are_short_and_have_all_their_parts() -> None:
    for page in DECISIONS:
        text = page.read_text(encoding="utf-8")
        assert tuple(re.findall(r"^\*\*(\w+)\.\*\* ", text, re.MULTILINE)) == PARTS, page.name
        assert len(text.split()) <= 400, page.name


def _leads_somewhere(page: Path, link: str) -> bool:
    if "://" in link:
        return link.startswith("https://")
    path, _, anchor = link.partition("#")
    target = (page.parent / path).resolve() if path else page
    if not target.exists() or ROOT not in target.parents:
        return False
    return not anchor or anchor in set(anchors(target))
