"""The report of a run: a page for the browser whose slider moves, and clear errors without one."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from cli_calls import invoke, output, refusal
from report_browser import seen_in_browser

from navfw.recording import PICTURE, RECORDING, REPORT, open_run
from navfw.report import read_moments

PROBE = """
setTimeout(async () => {
  const part = (id) => document.getElementById(id);
  const slider = part("slider"), out = document.body.dataset;
  const panels = ["camera", "plan", "sum", "chart-speed", "chart-turn"];
  const pause = () => new Promise((resolve) => setTimeout(resolve, 300));
  const seen = () => [...panels.map((id) => part(id).toDataURL()),
    part("time").textContent, part("values").textContent, part("link").hash];
  [out.event, out.best] = [part("event").textContent, part("sum").dataset.best];
  out.at = slider.value;
  const before = seen();
  slider.value = slider.max;
  slider.dispatchEvent(new Event("input"));
  await pause();
  out.changed = seen().map((shown, i) => shown !== before[i]).join(" ");
  out.linked = location.hash === part("link").hash;
  part("before").click();
  out.back = Number(slider.value) < Number(slider.max) && part("event").textContent !== "";
  location.hash = "#t=1.0";
  await pause();
  out.jumped = part("time").textContent;
  part("slider").dispatchEvent(new KeyboardEvent("keydown", {key: "n", bubbles: true}));
  out.next = parseFloat(part("time").textContent) > parseFloat(out.jumped);
  part("speed").value = "20";
  part("play").click();
  await pause().then(pause);
  out.played = Number(slider.value) > 12;
  out.wide = document.documentElement.scrollWidth - innerWidth;
}, 3000);
"""
"""What panels change with the slider, and what events, links, keys and play do."""


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report") / "run"
    words = ("--set", "mission.timeout=3", "--record", "--out", folder)
    done = invoke("run", "paper-room", "through-the-door", *words)
    assert (folder / RECORDING).is_file(), done.output
    return folder


def test_in_a_browser_all_panels_show_one_moment_and_go_from_event_to_event(
    run_folder: Path, tmp_path: Path
) -> None:
    page = tmp_path / REPORT
    assert invoke("report", run_folder, "--out", page).exit_code == 0
    assert page.stat().st_size < 10e6
    seen = seen_in_browser(page, PROBE, tmp_path / "profile")
    left = dict(re.findall(r'data-(\w+)="([^"]*)"', seen.body))
    assert "error" not in left
    assert left["changed"] == " ".join(["true"] * 8)
    assert left["event"].startswith("least clearance, 0.")
    assert [left[name] for name in ("linked", "back", "next", "played")] == ["true"] * 4
    assert left["jumped"] == "1.0 s"
    assert int(left["wide"]) <= 0
    assert [line for line in seen.console if "setting log level" not in line] == []
    moment = read_moments(open_run(run_folder))[int(left["at"])]
    assert moment.rating is not None
    weights = [moment.command["weights"][name] for name in moment.rating.names]
    worst = moment.rating.prohibition.max(axis=0) / 255.0
    desire = np.tensordot(weights, moment.rating.desirability / 255.0, axes=1)
    support = np.where(worst > 0.5, 0.0, desire * (1.0 - worst))
    assert float(left["best"]) == pytest.approx(support.max(), abs=6e-4)
    # the cross is within a region of what comes near the best
    v, w = moment.rating.commands(2)
    near = np.abs(v - moment.command["v"]).argmin(), np.abs(w - moment.command["w"]).argmin()
    assert support[near] > 0.7 * support.max()


def test_the_rules_are_told_with_what_was_perceived(run_folder: Path) -> None:
    moments = read_moments(open_run(run_folder))
    told = [moment for moment in moments if moment.rules and moment.sentence]
    assert told
    for moment in told:
        assert "perceived  Layer1" in moment.rules
        # rules are recorded twice a second
        later = moment.time - float(moment.rules.split()[1])
        assert -0.001 <= later + 0.05 < 0.65
        assert moment.sentence in moment.rules or later > 0.05


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
    assert "data:image/webp;base64," in page


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
    output("report", folder)
    assert "ends before its run" in (folder / REPORT).read_text(encoding="utf-8")
