"""Variants of a suite: all runs in one table; which stack and robot a run has."""

import json
import shutil
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from cli_calls import put_files
from navfw_benchmarks.plugins import navground
from suite_plans import drive, planned
from suite_samples import row

from navfw.config.lookup import list_missions, shipped_folder
from navfw.errors import InputError, MissingExtraError, UnknownNameError
from navfw.plugins import default_registry
from navfw.suite import load_suite
from navfw.suite.case import Case
from navfw.suite.paired_comparison import compare_tables, of_variant
from navfw.suite.run_row import RunRow
from navfw.suite.suite_folder import SuiteFolder
from navfw.suite.suite_plan import plan_runs
from navfw.suite.suite_summary import brief_table, summarize

SUITE = """\
entries:
  - {world: empty, missions: [straight], set: {mission.timeout: 9}}
variants:
  default:
  paper: {stack: paper}
  no-memory: {set: {local_map.memory: false, occupancy.hit: 1.5}}
"""


def test_every_run_is_made_with_every_variant(tmp_path: Path) -> None:
    plan = planned(tmp_path, SUITE, range(2))
    assert [(case.variant, case.key.stack, case.seed) for case in plan.cases] == [
        (variant, stack, seed)
        for variant, stack in (("default", "default"), ("paper", "paper"), ("no-memory", "default"))
        for seed in (0, 1)
    ]
    last = plan.cases[-1]
    assert last.overrides == ("mission.timeout=9", "local_map.memory=false", "occupancy.hit=1.5")
    settings = last.session(default_registry()).stack.resolved.settings
    assert settings.local_map.memory is False
    assert len({case.key for case in plan.cases}) == 6


def test_only_chosen_variants_are_run(tmp_path: Path) -> None:
    plan = planned(tmp_path, SUITE, range(2), variants=["no-memory", "default"])
    assert list(dict.fromkeys(case.variant for case in plan.cases)) == ["default", "no-memory"]


@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        (("stack: paper", "stack: papre"), {}, r"mine\.yaml:5: variants\.paper\.stack: .*'paper'"),
        (("map.memory", "map.memry"), {}, r"mine\.yaml:6: variants\.no-memory: .*'memory'"),
        (("missions: [straight]", "missions: [nowhere]"), {}, r"mine\.yaml:2: entries\[0\]"),
        (("stack: paper", "stak: paper"), {}, r"mine\.yaml:5: variants\.paper\.stak"),
        (("", ""), {"variants": ["papre"]}, "--variant: unknown variant .* did you mean 'paper'"),
        (("", ""), {"stacks": ["oracle"]}, "--stack: the variant 'paper' names a stack itself"),
    ],
)
def test_an_error_is_located_at_the_variant_that_causes_it(
    tmp_path: Path, change: tuple[str, str], options: dict[str, object], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        planned(tmp_path, SUITE.replace(*change), range(2), **options)


def test_a_variant_without_its_package_is_skipped_and_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    missing = Mock(side_effect=MissingExtraError("navground", "navground", key="navground"))
    monkeypatch.setattr(navground, "_navground", missing)
    text = SUITE + "  navground: {stack: navground}\n"
    plan = planned(tmp_path, text, range(2))
    assert "navground" not in {case.variant for case in plan.cases}
    assert "pip install 'navfw[navground]'" in plan.skipped["navground"]
    with pytest.raises(InputError, match="nothing is left to run"):
        planned(tmp_path, text, range(2), variants=["navground"])


def test_a_variant_of_a_package_that_is_not_installed_is_skipped(tmp_path: Path) -> None:
    plan = planned(tmp_path, SUITE + "  other: {package: no-such, stack: nowhere}\n", range(2))
    assert plan.skipped == {"other": "needs no-such, which is not installed"}
    text = SUITE + "  other: {package: navfw-benchmarks, stack: balance}\n"
    plan = planned(tmp_path, text, range(2))
    assert (plan.skipped, "other" in {case.variant for case in plan.cases}) == ({}, True)


def rows() -> list[RunRow]:
    good = [row(seed, variant="default") for seed in range(8)]
    bad = [row(seed, "reached" if seed < 2 else "stuck", variant="paper") for seed in range(8)]
    return [*good, *bad]


def test_the_summary_is_per_variant_and_overall() -> None:
    found = summarize(rows())
    assert (found["missions"], found["reached"]) == (16, 10)
    assert "by_stack" not in found
    paper = found["by_variant"]["paper"]
    assert paper["success"] == 0.25
    assert paper["by_entry"]["rooms"]["reached"] == 2
    assert paper["p"] == pytest.approx(2 * 0.5**6)
    assert found["by_variant"]["default"]["p"] == 1.0
    assert "by_variant" not in summarize([row(seed) for seed in range(3)])


def test_the_markdown_table_has_a_row_per_variant_and_a_column_per_entry() -> None:
    summary = {**summarize(rows()), "skipped": {"navground": "needs | navground"}}
    lines = brief_table(summary).markdown().splitlines()
    head = "variant | runs | success [95 %] | collided | mean SPL | mean time | faults | p | rooms"
    assert lines[0] == f"| {head} |"
    assert lines[2] == "| default | 8 | 100 % [68, 100] | 0 % | 0.90 | 20 s | 0 |  | 100 % |"
    assert lines[3].startswith("| paper | 8 | 25 % [7, 59] | 0 % |")
    assert "| 0.031 | 25 % |" in lines[3]
    assert lines[4].startswith(r"| navground | 0 | skipped: needs \| navground |")
    assert len({line.replace(r"\|", "").count("|") for line in lines}) == 1
    plain = brief_table(summarize([row(1), row(2, entry="poles")])).markdown().splitlines()
    assert [line.split(" | ")[0] for line in plain[2:]] == ["| rooms", "| poles", "| all"]


def test_variants_are_compared_with_each_other() -> None:
    table = rows()
    found = compare_tables(of_variant(table, "default"), of_variant(table, "paper"))
    assert found["pairs"] == 8
    assert len(found["lost"]) == 6
    both = compare_tables(table, table)
    assert both["pairs"] == 16
    shares = {name: part["success_b"] for name, part in both["by_configuration"].items()}
    assert shares == {"default": 1.0, "paper": 0.25}
    assert "by_configuration" not in found
    with pytest.raises(UnknownNameError, match="did you mean 'paper'"):
        of_variant(table, "papre")


def test_a_suite_writes_the_table_of_variants(tmp_path: Path) -> None:
    out = SuiteFolder(tmp_path / "out")
    plan = planned(tmp_path, SUITE, range(2))
    have = out.open(plan, "abc")
    done = drive(plan, out, have=have, keep="none")
    assert done.complete
    assert [row.variant for row in out.rows()][::2] == ["default", "paper", "no-memory"]
    summary = json.loads((out.path / "summary.json").read_text())
    assert list(summary["by_variant"]) == ["default", "paper", "no-memory"]
    assert (out.path / "table.md").read_text() == brief_table(summary).markdown()


@pytest.mark.slow
def test_all_variants_of_the_shipped_ablations_are_valid() -> None:
    pytest.importorskip("navground", reason="the extra navground is not installed")
    suite = load_suite("ablations")
    plan = plan_runs(suite, range(8000, 8001), default_registry())
    assert not plan.skipped
    assert len(plan.cases) == len(suite.spec.entries) * len(suite.spec.variants)
    stacks = {"default", "oracle", "paper", "balance", "divergence", "navground"}
    assert stacks <= set(suite.spec.variants)


# --- precedence of stacks and robots: option, variant, entry, mission, ``default`` ----------------


@pytest.fixture
def world(tmp_path: Path) -> Path:
    """A world with a mission that names the stack ``search``, and one without a stack."""
    folder = tmp_path / "field"
    shutil.copytree(shipped_folder() / "worlds" / "empty", folder)
    shutil.rmtree(folder / "missions")
    plain = "start: [1, 1, 0]\ngoals: [{x: 3, y: 1}]\ntimeout: 9\n"
    put_files(folder / "missions", {"plain.yaml": plain, "seek.yaml": plain + "stack: search\n"})
    return folder


def cases_of(folder: Path, entry: str, variants: str = "", **options: Any) -> tuple[Case, ...]:
    """The runs of a suite with one entry."""
    return planned(folder, f"entries:\n  - {{{entry}}}\n{variants}", **options).cases


def stacks(world: Path, entry: str, variants: str = "", **options: Any) -> dict[str, str]:
    """The stack of each mission (and variant)."""
    cases = cases_of(world.parent, f"world: {world / 'world.yaml'}{entry}", variants, **options)
    for case in cases:
        assert case.key.stack == case.session(default_registry()).stack_file.stem
    return {f"{case.key.mission} {case.variant}".strip(): case.key.stack for case in cases}


@pytest.mark.parametrize(
    ("entry", "options", "plain", "seek"),
    [
        ("", [], "default", "search"),
        (", stack: paper", [], "paper", "paper"),
        (", set: {mission.stack: patrol}", [], "patrol", "patrol"),
        (", stack: paper", ["patrol"], "patrol", "patrol"),
    ],
    ids=["mission", "entry", "set", "option"],
)
def test_the_last_choice_of_a_stack_counts(
    world: Path, entry: str, options: list[str], plain: str, seek: str
) -> None:
    assert stacks(world, entry, stacks=options) == {"plain": plain, "seek": seek}


@pytest.mark.parametrize("entry", ["", ", stack: paper"])
def test_the_stack_of_a_variant_takes_precedence_over_both(world: Path, entry: str) -> None:
    variants = "variants: {own: {}, set: {set: {mission.timeout: 5}}, other: {stack: patrol}}\n"
    own = "paper" if entry else "search"
    expected = {"seek own": own, "seek set": own, "seek other": "patrol"}
    assert stacks(world, f", missions: [seek]{entry}", variants) == expected


def test_an_unknown_stack_of_a_mission_is_refused_with_its_line(world: Path) -> None:
    seek = world / "missions" / "seek.yaml"
    seek.write_text(seek.read_text().replace("search", "serach"))
    with pytest.raises(InputError, match=r"mine\.yaml:2: entries\[0\]") as caught:
        stacks(world, "")
    assert "seek.yaml:4: stack: unknown stack 'serach': did you mean 'search'" in str(caught.value)


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["office", "hospital"])
def test_long_missions_of_shipped_suites_use_landmarks(name: str) -> None:
    plan = plan_runs(load_suite(name), range(1), default_registry())
    used = {case.key.mission: case.key.stack for case in plan.cases}
    assert set(used.values()) == {"floor_plan", "landmarks"}
    assert used["patrol"] == "landmarks"
    left_out = {mission.name for mission in list_missions(name)} - used.keys()
    assert left_out <= {"patrol-1km"}


@pytest.fixture
def project(workdir: Path) -> Path:
    """A project with robots of different radii."""
    robots = {"a": 0.21, "b": 0.22, "c": 0.23}
    put_files(workdir, {f"robots/{name}.yaml": f"radius: {r}\n" for name, r in robots.items()})
    (workdir / "navfw.toml").touch()
    return workdir


def radii(folder: Path, entry: str, variants: str = "", *options: str) -> list[float]:
    """The robot's radius in each run."""
    straight = f"world: empty, missions: [straight]{entry}"
    cases = cases_of(folder, straight, variants, overrides=options)
    return [case.session(default_registry()).mission.spec.robot.radius for case in cases]


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
    def fingerprint() -> str:
        (case,) = cases_of(project, "world: empty, missions: [straight], robot: a")
        return case.content

    before = fingerprint()
    assert fingerprint() == before
    (project / "robots" / "a.yaml").write_text("radius: 0.24\n")
    assert fingerprint() != before
