"""Plugins: found in three ways, verified when registered, and the broken ones named.

- files in a ``behaviors/`` folder (the shipped one's, the user's project's);
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
