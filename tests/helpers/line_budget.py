"""Whether each folder keeps its budget of lines, in ``pyproject.toml``: a part of ``make check``.

A decision record raises a budget, with the reason; nothing else does.
"""

import sys
import tomllib
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).parents[2]
MEASURED = ("behaviors", "docs", "examples", "navfw", "tests")


def sizes() -> Mapping[str, int]:
    """Lines of Python by folder, with words of Markdown, and files and entries of navfw."""
    counts: Counter[str] = Counter()
    for path in (path for folder in MEASURED for path in (ROOT / folder).rglob("*.py")):
        folders = path.relative_to(ROOT).parts[:-1]
        counts["/".join(folders[: 1 + (folders[0] == "navfw")])] += _lines(path)
        counts[f"{folders[0]}, all lines"] += _lines(path)
        counts[f"{folders[0]}, files"] += 1
    entries = {path.name for path in (ROOT / "navfw").iterdir()} - {"__pycache__"}
    counts["navfw, entries"] = len(entries)
    counts["README.md, words"] = _words(ROOT / "README.md")
    counts["docs, words"] = sum(map(_words, (ROOT / "docs").rglob("*.md")))
    return counts


def exceeded(counts: Mapping[str, int], budgets: Mapping[str, int]) -> list[str]:
    """What is above its budget; a folder of navfw without a budget is."""
    return [
        f"{name}: {count}, budget {budgets.get(name, 'missing')}"
        for name, count in sorted(counts.items())
        if count > budgets.get(name, 0) and (name in budgets or name.startswith("navfw/"))
    ]


def _lines(path: Path) -> int:
    return len(path.read_text(encoding="utf-8").splitlines())


def _words(path: Path) -> int:
    return len(path.read_text(encoding="utf-8").split())


def main() -> int:
    """Print what is above its budget; 1 if there is anything."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    above = exceeded(sizes(), settings["tool"]["line-budget"])
    if above:
        print("above the budgets of [tool.line-budget] in pyproject.toml:", *above, sep="\n  ")
        print("make it smaller, or raise the budget with a decision record that says why")
    return 1 if above else 0


if __name__ == "__main__":
    sys.exit(main())
