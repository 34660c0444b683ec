"""Plugins: discovered in three ways, verified on registration; broken ones are listed with errors.

- files in a ``behaviors/`` folder (the shipped one, and that of the user's project);
- entry points of installed packages (``navfw.behaviors``, ``navfw.flows``, ...), loaded lazily;
- in code: ``@plugin`` above a class, or ``registry.register(cls)``.
"""

from __future__ import annotations

from navfw.plugins.plugin_import import plugin
from navfw.plugins.registry import BUILT_IN, GROUPS, Registry, default_registry
from navfw.plugins.verification import find_problems, kind_of, verify

__all__ = [
    "BUILT_IN",
    "GROUPS",
    "Registry",
    "default_registry",
    "find_problems",
    "kind_of",
    "plugin",
    "verify",
]
