"""Three faults at once, drawn from the suite of single ones: no contact, no false arrival."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from suite_plans import drive, planned

from navfw.config.lookup import shipped_folder
from navfw.suite.suite_folder import SuiteFolder
from navfw.suite.suite_run import run_case

RUNS = 40
TOLERANCE = 0.5
WORLDS = (
    {"world": "office", "missions": ["lobby-to-lab"]},
    {"world": "hospital", "missions": ["reception-to-ward-3"]},
    {"world": "lounge", "missions": ["to-the-hall"]},
    {"family": "rooms", "difficulty": 0.5},
    {"family": "corridors", "difficulty": 0.5},
)


def entries_of(runs: int, seed: int) -> list[dict[str, Any]]:
    """Entries of a suite, each with three events that disturb different things."""
    text = (shipped_folder() / "worlds/suites/faults.yaml").read_text(encoding="utf-8")
    single = yaml.safe_load(text)["entries"]
    timed = [event for entry in single for event in entry.get("events", ()) if "at" in event]
    rng, drawn = np.random.default_rng(seed), []
    for number in range(runs):
        chosen: dict[str, dict[str, Any]] = {}
        while len(chosen) < 3:
            event = timed[rng.integers(len(timed))]
            what = next(name for name in event if name not in {"at", "lasting"})
            chosen.setdefault(what, event | {"at": float(rng.integers(0, 12))})
        entry = WORLDS[number % len(WORLDS)] | {"events": list(chosen.values())}
        drawn.append(entry | {"name": f"{number}", "set": {"mission.tolerance": TOLERANCE}})
    return drawn


@pytest.mark.slow
def test_three_faults_at_once_end_without_contact_or_with_its_cause(tmp_path: Path) -> None:
    entries = entries_of(RUNS, seed=0)
    plan = planned(tmp_path, json.dumps({"entries": entries}), range(1))
    with SuiteFolder.claim(tmp_path / "out", plan, range(1)) as folder:
        have = folder.open(plan, "abc", begin="resume")
        done = drive(plan, folder, work=run_case, workers=2, have=have)
    assert len(done.rows) == RUNS
    reached = [row for row in done.rows if row.outcome == "reached"]
    assert all((row.distance_to_goal_m or 0.0) <= TOLERANCE for row in reached)
    touched = [row for row in done.rows if row.collisions and row.collision_cause == "robot"]
    blank = {entry["name"] for entry in entries if any("textureless" in e for e in entry["events"])}
    assert {row.entry for row in touched} <= blank, (
        "docs/limits.md: without texture nothing is seen"
    )
