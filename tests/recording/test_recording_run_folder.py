"""Run folders and other outputs are locked, written atomically, and never replace other files."""

import errno
import json
import math
import os
import re
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from cli_calls import put_files

from navfw.errors import ConfigError, InputError
from navfw.process.atomic import AtomicFolder, write_text
from navfw.process.target_lock import TargetInUseError, TargetLock, sweep
from navfw.recording import RESULT, RunFolder, plain_json, read_result


def written(target: Path, text: str = "one", *, numbered: bool = False) -> Path:
    with RunFolder(target, numbered=numbered) as folder:
        folder.write_json(RESULT, {"text": text})
    assert folder.final is not None
    return folder.final


def names(folder: Path) -> list[str]:
    return sorted(entry.name for entry in folder.iterdir())


def test_a_folder_appears_when_everything_is_written(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "run"
    with RunFolder(target) as folder:
        folder.write_json(RESULT, {"text": "one"})
        assert not target.exists()
    assert read_result(target) == {"text": "one"}
    assert names(target.parent) == ["run"]


def test_nothing_is_left_after_an_exception_but_an_earlier_run(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), RunFolder(tmp_path / "run") as folder:
        folder.write_json(RESULT, {})
        raise KeyboardInterrupt
    assert names(tmp_path) == []
    target = written(tmp_path / "run")
    with pytest.raises(ValueError, match="oops"), RunFolder(target):
        raise ValueError("oops")
    assert read_result(target) == {"text": "one"}


def test_an_earlier_run_is_replaced(tmp_path: Path) -> None:
    target = written(tmp_path / "run")
    (target / "trajectory.png").write_bytes(b"old")
    assert written(target, "two") == target
    assert read_result(target) == {"text": "two"}
    assert names(target) == [RESULT]


@pytest.mark.parametrize("files", [["notes.txt"], [RESULT, "notes.txt"], ["trajectory.png"]])
def test_a_folder_that_is_no_run_folder_is_not_changed(tmp_path: Path, files: list[str]) -> None:
    put_files(tmp_path, dict.fromkeys(files, "{}"))
    with pytest.raises(InputError, match="not a run folder"):
        RunFolder(tmp_path)
    assert names(tmp_path) == sorted(files)


def test_numbered_folders_never_collide(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as threads:
        for text in "01234567":
            threads.submit(written, tmp_path / "run", text, numbered=True)
    assert names(tmp_path) == ["run", *(f"run-{number}" for number in range(2, 9))]
    assert {read_result(folder)["text"] for folder in tmp_path.iterdir()} == set("01234567")


def test_json_has_plain_values_only(tmp_path: Path) -> None:
    value = {"a": np.float64(1.5), "b": (np.int16(2), np.bool_(True)), "c": math.inf, "d": tmp_path}
    text = json.dumps(plain_json(value), allow_nan=False)
    assert json.loads(text) == {"a": 1.5, "b": [2, True], "c": None, "d": str(tmp_path)}


@pytest.mark.parametrize("text", ["", "{", "[1]", '"text"', "\xff", "[" * 100_000])
def test_a_missing_or_broken_result_is_named_by_its_file(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigError, match="not a run folder"):
        read_result(tmp_path)
    (tmp_path / RESULT).write_text(text, encoding="latin-1")
    with pytest.raises(ConfigError, match=RESULT):
        read_result(tmp_path)


PAGE = re.compile("index.md")

HOLDER = """
import signal, sys
from pathlib import Path
from navfw.recording.run_folder import RESULT, RunFolder
with RunFolder(sys.argv[1], numbered=len(sys.argv) > 2) as folder:
    folder.write_json(RESULT, {"text": "of the other process"})
    print("ready", flush=True)
    signal.pause()
"""


def holder(target: Path, *words: str) -> subprocess.Popen[str]:
    """Another process that is writing a run folder, and does not end by itself."""
    process = subprocess.Popen(  # noqa: S603 - this Python, words of our own
        [sys.executable, "-c", HOLDER, str(target), *words], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


def kill(process: subprocess.Popen[str]) -> None:
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=60)


def test_a_folder_in_use_is_refused_or_numbered_and_swept_after_kill_9(tmp_path: Path) -> None:
    other = holder(tmp_path / "run")
    try:
        with pytest.raises(TargetInUseError, match="another process"), RunFolder(tmp_path / "run"):
            pass
        assert written(tmp_path / "run", numbered=True) == tmp_path / "run-2"
        left = {".run.navfw-lock", ".run.navfw-part"}
        assert left < set(names(tmp_path)), "the folder of a live process has been swept"
    finally:
        kill(other)
    assert left < set(names(tmp_path))
    written(tmp_path / "other")  # any start in the folder sweeps
    assert names(tmp_path) == ["other", "run-2"]
    assert written(tmp_path / "run") == tmp_path / "run"


def test_a_process_killed_between_both_renames_leaves_the_earlier_run(tmp_path: Path) -> None:
    written(tmp_path / "run")
    lock = TargetLock(tmp_path / "run")
    lock.file.touch()
    lock.part.mkdir()
    (tmp_path / "run").rename(lock.old)
    sweep(tmp_path)
    assert names(tmp_path) == ["run"]
    assert read_result(tmp_path / "run") == {"text": "one"}


def test_links_are_followed_and_dangling_ones_refused(tmp_path: Path) -> None:
    real = written(tmp_path / "real")
    (tmp_path / "link").symlink_to(real)
    assert written(tmp_path / "link") == tmp_path / "link"
    assert (tmp_path / "link").is_symlink()
    assert names(tmp_path) == ["link", "real"]
    (tmp_path / "dangling").symlink_to(tmp_path / "none")
    for write in (
        RunFolder,
        lambda target: AtomicFolder(target, PAGE, "--out"),
        lambda target: write_text(target, "text"),
    ):
        with pytest.raises(InputError, match=r"a link to .*none, which does not exist"):
            write(tmp_path / "dangling")
    (tmp_path / "to-a-file").symlink_to(real / RESULT)
    with pytest.raises(InputError, match="is a file"):
        RunFolder(tmp_path / "to-a-file")


def test_devices_mount_points_and_read_only_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not a regular file"):
        write_text(Path("/dev/null"), "text")
    with pytest.raises(InputError, match="is a mount point"):
        RunFolder("/")
    if os.getuid() == 0:
        return  # root may write anywhere
    tmp_path.chmod(0o500)
    with pytest.raises(InputError, match="Permission denied"), RunFolder(tmp_path / "run"):
        pass


def test_a_run_whose_target_was_taken_is_kept_beside(tmp_path: Path) -> None:
    target = written(tmp_path / "run")
    folder = RunFolder(target)
    with pytest.raises(InputError, match=r"contains 'notes.*the run is in .*run-2"), folder:
        folder.write_json(RESULT, {"text": "two"})
        (target / "notes.txt").touch()
    assert folder.final == tmp_path / "run-2"
    assert read_result(tmp_path / "run-2") == {"text": "two"}
    assert read_result(target) == {"text": "one"}
    assert names(target) == ["notes.txt", RESULT]
    assert names(tmp_path) == ["run", "run-2"]


def test_a_full_disk_is_an_error_that_names_the_target(tmp_path: Path) -> None:
    out = tmp_path / "page"
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    with (
        pytest.raises(InputError, match=r"page: cannot be written: No space"),
        AtomicFolder(out, PAGE, "--out"),
    ):
        raise full
    with pytest.raises(FileNotFoundError), AtomicFolder(out, PAGE, "--out"):
        raise FileNotFoundError  # an error of the program stays what it is
    assert names(tmp_path) == []
