"""The report of a run: a page for the browser whose slider moves, and clear errors without one."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from cli_calls import invoke, put_files
from report_browser import seen_in_browser

from navfw.numerics import Image
from navfw.recording import RECORDING
from navfw.recording.channel_list import Discs
from navfw.recording.recorded_run import open_run
from navfw.recording.run_folder import PICTURE, REPORT
from navfw.report.run_moments import read_moments
from navfw.report.run_page import run_report
from navfw.signals import Pose

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
  out.inputs = [...part("inputs").children].map((one) => one.textContent).join("|");
  const before = seen();
  slider.value = slider.max;
  slider.dispatchEvent(new Event("input"));
  await pause();
  out.changed = seen().map((shown, i) => shown !== before[i]).join(" ");
  out.linked = location.hash === part("link").hash;
  part("before").click();
  out.back = Number(slider.value) < Number(slider.max) && part("event").textContent !== "";
  location.hash = "#t=0.2";
  await pause();
  out.jumped = part("time").textContent;
  part("slider").dispatchEvent(new KeyboardEvent("keydown", {key: "n", bubbles: true}));
  out.next = parseFloat(part("time").textContent) > parseFloat(out.jumped);
  part("speed").value = "20";
  part("play").click();
  out.played = part("play").textContent === "Pause";
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
    assert left["jumped"] == "0.2 s"
    assert int(left["wide"]) <= 0
    assert [line for line in seen.console if "setting log level" not in line] == []
    moment = read_moments(open_run(run_folder))[int(left["at"])]
    assert moment["rating"] is not None
    weights = [moment["command"]["weights"][name] for name in moment["rating"].names]
    worst = moment["rating"].prohibition.max(axis=0) / 255.0
    desire = np.tensordot(weights, moment["rating"].desirability / 255.0, axes=1)
    support = np.where(worst > 0.5, 0.0, desire * (1.0 - worst))
    assert float(left["best"]) == pytest.approx(support.max(), abs=6e-4)
    # the leader's inputs have a picture each, named with the value
    inputs = [f"{name} {value:.3g}" for name, value in moment["inputs"].items()]
    assert inputs
    assert all(any(shown.startswith(one) for shown in left["inputs"].split("|")) for one in inputs)
    # the cross is within a region of what comes near the best
    v, w = moment["rating"].commands(2)
    near = np.abs(v - moment["command"]["v"]).argmin(), np.abs(w - moment["command"]["w"]).argmin()
    assert support[near] > 0.7 * support.max()


WALKED = """\
name: hall
x: [-6, 6]
y: [-6, 6]
movers: [{name: anna, path: [[-2, -2], [-2, 2]], speed: 0.6}]
"""
AHEAD = "{map: empty, start: [0, 0, 0], goals: [{x: 3, y: 0}], timeout: 2}"
MOMENTS = """
setTimeout(async () => {
  const part = (id) => document.getElementById(id);
  const slider = part("slider"), out = document.body.dataset;
  const color = JSON.parse(part("data").textContent).moving.match(/[0-9A-F]{2}/gi);
  const moving = color.map((x) => parseInt(x, 16));
  const plan = part("plan"), count = [], differ = [];
  for (let n = 0; n <= slider.max; n++) {
    slider.value = n;
    slider.dispatchEvent(new Event("input"));
    await new Promise((resolve) => setTimeout(resolve, 100));
    const rules = part("rules").textContent, time = part("time").textContent;
    if (!rules.startsWith(`at ${time}: `) && rules !== "No command yet.") differ.push(time);
    const {data} = plan.getContext("2d").getImageData(0, 0, plan.width, plan.height);
    let pixels = 0;
    const alike = (i) => moving.every((c, k) => Math.abs(data[i + k] - c) < 9);
    for (let i = 0; i < data.length; i += 4) pixels += alike(i);
    count.push(pixels);
  }
  out.differ = differ.join(" ");
  out.drawn = Math.min(...count);
  out.moments = count.length;
}, 1000);
"""


def test_all_of_a_moment_is_of_its_time_and_walkers_that_nobody_tracks_are_in_the_plan(
    tmp_path: Path,
) -> None:
    put_files(tmp_path, {"hall/world.yaml": WALKED, "hall/missions/ahead.yaml": AHEAD})
    assert invoke("run", tmp_path / "hall", "ahead", "--record", "--out", tmp_path / "o").exit_code
    moments = read_moments(open_run(tmp_path / "o"))
    assert not any(moment["movers"] for moment in moments), "she is behind the robot"
    assert all(len(moment["walkers"]) == 1 for moment in moments)
    assert moments[-1]["walkers"][0] == pytest.approx(
        (-2.0, -2.0 + 0.6 * moments[-1]["time"], 0.25), abs=0.1
    )
    assert invoke("report", tmp_path / "o").exit_code == 0
    seen = seen_in_browser(tmp_path / "o" / REPORT, MOMENTS, tmp_path / "profile")
    left = dict(re.findall(r'data-(\w+)="([^"]*)"', seen.body))
    assert left["differ"] == ""
    assert int(left["moments"]) == len(moments) > 5
    assert int(left["drawn"]) > 20


def test_the_rules_are_told_with_what_was_perceived(run_folder: Path) -> None:
    moments = read_moments(open_run(run_folder))
    told = [moment for moment in moments if moment["rules"] and moment["sentence"]]
    assert told
    for moment in told:
        assert "perceived  Layer1" in moment["rules"]
        assert moment["rules"].startswith(f"at {moment['time']:.1f} s: ")
        assert moment["sentence"] in moment["rules"]


def test_the_page_shows_the_robot_from_behind_where_its_world_is_known(run_folder: Path) -> None:
    seen: list[Pose] = []

    def chase(pose: Pose, movers: Discs) -> Image:
        assert list(movers) == []
        seen.append(pose)
        return np.full((9, 16, 3), 200, np.uint8)

    assert 'id="chase"' not in run_report(run_folder)
    page = run_report(run_folder, chase)
    assert 'id="chase"' in page
    moments = read_moments(open_run(run_folder, chase))
    shown = [moment["chase"] for moment in moments]
    assert all(source.startswith("data:image/webp;base64,") for source in shown)
    assert seen[-1].x == pytest.approx(moments[-1]["robot"]["x"])


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
