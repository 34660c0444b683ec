"""Sdist and wheel contain everything that a run needs, and nothing else."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
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
        done = subprocess.run(  # noqa: S603 - uv, fixed arguments
            [*build, *options], capture_output=True, text=True, timeout=600, check=False
        )
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


def navfw(installed: Path, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    code = (
        "import os, sys, navfw; sys.argv[0] = 'navfw'\n"
        "assert navfw.__file__.startswith(os.environ['PYTHONPATH']), navfw.__file__\n"
        "from navfw.cli import main; main()"
    )
    return subprocess.run(  # noqa: S603 - this Python, fixed arguments
        [sys.executable, "-c", code, *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(installed)},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )


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
    for pattern in ("*.yaml", "*.csv", "*.html", "*.py", "py.typed"):
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


@pytest.mark.slow
def test_the_wheel_drives_in_an_empty_environment(dist: Path, tmp_path: Path) -> None:
    (wheel,) = dist.glob("*.whl")
    environment, elsewhere = tmp_path / "environment", tmp_path / "elsewhere"
    elsewhere.mkdir()
    with (ROOT / "pyproject.toml").open("rb") as file:
        pins = tomllib.load(file)["tool"]["uv"]["constraint-dependencies"]
    (tmp_path / "pins.txt").write_text("\n".join(pins), encoding="utf-8")
    python = environment / "bin" / "python"
    install = ["pip", "install", "--python", str(python), "-c", str(tmp_path / "pins.txt")]
    for words in (["venv", "--python", sys.executable, str(environment)], [*install, str(wheel)]):
        done = subprocess.run(  # noqa: S603 - uv, fixed arguments
            [uv(), *words, "--quiet"], capture_output=True, text=True, timeout=600, check=False
        )
        assert done.returncode == 0, done.stderr
    done = subprocess.run(  # noqa: S603 - the command just installed
        [str(environment / "bin" / "navfw"), "run", "empty", "straight", "--json"],
        cwd=elsewhere,
        env={name: value for name, value in os.environ.items() if name != "PYTHONPATH"},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["outcome"] == "reached"
    assert (elsewhere / answer["run_folder"] / "trajectory.png").is_file()
