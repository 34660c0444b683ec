"""``navfw schema``: a schema of every kind of file, with the keys of the shipped files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from cli_calls import invoke

from navfw.config import FILE_KINDS, load_yaml, shipped_folder

ROOT = shipped_folder()
EXAMPLES = {
    "map": ROOT / "maps/office.yaml",
    "mission": ROOT / "worlds/office/missions/lobby-to-lab.yaml",
    "robot": ROOT / "navfw/robot/robots/default.yaml",
    "rules": ROOT / "behaviors/avoid.yaml",
    "stack": ROOT / "navfw/stack/stacks/default.yaml",
    "suite": next(iter(sorted((ROOT / "worlds").rglob("suites/*.yaml")))),
    "world": ROOT / "worlds/office/world.yaml",
}


@pytest.mark.parametrize("kind", FILE_KINDS)
def test_the_schema_knows_every_key_of_a_shipped_file(kind: str) -> None:
    done = invoke("schema", kind)
    assert done.exit_code == 0, done.output
    schema = json.loads(done.stdout)
    assert schema["$schema"].endswith("2020-12/schema")
    assert schema["additionalProperties"] is False
    example: Path = EXAMPLES[kind]
    keys = load_yaml(example, 8_000_000, 300_000).data
    assert isinstance(keys, dict)
    assert set(keys) - set(schema["properties"]) == set()


def test_an_unknown_kind_gives_the_nearest() -> None:
    done = invoke("schema", "mision")
    assert done.exit_code == 2
    assert "unknown kind of file 'mision': did you mean 'mission'?" in done.output
