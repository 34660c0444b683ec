"""What is taken for granted where neither a file nor the user says it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Assumption:
    """That of ``what`` the value ``taken`` holds, for a ``reason``; an ``option`` replaces it.

    Whoever reads maps, bags, robots or images keeps these in its ``assumed``; the commands print
    them as text, and as objects in the list ``assumed`` of their JSON.

    >>> print(Assumption("frame rate", "10 images a second", "the names have no times", "--fps"))
    frame rate: 10 images a second, as the names have no times (--fps)
    """

    what: str
    taken: str
    reason: str = ""
    option: str = ""

    def __str__(self) -> str:
        reason = f", as {self.reason}" if self.reason else ""
        return f"{self.what}: {self.taken}{reason}{f' ({self.option})' if self.option else ''}"

    def as_data(self) -> dict[str, Any]:
        """The assumption as an object of JSON; every key has a text, "" where nothing is said."""
        return asdict(self)
