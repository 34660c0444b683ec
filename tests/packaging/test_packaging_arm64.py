"""The robot's half on an emulated arm64 board: from wheels alone, over a recorded run.

The board is a folder with Debian's packages, whose programs ``qemu-user-static`` runs. Compiling
takes it some ten minutes, so these tests run on request: ``pytest -m slow -k arm64``.
"""

import json
import os
import shutil
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import processes
import pytest
from processes import Done, uv

ROOT = Path(__file__).parents[2]
PACKAGES = """
    libc6 libgcc-s1 libstdc++6 libgomp1 zlib1g libexpat1 libssl3 libffi8 libbz2-1.0 liblzma5
    libsqlite3-0 libuuid1 libcrypt1 python3.11 python3.11-minimal libpython3.11-minimal
    libpython3.11-stdlib
"""
"""Python 3.11 of Debian 12 and the libraries that wheels expect of a system."""
DRIVE = """
import json, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from drive_recorded import load_recording, load_stack
folder = Path(sys.argv[2])
stack = load_stack(folder)
twists = [stack.step(reading) for reading in load_recording(folder / "run.mcap").readings]
print(json.dumps([(twist.v, twist.w) for twist in twists]))
"""
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not all(map(shutil.which, ("qemu-aarch64-static", "apt-get", "dpkg-deb"))),
        reason="needs qemu-user-static, apt-get and dpkg-deb",
    ),
]


class Board:
    """A folder with arm64's Debian packages and the wheels of navfw in ``site``."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.site = folder, folder / "site"
        self._fetch_packages()
        with (ROOT / "pins" / "pyproject.toml").open("rb") as file:
            pins = tomllib.load(file)["dependency-groups"]["pins"]
        (folder / "pins.txt").write_text("\n".join(pins), encoding="utf-8")
        target = ["--python-platform", "aarch64-manylinux_2_31", "--python-version", "3.11"]
        install = [uv(), "pip", "install", "--quiet", "--only-binary", ":all:", *target]
        build = [uv(), "build", "--quiet", "--wheel", "--out-dir", str(folder / "dist"), str(ROOT)]
        processes.run(build, cwd=folder, check=True)
        (wheel,) = (folder / "dist").glob("*.whl")
        wanted = [f"navfw[record] @ {wheel.as_uri()}", "pytest", "pytest-cov", "hypothesis"]
        options = ["--target", str(self.site), "-c", str(folder / "pins.txt")]
        processes.run([*install, *options, *wanted], cwd=folder, check=True)

    def _fetch_packages(self) -> None:
        """Unpack the packages, with lists of packages of the board's own."""
        for name in ("apt/lists/partial", "apt/archives/partial", "debs", "root"):
            (self.folder / name).mkdir(parents=True)
        (self.folder / "apt" / "status").touch()
        settings = {
            "Dir::State::Lists": self.folder / "apt" / "lists",
            "Dir::State::status": self.folder / "apt" / "status",
            "Dir::Cache": self.folder / "apt",
            "APT::Architecture": "arm64",
            "APT::Architectures": "arm64",
        }
        apt = ["apt-get", "-qq", *(f"-o{name}={value}" for name, value in settings.items())]
        for words in (["update"], ["download", *PACKAGES.split()]):
            done = processes.run([*apt, *words], cwd=self.folder / "debs")
            if done.returncode:
                pytest.skip(f"needs arm64's packages of Debian 12: {done.stderr[-200:]}")
        for package in (self.folder / "debs").glob("*.deb"):
            processes.run(["dpkg-deb", "-x", package, self.folder / "root"], check=True)

    def python(self, words: Sequence[object], folder: Path) -> Done:
        """The ended process of the board's Python."""
        root = self.folder / "root"
        command = ["qemu-aarch64-static", "-L", root, root / "usr" / "bin" / "python3.11", *words]
        variables = dict.fromkeys(name for name in os.environ if name.startswith(("PY", "NAVFW")))
        variables |= {"HOME": str(self.folder), "PYTHONPATH": str(self.site)}
        return processes.run(command, cwd=folder, env=variables, timeout=3000.0, check=True)


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Board:
    return Board(tmp_path_factory.mktemp("board"))


def test_over_a_recorded_run_the_commands_are_those_of_this_machine(
    board: Board, tmp_path: Path
) -> None:
    """All but the last digits: OpenCV's functions fuse operations there (docs/decisions/0068)."""
    words = "run office lobby-to-lab --record --quiet --set mission.timeout=4 --out drive"
    processes.run([sys.executable, "-m", "navfw", *words.split()], cwd=tmp_path)
    drive = ["-c", DRIVE, ROOT / "examples", tmp_path / "drive"]
    here = processes.run([sys.executable, *drive], cwd=tmp_path, check=True)
    there = board.python(drive, tmp_path)
    ours, theirs = (np.array(json.loads(done.stdout)) for done in (here, there))
    assert ours.shape == theirs.shape
    assert np.abs(ours).max() > 0.1
    assert np.abs(theirs - ours).max() < 1e-4


def test_moving_objects_are_told_from_the_floor(board: Board, tmp_path: Path) -> None:
    """As filter2D of OpenCV 5.0, which counts wrong on arm64, did not."""
    shutil.copytree(ROOT / "tests" / "movers", tmp_path / "tests" / "movers")
    shutil.copytree(ROOT / "tests" / "helpers", tmp_path / "tests" / "helpers")
    for name in ("pyproject.toml", "tests/conftest.py"):
        shutil.copyfile(ROOT / name, tmp_path / name)
    words = ["-m", "pytest", "-q", "-m", "not slow", "tests/movers/test_movers_localization.py"]
    done = board.python(words, tmp_path)
    assert " passed" in done.stdout
