"""The workflows of a host are valid, and call what there is; they cannot be run here."""

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import yaml
from cli_calls import commands
from processes import run, uv

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def steps() -> list[str]:
    """The commands of all steps."""
    jobs: list[dict[str, Any]] = [
        job for file in FILES for job in yaml.safe_load(file.read_text())["jobs"].values()
    ]
    return [step["run"] for job in jobs for step in job["steps"] if "run" in step]


def test_the_commands_of_the_workflows_exist() -> None:
    known = {words: {o for p in c.params for o in p.opts} for words, c in commands()}
    found = 0
    for line in steps():
        first, *words = shlex.split(line)
        if first == "make":
            assert re.search(rf"^{words[0]}:", (ROOT / "Makefile").read_text(), re.MULTILINE)
        elif first == "bash":
            assert (ROOT / words[0]).is_file()
        elif first == "navfw":
            path = tuple(words[:1]) if tuple(words[:2]) not in known else tuple(words[:2])
            assert {word for word in words if word.startswith("--")} <= known[path], line
            found += 1
        else:
            assert first == "python", line
    assert found >= 6


@pytest.mark.slow
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_the_workflows_are_valid(file: Path) -> None:
    """By the schema that check-jsonschema brings with it."""
    tool = [uv(), "tool", "run", "--from", "check-jsonschema", "check-jsonschema"]
    done = run([*tool, "--builtin-schema", "vendor.github-workflows", file])
    assert done.returncode == 0, done.stdout
