"""Optional parts of navfw: if one is not installed, the error says how to install it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata
from importlib.util import find_spec

from navfw.errors import MissingExtraError


@contextmanager
def extra_imports(extra: str, *, key: str | None = None) -> Iterator[None]:
    """Context for importing modules of an extra of ``pyproject.toml``, and nothing else.

    ``key`` names the command, option or plugin that needs them.

    Raises:
        MissingExtraError: one of the modules is not installed.

    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise MissingExtraError(extra, error.name or extra, key=key) from None


def require_extra(extra: str, module: str, *, key: str | None = None) -> None:
    """Check that ``module`` of an extra is installed, before long work that imports it at the end.

    Raises:
        MissingExtraError: the module is not installed.

    """
    if find_spec(module) is None:
        raise MissingExtraError(extra, module, key=key)


def pybullet_version() -> str:
    """Return the installed release of PyBullet, with the name of its fork if it is the fork."""
    for name in ("pybullet", "pybullet-arm64"):
        try:
            version = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
        return version if name == "pybullet" else f"{version} ({name})"
    return "not installed"
