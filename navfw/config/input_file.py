"""The only way to open a file that a person names or edits: regular files of bounded size.

A device, pipe or socket has no end and may block, so the kind and size of the file are checked
before anything is read. ``tests/config/test_config_input_file.py`` asserts that no other module
opens an input by itself.
"""

from __future__ import annotations

import json
import os
import re
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import wraps
from pathlib import Path
from typing import Any, BinaryIO, ParamSpec, TypeAlias, TypeVar

from navfw.errors import ConfigError, did_you_mean

_P = ParamSpec("_P")
_T = TypeVar("_T")

MAX_TEXT = 50_000_000
"""Largest text that is read [byte]: an hour of poses at 100 Hz, or any map, world and result."""

MAX_BYTES = 1 << 28
"""Largest file of other kinds that is read as a whole [byte]: images, meshes, jobs, scripts."""


_traced: ContextVar[set[Path] | None] = ContextVar("traced", default=None)


@contextmanager
def traced_inputs() -> Iterator[set[Path]]:
    """Context that collects the absolute paths of the files that are opened inside it."""
    files: set[Path] = set()
    token = _traced.set(files)
    try:
        yield files
    finally:
        _traced.reset(token)
        trace_input(*files)


def trace_input(*files: str | Path) -> None:
    """Add ``files``, which something else has opened, to those of ``traced_inputs``."""
    if (traced := _traced.get()) is not None:
        traced.update(Path(file).absolute() for file in files)


def cached_by_files(maxsize: int) -> Callable[[Callable[_P, _T]], Callable[_P, _T]]:
    """Cache results like ``lru_cache``, until a file that was opened for one of them changes."""

    def decorated(function: Callable[_P, _T]) -> Callable[_P, _T]:
        kept: dict[object, tuple[_T, dict[Path, _Stamp]]] = {}

        @wraps(function)
        def cached(*args: _P.args, **kwargs: _P.kwargs) -> _T:
            key = args, tuple(kwargs.items())
            entry = kept.pop(key, None)
            if entry is None or any(_stamp(file) != stamp for file, stamp in entry[1].items()):
                with traced_inputs() as files:
                    result = function(*args, **kwargs)
                entry = result, {file: _stamp(file) for file in files}
            kept[key] = entry
            if len(kept) > maxsize:
                del kept[next(iter(kept))]
            trace_input(*entry[1])
            return entry[0]

        return cached

    return decorated


_Stamp: TypeAlias = tuple[int, int]
"""Time of the last change [ns] and size [byte] of a file; zeros if it does not exist."""


def _stamp(file: Path) -> _Stamp:
    try:
        status = file.stat()
    except OSError:
        return 0, 0
    return status.st_mtime_ns, status.st_size


@contextmanager
def open_input(path: str | Path, max_bytes: int | None = None) -> Iterator[BinaryIO]:
    """Open the regular file at ``path`` (links are followed) for reading bytes; a context.

    Without ``max_bytes`` it may have any size: for files that are read in pieces.

    Raises:
        ConfigError: there is no such file, it is a folder, device, pipe or socket, cannot be read,
            or has more than ``max_bytes``.

    """
    path = Path(path)
    trace_input(path)
    if not is_file(path):
        raise no_such_file(path)
    try:
        stream = path.open("rb")
    except OSError as error:
        reason = error.strerror or error
        raise ConfigError(f"cannot read the file: {reason}", file=shown_path(path)) from None
    with stream:
        if max_bytes is not None and os.fstat(stream.fileno()).st_size > max_bytes:
            what = f"the file is too large: at most {max_bytes} bytes are read"
            raise ConfigError(what, file=shown_path(path))
        yield stream


def read_input(path: str | Path, max_bytes: int = MAX_BYTES) -> bytes:
    """Read the content of the regular file at ``path``; raises the errors of ``open_input``."""
    with open_input(path, max_bytes) as stream:
        return stream.read()


def read_input_text(path: str | Path, max_bytes: int = MAX_TEXT) -> str:
    """Read the UTF-8 text in the regular file at ``path``, without a byte order mark.

    Raises:
        ConfigError: ``open_input`` refuses the file, or its content is not UTF-8.

    """
    raw = read_input(path, max_bytes)
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        # with a byte order mark the position is counted behind it
        text = raw.removeprefix(b"\xef\xbb\xbf")
        line = text.count(b"\n", 0, error.start) + 1
        raise ConfigError(
            f"expected UTF-8 text, got byte 0x{text[error.start]:02x}",
            file=shown_path(Path(path)),
            line=line,
        ) from None


def is_file(path: str | Path) -> bool:
    """Whether ``path`` is a regular file; False also for names that no file can have."""
    return stat.S_ISREG(_mode(path))


def is_folder(path: str | Path) -> bool:
    """Whether ``path`` is a folder; False also for names that no folder can have."""
    return stat.S_ISDIR(_mode(path))


def real_path(path: str | Path) -> Path:
    """Return the absolute path behind all links; loops of links, unlike ``Path.resolve``, pass."""
    return Path(os.path.realpath(path))


def shown_path(path: Path) -> str:
    """Return ``path`` as error messages show it: relative to the working folder if it is inside."""
    try:
        return str(path.absolute().relative_to(Path.cwd()))
    except (ValueError, OSError):
        return str(path)


def no_such_file(path: Path) -> ConfigError:
    """Make the error for a ``path`` that is no regular file; it names the most similar file."""
    name, hint = shown_path(path), ""
    if re.match(r"[a-z0-9]+:/", name):
        address = name.replace(":/", "://", 1)
        hint = f"an address is not read: download it, or ffmpeg -t 60 -i '{address}' drive.mp4"
    elif name == "-" or name.startswith(("/dev/stdin", "/dev/fd/")):
        hint = "standard input is not read: write it to a file, and give that"
    elif name.startswith("/dev/video") or name.isdecimal():
        device = f"/dev/video{name}" if name.isdecimal() else name
        hint = f"a camera is not read: record a video: ffmpeg -t 60 -i {device} drive.mp4"
    if hint:
        return ConfigError(hint, file=name)
    if is_folder(path):
        return ConfigError("expected a file, got a folder", file=name)
    if _mode(path):
        return ConfigError(
            "expected a regular file, got a device, pipe or socket; copy its content to a file",
            file=name,
        )
    suffixes = {".yaml", ".yml"} if path.suffix in {".yaml", ".yml"} else {path.suffix}
    siblings: list[str] = []
    with suppress(OSError, ValueError):
        siblings = [p.name for p in path.parent.iterdir() if p.suffix in suffixes]
    near = did_you_mean(path.name, siblings)
    hint = f"; {near}" if near.startswith("did") else ""
    return ConfigError(f"there is no such file{hint}", file=name)


def _mode(path: str | Path) -> int:
    """Return the kind of file at ``path`` as in ``stat``; 0 where there is none."""
    try:
        return os.stat(path).st_mode  # noqa: PTH116 - Path.stat is the same call
    except (OSError, ValueError):
        return 0


def read_json_object(path: str | Path) -> dict[str, Any]:
    """Read the JSON object in the file at ``path``.

    Raises:
        ConfigError: the file cannot be read, is not JSON, or is not an object.

    """
    name = shown_path(Path(path))
    data = parse_json(read_input_text(path), name)
    if not isinstance(data, dict):
        raise ConfigError("expected one JSON object", file=name)
    return data


def parse_json(text: str, file: str) -> Any:
    """Return the JSON value in ``text``; NaN and Infinity, which are not JSON, are refused.

    Raises:
        ConfigError: ``text``, the content of ``file``, is not JSON, with the line, or nested too
            deeply.

    """
    try:
        return json.loads(text, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        raise ConfigError(f"not valid JSON: {error.msg}", file=file, line=error.lineno) from None
    except RecursionError:
        raise ConfigError("nested too deeply", file=file) from None
    except ValueError as error:  # a constant, or an integer of thousands of digits
        raise ConfigError(f"not valid JSON: {error}", file=file) from None


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is not a number of JSON")
