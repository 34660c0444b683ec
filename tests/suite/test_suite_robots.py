"""Precedence of robots: --robot, the variant's, the entry's, the mission's, ``default``."""

from __future__ import annotations

from pathlib import Path

import pytest

from navfw.errors import InputError
from navfw.plugins import default_registry
from navfw.suite import load_suite, plan_runs


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project with robots of different radii."""
    (tmp_path / "navfw.toml").touch()
    (tmp_path / "robots").mkdir()
    for name, radius in {"a": 0.21, "b": 0.22, "c": 0.23}.items():
        (tmp_path / "robots" / f"{name}.yaml").write_text(f"radius: {radius}\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def radii(folder: Path, entry: str, variants: str = "", *options: str) -> list[float]:
    """The robot's radius in each run of a suite with one entry."""
    file = folder / "mine.yaml"
    file.write_text(f"entries:\n  - {{world: empty, missions: [straight]{entry}}}\n{variants}")
    registry = default_registry()
    plan = plan_runs(load_suite(file), range(1), registry, overrides=options)
    return [case.session(registry).mission.spec.robot.radius for case in plan.cases]


def test_the_last_choice_counts(project: Path) -> None:
    variants = "variants: {own: {}, other: {robot: b}, changed: {robot: b, set: {robot.radius: 1}}}"
    assert radii(project, "") == [0.18]
    assert radii(project, ", robot: a") == [0.21]
    assert radii(project, ", robot: a, set: {robot.radius: 0.3}") == [0.3]
    assert radii(project, ", robot: a", variants) == [0.21, 0.22, 1.0]
    assert radii(project, ", robot: a", variants, "robot=c") == [0.23, 0.23, 0.23]


def test_an_unknown_robot_has_the_line_of_its_entry(project: Path) -> None:
    with pytest.raises(InputError, match=r"mine.yaml:2: .*unknown robot 'd'"):
        radii(project, ", robot: d")


def test_a_table_is_not_resumed_with_another_robot(project: Path) -> None:
    file = project / "mine.yaml"
    file.write_text("entries:\n  - {world: empty, missions: [straight], robot: a}\n")

    def fingerprint() -> object:
        return plan_runs(load_suite(file), range(1), default_registry()).content

    before = fingerprint()
    assert fingerprint() == before
    (project / "robots" / "a.yaml").write_text("radius: 0.24\n")
    assert fingerprint() != before
