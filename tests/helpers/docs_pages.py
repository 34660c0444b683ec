"""The pages of the README and the docs, and what they contain: files, links, tables."""

import importlib.util
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from cli_calls import put_files

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
PAGES += sorted((ROOT / "docs").rglob("*.md"))
PAGES += [ROOT / "benchmarks" / name for name in ("README.md", "results.md", "real-frames.md")]

# **`path/of/file`** with words behind it or not, then (perhaps after a paragraph) its fenced text
_FILE = re.compile(r"^\*\*`([\w./-]+)`\*\*[^`]*?^```\w+\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"\]\(([^)\s]+)\)")
_FENCED = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"^\$ (?:uv run )?navfw (.+?)(?:  +#.*)?$", re.MULTILINE)


def files_of(page: Path) -> dict[str, str]:
    """The files that a page asks its reader to write: text by path."""
    return dict(_FILE.findall(page.read_text(encoding="utf-8")))


def write_files(folder: Path) -> None:
    """Make ``folder`` a project with the files of all pages."""
    (folder / "navfw.toml").touch()
    for page in PAGES:
        put_files(folder, files_of(page))


class DocBlock(NamedTuple):
    """A fenced block: the page's name, the language, the text; ``file`` if it is one to write."""

    page: str
    language: str
    text: str
    file: str | None

    @property
    def first(self) -> str:
        """Its first line."""
        return self.text.partition("\n")[0].strip()


def blocks_of(page: Path) -> list[DocBlock]:
    """The fenced blocks of a page, in order."""
    names = {text: name for name, text in files_of(page).items()}
    found = _FENCED.findall(page.read_text(encoding="utf-8"))
    return [DocBlock(page.name, language, text, names.get(text)) for language, text in found]


def commands(page: Path) -> list[list[str]]:
    """The words of all commands of navfw on a page, without ``navfw``."""
    return [line.split() for line in COMMAND.findall(page.read_text(encoding="utf-8"))]


def links(page: Path) -> list[str]:
    """The targets of all links of a page."""
    return [str(link) for link in _LINK.findall(without_code(page.read_text(encoding="utf-8")))]


def table(page: Path, heading: str) -> str:
    """The rows of the table under a heading whose first cell is code."""
    text = page.read_text(encoding="utf-8")
    body = re.split(r"\n##+ ", text.split(f"\n{heading}\n", 1)[1])[0]
    return "\n".join(line for line in body.splitlines() if line.startswith("| `"))


def without_code(text: str) -> str:
    """``text`` without its fenced blocks."""
    return re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)


def anchors(page: Path) -> Iterator[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    for line in without_code(page.read_text(encoding="utf-8")).splitlines():
        if line.startswith("#"):
            words = re.sub(r"[^\w\s-]", "", line.lstrip("#").strip().lower())
            yield re.sub(r"\s", "-", words)


def execute(code: str, page: str, /, **names: Any) -> dict[str, Any]:
    """``names`` after the ``code`` of a page was executed with them."""
    exec(compile(code, page, "exec"), names)  # noqa: S102 - our own page
    return names


def load_module(file: Path) -> ModuleType:
    """The module in ``file``, which need not be on the path."""
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
