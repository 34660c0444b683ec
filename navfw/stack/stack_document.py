"""The content of a stack file on top of its base, before plugins and parameters are looked at.

With ``base: default`` the stages of a file replace those of the base, its behaviours are added, its
settings change single values. Apart from ``stackfile``, whose schema needs the rooms of the stack.
"""

from __future__ import annotations

from pathlib import Path

from navfw.config.document import YamlDocument, load_yaml
from navfw.config.overrides import on_its_base

STAGES = (
    "flow",
    "perception",
    "features",
    "localizer",
    "planner",
    "composite",
    "fusion",
    "controller",
)
"""The keys of a stack file that choose one plugin each."""


def read_stack(path: str | Path) -> YamlDocument:
    """Read the stack file at ``path`` and merge it into its base; plugins are not checked yet.

    Raises:
        ConfigError: the file is no YAML, or its base is not.
        UnknownNameError: the base does not exist.

    """
    return on_its_base(load_yaml(path), Path(path), "stack", replaced=STAGES)
