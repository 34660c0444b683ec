"""Standard output that is full, closed, or read by nobody ends without a traceback."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from processes import Done, run

NAVFW = [sys.executable, "-m", "navfw", "--version"]

full = pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device")


def shell(redirection: str) -> Done:
    return run(["/bin/sh", "-c", f'"$@" {redirection}', "sh", *NAVFW])


@full
def test_a_full_device_is_told() -> None:
    done = shell("> /dev/full")
    assert done.returncode == 1
    assert done.stderr == "navfw: cannot write the output: No space left on device\n"


@full
def test_a_full_device_for_both_streams_ends_with_1() -> None:
    assert shell("> /dev/full 2> /dev/full").returncode == 1


def test_a_reader_that_has_seen_enough_gets_no_message() -> None:
    done = shell("| head -c 0")
    assert done.stderr == ""


def test_closed_streams_are_no_error() -> None:
    done = shell(">&-")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert shell(">&- 2>&-").returncode == 0
