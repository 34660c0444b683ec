"""The page: complete, readable without a network, and sound in a browser."""

import hashlib
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from cli_calls import answer, refusal
from navfw_benchmarks.bench import real_benchmark
from navfw_benchmarks.bench.real_benchmark import RECORDINGS
from navfw_benchmarks.reproduce import paper_tables, reproduction
from navfw_benchmarks.reproduce.metric_comparison import compare_metrics
from navfw_benchmarks.reproduce.photographs import chosen_frames, real_as_data, real_scenes
from navfw_benchmarks.reproduce.reproduction import reproduce
from perceive_images import label, save_approach
from report_browser import seen_in_browser

from navfw.plugins import default_registry
from navfw.process.work_progress import silent
from navfw.recording import plain_json

UNLICENSED = "car_gyro_lab/images"
PROBE = """addEventListener("load", () => {
const broken = [...document.images].filter(image => !image.naturalWidth).length;
const wide = document.documentElement.scrollWidth > innerWidth;
document.body.dataset.found = [document.images.length, broken, wide].join(" ");
});"""


@pytest.fixture(scope="module")
def quick() -> Iterator[None]:
    """Few views in the comparison of metrics, which has tests of its own; few repeats of times."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            reproduction, "compare_metrics", lambda _, seed, report: compare_metrics(4, seed)
        )
        patch.setattr(paper_tables, "timings", partial(paper_tables.timings, repeats=2))
        yield


@dataclass
class Written:
    """A page, the result it was made from, and the recordings."""

    page: str
    result: dict[str, Any]
    data: Path


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory, quick: None) -> Iterator[Written]:
    """Written with two recordings; the frames of one of them may not be shown."""
    del quick
    folder = tmp_path_factory.mktemp("page")
    data, out = folder / "data", folder / "out"
    labels = [*save_approach(data), *save_approach(data, UNLICENSED)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(real_benchmark, "load_labels", lambda: labels)
        result = reproduce(out, 0, 20, data)
        yield Written((out / "index.html").read_text(encoding="utf-8"), result, data)


class Outline(HTMLParser):
    """The elements of a page with their attributes."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str]]] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, {name: value or "" for name, value in attrs}))

    def all(self, tag: str) -> list[dict[str, str]]:
        return [attributes for name, attributes in self.found if name == tag]


@pytest.mark.slow
def test_the_same_recordings_give_the_same_result_and_digest(written: Written) -> None:
    again, _ = real_scenes(written.data, default_registry(), silent)
    assert plain_json(real_as_data(again)) == written.result["real"]
    facts = {k: v for k, v in written.result.items() if k not in ("digest", "timings")}
    text = json.dumps(facts, sort_keys=True).encode()
    assert written.result["digest"] == hashlib.sha256(text).hexdigest()


def test_recordings_are_judged_and_one_frame_of_each_kind_is_shown(written: Written) -> None:
    real = written.result["real"]
    assert real["total"] == {"right": 4, "partly": 0, "wrong": 0, "silent": 0}
    assert [row["folder"] for row in real["recordings"]] == [UNLICENSED, "approach"]
    assert "donkeycar/images" in real["missing"]
    assert [(s["folder"], s["file"]) for s in real["scenes"]] == [
        ("approach", "image_5.png"),
        (UNLICENSED, "image_5.png"),
    ]
    for scene in real["scenes"]:
        assert scene["verdict"] == "right"
        assert scene["sentence"] in written.page


def test_every_labelled_recording_has_a_source_and_only_licensed_ones_are_shown() -> None:
    unlicensed = [name for name, about in RECORDINGS.items() if about.licence is None]
    assert unlicensed == [UNLICENSED, "car_gyro_hall/images"]


def test_frames_without_a_licence_are_not_on_the_page(written: Written) -> None:
    alts = [image["alt"] for image in Outline(written.page).all("img")]
    assert sum("Photograph" in alt for alt in alts) == 1
    assert written.page.count("names no licence") == 1


def test_every_sentence_and_verdict_is_on_the_page(written: Written) -> None:
    outline = Outline(written.page)
    assert len(written.result["table2"]) == 10
    for row in written.result["table2"]:
        assert {"id": f"waypoint-{row['waypoint']}"} in outline.all("section")
        for reading in row["readings"]:
            assert reading["sentence"] in written.page
        if row["truth"]["no_situation"]:
            assert row["truth"]["no_situation"] in written.page
    shown = re.findall(r'class="verdict (\w+)"', written.page)
    assert {"right", "partly", "wrong"} <= set(shown) <= {"right", "partly", "wrong", "silent"}
    assert written.result["digest"][:16] in written.page
    assert f"{written.result['metrics']['clear']} of them with a" in written.page


def test_the_page_is_one_bounded_file_that_needs_no_network(written: Written) -> None:
    outline = Outline(written.page)
    assert len(written.page) < 8_000_000
    assert not any(outline.all(tag) for tag in ("script", "link", "iframe", "object"))
    for image in outline.all("img"):
        assert image["src"].startswith("data:image/webp;base64,")
        assert image["alt"]
        assert int(image["width"]) > 100
    assert all(link["href"].startswith("#") for link in outline.all("a"))
    ids = {attributes["id"] for _, attributes in outline.found if "id" in attributes}
    assert {link["href"][1:] for link in outline.all("a")} <= ids
    assert len(outline.all("caption")) == len(outline.all("table"))


@pytest.mark.parametrize("width", [1400, 500])
def test_a_browser_shows_every_picture_within_the_window(
    width: int, written: Written, tmp_path: Path
) -> None:
    page = tmp_path / "page.html"
    page.write_text(written.page, encoding="utf-8")
    seen = seen_in_browser(page, PROBE, tmp_path / "profile", f"--window-size={width},900")
    pictures = 1 + len(written.result["table2"]) + len(written.result["table3"]) + 1
    assert seen.body == f'<body data-found="{pictures} 0 false">'


def test_the_middle_frame_of_each_front_is_chosen_of_the_test_split_where_there_is_one() -> None:
    walls = [label(front="wall", file=f"image_{k}.png") for k in range(5)]
    tested = [replace(found, split="test") for found in walls[:3]]
    doors = [label(front="door", file=f"door_{k}.png") for k in range(3)]
    elsewhere = [label(front="wall", file="image_9.png", folder="tum_fr1/rgb")]
    chosen = chosen_frames([*tested, *walls[3:], *doors, *elsewhere])
    assert [found.file for found in chosen] == ["image_1.png", "door_1.png", "image_9.png"]
    assert [found.split for found in chosen] == ["test", "tuning", "tuning"]


# --- the command ---------------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.usefixtures("quick")
def test_reproduce_without_recordings(tmp_path: Path) -> None:
    out = tmp_path / "page"
    result = answer("reproduce", "--out", out)
    assert all(result["checks"].values())
    assert result["timings"]["paper"]["obstacles_s"] == 0.16
    assert result["real"] is None
    assert "--data DIR" in result["summary"]["Table 3, photographs"][0]
    assert {path.name for path in out.iterdir()} == {"index.html", "result.json"}
    assert list(tmp_path.iterdir()) == [out]
    assert json.loads((out / "result.json").read_text()) == result
    page = (out / "index.html").read_text()
    assert "This part is missing" in page
    assert "reproduce --data DIR" in page


def test_reproduce_leaves_other_folders_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("work")
    refused = refusal("reproduce", "--out", tmp_path)
    assert "contains 'thesis.txt', so it is not replaced; choose another --out" in refused
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        ("nowhere", "there is no such folder of recordings"),
        ("empty", "has none of the labelled recordings; expected at least one of: donkeycar"),
        ("image", "the labelled image is missing"),
        ("broken", "image_1.png"),
    ],
)
def test_a_folder_without_the_recordings_costs_one_message(
    spoil: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data, out = tmp_path / "data", tmp_path / "page"
    labels = save_approach(data)
    monkeypatch.setattr(real_benchmark, "load_labels", lambda: labels)
    if spoil == "nowhere":
        data = data / "approach" / "image_1.png"
    elif spoil == "empty":
        data = data / "approach"
    elif spoil == "image":
        (data / "approach" / "image_5.png").unlink()
    else:
        for path in (data / "approach").iterdir():
            path.write_bytes(b"no image")
    assert message in refusal("reproduce", "--out", out, "--data", data)
    assert [path.name for path in tmp_path.iterdir()] == ["data"]
