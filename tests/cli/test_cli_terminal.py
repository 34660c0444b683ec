"""Commands on a terminal of 80 and 120 columns: what its screen shows, and what Ctrl-C leaves."""

import os
import re
import shutil
import sys
import types
from pathlib import Path

import pytest
from cli_calls import commands, put_file
from perceive_calls import APPROACH
from perceive_images import save
from terminals import Terminal

from navfw.__main__ import main
from navfw.process import compile_kernels
from navfw.recording import read_result

NAVFW = (
    sys.executable,
    "-c",
    "import sys; sys.argv[0] = 'navfw'; from navfw.cli import main; main()",
)

SEVERAL = """
import sys
from navfw.cli import main
for line in sys.argv[1:]:
    sys.argv = ["navfw", *line.split()]
    print("$", line, flush=True)
    try:
        main()
    except SystemExit as end:
        print("exit code", end.code or 0, flush=True)
"""
"""Calls several commands, of which the imports are shared."""

SUITE = "entries: [{world: empty, missions: [straight], set: {mission.timeout: 1}}]\n"

ROOT = Path(__file__).parents[2]
SCREENS = Path(__file__).with_name("screens")
PLAIN = [{"NO_COLOR": "1"}, {"TERM": "dumb"}]

VOLATILE = [
    (r"\d+\.\d x real time \(\d+\.\d s\)", "#.# x real time (#.# s)"),
    (r"commands    \w{16}", "commands    #"),
    (r"\d+\.\d+ of \d+\.\d+ s", "# of # s"),
]
"""What differs from run to run and from machine to machine."""


@pytest.fixture
def place(tmp_path: Path, recorded: Path) -> Path:
    """A working folder with a recorded run, a suite and images."""
    (tmp_path / "drive").symlink_to(recorded)
    put_file(tmp_path, "tiny.yaml", SUITE)
    return tmp_path


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a recorded run, driven on a terminal."""
    compile_kernels()
    folder = tmp_path_factory.mktemp("recorded") / "drive"
    words = ("run", "empty", "straight", "--record", "--out", folder.name)
    with Terminal([*NAVFW, *words], cwd=folder.parent) as terminal:
        assert terminal.ended() == 0, terminal.text()
        assert terminal.faults() == []
        shown = terminal.text()
        drawn = terminal.printed.decode()
    assert "fault" not in shown
    assert "m to go" in drawn  # by the live line
    assert "m to go" not in shown
    assert_screen("run", shown)
    return folder


def shown(place: Path, *words: str, columns: int = 80, code: int = 0, **env: str | None) -> str:
    """The screen at the end of a command, which must end with ``code`` and without a fault."""
    with Terminal([*NAVFW, *words], columns=columns, cwd=place, env=env) as terminal:
        ended = terminal.ended()
        assert (ended, terminal.faults()) == (code, []), terminal.text()
        return terminal.text()


def assert_screen(name: str, text: str) -> None:
    """The text is that of the file; NAVFW_SCREENS=1 writes it."""
    for pattern, stands in VOLATILE:
        text = re.sub(pattern, stands, text)
    file = SCREENS / f"{name}.txt"
    if os.environ.get("NAVFW_SCREENS"):
        put_file(SCREENS, file.name, f"{text}\n")
    assert text == file.read_text().rstrip("\n")


HELP = ["-h", *(" ".join([*words, "-h"]) for words, _ in commands() if words)]

LOOKS = {
    0: [
        *("list", "list worlds", "list missions office", "list stacks", "list robots", "list maps"),
        *("list suites", "list plugins", "list plugins --kind behavior", "explain drive --at 5"),
        *("map check office", "map plan office lobby lab", "map show empty", "world show empty"),
        *("trust --list", "warm", "check tiny.yaml", "new project mine", "report drive"),
    ],
    2: [
        *("run nowhere straight", "run empty nothing", "run empty straight --set avoid.latancy=1"),
        *("run empty straight --set mission.timeout=never", "replay nothing", "perceive nothing"),
        *("ros drive --map nowhere", "ros sim nowhere", "list missions nowhere", "list plguins"),
        *("explain drive --at 5000", "report nothing", "export nothing --to bag", "rnu"),
        *("world show nowhere", "map plan office lobby nowhere", "suite nothing --seeds 0:1"),
        *("suite tiny.yaml --seeds x", "tune nothing", "new robot", "check nothing.yaml"),
        *("schema nothing", "trust nowhere", "warm --nothing", "bench nothing", "results nothing"),
        *("reproduce --views", "run", "rules nothing", "demo --nothing"),
    ],
}
"""Commands by exit code, all of ``navfw --help``."""


def several(place: Path, lines: list[str], columns: int) -> dict[str, str]:
    """What a terminal shows of each of several commands; it must be without a fault."""
    with Terminal([sys.executable, "-c", SEVERAL, *lines], columns=columns, cwd=place) as terminal:
        assert (terminal.ended(), terminal.faults()) == (0, [])
        parts = f"\n{terminal.text()}".split("\n$ ")
    return dict(part.partition("\n")[::2] for part in parts[1:])


@pytest.mark.parametrize("columns", [80, 120])
def test_the_help_of_every_command_fits(columns: int, tmp_path: Path) -> None:
    texts = several(tmp_path, HELP, columns)
    assert list(texts) == HELP
    for line, text in texts.items():
        assert text.endswith("exit code 0"), line
        assert "..." not in text.partition("Commands:")[2], f"{line}: cut"


def test_every_command_is_looked_at() -> None:
    looked = {line.split()[0] for lines in LOOKS.values() for line in lines}
    assert {words[0] for words, _ in commands() if words} <= looked


@pytest.mark.thorough
@pytest.mark.parametrize("columns", [80, pytest.param(120, marks=pytest.mark.slow)])
@pytest.mark.parametrize("code", LOOKS)
def test_commands_look_well(code: int, columns: int, place: Path) -> None:
    texts = several(place, LOOKS[code], columns)
    wrong = [
        f"{line}: {text}" for line, text in texts.items() if not text.endswith(f"exit code {code}")
    ]
    assert (wrong, list(texts)) == ([], LOOKS[code])
    assert "Traceback" not in "".join(texts.values())


@pytest.mark.parametrize(
    ("name", "words"),
    [("list", "list worlds"), ("explain", "explain drive --at 5"), ("check", "check tiny.yaml")],
)
def test_screens(name: str, words: str, place: Path) -> None:
    assert_screen(name, shown(place, *words.split()))


@pytest.mark.thorough
def test_the_screen_of_a_suite(place: Path) -> None:
    assert_screen("suite", shown(place, *["suite", "tiny.yaml", "--seeds", "0:2", "--out", "s"]))


@pytest.mark.thorough
def test_the_screen_of_perceived_images(place: Path) -> None:
    save(place, APPROACH)
    images = sorted(file.name for file in place.glob("image_*.png"))
    assert_screen("perceive", shown(place, "perceive", *images, "--hfov", "60"))


@pytest.mark.parametrize("setting", PLAIN, ids=str)
def test_no_colour_where_none_is_wanted(setting: dict[str, str], place: Path) -> None:
    with Terminal([*NAVFW, "list", "worlds"], cwd=place, env={**setting}) as terminal:
        assert terminal.ended() == 0
        assert terminal.faults() == []
        assert not re.search(rb"\x1b\[[0-9;]*[34]\dm", terminal.printed)
        if "TERM" in setting:
            assert b"\x1b" not in terminal.printed


LONG = ("run", "office", "patrol", "--out", "long")


@pytest.mark.thorough
@pytest.mark.parametrize(
    "setting", [{}, *(pytest.param(one, marks=pytest.mark.slow) for one in PLAIN)], ids=str
)
def test_ctrl_c_ends_a_run_as_cancelled(setting: dict[str, str], tmp_path: Path) -> None:
    with Terminal([*NAVFW, *LONG], cwd=tmp_path, env={**setting}) as terminal:
        terminal.wait_for("m to go")
        terminal.press("\x03")
        assert terminal.ended() == 130, terminal.text()
        assert terminal.faults() == []
        first = terminal.lines()[0 if setting.get("TERM") != "dumb" else -7]
    assert "cancelled after" in first
    assert "stopped by the user" in first
    assert read_result(tmp_path / "long")["outcome"] == "cancelled"


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("words", "text"),
    [
        ("suite tiny.yaml --seeds 0:5000 --out s --keep none", " of 5000 runs"),
        ("bench planning", "bench"),
    ],
)
def test_ctrl_c_says_one_line(words: str, text: str, place: Path) -> None:
    with Terminal([*NAVFW, *words.split()], cwd=place) as terminal:
        terminal.wait_for(text)
        terminal.press("\x03")
        assert terminal.ended() == 130, terminal.text()
        assert terminal.faults() == []
        said = [line.removeprefix("^C") for line in terminal.lines()]
    if words.startswith("suite"):
        assert "interrupted; --resume runs the rest" in said
    else:
        assert said[-1] == "navfw: interrupted"
        assert len(said) == 1


class Interrupted(types.ModuleType):
    """A module in whose import Ctrl-C is pressed."""

    def __getattr__(self, name: str) -> object:
        raise KeyboardInterrupt


def test_ctrl_c_during_the_imports_leaves_no_traceback(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "navfw.cli", Interrupted("navfw.cli"))
    with pytest.raises(SystemExit) as end:
        main()
    assert (end.value.code, capsys.readouterr().err) == (130, "navfw: interrupted\n")


@pytest.mark.slow
def test_make_run() -> None:
    if shutil.which("make") is None:
        pytest.skip("make is not installed")
    with Terminal(["make", "run"], cwd=ROOT, env={"UV_OFFLINE": "1"}) as terminal:
        code = terminal.ended()
        if code == 2 and "network" in terminal.text():
            pytest.skip("make run needs the network")
        assert (code, terminal.faults()) == (0, []), terminal.text()
        assert "reached after" in terminal.text()
