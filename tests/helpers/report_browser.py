"""A page in headless Chromium: what a script left in it, and what its console said."""

import re
import shutil
from pathlib import Path
from typing import NamedTuple

import pytest
from processes import run

CONTRAST = """
(() => {
  const light = (color) => color.match(/[\\d.]+/g).slice(0, 3).map((x) => x / 255)
    .map((x) => x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4)
    .reduce((sum, x, i) => sum + x * [0.2126, 0.7152, 0.0722][i], 0);
  const behind = (e) => {
    const color = e === null ? "rgb(255, 255, 255)" : getComputedStyle(e).backgroundColor;
    return color === "rgba(0, 0, 0, 0)" ? behind(e.parentElement) : color;
  };
  const says = (e) => [...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim());
  return Math.min(...[...document.querySelectorAll("body *")]
    .filter((e) => e.tagName !== "SCRIPT" && says(e))
    .map((e) => [light(getComputedStyle(e).color), light(behind(e))].sort((a, b) => b - a))
    .map(([bright, dark]) => (bright + 0.05) / (dark + 0.05)));
})()
"""
"""The least contrast of a text to what is behind it: at least 4.5 by WCAG 2."""


class SeenPage(NamedTuple):
    """The page's opening tag ``<body ...>``, and the lines of the console."""

    body: str
    console: list[str]


def seen_in_browser(page: Path, probe: str, profile: Path, *words: str) -> SeenPage:
    """Open ``page`` with the script ``probe`` added before its main part; skips without Chromium.

    An error of any script is left in ``data-error`` of the body. In the end all text has contrast.
    """
    browser = shutil.which("chromium")
    if browser is None:
        pytest.skip("no chromium; install the package chromium")
    catch = 'addEventListener("error", (e) => { document.body.dataset.error = e.message; });'
    look = f"setTimeout(() => {{ document.body.dataset.contrast = {CONTRAST} }}, 9000);"
    script = f"<script>{catch}\n{probe}\n{look}</script>"
    text = page.read_text(encoding="utf-8")
    page.write_text(text.replace("<main>", script + "<main>", 1), encoding="utf-8")
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr"]
    options += ["--virtual-time-budget=12000", f"--user-data-dir={profile}"]
    done = run([browser, *options, *words, "--dump-dom", page.as_uri()], check=True)
    body = re.search(r"<body[^>]*>", done.stdout)
    contrast = re.search(r' data-contrast="(.*?)"', done.stdout)
    assert body is not None and contrast is not None, done.stdout
    assert float(contrast[1]) >= 4.5
    return SeenPage(
        body[0].replace(contrast[0], ""),
        [line for line in done.stderr.splitlines() if "CONSOLE" in line],
    )
