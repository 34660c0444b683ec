"""The fingerprints of the commands of many short drives: the content of ``hashes.json``.

``uv run python tests/helpers/hash_table.py`` writes the file anew.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

__all__ = ["Hashes", "measured_hashes", "stored_hashes"]

Hashes = dict[str, str]
"""``command_hash`` by "entry, seed N"."""

FOLDER = Path(__file__).parents[1] / "missions"
SUITE, TABLE = FOLDER / "hashes.yaml", FOLDER / "hashes.json"
NAVFW = [sys.executable, "-c", "from navfw.cli import main; main()"]


def stored_hashes() -> Hashes:
    """What ``hashes.json`` has."""
    table: Hashes = json.loads(TABLE.read_text(encoding="utf-8"))
    return table


def measured_hashes(folder: Path, settings: Mapping[str, str]) -> Hashes:
    """What the suite drives now, in processes with ``settings`` in their environment."""
    words = ["suite", str(SUITE), "--seeds", "0:2", "--workers", "2", "--out", "table", "--quiet"]
    done = subprocess.run(  # noqa: S603 - this Python, words of our own
        [*NAVFW, *words, "--json"],
        cwd=folder,
        env={**os.environ, **settings},
        capture_output=True,
        timeout=3000,
        check=True,  # it fails where a plugin has failed
    )
    runs = json.loads(done.stdout)["runs"]
    return {f"{run['entry']}, seed {run['seed']}": run["command_hash"] for run in runs}


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        hashes = measured_hashes(Path(name), {})
    TABLE.write_text(json.dumps(hashes, indent=2) + "\n", encoding="utf-8")
