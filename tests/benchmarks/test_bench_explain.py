"""The benchmark of explanations: named changes are applied, and false ones are counted as such."""

from dataclasses import replace
from pathlib import Path

import pytest
from navfw_benchmarks.bench import explained_decisions
from navfw_benchmarks.bench.explained_decisions import bench_explain, tables

from navfw.missions import prepare
from navfw.missions.run_report import write_run
from navfw.recording import RunFolder
from navfw.recording.decision_moment import DecisionMoment
from navfw.recording.why_not import WhyNot, why_not


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    session = prepare("paper-room", "through-the-door", overrides=["mission.timeout=4"])
    target = tmp_path_factory.mktemp("explain") / "run"
    result = session.run(record=True)
    with RunFolder(target) as folder:
        write_run(result, folder)
    return target


@pytest.mark.slow
def test_each_named_change_is_true_and_half_of_it_is_not_enough(run: Path) -> None:
    result = bench_explain([run], decisions=3, seed=1)
    assert result["decisions"] == 3
    assert result["answers"] == result["single"] + result["pair"] + result["none"] >= 9
    assert "input" in result["changes"]
    for row in result["changes"].values():
        assert row["true"] == row["half_not_enough"] == row["named"] > 0
    changes, times = tables(result)
    assert len(changes.rows) == len(result["changes"])
    assert [row[0] for row in times.rows] == ["search", "answer", "explanation"]


def test_a_change_that_does_not_turn_the_decision_is_counted(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def too_little(moment: DecisionMoment, wanted: str) -> WhyNot:
        answer = why_not(moment, wanted)
        return replace(answer, changes=tuple(one.scaled(0.5) for one in answer.changes))

    monkeypatch.setattr(explained_decisions, "why_not", too_little)
    rows = bench_explain([run], decisions=2)["changes"].values()
    assert sum(row["named"] for row in rows) > sum(row["true"] for row in rows) == 0
