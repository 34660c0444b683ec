"""Names of a package that are imported on first access, so that importing the package is fast.

A package gives such names by a function ``__getattr__`` of its module (PEP 562)::

    _HOMES = {"TopoMap": "navfw.topomap.topological_map"}

    def __getattr__(name: str) -> Any:
        return first_access(__name__, name, _HOMES)

For type checkers the same names are imported below ``if TYPE_CHECKING:``.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping
from typing import Any


def first_access(package: str, name: str, homes: Mapping[str, str]) -> Any:
    """The object ``name`` of the module ``homes[name]``; from now on ``package`` has it itself.

    Raises:
        AttributeError: ``homes`` has no such name.

    """
    if name not in homes:
        raise AttributeError(f"module {package!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(homes[name]), name)
    setattr(sys.modules[package], name, value)
    return value
