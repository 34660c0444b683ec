"""Behaviours whose proposals depend on chance: ``navfw check`` names scene and part."""

import json
from pathlib import Path

import pytest
from cli_calls import invoke, put_file

HEAD = """import itertools, os, random, time
from typing import ClassVar
import numpy as np
from navfw import Behavior, Context, Proposal

COUNT = itertools.count()
print('imported')
NAMES = {f"name {number}" for number in range(40)}

class Own(Behavior):
    \"\"\"Own: a sample.\"\"\"

    name: ClassVar[str] = "%s"

    def __init__(self, robot, params=None):
        super().__init__(robot, params)
        self.state = 0.0

    def propose(self, context: Context) -> Proposal:
        commands = context.commands
        wanted = commands.product(np.abs(commands.relative_v), np.ones(commands.w.size))
        degree = float(self.degree(context))
        return Proposal(degree, wanted, commands.zeros(), reason="as it happens")

    def degree(self, context):
        %s
"""
CHANCES = {
    "generator": "return np.random.default_rng().random()",
    "pythons_own": "return random.random()",
    "clock": "return time.perf_counter() % 1.0",
    "address": "return id(self) // 16 % 997 / 997",
    "hash": "return hash('word') % 997 / 997",
    "order_of_a_set": "return sum(i * int(n[5:]) for i, n in enumerate(NAMES)) % 997 / 997",
    "process": "return os.getpid() % 997 / 997",
    "kept_over_reset": "self.state += 0.001; return min(self.state, 1.0)",
    "kept_by_the_module": "return next(COUNT) % 997 / 997",
}
ELSEWHERE = {"hash", "order_of_a_set", "process"}
"""Those that are the same in all instances of a process."""


def errors_of_check() -> dict[str, str]:
    """What ``navfw check`` finds in the current project, by the name of the part."""
    result = invoke("check", "--json")
    assert result.exit_code == 2, result.stdout
    return {row["name"]: row["error"] for row in json.loads(result.stdout)}


@pytest.mark.slow
def test_every_source_of_chance_is_named(folder: Path) -> None:
    put_file(folder, "navfw.toml", "")
    for name, body in {**CHANCES, "sound": "return 0.5"}.items():
        put_file(folder, f"behaviors/{name}.py", HEAD % (name, body))
    errors = errors_of_check()
    assert errors.pop("sound") is None
    assert errors.keys() == CHANCES.keys()
    for name, error in errors.items():
        assert error is not None, (name, invoke("check", "--json").stdout)
        assert "in the scene 'before the first percept'" in error, name
        assert "its applicability differs" in error, name
        assert ("in another process" in error) >= (name in ELSEWHERE), error
