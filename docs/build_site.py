"""Build the site of the documentation, without warnings, into ``dist/site`` or ``--out``.

Its pages are those of this folder, two sections of the README, and pages made here: the Python API
from docstrings, the options of all commands, the notebook. The video, the camera's picture and the
report on the first page are those of a run that is driven for them. ``docs/zensical.toml`` has the
order of pages::

    uv run --group docs python docs/build_site.py
"""

from __future__ import annotations

import argparse
import inspect
import json
import posixpath
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import cv2
import typer
import typer.cli
import typer.main

import navfw
import navfw.testing
from navfw.cli import app

DOCS = Path(__file__).parent
ROOT = DOCS.parent

README_PAGES = {
    "index.md": "How it works",
    "first-run.md": "Commands",
}
"""The sections of the README that are pages of the site; the first one with what precedes it."""

PROJECT_PAGES = {
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "benchmarks/README.md": "benchmarks.md",
    "benchmarks/results.md": "results.md",
    "benchmarks/real-frames.md": "real-frames.md",
    "examples/ros/README.md": "ros-package.md",
    "QUALITY_DECLARATION.md": "quality.md",
    "SECURITY.md": "security.md",
}
"""Pages of the repository outside of this folder, with their names on the site."""

API_MODULES = {
    navfw: "The robot, missions and plugins",
    navfw.testing: "Tests of plugins and missions",
}
"""The public modules, each with the heading of its section; a name is shown once."""

SHOWN_RUN = ("paper-room", "--goal", "4.2,2.3", "--seed", "0")
"""The run that the first page shows: of ten seconds."""

LOOK = """## What it looks like

The camera with flow and the percept, beside the plan; a run of ten seconds:

<video src="shown-run.mp4" poster="shown-run.jpg" controls loop muted style="width: 100%"></video>

Every run has [a report](shown-run.html), one page without a server: its events, every command's
rating, and the rules behind it.

<iframe src="shown-run.html" title="Report of the run" loading="lazy"
  style="width: 100%; height: 36rem; border: 1px solid #8888"></iframe>

"""
"""What the first page shows of that run."""

_RECIPE = re.compile(r"^- \[(.+?)\]\((\.\./examples/.+?)\)$", re.MULTILINE)
"""A recipe in ``examples``, which the site has not: it shows the text instead."""

WORKER = "https://unpkg.com/iframe-worker/shim"
"""What the generator's offline search would load from a server, instead of ``file-worker.js``."""

_LINK = re.compile(r"(?<=\]\()(?!https?:)[^)#\s]+")


def assemble(folder: Path) -> None:
    """Write the configuration and all pages of the site to ``folder``."""
    pages = folder / "pages"
    shutil.copytree(DOCS, pages, ignore=shutil.ignore_patterns("*.py", "*.toml", "*.ipynb"))
    shutil.copy(DOCS / "zensical.toml", folder)
    for page in pages.rglob("*.md"):
        page.write_text(_relinked(f"docs/{page.relative_to(pages)}"), encoding="utf-8")
    for name in ("recipes.md", "paper.md"):
        text = (pages / name).read_text(encoding="utf-8")
        (pages / name).write_text(_RECIPE.sub(_shown, text), encoding="utf-8")
    made = {**dict(readme_pages()), "python.md": notebook_page(), "api.md": api_page()}
    for source, name in PROJECT_PAGES.items():
        made[name] = _relinked(source)
    made["options.md"] = options_page()
    for name, text in made.items():
        (pages / name).write_text(text, encoding="utf-8")


def _shown(recipe: re.Match[str]) -> str:
    """A recipe that is a file, with its text."""
    file = (DOCS / recipe[2]).resolve()
    language = "python" if file.suffix == ".py" else "yaml"
    text = file.read_text(encoding="utf-8")
    return f"### {recipe[1]}\n\n`{file.name}`:\n\n```{language}\n{text}```\n"


def readme_pages() -> Iterator[tuple[str, str]]:
    """The pages that are sections of the README: name and text."""
    first, *sections = re.split(r"^## ", _relinked("README.md"), flags=re.MULTILINE)
    by_heading = {section.partition("\n")[0]: section for section in sections}
    for name, heading in README_PAGES.items():
        if name == "index.md":
            yield name, f"{first}{LOOK}## {by_heading[heading]}"
        else:
            yield name, f"# {by_heading[heading]}"


def notebook_page() -> str:
    """The cells of the notebook, code as fenced blocks."""
    cells = json.loads((DOCS / "python.ipynb").read_text(encoding="utf-8"))["cells"]
    texts = [(cell["cell_type"], "".join(cell["source"])) for cell in cells]
    return "\n\n".join(
        f"```python\n{text}\n```" if kind == "code" else text for kind, text in texts
    )


def api_page() -> str:
    """The docstrings of all public names, by module."""
    parts = ["# Python API", "Generated from the docstrings. Units are SI and radians."]
    shown: set[object] = set()
    for module, heading in API_MODULES.items():
        parts.append(f"## {heading}\n\n`{module.__name__}`")
        for name in module.__all__:
            value = getattr(module, name)
            if not inspect.isroutine(value) and not inspect.isclass(value):
                continue
            if not value.__module__.startswith("navfw") or value in shown:
                continue
            shown.add(value)
            parts.append(f"::: {value.__module__}.{value.__qualname__}")
    return "\n\n".join(parts) + "\n"


def options_page() -> str:
    """Arguments and options of all commands, as ``--help`` has them."""
    command = typer.main.get_command(app)
    text = typer.cli.get_docs_for_click(
        obj=command, ctx=typer.Context(command), name="navfw", title="Options of all commands"
    )
    prose_and_code = str(text).split("`")
    prose_and_code[::2] = [prose.replace("[", "\\[") for prose in prose_and_code[::2]]
    return "`".join(prose_and_code)


def _relinked(page: str) -> str:
    """The text of a page of the repository, with the links that it has on the site."""

    def on_site(link: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(posixpath.dirname(page), link[0]))
        if target not in PROJECT_PAGES and not target.startswith("docs/"):
            return link[0]
        return posixpath.relpath(_place(target), posixpath.dirname(_place(page)) or ".")

    text = (ROOT / page).read_text(encoding="utf-8")
    return _LINK.sub(on_site, text).replace("[licence](LICENSE)", "licence")


def _place(path: str) -> str:
    """Where a page or picture of the repository is on the site."""
    return PROJECT_PAGES.get(path, path.removeprefix("docs/").replace(".ipynb", ".md"))


def drive(pages: Path) -> None:
    """Drive ``SHOWN_RUN``, and put its video, a picture of it and its report in ``pages``."""
    navfw_ = [sys.executable, "-m", "navfw"]
    video, picture = pages / "shown-run.mp4", pages / "shown-run.jpg"
    with tempfile.TemporaryDirectory() as made:
        run = Path(made) / "run"
        words: list[str | Path] = [
            *navfw_,
            "run",
            *SHOWN_RUN,
            "--record",
            "--quiet",
            "--out",
            run,
            "--video",
            video,
        ]
        report: list[str | Path] = [*navfw_, "report", run, "--out", pages / "shown-run.html"]
        for command in (words, report):
            subprocess.run(command, check=True)  # noqa: S603 - no shell
    frames = cv2.VideoCapture(str(video))
    frames.set(cv2.CAP_PROP_POS_FRAMES, frames.get(cv2.CAP_PROP_FRAME_COUNT) // 2)
    cv2.imwrite(str(picture), frames.read()[1])


def build(out: Path) -> int:
    """Build the site into ``out``, which is replaced; the exit code of the generator."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        assemble(folder)
        drive(folder / "pages")
        command = [sys.executable, "-m", "zensical", "build", "--strict", "--clean"]
        code = subprocess.run(command, cwd=folder, check=False).returncode  # noqa: S603 - no shell
        if code == 0:
            for page in (folder / "site").rglob("*.html"):
                up = "../" * (len(page.relative_to(folder / "site").parts) - 1)
                text = page.read_text(encoding="utf-8").replace(WORKER, f"{up}file-worker.js")
                page.write_text(text, encoding="utf-8")
            shutil.rmtree(out, ignore_errors=True)
            shutil.copytree(folder / "site", out)
    return code


def main() -> int:
    """Build the site; 0 if there was no warning."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "dist" / "site", help="folder to write")
    return build(parser.parse_args().out)


if __name__ == "__main__":
    sys.exit(main())
