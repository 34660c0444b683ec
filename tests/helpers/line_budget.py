"""Whether each top-level folder keeps within its limit of lines or words; part of ``make check``.

A limit goes down when a folder got smaller; it goes up only by a number that an issue grants.
"""

import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

ROOT = Path(__file__).parents[2]
LIMITS = {
    "navfw/, lines of Python": 79360,
    "navfw/, lines of stubs": 266,
    "navfw/, lines of scripts, pages, styles and templates": 2470,
    "behaviors/, lines of Python": 1550,
    "examples/, lines of Python": 1004,
    "benchmarks/, lines of Python, pages and stubs": 7766,
    "tests/, lines of Python": 54059,
    "docs/, words": 44990,
    "README.md, words": 900,
    "pyproject.toml, lines": 309,
}
"""What each folder may have."""


def counts(root: Path = ROOT) -> Mapping[str, int]:
    """What each folder has, by the names of ``LIMITS``; empty lines and comments count too."""
    navfw = root / "navfw"
    return {
        "navfw/, lines of Python": _lines(navfw, ".py"),
        "navfw/, lines of stubs": _lines(navfw, ".pyi"),
        "navfw/, lines of scripts, pages, styles and templates": _lines(
            navfw, ".js", ".html", ".css", ".template"
        ),
        "behaviors/, lines of Python": _lines(root / "behaviors", ".py"),
        "examples/, lines of Python": _lines(root / "examples", ".py"),
        "benchmarks/, lines of Python, pages and stubs": _lines(
            root / "benchmarks", ".py", ".pyi", ".html"
        ),
        "tests/, lines of Python": _lines(root / "tests", ".py"),
        "docs/, words": _words((root / "docs").rglob("*.md")),
        "README.md, words": _words([root / "README.md"]),
        "pyproject.toml, lines": len(_text(root / "pyproject.toml").splitlines()),
    }


def exceeded(counted: Mapping[str, int], limits: Mapping[str, int] = LIMITS) -> list[str]:
    """What is above its limit."""
    return [
        f"{name}: {counted[name]}, limit {limit}"
        for name, limit in limits.items()
        if counted[name] > limit
    ]


def _lines(folder: Path, *suffixes: str) -> int:
    paths = (path for path in folder.rglob("*") if path.suffix in suffixes)
    return sum(len(_text(path).splitlines()) for path in paths)


def _words(paths: Iterable[Path]) -> int:
    return sum(len(_text(path).split()) for path in paths)


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def main() -> int:
    """Print the table, and what is above its limit; 1 if there is anything."""
    counted = counts()
    for name, limit in LIMITS.items():
        print(f"{counted[name]:>7} of {limit:>6}  {name}")
    above = exceeded(counted)
    if above:
        print("above the limits in tests/helpers/line_budget.py:", *above, sep="\n  ")
        print("make it smaller; only an issue raises a limit")
    return 1 if above else 0


if __name__ == "__main__":
    sys.exit(main())
