"""The report of a run: a page for the browser whose slider moves, and clear errors without one."""

import shutil
from pathlib import Path

import pytest
from cli_calls import invoke, refusal
from report_browser import seen_in_browser

from navfw.recording import PICTURE, RECORDING, REPORT, open_run
from navfw.report import read_moments

PROBE = """
setTimeout(() => {
  const seen = () => [document.getElementById("camera").toDataURL(),
    document.getElementById("time").textContent,
    Bokeh.documents[0].get_model_by_name("now-command").location].join("|");
  const slider = document.getElementById("slider");
  const before = seen();
  slider.value = slider.max;
  slider.dispatchEvent(new Event("input"));
  setTimeout(() => {
    const changed = seen().split("|").map((part, i) => part !== before.split("|")[i]);
    document.body.dataset.changed = changed.join(" ");
  }, 2000);
}, 4000);
"""
"""Moves the slider to its end; leaves in the page what of picture, time and timeline changed."""


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report") / "run"
    words = ("--set", "mission.timeout=3", "--record", "--out", folder)
    done = invoke("run", "paper-room", "through-the-door", *words)
    assert (folder / RECORDING).is_file(), done.output
    return folder


def test_in_a_browser_the_slider_changes_picture_time_and_timeline(
    run_folder: Path, tmp_path: Path
) -> None:
    page = tmp_path / REPORT
    assert invoke("report", run_folder, "--out", page).exit_code == 0
    assert page.stat().st_size < 15e6
    seen = seen_in_browser(page, PROBE, tmp_path / "profile")
    assert seen.body == '<body data-changed="true true true">'
    assert [line for line in seen.console if "setting log level" not in line] == []


def test_the_rules_are_told_with_what_was_perceived(run_folder: Path) -> None:
    moments = read_moments(open_run(run_folder))
    told = [moment for moment in moments if moment.rules and moment.sentence]
    assert told
    for moment in told:
        assert "perceived  Layer1" in moment.rules
        # rules are recorded twice a second
        assert -0.001 <= moment.time - float(moment.rules.split()[1]) + 0.05 < 0.65


def test_texts_of_a_run_are_no_code_on_its_page(run_folder: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(run_folder, folder)
    result = folder / "result.json"
    shown = result.read_text(encoding="utf-8").replace('"paper-room"', '"<script>hostile"', 1)
    result.write_text(shown, encoding="utf-8")
    assert invoke("report", folder).exit_code == 0
    page = (folder / REPORT).read_text(encoding="utf-8")
    assert "<script>hostile" not in page
    assert "&lt;script&gt;hostile" in page


def test_without_a_recording_the_page_has_the_picture_and_says_so(
    run_folder: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    for name in ("result.json", PICTURE):
        shutil.copy(run_folder / name, folder / name)
    assert invoke("report", folder).exit_code == 0
    page = (folder / REPORT).read_text(encoding="utf-8")
    assert "was not recorded" in page
    assert "data:image/png;base64," in page


def test_a_foreign_folder_and_an_unwritable_place_are_refused(
    run_folder: Path, tmp_path: Path
) -> None:
    assert "is neither the folder of a run" in refusal("report", tmp_path)
    (tmp_path / "file").touch()
    below = ("--out", tmp_path / "file" / "page.html")
    assert "cannot be written" in refusal("report", run_folder, *below)


def test_a_cut_recording_is_shown_as_far_as_it_is_intact(run_folder: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(run_folder, folder)
    recording = folder / RECORDING
    content = recording.read_bytes()
    recording.write_bytes(content[: len(content) * 9 // 10])
    done = invoke("report", folder)
    assert done.exit_code == 0, done.output
    assert "ends before its run" in (folder / REPORT).read_text(encoding="utf-8")
