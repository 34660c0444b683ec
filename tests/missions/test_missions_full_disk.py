"""``navfw run`` on a full disk, and with a file size limit: the result is never lost."""

from __future__ import annotations

import json
import resource
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from navfw.cli import app
from navfw.missions import MissionResult, Session
from navfw.recording import read_result


def navfw_run(out: Path, *options: str) -> Any:
    words = ["run", "empty", "straight", "--set", "mission.timeout=1", "--record", "--quiet"]
    return CliRunner().invoke(app, [*words, "--out", str(out), *options])


@pytest.fixture
def limited(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Iterator[None]:
    """From the end of the drive on, files are limited to ``request.param`` [byte]."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    run = Session.run

    def run_then_limit(session: Session, *args: Any, **kwargs: Any) -> MissionResult:
        result = run(session, *args, **kwargs)
        resource.setrlimit(resource.RLIMIT_FSIZE, (request.param, before[1]))
        return result

    monkeypatch.setattr(Session, "run", run_then_limit)
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("limited", [100], indirect=True)
@pytest.mark.usefixtures("limited")
def test_a_result_that_cannot_be_written_is_printed(tmp_path: Path) -> None:
    ended = navfw_run(tmp_path / "o", "--json")
    assert ended.exit_code == 3, ended.output
    printed = json.loads(ended.stdout)
    assert (printed["outcome"], printed["run_folder"]) == ("timeout", None)
    lines = ended.stderr.splitlines()
    assert lines[0].endswith("o: result.json cannot be written: File too large")
    assert lines[1] == "navfw: saved: nothing; the result is on stdout"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("limited", [20_000], indirect=True)
@pytest.mark.usefixtures("limited")
def test_a_file_size_limit_costs_picture_and_recording_only(tmp_path: Path) -> None:
    ended = navfw_run(tmp_path / "o")
    assert ended.exit_code == 3, ended.output
    assert ended.stdout.startswith("timeout after")
    assert ended.stderr.splitlines() == [
        "navfw: run.mcap is missing: File too large",
        "navfw: trajectory.png is missing: File too large",
        f"navfw: saved: map.yaml, result.json, stack.yaml in {tmp_path / 'o'}",
    ]
    assert read_result(tmp_path / "o")["outcome"] == "timeout"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["o"]


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 64 KB in memory; skipped where this user must not mount one."""
    place = tmp_path / "small"
    place.mkdir()
    mount, unmount = shutil.which("mount"), shutil.which("umount")
    if mount is None or unmount is None:
        pytest.skip("there is no command mount")
    words = [mount, "-t", "tmpfs", "-o", "size=64k", "navfw-small", str(place)]
    if subprocess.run(words, check=False, capture_output=True).returncode:  # noqa: S603 - our words
        pytest.skip("this user must not mount a tmpfs")
    yield place
    subprocess.run([unmount, str(place)], check=True)  # noqa: S603 - our words


def test_a_full_disk_costs_picture_and_recording_first(small_disk: Path) -> None:
    ended = navfw_run(small_disk / "o", "--json")
    assert ended.exit_code == 3, ended.output
    assert "run.mcap is missing: No space left on device" in ended.stderr
    printed = json.loads(ended.stdout)
    assert read_result(small_disk / "o")["command_hash"] == printed["command_hash"]

    (small_disk / "filler").write_bytes(bytes(resource.getpagesize()))
    with pytest.raises(OSError, match="No space"), (small_disk / "filler").open("ab") as stream:
        while True:
            stream.write(bytes(resource.getpagesize()))
            stream.flush()
    ended = navfw_run(small_disk / "full", "--json")
    assert ended.exit_code == 3, ended.output
    assert json.loads(ended.stdout)["command_hash"] == printed["command_hash"]
    assert "result.json cannot be written: No space left on device" in ended.stderr
    assert sorted(file.name for file in small_disk.iterdir()) == ["filler", "o"]
