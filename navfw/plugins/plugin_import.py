"""Import a plugin file or ``module:Class``; every failure becomes a located ``PluginError``."""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Iterator
from contextvars import ContextVar
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from navfw.config.input_file import real_path, shown_path
from navfw.errors import PluginError, described, did_you_mean
from navfw.interfaces import Plugin
from navfw.plugins.built_in import DECORATED
from navfw.plugins.verification import find_problems, kind_of, verify
from navfw.process.interruption import check_interrupted
from navfw.process.watchdog import Watchdog

IMPORT_LIMIT = 60.0
"""Wall time limit of an import [s]; large libraries on a slow disk need a part of it."""

ClassT = TypeVar("ClassT", bound=type[Any])

# While a file of a plugin folder is imported, its decorated classes are collected here and verified
# later, so that one invalid class does not prevent the definition of the others.
_collecting: ContextVar[list[type[Any]] | None] = ContextVar("collecting", default=None)


def plugin(cls: ClassT) -> ClassT:
    """Decorate a class, so that each later ``default_registry`` registers it; return the class.

    Raises:
        PluginError: the class does not meet the interface of its kind.

    """
    collecting = _collecting.get()
    if collecting is not None:
        collecting.append(cls)
        return cls
    verify(cls)
    # by name, so that a class defined again (in a notebook's cell) replaces the former one
    DECORATED[(cls.__module__, cls.__qualname__)] = cls
    return cls


def import_file(file: Path) -> tuple[ModuleType, list[type[Any]]]:
    """Import ``file``; return the module and the classes decorated with ``plugin`` in it.

    The folder becomes a package with a unique name, so that files of the same name in two folders
    do not collide, ``from .other import x`` works, and ``sys.path`` remains unchanged.

    Raises:
        PluginError: the import failed for any reason; the message names file and line.

    """
    package = _package_of(file.parent)
    name = f"{package}.{file.stem}"
    collected: list[type[Any]] = []
    token = _collecting.set(collected)
    try:
        spec = importlib.util.spec_from_file_location(name, file)
        if spec is None or spec.loader is None:
            raise PluginError("expected a Python file", file=shown_path(file))
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        with _contained(file):
            spec.loader.exec_module(module)
    except BaseException:
        sys.modules.pop(name, None)
        raise
    finally:
        _collecting.reset(token)
    return module, collected


def import_object(target: str) -> Any:
    """Import and return the object at ``target``, written ``module:Class``.

    Raises:
        PluginError: the module cannot be imported or has no such object.

    """
    module_name, _, attribute = target.partition(":")
    with _contained(None, target):
        module = importlib.import_module(module_name)
    value: Any = module
    for part in attribute.split(".") if attribute else []:
        if not hasattr(value, part):
            names = [n for n in vars(module) if not n.startswith("_")]
            near = did_you_mean(part, names)
            hint = f"; {near}" if near.startswith("did") else ""
            raise PluginError(f"{module_name} has no {attribute!r}{hint}", key=target)
        value = getattr(value, part)
    return value


def candidates_of(module: ModuleType, decorated: list[type[Any]]) -> list[type[Any]]:
    """Return the classes of ``module`` to register: decorated ones, and subclasses of Plugin.

    Private classes are left out, and incomplete base classes of other classes of the module.
    """
    defined = [
        value
        for name, value in vars(module).items()
        if inspect.isclass(value)
        and value.__module__ == module.__name__
        and issubclass(value, Plugin)
        and not name.startswith("_")
    ]
    unique = list(dict.fromkeys([*decorated, *defined]))
    return [
        cls
        for cls in unique
        if cls in decorated
        or not any(other is not cls and issubclass(other, cls) for other in unique)
        or not find_problems(cls)
    ]


def nothing_found(module: ModuleType, file: Path) -> PluginError:
    """Make the error for a file in a plugin folder that contains no plugin."""
    classes = [
        name
        for name, value in vars(module).items()
        if inspect.isclass(value) and value.__module__ == module.__name__ and kind_of(value) is None
    ]
    others = f" (it has {', '.join(classes)})" if classes else ""
    return PluginError(
        f"no plugin in this file{others}; derive a class from navfw.interfaces.Behavior, "
        "or begin the file's name with _ if it is a helper",
        file=shown_path(file),
    )


def _package_of(folder: Path) -> str:
    """Make ``folder`` importable as a package; returns the package's name."""
    folder = real_path(folder)
    digest = hashlib.sha256(str(folder).encode()).hexdigest()[:12]
    name = f"navfw_folder_{digest}"
    if name not in sys.modules:
        package = ModuleType(name, f"The plugin folder {folder}.")
        package.__path__ = [str(folder)]
        sys.modules[name] = package
    return name


@contextlib.contextmanager
def _contained(file: Path | None, target: str | None = None) -> Iterator[None]:
    """An import within its time limit, that prints on stderr.

    Raises:
        PluginError: the import raised, SystemExit included.

    """
    watchdog = Watchdog()
    with contextlib.redirect_stdout(sys.stderr), watchdog.on_duty():
        watchdog.begin(IMPORT_LIMIT)
        try:
            yield
        except BaseException as error:
            check_interrupted(error)
            raise _import_error(error, file, target) from error
        finally:
            watchdog.end()


def _import_error(
    error: BaseException, file: Path | None, target: str | None = None
) -> PluginError:
    if isinstance(error, PluginError):
        return error
    where, line = _position(error, file)
    kind, text = described(error)
    if isinstance(error, SyntaxError):
        text = error.msg
    message = f"cannot be imported: {kind}: {text}" if text else f"cannot be imported: {kind}"
    if isinstance(error, ModuleNotFoundError) and file is not None and error.name:
        if (file.parent / f"{error.name}.py").is_file():
            message += f"; write: from .{error.name} import ..."
        else:
            message += "; install it in the environment that runs navfw"
    return PluginError(
        message, file=None if where is None else shown_path(where), line=line, key=target
    )


def _position(error: BaseException, file: Path | None) -> tuple[Path | None, int | None]:
    """File and line of ``error``: the innermost line of ``file`` in its traceback."""
    if isinstance(error, SyntaxError) and error.filename:
        bad = Path(error.filename)
        if file is None or bad == file:
            return bad, error.lineno
    if file is None:
        return None, None
    lines = [
        frame.lineno
        for frame in traceback.extract_tb(error.__traceback__)
        if Path(frame.filename) == file
    ]
    return file, lines[-1] if lines else None
