"""Optional parts of navfw: whatever needs one that is not installed says how to get it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata
from importlib.util import find_spec

from navfw.errors import MissingExtraError


@contextmanager
def extra_imports(extra: str, *, key: str | None = None) -> Iterator[None]:
    """Import modules of an extra of ``pyproject.toml`` in the body, and nothing else.

    ``key`` says what needs them: a command, an option or a plugin.

    Raises:
        MissingExtraError: one of the modules is not installed.

    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise MissingExtraError(extra, error.name or extra, key=key) from None


def require_extra(extra: str, module: str, *, key: str | None = None) -> None:
    """Check that ``module`` of an extra is installed, before work that imports it at its end.

    Raises:
        MissingExtraError: it is not installed.

    """
    if find_spec(module) is None:
        raise MissingExtraError(extra, module, key=key)


def pybullet_version() -> str:
    """The release of PyBullet that is installed; of its fork with the fork's name."""
    for name in ("pybullet", "pybullet-arm64"):
        try:
            version = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
        return version if name == "pybullet" else f"{version} ({name})"
    return "not installed"
