"""Valid and broken plugins in temporary folders, and their status in a registry."""

from pathlib import Path
from typing import Any, ClassVar

from cli_calls import put_file

from navfw.interfaces import Behavior
from navfw.plugins import Registry

GOOD = '''
from navfw.interfaces import Behavior

class {cls}(Behavior):
    """{cls} does a thing.

    And more.
    """
    name = "{name}"
    def propose(self, context): pass
'''


class Mine(Behavior):
    """Mine."""

    name: ClassVar[str] = "mine"

    def propose(self, context: Any) -> Any:
        del context


def put(folder: Path, name: str, text: str | bytes | None = None, cls: str = "Thing") -> Path:
    text = GOOD.format(cls=cls, name=name) if text is None else text
    return put_file(folder, f"{name}.py", text)


def discovered(folder: Path) -> Registry:
    registry = Registry()
    registry.discover_folder(folder)
    return registry


def statuses(registry: Registry, kind: str = "behavior") -> dict[str, str]:
    return {row["name"]: row["status"] for row in registry.listing(kind)}
