"""``navfw tune`` killed at seeded moments keeps its finished trials, and goes on with them.

``NAVFW_KILLS=20 uv run pytest -m slow tests/tune/test_tune_killed.py`` takes 20 moments a signal.
"""

import csv
import json
import signal
import time
from pathlib import Path

import pytest
from cli_calls import PROGRAM
from killing import MANY, TINY, Ended, Started, moments

pytest.importorskip("optuna", reason="needs the extra tune: uv sync --extra tune")

STUDY = ("tiny.yaml", "--stack=detuned.yaml", "--param=avoid.spare", "--trials=4", "--seeds=0:2")
WORDS = ("tune", *STUDY, "--validate=9:10", "--workers=2", "--out=o", "--json")


def start(folder: Path) -> Started:
    """Start the study, or resume the one that is there."""
    folder.mkdir(exist_ok=True)
    (folder / "tiny.yaml").write_text(TINY)
    (folder / "detuned.yaml").write_text("base: default\nbehaviors:\n  avoid: {spare: 0.9}\n")
    resume = ["--resume"] if (folder / "o" / "study.db").exists() else []
    return Started(PROGRAM, (*WORDS, *resume), folder)


def finished(folder: Path) -> dict[str, dict[str, str]]:
    """The rows of the table of trials, by their number."""
    if not (file := folder / "o" / "trials.csv").exists():
        return {}
    with file.open(newline="") as stream:
        return {row["trial"]: row for row in csv.DictReader(stream)}


def check(ended: Ended, folder: Path) -> None:
    assert ended.code == 0, ended.stderr
    assert len(finished(folder)) == 4
    assert json.loads(ended.stdout)["runs"] == 1
    assert not [file for file in folder.rglob(".*") if file.name != ".nv"]
    assert not list((folder / "tmp").glob("navfw*"))


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_study_killed_at_many_moments(number: signal.Signals, tmp_path: Path) -> None:
    began = time.monotonic()
    check(start(tmp_path / "whole").ended(), tmp_path / "whole")
    for index, moment in enumerate(moments(number, MANY, time.monotonic() - began)):
        folder = tmp_path / str(index)
        started = start(folder)
        if started.after(moment):
            started.send(number)
        ended, kept = started.ended(), finished(folder)
        assert "Traceback" not in ended.stderr or not (folder / "o").exists()  # while importing
        check(start(folder).ended(), folder)
        assert kept.items() <= finished(folder).items(), "a finished trial was lost, or changed"
