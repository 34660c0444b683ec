"""Suite files of a test, and their plans."""

from pathlib import Path
from typing import Any

from navfw.plugins import default_registry
from navfw.suite import SuitePlan, load_suite, plan_runs


def suite_file(folder: Path, text: str) -> Path:
    """``mine.yaml`` in ``folder`` with this text."""
    file = folder / "mine.yaml"
    file.write_text(text)
    return file


def planned(folder: Path, text: str, seeds: range = range(1), **options: Any) -> SuitePlan:
    """The runs of a suite with this text."""
    return plan_runs(load_suite(suite_file(folder, text)), seeds, default_registry(), **options)
