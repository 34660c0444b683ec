"""The stacks that the cases of a suite are run with: files by their names in the table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from navfw.config.lookup import find
from navfw.errors import InputError
from navfw.suite.suitefile import Suite


def stacks_of(suite: Suite, index: int, variant: str) -> Mapping[str, Path | None]:
    """The stack of the variant, else of the entry; None: the mission's, not known yet."""
    own = suite.variants[variant].stack
    if own is None:
        return stack_of_entry(suite, index)
    try:
        return stack_files([own])
    except InputError as error:
        raise suite.located(error, index, "stack", variant) from None


def stack_of_entry(suite: Suite, index: int) -> Mapping[str, Path | None]:
    """The stack of an entry; None: the mission's, not known yet."""
    own = suite.spec.entries[index].stack
    return {"": None} if own is None else stack_files([own], suite, index)


def stack_files(
    names: Sequence[str], suite: Suite | None = None, index: int = 0
) -> dict[str, Path]:
    """Stack files by their names in the table."""
    found: dict[str, Path] = {}
    for name in names:
        try:
            file = find("stack", name).absolute()
        except InputError as error:
            if suite is None or suite.spec.entries[index].stack is None:
                raise
            raise suite.located(error, index, "stack") from None
        title = file.stem
        if title in found:
            what = f"two stacks have the name {title!r}, which has to be unique in the table"
            raise InputError(what, key="--stack")
        found[title] = file
    return found
