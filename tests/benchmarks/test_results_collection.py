"""From what commands leave behind to results: origin, figures, refusals."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from cli_calls import answer, invoke, refusal
from docs_pages import ROOT
from navfw_benchmarks.results.collection import collect, seed_range
from navfw_benchmarks.results.result_file import (
    StoredSuiteResult,
    StoredValues,
    load_results,
    save_result,
)
from processes import run
from results_samples import REVISION, bench_result, mixed_rows, suite_folder
from suite_samples import row

from navfw.errors import InputError
from navfw.missions import prepare
from navfw.missions.run_report import write_run
from navfw.recording import RunFolder, machine_kind
from navfw.suite.paired_comparison import wilson
from navfw.suite.suite_folder import SuiteFolder


def of_suite(folder: SuiteFolder, *, total: bool = False) -> StoredSuiteResult:
    (result,) = collect(folder.path, total=total)
    assert isinstance(result, StoredSuiteResult)
    return result


def of_values(source: Path) -> StoredValues:
    (result,) = collect(source)
    assert isinstance(result, StoredValues)
    return result


def test_a_suite_is_kept_with_its_origin_and_figures(tmp_path: Path) -> None:
    result = of_suite(suite_folder(tmp_path / "runs", mixed_rows()))
    assert result.name == "rooms-0-4"
    assert result.command == "navfw suite rooms --seeds 0:4"
    assert (result.revision, result.seeds, result.stacks) == (REVISION, "0:4", ("default",))
    assert result.suite_hash == "5eed" * 16
    assert result.machine.model_dump() == machine_kind()
    figures = result.figures
    assert (figures.runs, figures.reached, figures.collisions) == (4, 3, 1)
    assert (figures.success_low, figures.success_high) == wilson(3, 4)
    assert figures.collisions_by_robot == 1
    assert figures.causes == {"collided: slow": 1}
    assert result.parts == {}
    assert not result.dirty


def test_what_runs_cost_is_kept(tmp_path: Path) -> None:
    rows = [replace(row(seed), cpu_time_s=2.0 + seed, memory_mb=300.0 + seed) for seed in range(3)]
    folder = suite_folder(tmp_path / "runs", rows)
    (folder.path / "failure.png").write_bytes(bytes(300_000))
    result = of_suite(folder)
    assert (result.figures.cpu_time_s, result.figures.memory_mb) == (3.0, 302.0)
    assert result.disk_kb is not None
    assert 100.0 < result.disk_kb < 150.0, "everything in the folder, per run"


def test_options_are_part_of_command_and_name(tmp_path: Path) -> None:
    options = ("--stack", "paper", "--set", "mission.timeout=60")
    result = of_suite(suite_folder(tmp_path / "runs", mixed_rows(), options=options))
    assert result.command == f"navfw suite rooms --seeds 0:4 {' '.join(options)}"
    assert result.name == "rooms-0-4-paper-mission.timeout-60"


def test_each_variant_is_a_result_compared_with_the_first(tmp_path: Path) -> None:
    rows = [row(seed, variant="default") for seed in range(5)]
    rows += [row(seed, "stuck", variant="bare") for seed in range(5)]
    first, second = collect(suite_folder(tmp_path / "runs", rows).path)
    assert isinstance(first, StoredSuiteResult)
    assert isinstance(second, StoredSuiteResult)
    assert (first.name, first.p, first.against) == ("rooms-0-5-default", None, "")
    assert (second.name, second.p, second.against) == ("rooms-0-5-bare", 0.0625, "default")
    assert second.command == "navfw suite rooms --seeds 0:5 --variant bare"


def test_all_variants_may_be_one_result(tmp_path: Path) -> None:
    rows = [row(seed, variant=variant) for variant in ("slow", "fast") for seed in range(5)]
    result = of_suite(suite_folder(tmp_path / "runs", rows), total=True)
    assert (result.name, result.variant, result.p) == ("rooms-0-5", "", None)
    assert (result.figures.runs, result.figures.reached) == (10, 10)
    assert result.command == "navfw suite rooms --seeds 0:5"


def test_entries_and_missions_are_parts(tmp_path: Path) -> None:
    rows = [
        row(0, entry="office", mission="there"),
        row(0, entry="office", mission="back"),
        row(0, "stuck", entry="shut", mission="there"),
    ]
    result = of_suite(suite_folder(tmp_path / "runs", rows, expect={"shut": "stop"}))
    assert set(result.parts) == {"office there", "office back", "shut"}
    assert (result.parts["shut"].expect, result.parts["shut"].passed) == ("stop", 1)
    assert result.parts["office back"].passed is None
    assert (result.figures.expect, result.figures.passed) == (None, 3)


def test_what_does_not_say_what_it_is_is_refused(tmp_path: Path) -> None:
    suite_folder(tmp_path / "partial", mixed_rows(), complete=False)
    for name in ("mixed", "older"):
        suite_folder(tmp_path / name, mixed_rows())
    edited(tmp_path / "mixed" / "suite.json", revisions=[REVISION, "another"])
    edited(tmp_path / "older" / "suite.json", machines=[])
    suite_folder(tmp_path / "gap", [row(1), row(3)])
    suite_folder(tmp_path / "stacks", [row(1), row(1, stack="paper")])
    (tmp_path / "plain.json").write_text("{}")
    for name, message in {
        "partial": "is incomplete: run the rest with --resume",
        "mixed": r"suite\.json: revisions: expected one, got",
        "older": r"machines: expected one.*run the whole suite anew",
        "gap": "2 is missing in 1:4",
        "stacks": "same runs with several stacks",
        ".": "is not a run folder",
        "nothing.json": "there is no such file",
        "plain.json": "expected a suite's folder, a run folder",
    }.items():
        with pytest.raises(InputError, match=message):
            collect(tmp_path / name)


def edited(file: Path, **changes: Any) -> None:
    """Change or, by None, remove keys of a JSON file."""
    data = {**json.loads(file.read_text()), **changes}
    file.write_text(json.dumps({key: data[key] for key in data if data[key] is not None}))


def test_a_run_is_kept_from_its_folder_or_from_what_it_printed(tmp_path: Path) -> None:
    done = prepare("empty", "straight", seed=2, overrides=["mission.timeout=1"]).run()
    with RunFolder(tmp_path / "run") as target:
        write_run(done, target)
    result = of_values(tmp_path / "run")
    assert result.name == "empty-straight-2-default-mission.timeout-1"
    assert result.command == (
        "navfw run empty straight --seed 2 --stack default --set mission.timeout=1"
    )
    assert result.values["outcome"] == "timeout"
    assert result.values["command_hash"] == done.summary()["command_hash"]
    assert "config" not in result.values
    printed = tmp_path / "printed.json"
    printed.write_text(json.dumps({"outcome": "timeout", "run_folder": str(tmp_path / "run")}))
    assert collect(printed) == [result]
    edited(tmp_path / "run" / "result.json", machine={"processor": "x"})
    with pytest.raises(InputError, match="cores: Field required"):
        collect(tmp_path / "run")
    edited(tmp_path / "run" / "result.json", revision=None)
    with pytest.raises(InputError, match=r"has no 'revision'.*run the mission anew"):
        collect(tmp_path / "run")


def test_a_benchmark_is_kept_without_its_raw_data(tmp_path: Path) -> None:
    file = tmp_path / "planning.json"
    file.write_text(json.dumps(answer("bench", "planning", "--places", "200", "--repeats", "3")))
    edited(
        file, raw=list(range(99)), pair=[1, 2], deep={"a": {"b": {"c": {"d": {"e": 1}, "f": 2}}}}
    )
    result = of_values(file)
    assert result.name == "bench-planning"
    assert result.command == "navfw bench planning --places 200 --repeats 3 --seed 0"
    assert result.seeds == "0"
    assert result.values["pair"] == [1, 2]
    assert result.values["deep"] == {"a": {"b": {"c": {"f": 2}}}}
    assert "raw" not in result.values
    assert "provenance" not in result.values


@pytest.mark.slow
def test_results_are_measured_anew_by_their_commands(tmp_path: Path) -> None:
    command, hand = "navfw run empty straight --seed 3 --stack default", "make test-ros"
    old = bench_result("one", command=command, seeds="3", kind="run")
    by_hand = bench_result("two", command=hand)
    for result in (old, by_hand):
        save_result(tmp_path, result)
    script = ROOT / "benchmarks" / "measure_results.py"
    done = run([sys.executable, script, "--data", tmp_path, "--results", tmp_path])
    assert (done.returncode, done.stdout.splitlines()) == (1, [command, hand])
    measured, *others = load_results(tmp_path)
    assert others == [by_hand]
    assert isinstance(measured, StoredValues)
    assert measured.values["outcome"] == "reached"
    assert measured.revision != REVISION


def test_seeds_are_one_range() -> None:
    assert seed_range([3, 1, 2, 2]) == "1:4"
    assert seed_range([7]) == "7:8"


def test_the_command_keeps_results_and_tells_of_a_changed_tree(tmp_path: Path) -> None:
    folder = tmp_path / "results"
    folder.mkdir()
    runs = suite_folder(tmp_path / "runs", mixed_rows(), revision=f"{REVISION}-dirty").path
    words = ["results", "add", str(runs), "--folder", str(folder)]
    done = invoke(*words)
    assert done.exit_code == 0, done.output
    assert "rooms-0-4.json: navfw suite rooms --seeds 0:4" in done.stdout
    assert "rooms-0-4: the code had uncommitted changes" in done.stderr
    (result,) = load_results(folder)
    assert result.dirty
    missing = refusal(*words[:-1], tmp_path / "nowhere")
    assert "name the folder of results with --folder" in missing
