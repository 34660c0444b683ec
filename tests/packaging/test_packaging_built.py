"""Sdist and wheel contain everything that a run needs, and nothing else.

Without its extras navfw imports, and each command, option and name says which one it needs.
"""

import json
import os
import re
import shutil
import sys
import tarfile
import tomllib
from pathlib import Path
from typing import Any

import processes
import pytest
from cli_calls import put_file
from processes import Done, python, uv

from navfw.config.extras import extra_imports, require_extra
from navfw.errors import MissingExtraError

ROOT = Path(__file__).parents[2]
PYTHONS = ("3.11", "3.12", "3.13")
SHIPPED = {"behaviors": ("*.py", "*.yaml"), "maps": ("*.yaml",), "worlds": ("*.yaml",)}
LOCAL = {".git", ".venv", ".tools", "runs", "dist", "uv.lock", "__pycache__"}


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


def run(command: list[str], folder: Path, path: str | None = None, **options: Any) -> Done:
    """The ended process of a command with ``path`` as that of Python's modules."""
    return processes.run(command, cwd=folder, env={"PYTHONPATH": path}, timeout=600, **options)


def listed(installed: Path, folder: Path, kind: str) -> list[dict[str, Any]]:
    """What ``navfw list`` of that installation gives."""
    code = (
        "import os, sys, navfw; sys.argv[0] = 'navfw'\n"
        "assert navfw.__file__.startswith(os.environ['PYTHONPATH']), navfw.__file__\n"
        "from navfw.cli import main; main()"
    )
    words = [sys.executable, "-c", code, "list", kind, "--json"]
    done = run(words, folder, str(installed), check=True)
    rows: list[dict[str, Any]] = json.loads(done.stdout)
    return rows


def test_the_sdist_has_the_sources_and_nothing_local(dist: Path) -> None:
    (sdist,) = dist.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        top = sdist.name.removesuffix(".tar.gz")
        paths = [Path(name).relative_to(top) for name in archive.getnames()]
    assert [str(path) for path in paths if LOCAL & set(path.parts)] == []
    tops = {path.parts[0] for path in paths}
    assert {"navfw", "behaviors", "maps", "worlds", "tests", "docs", "pyproject.toml"} <= tops


def test_the_wheel_contains_every_data_file(installed: Path) -> None:
    def below(folder: Path, pattern: str) -> set[Path]:
        return {path.relative_to(folder) for path in folder.rglob(pattern)}

    package = installed / "navfw"
    for folder, patterns in SHIPPED.items():
        for pattern in patterns:
            wanted = below(ROOT / folder, pattern)
            assert wanted == below(package / "shipped" / folder, pattern) != set()
    for pattern in ("*.yaml", "*.json", "*.html", "*.py", "*.pyi", "py.typed"):
        got = {path for path in below(package, pattern) if path.parts[0] != "shipped"}
        assert below(ROOT / "navfw", pattern) == got != set()
    assert sorted(path.name.split("-")[0] for path in installed.iterdir()) == ["navfw", "navfw"]


@pytest.mark.thorough
def test_the_benchmarks_are_a_wheel_of_their_own(tmp_path: Path) -> None:
    run(
        [uv(), "build", "--quiet", "--wheel", "--out-dir", str(tmp_path), "benchmarks"],
        ROOT,
        check=True,
    )
    (wheel,) = tmp_path.glob("navfw_benchmarks-*.whl")
    shutil.unpack_archive(wheel, tmp_path / "site", "zip")
    package = ROOT / "benchmarks" / "navfw_benchmarks"
    wanted = {path.relative_to(package) for path in package.rglob("*.*") if path.suffix != ".pyc"}
    unpacked = tmp_path / "site" / "navfw_benchmarks"
    assert {path.relative_to(unpacked) for path in unpacked.rglob("*.*")} == wanted
    assert {Path("plugins/fusions.py"), Path("stacks/balance.yaml")} < wanted


@pytest.mark.thorough
def test_an_installed_navfw_lists_its_files_from_any_folder(
    installed: Path, tmp_path: Path
) -> None:
    rows = listed(installed, tmp_path, "worlds")
    assert {"office", "paper-room", "empty"} <= {row["name"] for row in rows}
    assert {(row["source"], row["status"]) for row in rows} == {("shipped", "ok")}
    plugins = listed(installed, tmp_path, "plugins")
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
        run([sys.executable, "-m", *words], ROOT, check=True)


def test_the_links_of_the_wheels_readme_are_absolute(installed: Path) -> None:
    (metadata,) = installed.glob("navfw-*.dist-info/METADATA")
    readme = metadata.read_text(encoding="utf-8").partition("\n\n")[2]
    links = re.findall(r"\]\(([^)\s]+)\)", readme)
    assert len(links) > 5
    assert [link for link in links if not link.startswith(("https://", "#"))] == []


class Environment:
    """A Python with the wheel installed from wheels alone, with the pins of the project."""

    def __init__(self, folder: Path, version: str, wheel: Path, extra: str, *more: str) -> None:
        found = run([uv(), "python", "find", "--no-python-downloads", version], folder)
        if found.returncode:
            pytest.skip(f"needs Python {version}")
        self.python = folder / "environment" / "bin" / "python"
        with (ROOT / "pins" / "pyproject.toml").open("rb") as file:
            pins = tomllib.load(file)["dependency-groups"]["pins"]
        (folder / "pins.txt").write_text("\n".join(pins), encoding="utf-8")
        wanted = f"navfw[{extra}] @ {wheel.as_uri()}"
        install = ["pip", "install", "--python", str(self.python), "--only-binary", ":all:"]
        for words in (
            ["venv", "--python", found.stdout.strip(), str(folder / "environment")],
            [*install, "-c", str(folder / "pins.txt"), wanted, *more],
        ):
            run([uv(), *words, "--quiet"], folder, check=True)

    def navfw(self, folder: Path, *words: str) -> Done:
        return run([str(self.python.with_name("navfw")), *words], folder)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a recorded run, driven by this Python."""
    folder = tmp_path_factory.mktemp("recorded")
    words = ["empty", "straight", "--record", "--json", "--out", str(folder / "run")]
    run([sys.executable, "-m", "navfw", "run", *words], folder, check=True)
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
    environment = Environment(tmp_path, version, wheel, "sim", "pytest")
    assert "Of installed packages" not in environment.navfw(tmp_path, "--help").stdout
    balance = environment.navfw(tmp_path, "suite", "hard", "--seeds", "0:1", "--variant", "balance")
    assert "needs navfw-benchmarks, which is not installed" in balance.stderr
    done = environment.navfw(tmp_path, "run", "empty", "straight", "--json")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["outcome"] == "reached"
    assert (tmp_path / answer["run_folder"] / "trajectory.png").is_file()
    result = json.loads((recorded / "result.json").read_text(encoding="utf-8"))
    assert answer["command_hash"] == result["command_hash"]
    environment.navfw(tmp_path, "new", "project", "mine")  # its tests record where they can
    run([str(environment.python), "-m", "pytest", "-q"], tmp_path / "mine", check=True)


EXECUTE = """
import sys, nbformat
from nbclient import NotebookClient
book = nbformat.read(sys.argv[1], 4)
NotebookClient(book, timeout=600, kernel_name="python3").execute()
print(*(out.get("text", "") for cell in book.cells for out in cell.get("outputs", ())))
"""


@pytest.mark.slow
def test_the_notebooks_run_without_a_display(dist: Path, tmp_path: Path) -> None:
    (wheel,) = dist.glob("*.whl")
    tools = ("nbclient", "nbformat", "ipykernel", "pip")
    environment = Environment(tmp_path, "3.12", wheel, "sim,record", *tools)
    variables = {"DISPLAY": None, "NAVFW": f"navfw[sim,record] @ {wheel.as_uri()}"}
    variables["PATH"] = f"{environment.python.parent}{os.pathsep}{os.environ['PATH']}"
    for name, said in (
        ("examples/first_drive.ipynb", "reached: "),
        ("docs/python.ipynb", "led by "),
    ):
        words = [str(environment.python), "-c", EXECUTE, str(ROOT / name)]
        done = processes.run(words, cwd=tmp_path, env=variables, timeout=900)
        assert done.returncode == 0, done.stderr[-3000:]
        assert said in done.stdout


@pytest.mark.slow
def test_builds_of_one_revision_are_equal(dist: Path, tmp_path: Path) -> None:
    """Built again from a copy in another folder, with other times."""
    copy = tmp_path / "copy"
    ignored = shutil.ignore_patterns(*LOCAL, ".mypy_cache", ".ruff_cache", "generated")
    shutil.copytree(ROOT, copy, ignore=ignored, copy_function=shutil.copy)
    shutil.copy(ROOT / ".gitignore", copy / ".gitignore")
    out = tmp_path / "dist"
    run([uv(), "build", "--quiet", "--out-dir", str(out), str(copy)], copy, check=True)
    for built in (*dist.glob("*.whl"), *dist.glob("*.tar.gz")):
        assert built.read_bytes() == (out / built.name).read_bytes(), built.name


# --- extras --------------------------------------------------------------------------------------

OPTIONAL = """
    pybullet pybullet_data matplotlib jinja2 foxglove mcap mcap_protobuf trimesh collada
    websockets gymnasium optuna distributed av pandas navground
"""
"""The modules of all extras."""

COMMANDS = {
    "run empty straight": "sim",
    "suite rooms --seeds 0:1": "sim",
    "tune rooms --stack default --trials 1": "tune",
    "replay RUN": "record",
    "explain RUN --at 1": "record",
    "report RUN": "record",
    "map show empty": "report",
    "replay RUN --video out.mp4": "video",
}
"""Commands, and the first extra that each of them lacks."""

NAMES = {
    "navfw.run": "sim",
    "navfw.open_simulation": "sim",
    "navfw.open_run": "record",
    "navfw.gym": "gym",
}
"""Names of Python, likewise."""

CORE = ("Stack", "SensorReading", "Frame", "RobotModel", "load_map", "RuledBehavior", "Planner")


def without_extras(code: str, folder: Path) -> Done:
    """What ``code`` prints in a fresh process in which no module of an extra can be imported."""
    blocked = f"import sys; sys.modules.update(dict.fromkeys({OPTIONAL.split()!r}))\n"
    return python(blocked + code, cwd=folder)


def test_every_extra_is_among_all() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (everything,) = project["optional-dependencies"].pop("all")[:1]
    named = re.fullmatch(r"navfw\[(.+)\]", everything)
    assert named is not None
    assert sorted(named[1].split(",")) == sorted(project["optional-dependencies"])


def test_the_message_names_module_extra_and_remedy() -> None:
    with pytest.raises(MissingExtraError) as caught, extra_imports("report", key="--plot"):
        import no_such_module  # type: ignore[import-not-found]  # noqa: F401
    assert caught.value.extra == "report"
    assert str(caught.value) == (
        "--plot: needs no_such_module, which is not installed: pip install 'navfw[report]', or in"
        " a clone uv sync --extra report"
    )
    with pytest.raises(MissingExtraError, match=r"navfw tune: needs no_such_module, .*\[tune\]"):
        require_extra("tune", "no_such_module", key="navfw tune")
    require_extra("sim", "math")


def test_an_error_of_another_kind_is_not_taken_for_a_missing_extra() -> None:
    with pytest.raises(ZeroDivisionError), extra_imports("sim"):
        _ = 1 // 0


def test_the_robots_half_needs_no_extra(tmp_path: Path) -> None:
    code = f"import navfw; print([getattr(navfw, name).__name__ for name in {CORE!r}])"
    done = without_extras(code, tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == str(list(CORE))


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("words", "extra"),
    [
        pytest.param(*item, marks=() if item[1] in {"sim", "report"} else pytest.mark.slow)
        for item in COMMANDS.items()
    ],
)
def test_a_command_says_which_extra_it_needs(words: str, extra: str, tmp_path: Path) -> None:
    run = put_file(tmp_path, "run/result.json", "{}").parent
    argv = [str(run) if word == "RUN" else word for word in words.split()]
    code = f"sys.argv = ['navfw', *{argv!r}]\nfrom navfw.cli import main; main()"
    done = without_extras(code, tmp_path)
    assert done.returncode == 2, done.stdout + done.stderr
    (line,) = done.stderr.strip().splitlines()
    assert line.startswith("navfw: ")
    assert f"pip install 'navfw[{extra}]'" in line
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


@pytest.mark.parametrize(("name", "extra"), NAMES.items())
def test_a_name_says_which_extra_it_needs(name: str, extra: str, tmp_path: Path) -> None:
    module, _, attribute = name.partition(".")
    code = f"from {module} import {attribute}" if attribute != "gym" else "import navfw.gym"
    done = without_extras(code, tmp_path)
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("navfw.errors.MissingExtraError: ")
    assert f"pip install 'navfw[{extra}]'" in last
