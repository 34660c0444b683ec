"""What only POSIX has is not needed: fork, flock, interval timers, limits, the user database.

They are taken away in processes of this Python, and in those that these start, by a module that
every Python imports first. That the rest of Windows is like Linux is not shown by this.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from cli_calls import put_file
from processes import Done, run

WITHOUT = """
import multiprocessing, os, signal, sys

for name in ("fcntl", "resource", "pwd", "grp", "termios"):
    sys.modules[name] = None
for module, names in (
    (os, "fork forkpty set_blocking O_NOFOLLOW sched_getaffinity killpg setsid"),
    (signal, "SIGALRM setitimer getitimer ITIMER_REAL siginterrupt alarm pthread_sigmask"),
):
    for name in names.split():
        vars(module).pop(name)
os.environ["NAVFW_TEST_TAKEN_AWAY"] = "yes"
multiprocessing.set_start_method("spawn", force=True)
"""


@pytest.fixture(scope="module")
def without(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str | None]:
    """The environment of a Python without them."""
    folder = tmp_path_factory.mktemp("without")
    put_file(folder, "sitecustomize.py", WITHOUT)
    path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    return {"PYTHONPATH": path, "NAVFW_TRUST": None}


def called(folder: Path, environment: dict[str, str | None], *words: object) -> Done:
    code = "import os; from navfw.__main__ import main; main()"
    if environment:
        code = f"import os; assert os.environ['NAVFW_TEST_TAKEN_AWAY']; {code}"
    words = (sys.executable, "-c", code, *words)
    return run(words, cwd=folder, env=environment, timeout=900)


@pytest.mark.slow
def test_a_drive_gives_the_same_commands(tmp_path: Path, without: dict[str, str | None]) -> None:
    words = ("run", "empty", "straight", "--json", "--quiet", "--record")
    results: list[dict[str, Any]] = []
    for environment in ({}, without):
        done = called(tmp_path, environment, *words)
        assert done.returncode == 0, done.stderr
        results.append(json.loads(done.stdout))
    assert results[0]["command_hash"] == results[1]["command_hash"]
    folder = tmp_path / results[1]["run_folder"]
    assert called(tmp_path, without, "replay", folder).returncode == 0
    left = [path.name for path in folder.parent.iterdir() if "navfw-" in path.name]
    assert left == []


@pytest.mark.slow
def test_suite_check_and_mission_tests_run(tmp_path: Path, without: dict[str, str | None]) -> None:
    put_file(tmp_path, "suite.yaml", "entries: [{world: empty, missions: [straight]}]\n")
    words = ("suite", "suite.yaml", "--seeds", "0:2", "--workers", 2, "--out", "out", "--quiet")
    for environment in ({}, without):
        done = called(tmp_path, environment, *words, "--restart")
        assert done.returncode == 0, done.stderr
    rows = (tmp_path / "out" / "table.csv").read_bytes()
    assert rows.count(b"reached") == 2

    assert called(tmp_path, without, "new", "project", "mine").returncode == 0
    project = tmp_path / "mine"
    done = called(project, without, "check")
    assert (done.returncode, done.stdout.splitlines()[-1].endswith(" 0 wrong")) == (0, True)
    tested = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider")
    done = run(tested, cwd=project, env=without, timeout=900)
    assert done.returncode == 0, done.stdout


def test_kernels_are_compiled_by_processes_that_are_not_forked(
    tmp_path: Path, without: dict[str, str | None]
) -> None:
    code = (
        "from navfw.process import kernel_compilation as kernels\n"
        "if __name__ == '__main__':\n"
        "    found = [k for k in kernels.listed_kernels() if k.name.endswith('sum_in_order')][:1]\n"
        "    found = found or kernels.listed_kernels()[:1]\n"
        "    print(found[0].missing)\n"
        "    kernels._compile_groups([found], lambda state: None)\n"
        "    print(found[0].missing)\n"
    )
    put_file(tmp_path, "compiling.py", code)
    environment = {**without, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    words = [sys.executable, "compiling.py"]
    done = run(words, cwd=tmp_path, env=environment, timeout=600)
    assert done.stdout.split() == ["True", "False"], done.stderr


HOLDER = """
import sys
from pathlib import Path
from navfw.process.target_lock import TargetLock
with TargetLock(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""
TAKER = """
import sys
from pathlib import Path
from navfw.process.target_lock import TargetInUseError, TargetLock
try:
    with TargetLock(Path(sys.argv[1])):
        print("free")
except TargetInUseError:
    print("in use")
"""


def test_a_target_is_locked_until_its_process_dies(
    tmp_path: Path, without: dict[str, str | None]
) -> None:
    environment = {**os.environ, "PYTHONPATH": without["PYTHONPATH"] or ""}
    target = tmp_path / "run"

    def taken() -> str:
        return run([sys.executable, "-c", TAKER, target], env=without).stdout.strip()

    words = [sys.executable, "-c", HOLDER, str(target)]
    with subprocess.Popen(  # noqa: S603 - this Python, words of our own
        words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, text=True
    ) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        assert taken() == "in use"
        assert [path.name for path in tmp_path.iterdir()] == [".run.navfw-lock"]
        holder.kill()
    assert taken() == "free"
    assert list(tmp_path.iterdir()) == []
