"""Answers of behaviours and composites in another process, with another hash seed.

There sets have another order, and objects other addresses. Run as a module, it prints the answers.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from navfw.plugins import default_registry
from navfw.testing.behavior_check import Answers, scene_answers

_SECONDS = 300.0
"""Longest time of all answers [s]."""

Names = Sequence[tuple[str, str]]
"""Kind and name of plugins."""


def answers_elsewhere(folders: Sequence[Path], plugins: Names) -> list[Answers]:
    """The ``scene_answers`` of each of ``plugins``, some of them in ``folders``.

    Raises:
        OSError: the process cannot be started, takes too long, or dies; the message says why.

    """
    seed = "2" if os.environ.get("PYTHONHASHSEED") == "1" else "1"
    environment = {**os.environ, "PYTHONHASHSEED": seed, "NAVFW_TRUST": "1"}
    asked = json.dumps([[str(folder.absolute()) for folder in folders], list(plugins)])
    words = [sys.executable, "-P", "-m", __name__, asked]
    try:
        # S603: fixed words and names of plugins, no shell
        done = subprocess.run(  # noqa: S603
            words, env=environment, capture_output=True, text=True, timeout=_SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        raise OSError(f"took more than {_SECONDS:g} s") from None
    try:
        answers: list[Answers] = json.loads(done.stdout.splitlines()[-1])
    except (ValueError, IndexError):
        raise OSError((done.stderr.splitlines() or [f"exit code {done.returncode}"])[-1]) from None
    return answers


def _print_answers(folders: Sequence[str], plugins: Names) -> None:
    registry = default_registry()
    for folder in folders:
        registry.discover_folder(folder)
    answers = []
    for kind, name in plugins:
        try:
            answers.append(scene_answers(registry.get(kind, name)))
        except Exception:  # of the plugin, in this process only
            answers.append({"": {}})
    sys.stdout.write(f"\n{json.dumps(answers)}\n")


if __name__ == "__main__":
    _print_answers(*json.loads(sys.argv[1]))
