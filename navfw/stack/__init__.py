"""The stack: the chain of stages, and the files that compose it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from navfw.lazy_names import first_access

if TYPE_CHECKING:
    from navfw.stack.stack import TIMED, Stack

_HOMES = {"TIMED": "navfw.stack.stack", "Stack": "navfw.stack.stack"}

__all__ = ["TIMED", "Stack"]


def __getattr__(name: str) -> Any:
    return first_access(__name__, name, _HOMES)


def __dir__() -> list[str]:
    return __all__
