"""Run folders are written atomically and never replace other files."""

from __future__ import annotations

import json
import math
import threading
from pathlib import Path

import numpy as np
import pytest

from navfw.errors import ConfigError, InputError
from navfw.recording import RESULT, RunFolder, plain_json, read_result


def write(target: Path, text: str = "one", *, numbered: bool = False) -> Path:
    with RunFolder(target, numbered=numbered) as folder:
        folder.write_json(RESULT, {"text": text})
    assert folder.final is not None
    return folder.final


def test_a_folder_appears_when_everything_is_written(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "run"
    with RunFolder(target) as folder:
        folder.write_json(RESULT, {"text": "one"})
        assert not target.exists()
    assert read_result(target) == {"text": "one"}
    assert [entry.name for entry in target.parent.iterdir()] == ["run"]


def test_nothing_is_left_after_an_exception(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), RunFolder(tmp_path / "run") as folder:
        folder.write_json(RESULT, {})
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_an_earlier_run_stays_when_the_new_one_fails(tmp_path: Path) -> None:
    target = write(tmp_path / "run")
    with pytest.raises(ValueError, match="oops"), RunFolder(target):
        raise ValueError("oops")
    assert read_result(target) == {"text": "one"}


def test_an_earlier_run_is_replaced(tmp_path: Path) -> None:
    target = write(tmp_path / "run")
    (target / "trajectory.png").write_bytes(b"old")
    assert write(target, "two") == target
    assert read_result(target) == {"text": "two"}
    assert [entry.name for entry in target.iterdir()] == [RESULT]


@pytest.mark.parametrize("files", [["notes.txt"], [RESULT, "notes.txt"], ["trajectory.png"]])
def test_a_folder_that_is_no_run_folder_is_not_changed(tmp_path: Path, files: list[str]) -> None:
    target = tmp_path / "mine"
    target.mkdir()
    for name in files:
        (target / name).write_text("{}")
    with pytest.raises(InputError, match="not a run folder"):
        RunFolder(target)
    assert sorted(entry.name for entry in target.iterdir()) == sorted(files)


def test_a_file_is_refused_as_run_folder(tmp_path: Path) -> None:
    target = tmp_path / "mine"
    target.write_text("text")
    with pytest.raises(InputError, match="is a file"):
        RunFolder(target)
    with pytest.raises(InputError, match="cannot be written"), RunFolder(target / "run"):
        pass


def test_a_file_added_during_the_run_keeps_the_folder_from_being_replaced(tmp_path: Path) -> None:
    target = write(tmp_path / "run")
    with pytest.raises(InputError, match="contains 'notes"), RunFolder(target) as folder:
        folder.write_json(RESULT, {})
        (target / "notes.txt").write_text("mine")
    assert (target / "notes.txt").read_text() == "mine"
    assert read_result(target) == {"text": "one"}


def test_numbered_folders_never_collide(tmp_path: Path) -> None:
    target = tmp_path / "run"
    threads = [
        threading.Thread(target=write, args=(target, str(number)), kwargs={"numbered": True})
        for number in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    names = sorted(entry.name for entry in tmp_path.iterdir())
    assert names == sorted(["run", *(f"run-{number}" for number in range(2, 9))])
    texts = {read_result(tmp_path / name)["text"] for name in names}
    assert texts == {str(number) for number in range(8)}


def test_json_has_plain_values_only(tmp_path: Path) -> None:
    value = {"a": np.float64(1.5), "b": (np.int16(2), np.bool_(True)), "c": math.inf, "d": tmp_path}
    text = json.dumps(plain_json(value), allow_nan=False)
    assert json.loads(text) == {"a": 1.5, "b": [2, True], "c": None, "d": str(tmp_path)}


@pytest.mark.parametrize("text", ["", "{", "[1]", '"text"', "\xff", "[" * 100_000])
def test_a_broken_result_is_an_error_that_names_the_file(tmp_path: Path, text: str) -> None:
    (tmp_path / RESULT).write_text(text, encoding="latin-1")
    with pytest.raises(ConfigError, match=RESULT):
        read_result(tmp_path)


def test_a_folder_without_result_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="not a run folder"):
        read_result(tmp_path)
