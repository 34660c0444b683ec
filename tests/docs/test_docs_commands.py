"""The commands of the README and the docs: the quick ones do what is shown, all can be typed.

Typed one after the other, those of a page succeed, and leave nothing behind; those of the README
are typed in ``test_docs_readme``.
"""

import os
import re
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import typer.main
from cli_calls import answer, output, put_files, refusal
from docs_pages import PAGES, ROOT, blocks_of, execute, load_module, table, write_files
from perceive_images import save, texture, wall_at
from processes import run

from navfw.cli import app
from navfw.recording import palette

QUICK = (
    "map plan ",
    "map show hospital",
    "map check",
    "map build",
    "map convert",
    "list plugins",
    "explain ",
    "export ",
    "replay ",
    "run empty straight --record",
)
"""Beginnings of the commands that are run here; the others take longer, or need files."""

TYPED = {
    page: [
        typed.splitlines()
        for block in blocks_of(page)
        if block.language == "console"
        for typed in re.split(r"^\$ ", block.text, flags=re.MULTILINE)[1:]
    ]
    for page in PAGES
}
"""What each page shows typed: the line, and those that are shown below it."""


def commands_and_output(page: Path) -> Iterator[tuple[str, list[str]]]:
    """The commands of navfw on a page, each with the lines that are shown below it."""
    for line, *shown in TYPED[page]:
        words = re.match(r"(?:uv run )?navfw (.+?)(?:  +#.*)?$", line)
        if words is not None:
            yield words[1], [row for row in shown if row.strip() not in ("", "...")]


ALL = [
    pytest.param(command, shown, id=f"{page.name}: {command[:40]}")
    for page in PAGES
    for command, shown in commands_and_output(page)
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The working folder of the commands; their /tmp/... is within it."""
    path = tmp_path_factory.mktemp("commands")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(path)
        write_files(path)
        for options in ("--out /tmp/straight", '--set "behaviors.gentle={}" --out /tmp/gentle'):
            output(*words_of(f"run empty straight --record {options}", path))
        yield path


def words_of(command: str, folder: Path) -> list[str]:
    return shlex.split(command.replace("/tmp/", f"{folder}/"))  # noqa: S108 - replaced


def test_the_commands_and_their_options_exist() -> None:
    for line, _ in (parameters.values for parameters in ALL):
        words = shlex.split(str(line).partition(" --ros-args")[0])
        command: Any = typer.main.get_command(app)
        while hasattr(command, "commands"):
            command = command.get_command(None, words.pop(0))
        options = {option for parameter in command.params for option in parameter.opts}
        assert [word for word in words if word.startswith("--") and word not in options] == [], line


@pytest.mark.parametrize(
    ("command", "shown"), [p for p in ALL if str(p.values[0]).startswith(QUICK)]
)
def test_a_quick_command_succeeds_and_prints_what_is_shown(
    command: str, shown: list[str], folder: Path
) -> None:
    if command == "replay /tmp/straight-bag" and not (folder / "straight-bag").exists():
        output(*words_of("export /tmp/straight --to /tmp/straight-bag", folder))  # another worker's
    printed = [row.rstrip() for row in output(*words_of(command, folder)).splitlines()]
    assert [row for row in shown if row not in printed] == []


OUTVOTED = {"weight": 0.2, "desirability": 0.1, "best": 1.0, "prohibition": 0.0}
"""The rating of a command by a behaviour that desired another one."""


def test_only_an_outvoted_behavior_of_the_user_is_sent_to_the_page(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ratings = {
        "peek": OUTVOTED,
        "mine": OUTVOTED,
        "heard": OUTVOTED | {"desirability": 0.9},
        "idle": OUTVOTED | {"weight": 0.0},
        "only_forbids": OUTVOTED | {"desirability": 0.0, "best": 0.0},
    }
    behaviors = {name: rating | {"reason": "", "rules": []} for name, rating in ratings.items()}
    why = {"time": 1.0, "v": 0.0, "w": 0.0, "leader": "peek", "behaviors": behaviors}
    monkeypatch.setattr("navfw.recording.explanations.explain_at", lambda *_, **__: why)
    lines = output(*words_of("explain /tmp/straight --at 1", folder)).splitlines()
    page = "desired another command and was outvoted: see docs/not-heard.md"
    assert [line for line in lines if "docs/" in line] == [f"mine {page}"]


def test_the_picture_of_a_run_shows_camera_and_path(folder: Path) -> None:
    drawing = load_module(ROOT / "docs" / "draw_run.py")
    (picture,) = drawing.moments(folder / "straight", [30])
    assert picture.shape == (drawing.HEIGHT, 2 * drawing.WIDTH, 3)
    flow = (picture == palette.bgr(palette.FLOW)).all(axis=2)
    assert flow[: drawing.HEIGHT // 2, : drawing.WIDTH].sum() > 100  # arrows
    blue, _, red = picture[: drawing.CHASE_SIZE[1], drawing.WIDTH :].astype(int).transpose(2, 0, 1)
    assert (red - blue > 150).sum() > 1000  # the robot from behind
    (image,) = re.findall(r"docs/images/[\w-]+\.png", (ROOT / "README.md").read_text())
    assert (ROOT / image).stat().st_size < 500_000


def test_the_code_that_reads_a_recording_runs(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (block,) = (b for b in blocks_of(ROOT / "docs" / "recordings.md") if b.language == "python")
    names = execute(block.text.replace("/tmp/", f"{folder}/"), block.page)  # noqa: S108 - replaced
    assert names["image"].shape == (120, 160)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 30
    assert re.fullmatch(r"\d+\.\d s \w+", lines[-1])


@pytest.mark.parametrize(
    ("command", "heading"),
    [
        ("map plan hospital reception ward-3", "## Plan"),
        ("map show office", "## Maps"),
        ("map check office", "## Maps"),
        ("map build office --out draft.yaml", "## Maps"),
        ("map convert office office.geojson", "## Maps"),
    ],
)
def test_the_keys_of_the_json_are_documented(command: str, heading: str, folder: Path) -> None:
    documented = re.findall(r"`(\w+)`", table(ROOT / "docs" / "commands.md", heading))
    assert set(answer(*words_of(command, folder))) - set(documented) == set()


def test_the_readme_shows_a_mistake_with_its_message() -> None:
    ((command, shown),) = (
        pair for pair in commands_and_output(ROOT / "README.md") if "latancy" in pair[0]
    )
    assert refusal(*shlex.split(command)).splitlines() == shown


# --- typed one after the other ----------------------------------------------------------------

NOT_TYPED = {
    r"make (run|test|coverage)": "drives and tests what other tests do",
    r"uv run pytest|pytest tests": "these tests themselves",
    r"uv run --group mutation": "tests/mutation",
    r"uv run pre-commit": "changes the hooks of the clone",
    r"navfw suite": "hours; tests/suite",
    r"navfw report runs/rooms": "reports what takes hours; tests/report",
    r"navfw report (--text )?runs/hard": "compares what takes hours; tests/suite",
    r"navfw results": "writes pages of this repository; tests/benchmarks",
    r"navfw tune": "hours; tests/tune",
    r"navfw bench": "minutes each; tests/benchmarks",
    r"navfw run (office|hospital) (patrol|find-yourself)": "minutes each; tests/missions",
    r"navfw world import BARN": "needs worlds of others; tests/worldgen",
    r"navfw reproduce .*--data": "needs recordings of others; tests/benchmarks",
    r".* examples/learn_weights": "an hour",
    r"navfw ros|ros2 |source /opt|python3 -m venv|~/navfw": "tests/ros; needs a distribution",
    r".* examples/(drive|simulated)_robot": "tests/docs/test_docs_real_robot.py",
    r".* examples/paper_in_one_file": "tests/docs/test_docs_paper.py",
}
"""Commands that are not typed here, as regular expressions, with the reason."""

LEFT_BEHIND = {"runs", "generated", "dist"}
"""Folders that git ignores: a command may write there wherever it is typed."""

IN_A_PROJECT = {"plugins.md", "recipes.md", "worlds.md"}
"""Pages whose reader stands in a project: their commands may write to its folders."""

TYPED_BEFORE = {
    "commands.md": ["navfw new project ~/my-robot"],
    "recordings.md": ["navfw run empty straight --record --out /tmp/straight"],
}
"""What the reader of a page has typed on another one."""

LINES = {page: [line for line, *_ in typed] for page, typed in TYPED.items()}


def is_typed(line: str) -> bool:
    return not any(re.match(pattern, line) for pattern in NOT_TYPED)


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
    lens = (
        f"image_width: {width}\nimage_height: {height}\ndistortion_model: plumb_bob\n"
        f"camera_matrix: [300, 0, {0.5 * width}, 0, 300, {0.5 * height}, 0, 0, 1]\n"
        "distortion_coefficients: [0, 0, 0, 0, 0]\n"
    )
    times = "".join(f"{0.01 * n:.2f},0.0\n" for n in range(100))
    put_files(folder, {"camera.yaml": lens, "gyro.csv": f"time,yaw_rate\n{times}"})


def write_plans(folder: Path) -> None:
    """Floor plans of one hall, as an image and as of a map server, and a Gazebo world."""
    cells = np.full((160, 240), 254, np.uint8)
    cells[:4], cells[-4:], cells[:, :4], cells[:, -4:] = 0, 0, 0, 0
    for name in ("plan.png", "scan.png", "depot.png"):
        assert cv2.imwrite(str(folder / name), cells)
    plan = (
        "image: depot.png\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    world = (
        "<?xml version='1.0'?><sdf version='1.6'><world name='hall'><model name='post'>"
        "<static>1</static><pose>4 4 0.5 0 0 0</pose><link name='link'><collision name='c'>"
        "<geometry><cylinder><radius>0.2</radius><length>1</length></cylinder></geometry>"
        "</collision></link></model></world></sdf>"
    )
    put_files(folder, {"depot.yaml": plan, "hall.world": world})
    (folder.parent / "home" / "gazebo_models").mkdir(parents=True)


@pytest.mark.slow
@pytest.mark.parametrize(
    "page",
    [p for p, lines in LINES.items() if any(map(is_typed, lines)) and p != ROOT / "README.md"],
    ids=lambda p: p.name,
)
def test_the_commands_of_a_page_succeed(page: Path, desk: Path, tmp_path: Path) -> None:
    lines = [*TYPED_BEFORE.get(page.name, ()), *filter(is_typed, LINES[page])]
    before = set(desk.iterdir())
    moved = [line.replace("/tmp/", f"{tmp_path}/") for line in lines]  # noqa: S108 - replaced
    typed = [line.removeprefix("uv run ") for line in moved]
    script = "".join(f"{line}\necho ':: {n} exit '$?\n" for n, line in enumerate(typed))
    environment = {
        "HOME": str(tmp_path / "home"),
        "XDG_CONFIG_HOME": str(tmp_path / "config"),
        "NAVFW_TRUST": "1",
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    }
    bash = ["/bin/bash", "-c", f"exec < /dev/null 2>&1\n{script}"]
    done = run(bash, cwd=desk, env=environment, timeout=3600.0)
    codes = [int(code) for code in re.findall(r"^:: \d+ exit (\d+)$", done.stdout, re.MULTILINE)]
    assert [line for line, code in zip(lines, codes, strict=True) if code] == [], done.stdout
    if page.name not in IN_A_PROJECT:
        assert {path.name for path in set(desk.iterdir()) - before} <= LEFT_BEHIND


def test_every_reason_not_to_type_a_command_has_one() -> None:
    every = [line for lines in LINES.values() for line in lines]
    idle = [pattern for pattern in NOT_TYPED if not any(re.match(pattern, e) for e in every)]
    assert idle == []
    for reason in NOT_TYPED.values():
        for named in re.findall(r"tests/[\w/.]+", reason):
            assert (ROOT / named).exists()
