"""The page of perceived images: what it shows in a browser, and how much of a long sequence."""

import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_browser import live_browser
from perceive_calls import APPROACH, perceive
from perceive_images import save
from report_browser import seen_in_browser
from websockets.sync.client import connect

from navfw.assumption import Assumption
from navfw.numerics import Image
from navfw.report.perceive_live import PerceiveServer
from navfw.report.report_page import PerceivePage

PROBE = """
setTimeout(() => {
  const seen = () => [document.getElementById("picture").src.length,
    document.getElementById("time").textContent, document.getElementById("sentence").textContent,
    document.querySelectorAll("#said tr, #contacts tr").length,
    document.getElementById("nearness").toDataURL()].join("|");
  const slider = document.getElementById("slider");
  const before = seen().split("|");
  slider.value = slider.max;
  slider.dispatchEvent(new Event("input"));
  const after = seen().split("|");
  document.body.dataset.changed = after.map((part, i) => part !== before[i]).join(" ");
  document.body.dataset.rows = after[3];
}, 500);
"""
"""Moves the slider to its end; leaves what has changed, and the rows of words and contacts."""
PICTURE: Image = np.full((60, 80, 3), 90, np.uint8)


def result(number: int, sentence: str = "Front is a wall") -> dict[str, Any]:
    contact = {"ttc_s": 2.0 + number}
    return {
        "time": 0.1 * number,
        "sentence": sentence,
        "notes": [],
        "statements": [{"what": "front", "says": sentence, "probability": 0.9, "age_s": 0.2}],
        "front": {"wall": 0.9, "other": 0.1},
        "ttc_s": None,
        "known": True,
        "confidence": 0.7,
        "distances": dict.fromkeys(("P1", "P2", "P3", "P4"), contact),
    }


def test_in_a_browser_the_slider_moves_picture_sentence_and_time(tmp_path: Path) -> None:
    images = save(tmp_path / "images", APPROACH)
    page = tmp_path / "page.html"
    perceive(images, "--fps", "10", "--page", page)
    assert page.stat().st_size < 3e6
    seen = seen_in_browser(page, PROBE, tmp_path / "profile")
    assert 'data-changed="true true' in seen.body
    assert 'data-rows="7"' in seen.body
    assert [line for line in seen.console if "setting log level" not in line] == []


@pytest.mark.parametrize(("count", "shown"), [(3, 3), (601, 301), (1300, 325)])
def test_of_a_long_sequence_evenly_spaced_pictures_are_shown(count: int, shown: int) -> None:
    page = PerceivePage("long")
    for number in range(count):
        page.add(PICTURE, result(number, f"Front is a wall{number // 100 * '!'}"))
    times = [moment["time"] for moment in page._moments]
    assert len(times) == shown
    assert np.ptp(np.diff(times)) < 1e-6
    text = page.render(["a note with <b>"])
    assert f"{count} pairs of images, {shown} of them shown" in text
    assert f"the words change {(count - 1) // 100} times" in text
    assert "a note with &lt;b&gt;" in text


def test_the_live_page_shows_the_results_from_the_first_viewer_on(tmp_path: Path) -> None:
    taken = [Assumption("pitch", "0 degrees", "", "--pitch"), Assumption("lens", "none")]
    server, begun = PerceiveServer("a drive", assumed=lambda: taken), threading.Event()

    def work() -> None:
        for number in range(12):
            server.add(PICTURE, result(number, f"Front is a wall, {number}"))
            begun.set()

    worker = threading.Thread(target=work, daemon=True)
    worker.start()
    assert not begun.wait(0.3)  # until somebody looks
    with live_browser(tmp_path) as browser:
        browser.open(server.url)
        assert begun.wait(10.0)
        browser.wait_for("document.getElementById('sentence').textContent.endsWith(', 11')")
        assert browser.evaluate("document.querySelectorAll('#said tr').length") == 1
        assert browser.evaluate("document.getElementById('live').textContent") == "1.1 s"
        told = browser.evaluate("document.getElementById('assumed').innerText")
        assert told == "assumed: pitch: 0 degrees (--pitch)\nassumed: lens: none"
        worker.join()
        server.close()
        browser.wait_for("document.getElementById('live').textContent.includes('ended')")
        assert browser.console == []


def test_the_images_go_on_when_the_viewer_leaves() -> None:
    server = PerceiveServer("a drive")

    def work() -> None:
        for number in range(8):
            server.add(PICTURE, result(number))

    worker = threading.Thread(target=work, daemon=True)
    worker.start()
    with connect(server.url.replace("http", "ws", 1), subprotocols=[*server.protocols]) as viewer:
        viewer.recv(timeout=10.0)
    worker.join(timeout=10.0)
    assert not worker.is_alive()
    server.close()
