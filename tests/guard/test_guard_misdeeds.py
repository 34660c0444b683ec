"""Every kind of plugin with every misdeed: the run ends with a result that names the plugin."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from misdeeds import BASES, HARMLESS, MISDEEDS, write_wrongdoer

DRIVER = Path(__file__).parents[1] / "helpers" / "short_limits.py"
ENDED = ("exits at once", "loops in compiled code", "disables the timer")
"""Misdeeds that end the process of the run; its supervisor writes the result."""
TOLD = ("threads", "changes the folder", "draws global random numbers")
"""Misdeeds with a correct answer that are found when the run is over."""
REPLACES = "replaces the safety monitor"
VITAL = ("flow", "perception", "localizer", "planner", "fusion", "controller")
QUICK = {
    ("behavior", "exits"),
    ("fusion", "exits at once"),
    ("flow", "loops in compiled code"),
    ("controller", "threads"),
    ("behavior", REPLACES),
}
"""Pairs that are tried by default; the others are slow in their sum."""
PAIRS = [
    pytest.param(kind, deed, marks=[] if (kind, deed) in QUICK else pytest.mark.slow)
    for kind in BASES
    for deed in MISDEEDS
]


def drive(folder: Path) -> dict[str, Any]:
    """The result of a short mission with the stack ``wrong`` of a project, as a process."""
    command = [sys.executable, str(DRIVER), "run", "paper-room", "through-the-door", "--json"]
    command += ["--stack", "wrong", "--set", "mission.timeout=8", "--out", "result"]
    done = subprocess.run(  # noqa: S603 - this Python, fixed arguments
        command,
        cwd=folder,
        env={**os.environ, "NAVFW_TRUST": "1"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 1, done.stderr
    assert "Traceback" not in done.stderr
    result: dict[str, Any] = json.loads(done.stdout)
    written = json.loads((folder / "result" / "result.json").read_text(encoding="utf-8"))
    assert written["outcome"] == result["outcome"]
    assert written["faults"] == result["faults"]
    return result


@pytest.mark.thorough
@pytest.mark.parametrize(("kind", "misdeed"), PAIRS)
def test_a_plugin_costs_its_own_calls_and_is_told(tmp_path: Path, kind: str, misdeed: str) -> None:
    write_wrongdoer(tmp_path, kind, misdeed)
    result = drive(tmp_path)
    told = " ".join([*result["faults"], result["reason"]])
    assert result.get("collisions", 0) == 0
    if misdeed in HARMLESS:
        assert (result["outcome"], result["faults"]) == ("timeout", [])
        return
    assert f"{kind} wrongdoer: " in told
    if misdeed in ENDED or misdeed == REPLACES or (kind in VITAL and misdeed not in TOLD):
        assert result["outcome"] == "fault"
        assert f"{kind} wrongdoer: " in result["reason"]
    else:
        assert result["outcome"] == "timeout"
