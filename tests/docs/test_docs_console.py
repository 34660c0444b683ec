"""The commands of every page, typed one after the other: they succeed, and leave nothing behind."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from docs_pages import PAGES, ROOT, blocks_of, write_files
from perceive_images import save, texture, wall_at

NOT_TYPED = {
    r"make (run|test|coverage)": "drives and tests what other tests do",
    r"uv run pytest|pytest tests/|uv run --project": "these tests themselves",
    r"uv run --group mutation": "tests/mutation",
    r"uv run pre-commit": "changes the hooks of the clone",
    r"pip install": "tests/packaging",
    r"navfw suite": "hours; tests/suite",
    r"navfw report runs/rooms": "reports what takes hours; tests/report",
    r"navfw report --text runs/ablations": "compares what takes hours; tests/suite",
    r"navfw results": "writes pages of this repository; tests/results",
    r"navfw tune": "hours; tests/tune",
    r"navfw bench": "minutes each; tests/bench",
    r"navfw run (office|hospital) (patrol|find-yourself)": "minutes each; tests/missions",
    r"navfw world import BARN": "needs worlds of others; tests/worldgen",
    r"navfw reproduce .*--data": "needs recordings of others; tests/reproduce",
    r".* examples/learn_weights": "an hour",
    r".* examples/(drive|simulated)_robot": "tests/docs/test_docs_real_robot.py",
}
"""Commands that are not typed here, as regular expressions, with the reason."""

REFUSED = ("latancy",)
"""Words of commands whose message, exit code 2, the page shows."""

LEFT_BEHIND = {"runs", "generated", "dist"}
"""Folders that git ignores: a command may write there wherever it is typed."""

IN_A_PROJECT = {"plugins.md", "recipes.md", "worlds.md"}
"""Pages whose reader stands in a project: their commands may write to its folders."""

LINES = {
    page: [
        line
        for block in blocks_of(page)
        if block.language == "console"
        for line in re.findall(r"^\$ (.*)$", block.text, re.MULTILINE)
    ]
    for page in PAGES
}


def is_typed(line: str) -> bool:
    return not any(re.match(pattern, line) for pattern in NOT_TYPED)


TYPED = [page for page, lines in LINES.items() if any(map(is_typed, lines))]


@pytest.fixture
def desk(tmp_path: Path) -> Path:
    """A project with the files of all pages, and the reader's own pictures, plans and records."""
    folder = tmp_path / "desk"
    folder.mkdir()
    write_files(folder)
    write_pictures(folder)
    write_plans(folder)
    return folder


def write_pictures(folder: Path) -> None:
    """An approach to a wall, as images and as a video, with the lens and the gyro's record."""
    images = [wall_at(distance, texture()) for distance in np.linspace(1.2, 0.9, 10)]
    save(folder / "images", images)
    height, width = images[0].shape
    video = cv2.VideoWriter(
        str(folder / "corridor.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 20.0, (width, height)
    )
    for image in images:
        video.write(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
    video.release()
    (folder / "camera.yaml").write_text(
        f"image_width: {width}\nimage_height: {height}\ndistortion_model: plumb_bob\n"
        f"camera_matrix: [300, 0, {0.5 * width}, 0, 300, {0.5 * height}, 0, 0, 1]\n"
        "distortion_coefficients: [0, 0, 0, 0, 0]\n"
    )
    times = "".join(f"{0.01 * n:.2f},0.0\n" for n in range(100))
    (folder / "gyro.csv").write_text(f"time,yaw_rate\n{times}")


def write_plans(folder: Path) -> None:
    """Floor plans of one hall, as an image and as of a map server, and a Gazebo world."""
    cells = np.full((160, 240), 254, np.uint8)
    cells[:4], cells[-4:], cells[:, :4], cells[:, -4:] = 0, 0, 0, 0
    for name in ("plan.png", "scan.png", "depot.png"):
        assert cv2.imwrite(str(folder / name), cells)
    (folder / "depot.yaml").write_text(
        "image: depot.png\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    (folder / "hall.world").write_text(
        "<?xml version='1.0'?><sdf version='1.6'><world name='hall'><model name='post'>"
        "<static>1</static><pose>4 4 0.5 0 0 0</pose><link name='link'><collision name='c'>"
        "<geometry><cylinder><radius>0.2</radius><length>1</length></cylinder></geometry>"
        "</collision></link></model></world></sdf>"
    )
    (folder.parent / "home" / "gazebo_models").mkdir(parents=True)


@pytest.mark.slow
@pytest.mark.parametrize("page", TYPED, ids=lambda page: page.name)
def test_the_commands_of_a_page_succeed(page: Path, desk: Path, tmp_path: Path) -> None:
    lines = list(filter(is_typed, LINES[page]))
    before = set(desk.iterdir())
    if page.name == "recordings.md":  # its reader has made this one on another page
        lines.insert(0, "navfw run empty straight --record --out /tmp/straight")
    moved = [line.replace("/tmp/", f"{tmp_path}/") for line in lines]  # noqa: S108 - replaced
    typed = [line.removeprefix("uv run ") for line in moved]
    script = "".join(f"{line}\necho ':: {n} exit '$?\n" for n, line in enumerate(typed))
    environment = os.environ | {
        "HOME": str(tmp_path / "home"),
        "XDG_CONFIG_HOME": str(tmp_path / "config"),
        "NAVFW_TRUST": "1",
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    }
    done = subprocess.run(  # noqa: S603 - commands of our own pages
        ["/bin/bash", "-c", script],
        cwd=desk,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    codes = [int(code) for code in re.findall(r"^:: \d+ exit (\d+)$", done.stdout, re.MULTILINE)]
    expected = [2 if any(word in line for word in REFUSED) else 0 for line in lines]
    assert dict(zip(lines, codes, strict=True)) == dict(zip(lines, expected, strict=True)), (
        done.stdout
    )
    if page.name not in IN_A_PROJECT:
        assert {path.name for path in set(desk.iterdir()) - before} <= LEFT_BEHIND


def test_every_reason_not_to_type_a_command_has_one() -> None:
    every = [line for lines in LINES.values() for line in lines]
    idle = [pattern for pattern in NOT_TYPED if not any(re.match(pattern, e) for e in every)]
    assert idle == []
    for reason in NOT_TYPED.values():
        for named in re.findall(r"tests/[\w/.]+", reason):
            assert (ROOT / named).exists()
