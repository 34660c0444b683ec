"""Sdist and wheel contain everything that a run needs, and nothing else."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path

import processes
import pytest
from processes import Done

ROOT = Path(__file__).parents[2]
PYTHONS = ("3.11", "3.12", "3.13")
SHIPPED = {"behaviors": ("*.py", "*.yaml"), "maps": ("*.yaml",), "worlds": ("*.yaml",)}
LOCAL = {".git", ".venv", ".tools", "runs", "dist", "uv.lock", "__pycache__"}


def uv() -> str:
    """The uv that runs these tests, or any other."""
    found = os.environ.get("UV") or shutil.which("uv")
    local = ROOT / ".tools" / "uv" / "bin" / "uv"
    if found is None and not local.is_file():
        pytest.skip("needs uv")
    return found or str(local)


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with sdist and wheel; the wheel is built from the sdist."""
    folder = tmp_path_factory.mktemp("dist")
    build = [uv(), "build", "--quiet", "--out-dir", str(folder), str(ROOT)]
    # a synced project has the build backend; otherwise it is downloaded
    for options in (["--offline"], []):
        done = run([*build, *options], ROOT)
        if done.returncode == 0:
            return folder
    pytest.fail(done.stderr)


@pytest.fixture(scope="module")
def installed(dist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The content of the wheel, to precede the checkout on Python's path."""
    (wheel,) = dist.glob("*.whl")
    folder = tmp_path_factory.mktemp("site")
    shutil.unpack_archive(wheel, folder, "zip")
    return folder


def run(command: list[str], folder: Path, path: str | None = None) -> Done:
    """The ended process of a command with ``path`` as that of Python's modules."""
    return processes.run(command, cwd=folder, env={"PYTHONPATH": path}, timeout=600)


def navfw(installed: Path, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    code = (
        "import os, sys, navfw; sys.argv[0] = 'navfw'\n"
        "assert navfw.__file__.startswith(os.environ['PYTHONPATH']), navfw.__file__\n"
        "from navfw.cli import main; main()"
    )
    return run([sys.executable, "-c", code, *words], folder, str(installed))


def test_the_sdist_has_the_sources_and_nothing_local(dist: Path) -> None:
    (sdist,) = dist.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        paths = [
            Path(name).relative_to(sdist.name.removesuffix(".tar.gz"))
            for name in archive.getnames()
        ]
    assert [str(path) for path in paths if LOCAL & set(path.parts)] == []
    tops = {path.parts[0] for path in paths}
    assert {"navfw", "behaviors", "maps", "worlds", "tests", "docs", "pyproject.toml"} <= tops


def test_the_wheel_contains_every_data_file(installed: Path) -> None:
    package = installed / "navfw"
    for folder, patterns in SHIPPED.items():
        for pattern in patterns:
            wanted = {path.relative_to(ROOT) for path in (ROOT / folder).rglob(pattern)}
            got = {
                path.relative_to(package / "shipped")
                for path in (package / "shipped" / folder).rglob(pattern)
            }
            assert wanted == got != set()
    for pattern in ("*.yaml", "*.csv", "*.html", "*.py", "*.pyi", "py.typed"):
        wanted = {path.relative_to(ROOT / "navfw") for path in (ROOT / "navfw").rglob(pattern)}
        got = {path.relative_to(package) for path in package.rglob(pattern)}
        assert wanted == {path for path in got if path.parts[0] != "shipped"} != set()
    assert sorted(path.name.split("-")[0] for path in installed.iterdir()) == ["navfw", "navfw"]


@pytest.mark.thorough
def test_an_installed_navfw_lists_its_files_from_any_folder(
    installed: Path, tmp_path: Path
) -> None:
    done = navfw(installed, tmp_path, "list", "worlds", "--json")
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)
    assert {"office", "paper-room", "empty"} <= {row["name"] for row in rows}
    assert {(row["source"], row["status"]) for row in rows} == {("shipped", "ok")}
    done = navfw(installed, tmp_path, "list", "plugins", "--json")
    assert done.returncode == 0, done.stderr
    plugins = json.loads(done.stdout)
    assert {"avoid", "go_to_xy", "travel"} <= {row["name"] for row in plugins}
    assert [row["error"] for row in plugins if row["status"] != "ok"] == []
    assert list(tmp_path.iterdir()) == []


@pytest.mark.thorough
def test_the_distributions_can_be_published(dist: Path) -> None:
    """The readme renders, the metadata are valid, and the wheel contains no stray files."""
    (wheel,), (sdist,) = dist.glob("*.whl"), dist.glob("*.tar.gz")
    for words in (
        ["twine", "check", "--strict", str(wheel), str(sdist)],
        ["check_wheel_contents", "--no-config", str(wheel)],
    ):
        done = run([sys.executable, "-m", *words], ROOT)
        assert done.returncode == 0, done.stdout + done.stderr


def test_the_links_of_the_wheels_readme_are_absolute(installed: Path) -> None:
    (metadata,) = installed.glob("navfw-*.dist-info/METADATA")
    readme = metadata.read_text(encoding="utf-8").partition("\n\n")[2]
    links = re.findall(r"\]\(([^)\s]+)\)", readme)
    assert len(links) > 5
    assert [link for link in links if not link.startswith(("https://", "#"))] == []


class Environment:
    """A Python with the wheel installed from wheels alone, with the pins of the project."""

    def __init__(self, folder: Path, version: str, wheel: Path, extra: str) -> None:
        found = run([uv(), "python", "find", "--no-python-downloads", version], folder)
        if found.returncode:
            pytest.skip(f"needs Python {version}")
        self.python = folder / "environment" / "bin" / "python"
        with (ROOT / "pyproject.toml").open("rb") as file:
            pins = tomllib.load(file)["tool"]["uv"]["constraint-dependencies"]
        (folder / "pins.txt").write_text("\n".join(pins), encoding="utf-8")
        wanted = f"navfw[{extra}] @ {wheel.as_uri()}"
        install = ["pip", "install", "--python", str(self.python), "--only-binary", ":all:"]
        for words in (
            ["venv", "--python", found.stdout.strip(), str(folder / "environment")],
            [*install, "-c", str(folder / "pins.txt"), wanted],
        ):
            done = run([uv(), *words, "--quiet"], folder)
            assert done.returncode == 0, done.stderr

    def navfw(self, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
        return run([str(self.python.with_name("navfw")), *words], folder)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a recorded run, driven by this Python."""
    folder = tmp_path_factory.mktemp("recorded")
    words = ["empty", "straight", "--record", "--json", "--out", str(folder / "run")]
    done = run([sys.executable, "-m", "navfw", "run", *words], folder)
    assert done.returncode == 0, done.stderr
    return folder / "run"


@pytest.mark.slow
@pytest.mark.parametrize("version", PYTHONS)
def test_the_stack_drives_recorded_frames_without_a_simulator(
    dist: Path, recorded: Path, version: str, tmp_path: Path
) -> None:
    (wheel,) = dist.glob("*.whl")
    environment = Environment(tmp_path, version, wheel, "record")
    for module in ("pybullet", "matplotlib", "pytest"):
        assert run([str(environment.python), "-c", f"import {module}"], tmp_path).returncode == 1
    example = ROOT / "examples" / "drive_recorded.py"
    done = run([str(environment.python), str(example), str(recorded)], tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1].startswith("0 of ")
    done = environment.navfw(tmp_path, "replay", str(recorded))
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("same commands in all ")
    done = environment.navfw(tmp_path, "run", "empty", "straight")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("navfw: needs pybullet, which is not installed: pip install")


@pytest.mark.slow
@pytest.mark.parametrize("version", PYTHONS)
def test_the_wheel_drives_in_an_empty_environment(
    dist: Path, recorded: Path, version: str, tmp_path: Path
) -> None:
    (wheel,) = dist.glob("*.whl")
    environment = Environment(tmp_path, version, wheel, "sim")
    done = environment.navfw(tmp_path, "run", "empty", "straight", "--json")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["outcome"] == "reached"
    assert (tmp_path / answer["run_folder"] / "trajectory.png").is_file()
    result = json.loads((recorded / "result.json").read_text(encoding="utf-8"))
    assert answer["command_hash"] == result["command_hash"]
