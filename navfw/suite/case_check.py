"""Check of a case before any run starts, and the fingerprints of what its result depends on."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from navfw.config.document import MAX_BYTES
from navfw.config.input_file import read_input_text
from navfw.errors import InputError, MissingExtraError, UnknownNameError
from navfw.missions.session import Session
from navfw.suite.case import Case
from navfw.suite.case_stacks import stack_of_entry
from navfw.suite.entry_cases import with_seed
from navfw.suite.suitefile import Suite

if TYPE_CHECKING:
    from navfw.plugins import Registry


def check_case(
    suite: Suite, index: int, case: Case, registry: Registry
) -> tuple[Case, dict[str, str]]:
    """Build the session of ``case``, a case of the suite's entry ``index``, to find errors early.

    Returns the case with its stack, which may be the mission's, and the fingerprints of entry,
    stack, overrides, robot, world and mission by name; ``Case.content`` is that of them all. Of a
    family only the first seed is checked; the world of another seed may still be impossible, which
    gives a row with the outcome fault.

    Raises:
        MissingExtraError: a plugin needs a package that is not installed.
        InputError: the session cannot be built; the message has the suite's file, line and key.

    """
    entry = suite.spec.entries[index]
    case = with_seed(case, entry, case.seed)
    try:
        session = case.session(registry)
    except MissingExtraError:
        raise
    except InputError as error:
        if case.variant and _valid_without_variant(suite, index, case, registry):
            raise suite.located(error, index, None, case.variant) from None
        unknown = isinstance(error, UnknownNameError) and error.what.startswith("family")
        raise suite.located(error, index, "family" if unknown else None) from None
    file = session.stack_file.absolute()
    case = replace(case, stack=str(file), stack_name=file.stem)
    title = f"entry {case.entry}" + (f", variant {case.variant}" if case.variant else "")
    parts = {
        title: _digest([entry.model_dump(mode="json", exclude={"name", "worlds", "expect"})]),
        f"stack {case.stack_name} of {title}": _digest([session.stack.config]),
        f"overrides of {title}": _digest(list(case.overrides)),
        f"robot of {title}": _digest([session.mission.spec.robot.model_dump(mode="json")]),
    }
    if not case.family:
        world, mission = Path(case.world), Path(case.mission)
        parts[f"world {case.world_name} of {title}"] = _digest(_text(world))
        parts[f"mission {case.mission_name} of {case.world_name} of {title}"] = _digest(
            [_text(mission), _map_of(session)]
        )
    return replace(case, content=_digest(parts)), parts


def _valid_without_variant(suite: Suite, index: int, case: Case, registry: Registry) -> bool:
    """Whether the case is valid without its variant, so that the variant is the cause."""
    entry = suite.spec.entries[index]
    file = next(iter(stack_of_entry(suite, index).values()))
    plain = replace(case, stack=str(file or ""), overrides=entry.overrides, variant="")
    try:
        plain.session(registry)
    except InputError:
        return False
    return True


def _map_of(session: Session) -> dict[str, Any]:
    from navfw.topomap.mapfile import map_data

    return map_data(session.mission.topo_map)


def _text(file: Path) -> str:
    return read_input_text(file, MAX_BYTES)


def _digest(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:16]
