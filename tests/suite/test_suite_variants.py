"""Variants of a suite: every run with each variant, in one table, compared with the first."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import suite_samples as samples
from suite_samples import row

from navfw.errors import InputError, MissingExtraError, UnknownNameError
from navfw.mofis import navground
from navfw.plugins import default_registry
from navfw.suite import (
    RunRow,
    SuiteFolder,
    SuitePlan,
    compare_tables,
    load_suite,
    markdown_summary,
    of_variant,
    plan_runs,
    run_suite,
    summarize,
)

SUITE = """\
entries:
  - {world: empty, missions: [straight], set: {mission.timeout: 9}}
variants:
  default:
  paper: {stack: paper}
  no-memory: {set: {local_map.memory: false, occupancy.hit: 1.5}}
"""


def plan_of(text: str, folder: Path, **options: Any) -> SuitePlan:
    file = folder / "mine.yaml"
    file.write_text(text)
    return plan_runs(load_suite(file), range(2), default_registry(), **options)


def test_every_run_is_made_with_every_variant(tmp_path: Path) -> None:
    plan = plan_of(SUITE, tmp_path)
    assert [(case.variant, case.stack_name, case.seed) for case in plan.cases] == [
        (variant, stack, seed)
        for variant, stack in (("default", "default"), ("paper", "paper"), ("no-memory", "default"))
        for seed in (0, 1)
    ]
    last = plan.cases[-1]
    assert last.overrides == (
        "mission.timeout=9",
        "local_map.memory=false",
        "occupancy.hit=1.5",
    )
    session = last.session(default_registry())
    assert session.stack.resolved.settings.local_map.memory is False
    assert len({case.key for case in plan.cases}) == 6


def test_only_chosen_variants_are_run(tmp_path: Path) -> None:
    plan = plan_of(SUITE, tmp_path, variants=["no-memory", "default"])
    assert list(dict.fromkeys(case.variant for case in plan.cases)) == ["default", "no-memory"]


@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        (("stack: paper", "stack: papre"), {}, r"mine\.yaml:5: variants\.paper\.stack: .*'paper'"),
        (
            ("local_map.memory", "local_map.memry"),
            {},
            r"mine\.yaml:6: variants\.no-memory: .*'memory'",
        ),
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
        plan_of(SUITE.replace(*change), tmp_path, **options)


def test_a_variant_without_its_package_is_skipped_and_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(module: str) -> object:
        raise MissingExtraError("navground", "navground", key=module)

    monkeypatch.setattr(navground, "_navground", missing)
    text = SUITE + "  navground: {stack: navground}\n"
    plan = plan_of(text, tmp_path)
    assert "navground" not in {case.variant for case in plan.cases}
    assert "pip install 'navfw[navground]'" in plan.skipped["navground"]
    with pytest.raises(InputError, match="nothing is left to run"):
        plan_of(text, tmp_path, variants=["navground"])


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
    lines = markdown_summary(summary).splitlines()
    head = "| variant | runs | success [95 %] | collided | SPL | time | faults | p | rooms |"
    assert lines[0] == head
    assert lines[2] == "| default | 8 | 100 % [68, 100] | 0 % | 0.90 | 20 s | 0 |  | 100 % |"
    assert lines[3].startswith("| paper | 8 | 25 % [7, 59] | 0 % |")
    assert "| 0.031 | 25 % |" in lines[3]
    assert lines[4].startswith(r"| navground | 0 | skipped: needs \| navground |")
    assert len({line.replace(r"\|", "").count("|") for line in lines}) == 1
    plain = markdown_summary(summarize([row(1), row(2, entry="poles")])).splitlines()
    assert [line.split(" | ")[0] for line in plain[2:]] == ["| rooms", "| poles", "| all"]


def test_variants_are_compared_with_each_other() -> None:
    table = rows()
    found = compare_tables(of_variant(table, "default"), of_variant(table, "paper"))
    assert found["pairs"] == 8
    assert len(found["lost"]) == 6
    both = compare_tables(table, table)
    assert both["pairs"] == 16
    assert {name: part["success_b"] for name, part in both["by_configuration"].items()} == {
        "default": 1.0,
        "paper": 0.25,
    }
    assert "by_configuration" not in found
    with pytest.raises(UnknownNameError, match="did you mean 'paper'"):
        of_variant(table, "papre")


def test_a_suite_writes_the_table_of_variants(tmp_path: Path) -> None:
    out = SuiteFolder(tmp_path / "out")
    plan = plan_of(SUITE, tmp_path)
    have = out.open(plan, "abc")
    done = run_suite(plan, out, have=have, work=samples.fake_run, keep="none")
    assert done.complete
    assert [row.variant for row in out.rows()][::2] == ["default", "paper", "no-memory"]
    summary = json.loads((out.path / "summary.json").read_text())
    assert list(summary["by_variant"]) == ["default", "paper", "no-memory"]
    assert (out.path / "table.md").read_text() == markdown_summary(summary)


def test_all_variants_of_the_shipped_ablations_are_valid() -> None:
    pytest.importorskip("navground", reason="the extra navground is not installed")
    suite = load_suite("ablations")
    plan = plan_runs(suite, range(8000, 8001), default_registry())
    assert not plan.skipped
    assert len(plan.cases) == len(suite.spec.entries) * len(suite.spec.variants)
    assert {"default", "oracle", "paper", "balance", "divergence", "navground"} <= set(
        suite.spec.variants
    )
