"""The rows of a registry's listing that have an error."""

from typing import Any

from navfw.plugins import Registry


def broken_rows(registry: Registry) -> list[dict[str, Any]]:
    return [row for row in registry.listing() if row["error"] is not None]
