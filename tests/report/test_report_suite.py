"""The reports of suites: failures first, pictures a click away; two suites side by side."""

import json
import re
import sqlite3
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from cli_calls import invoke, output, put_files, refusal, sole_refusal
from report_browser import seen_in_browser
from suite_samples import row

from navfw.suite.run_row import RunJournal, RunRow
from navfw.suite.suite_folder import SuiteFolder

PROBE = """
const settle = () => new Promise((done) => setTimeout(done, 300));
setTimeout(async () => {
  const viewer = document.getElementById("viewer");
  const title = () => viewer.querySelector("h2").textContent;
  const images = () => Array.from(viewer.querySelectorAll("img"));
  const large = () => images().map((image) => image.naturalWidth).join("+");
  document.querySelector("tr .shot").click();
  await settle();
  const seen = [viewer.open, title(), large()];
  viewer.querySelector("[data-step='1']").click();
  await settle();
  seen.push(title());
  viewer.querySelector("[data-step='0']").click();
  const filter = document.getElementById("filter");
  filter.value = "SEED 5";
  filter.dispatchEvent(new Event("input"));
  seen.push(viewer.open, document.getElementById("count").textContent);
  document.body.dataset.seen = seen.join("; ");
  const sort = document.querySelectorAll("table.runs th.n .sort")[0], table = sort.closest("table");
  const seeds = () => Array.from(table.tBodies[0].rows, (row) => row.dataset.run.split(" ").pop());
  sort.click();
  const up = seeds().join(" ");
  sort.click();
  document.body.dataset.sorted = `${up}, ${seeds().join(" ")}`;
  document.body.dataset.points = document.querySelector("canvas").dataset.points;
}, 500);
"""
"""Opens a run's pictures, goes to the next run, closes them, and looks for runs with seed 5."""


def write_suite(folder: Path, rows: Sequence[RunRow], size: tuple[int, int] = (900, 700)) -> Path:
    """The folder of a suite with ``rows``; a picture of ``size`` for each row that names one."""
    (folder / "pictures").mkdir(parents=True)
    for one in rows:
        if one.picture:
            image = np.full((*size[::-1], 3), 255, np.uint8)
            cv2.line(image, (20, 20), (300 + one.seed, 500), (180, 90, 20), 4)
            cv2.imwrite(str(folder / one.picture), image)
    journal = RunJournal(folder / "journal.sqlite")
    journal.create()
    journal.add("made-with", *rows)
    about = {"suite": "rooms", "content": {"entry rooms": "x"}, "current": ["made-with"]}
    (folder / "suite.json").write_text(json.dumps(about))
    return folder


def pictured(seed: int, outcome: str = "reached", **values: object) -> RunRow:
    return row(seed, outcome, picture=f"pictures/run-{seed}.png", **values)


@pytest.fixture
def suite(tmp_path: Path) -> Path:
    rows = [
        pictured(1),
        pictured(2, "collided", cause="drove_into", reason="hit 'box <b>3'"),
        pictured(5, "stuck", cause="standstill"),
        row(3),
        pictured(4, "stuck", cause="standstill"),
    ]
    return write_suite(tmp_path / "a", rows)


def test_failures_come_first_by_cause_with_their_pictures(suite: Path) -> None:
    done = invoke("report", suite)
    assert (done.exit_code, done.stdout) == (0, f"report: {suite / 'report.html'}\n")
    page = (suite / "report.html").read_text(encoding="utf-8")
    _, *heads = re.findall(r"<h2>(.+?)</h2>", page)
    assert heads == ["2 x stuck: standstill", "1 x collided: drove_into", "2 x reached"]
    runs = re.findall(r'data-run="([^"]+)"', page)
    assert [run.rpartition(" ")[2] for run in runs] == ["5", "4", "2", "1", "3"]
    assert page.count("data:image/webp;base64,") == 4
    links = re.findall(r'href="(pictures/[^"]+)"', page)
    assert [(suite / link).is_file() for link in links] == [True] * 4
    assert "40.0 % [11.8, 76.9]" in page
    assert "hit &#39;box &lt;b&gt;3&#39;" in page
    assert "not complete" in page  # there is no summary yet


@pytest.fixture
def later(tmp_path: Path) -> Path:
    """The same runs: 2 and 4 gained, 1 lost, 3 worse, 5 stuck as before."""
    first, last = (pictured(seed, "stuck", cause="standstill") for seed in (1, 5))
    return write_suite(tmp_path / "b", [first, row(2), row(3, spl=0.5), row(4), last])


def test_two_suites_stand_side_by_side(suite: Path, later: Path) -> None:
    comparison, _, report = output("report", suite, later).rstrip("\n").rpartition("\n")
    assert report == f"report: {later / 'comparison.html'}"
    assert comparison == invoke("report", suite, later, "--text").stdout.rstrip("\n")
    assert comparison.startswith("5 pairs, 0 unpaired runs\n")
    page = (later / "comparison.html").read_text(encoding="utf-8")
    _, *heads = re.findall(r"<h2>(.+?)</h2>", page)
    assert heads == ["Lost: 1", "Worse: 1", "Gained: 2", "Better: 0", "Failed in both: 1"]
    assert page.count("data:image/webp;base64,") == 6
    assert 'href="../a/pictures/run-2.png"' in page
    shown = invoke("report", "--text", suite, later).stdout
    assert "40.0 % -> 60.0 %" in shown
    difference = re.search(r"success .*\((.+)\)", shown)
    assert difference is not None
    assert f"<td>{difference[1]}</td>" in page
    assert re.search(r"mean SPL +0.360 -> 0.460  \(\+0.100\)\nmedian SPL +0.000 -> 0.500 ", shown)
    assert f"reports    {suite / 'table.md'}" not in shown


@pytest.fixture
def ablations(tmp_path: Path) -> Path:
    """A suite with two variants: ``paper`` gets stuck with seeds 2 and 3."""
    rows = [row(seed, variant="default", picture="") for seed in (1, 2, 3)]
    rows += [row(1, variant="paper")]
    rows += [row(seed, "stuck", cause="standstill", variant="paper") for seed in (2, 3)]
    return write_suite(tmp_path / "ablations", rows)


def test_two_variants_of_a_suite_stand_side_by_side(ablations: Path) -> None:
    words = ("--variant-a", "default", "--variant-b", "paper")
    done = invoke("report", ablations, ablations, *words)
    assert (done.exit_code, done.stderr) == (0, "")
    page = (ablations / "comparison.html").read_text(encoding="utf-8")
    assert f"{ablations}, default and {ablations}, paper" in page
    assert re.findall(r"<h2>(.+?)</h2>", page)[1:3] == ["Lost: 2", "Worse: 0"]
    assert "<th>stack</th>" not in page


def test_suites_with_variants_are_compared_variant_by_variant(
    ablations: Path, tmp_path: Path
) -> None:
    before = [row(seed, variant=name) for name in ("default", "paper") for seed in (1, 2, 3)]
    suites = (write_suite(tmp_path / "before", before), ablations)
    assert invoke("report", *suites).exit_code == 0
    page = (ablations / "comparison.html").read_text(encoding="utf-8")
    numbers = re.findall(r"<tr><td>(.+?)</td><td.*?>(.+?)</td><td.*?>(.+?)</td>", page)
    assert numbers[0] == ("success", "100.0 %", "66.7 %")
    assert numbers[-4] == ("default: success", "100.0 %", "100.0 %")
    assert numbers[-3] == ("default: mean SPL", "0.900", "0.900")
    assert numbers[-2] == ("paper: success", "100.0 %", "33.3 %")
    assert re.findall(r'data-run="([^"]+)"', page) == [
        f"rooms / rooms-{seed} / cross, seed {seed}, paper" for seed in (2, 3)
    ]
    shown = invoke("report", "--text", *suites).stdout
    assert "paper: success    100.0 % -> 33.3 %" in shown
    assert "lost: rooms / rooms-2 / cross, seed 2, paper (stuck" in shown


def test_in_a_browser_a_click_shows_both_pictures(suite: Path, later: Path, tmp_path: Path) -> None:
    assert invoke("report", suite, later).exit_code == 0
    seen = seen_in_browser(later / "comparison.html", PROBE, tmp_path / "profile")
    first, second = "rooms / rooms-1 / cross, seed 1", "rooms / rooms-2 / cross, seed 2"
    expected = f"true; {first}; 640+640; {second}; false; 1 of 5"
    after = 'data-sorted="1, 1" data-points="5"'
    assert (seen.body, seen.console) == (f'<body data-seen="{expected}" {after}>', [])


def test_equal_stacks_say_so_in_one_line(tmp_path: Path) -> None:
    runs = [(name, seed) for name in ("default", "paper") for seed in (1, 2)]
    rows = [row(n, variant=name, command_hash="a1", barn_score=None) for name, n in runs]
    folder = write_suite(tmp_path / "a", rows)
    assert invoke("report", folder).exit_code == 0
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "default, paper: the same commands in all runs." in page
    assert ">2 of 2<" in page, "two runs have no interval"
    assert ">BARN<" not in page
    words = ("--text", "--variant-a", "default", "--variant-b", "paper")
    shown = invoke("report", folder, folder, *words).stdout.splitlines()
    assert shown[1] == "runs       2 -> 2  (the same commands in all of them)"
    assert shown[2].startswith("reports")


def test_a_damaged_picture_costs_itself_alone(suite: Path) -> None:
    (suite / "pictures" / "run-2.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    done = invoke("report", suite)
    assert done.exit_code == 0
    assert "left out: " in done.stderr
    assert "run-2.png" in done.stderr
    page = (suite / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/webp;base64,") == 3


@pytest.mark.slow
def test_recorded_runs_are_a_click_from_their_own_reports(
    workdir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tiny = "entries: [{world: paper-room, missions: [through-the-door], set: {mission.timeout: 2}}]"
    Path("tiny.yaml").write_text(tiny)
    ended: list[int] = []
    monkeypatch.setattr(
        "navfw.cli.suite.compile_with_progress",
        lambda **options: ended.append(len(SuiteFolder(Path("s")).rows())),
    )
    words = ("suite", "tiny.yaml", "--seeds", "3:5", "--out", "s", "--quiet")
    done = invoke(*words, "--record", "failed")
    assert (done.exit_code, "checking" in done.stderr) == (0, False), done.output
    assert ended == [0]  # kernels are compiled before the first run
    done = invoke("report", "s")
    assert "report: 0 of 2 recorded runs" in done.stderr
    page = Path("s/report.html").read_text(encoding="utf-8")
    links = re.findall(r'href="(recordings/[^"]+)"', page)
    assert len(set(links)) == 2
    for link in links:
        assert "Rules that fired" in (Path("s") / link).read_text(encoding="utf-8")
    assert invoke("report", "s").stderr == ""  # they have their reports
    cluster = ("--engine", "dask", "--scheduler", "tcp://x:1")
    assert "--record" in refusal(*words, *cluster, "--record", "all")


CHANGES = {
    "damaged": "UPDATE run SET cells = replace(cells, 'stuck', 'won')",
    "empty": "DELETE FROM run",
}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["none"], "none: is neither the folder of a run"),
        (["foreign"], "foreign: is neither the folder of a run"),
        (["a", "foreign"], "foreign: is neither the folder of a run"),
        (["a", "run"], "run: is the folder of a run; two suites can be compared"),
        (["a", "a", "a"], "at most two folders"),
        (["damaged"], "a row has no valid cells; --restart drives the suite again"),
        (["a", "damaged"], "a row has no valid cells"),
        (["empty"], "empty: no run of the suite has ended yet"),
        (["a", "other"], "a, other: the tables have no run in common"),
        (["variants", "a"], "variant); --variant-a and --variant-b choose one of each"),
        (["variants", "a", "--variant-a", "papr"], "did you mean 'paper'"),
        (["a", "--variant-b", "paper"], "needs two suites to compare"),
        (["a", "--out", "a"], "expected a file to write, got a folder"),
        (["a", "--out", "foreign/file/page.html"], "cannot be written"),
    ],
)
def test_bad_input_gives_one_message_and_writes_nothing(
    words: list[str], message: str, workdir: Path
) -> None:
    write_suite(workdir / "a", [pictured(1, "stuck")])
    for name, change in CHANGES.items():
        folder = write_suite(workdir / name, [pictured(1, "stuck")])
        with sqlite3.connect(folder / "journal.sqlite") as database:
            database.execute(change)
    write_suite(workdir / "other", [row(1, entry="maze")])
    write_suite(workdir / "variants", [row(1, variant=name) for name in ("default", "paper")])
    put_files(workdir, {"foreign/file": "", "run/result.json": ""})
    before = sorted(workdir.rglob("*"))
    refused = sole_refusal("report", *words)
    assert message in " ".join(refused.replace("│", " ").split())
    assert sorted(workdir.rglob("*")) == before
