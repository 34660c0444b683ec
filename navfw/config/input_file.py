"""The one way to open a file that a person names or edits: regular files of bounded size.

A device, pipe or socket has no end and may block, so the kind and size of the file are checked on
the opened descriptor, before anything is read. ``tests/config/test_config_input_file.py`` asserts
that no other module opens an input by itself.

This is also the only place of the bounds, from which the table in ``docs/robustness.md`` is
written: bytes are checked here, items, depth and seconds by the parser of a kind, while, or before,
it builds anything.
"""

from __future__ import annotations

import json
import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from navfw.errors import ConfigError, did_you_mean

MAX_DEPTH = 60
"""Largest nesting of lists, mappings, elements and dotted keys, in files of all kinds."""


class InputBounds(NamedTuple):
    """Largest size of a file [byte], and number of ``items`` in it, which ``unit`` names.

    ``seconds`` is the longest time of a parser that is not bounded by these.
    """

    max_bytes: int
    items: int = 0
    unit: str = ""
    seconds: float = 0.0


_NODES = "keys and values"
INPUT_BOUNDS = {
    "YAML": InputBounds(1_000_000, 40_000, _NODES),  # 2 to 4 s
    "map": InputBounds(8_000_000, 300_000, _NODES),  # ten thousand places, half a minute
    "exchanged map": InputBounds(32_000_000, 2_000_000, _NODES),
    "JSON": InputBounds(16_000_000, 2_000_000, _NODES),  # 2 h with 1000 events: 1 MB
    "pyproject.toml": InputBounds(500_000, 100_000, _NODES),
    "recording": InputBounds(1 << 30),  # an hour of 160x120 images at 10 Hz: 0.6 GB
    "chunk of a recording": InputBounds(1 << 26),  # navfw writes 1 MB
    "bag": InputBounds(20_000_000_000, seconds=10.0),
    "chunk of a bag": InputBounds(1 << 28),
    "metadata of a bag": InputBounds(10_000_000, 40_000, _NODES),
    "journal of a suite": InputBounds(400_000_000, 200_000, "runs", 10.0),  # 1 kB a run
    "study": InputBounds(2_000_000_000, seconds=10.0),
    "image": InputBounds(100_000_000, 64_000_000, "pixels"),  # telephones: 12 to 50 megapixels
    "picture of a texture": InputBounds(20_000_000, 4_000_000, "pixels"),  # 4 mm over 8 x 8 m
    "picture of a poster": InputBounds(20_000_000, 64_000_000, "pixels"),
    "picture of a report": InputBounds(5_000_000),
    "video": InputBounds(20_000_000_000, 64_000_000, "pixels a frame"),
    "timed table": InputBounds(50_000_000),  # an hour of poses at 100 Hz
    "mesh of furniture": InputBounds(10_000_000, 20_000, "triangles"),  # each image draws them
    "mesh of a Gazebo world": InputBounds(50_000_000, 500_000, "triangles"),
    "mesh of a URDF": InputBounds(200_000_000),
    "Gazebo world": InputBounds(20_000_000),  # the largest of BARN: 0.7 MB
    "path of BARN": InputBounds(1_000_000, 100_000, "numbers"),
    "URDF": InputBounds(5_000_000),  # that of Husky: 11 kB
    "file that xacro includes": InputBounds(10_000_000, seconds=20.0),
    "benchmark": InputBounds(50_000_000),
    "template or page": InputBounds(2_000_000),
    "files of a job": InputBounds(200_000_000),
    "fingerprinted file": InputBounds(1 << 28),
    "refs of git": InputBounds(64_000_000),  # some hundred thousand
    "stored run of a test": InputBounds(64_000_000),  # 2 h: 45 MB
}
"""The bounds by the kind of file."""


def max_bytes(kind: str) -> int:
    """The largest size of a file of that kind [byte]."""
    return INPUT_BOUNDS[kind].max_bytes


_FLAGS = os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY  # a pipe must not wait for a writer


_traced: ContextVar[set[Path] | None] = ContextVar("traced", default=None)


@contextmanager
def traced_inputs() -> Iterator[set[Path]]:
    """Collect the absolute paths of the files that are opened in this context."""
    files: set[Path] = set()
    token = _traced.set(files)
    try:
        yield files
    finally:
        _traced.reset(token)


@contextmanager
def open_input(path: str | Path, max_bytes: int) -> Iterator[BinaryIO]:
    """The regular file at ``path`` (or behind a link there), opened for reading bytes.

    Raises:
        ConfigError: there is no such file, it is a folder, device, pipe or socket, cannot be read,
            or has more than ``max_bytes``.

    """
    path = Path(path)
    if (traced := _traced.get()) is not None:
        traced.add(path.absolute())
    try:
        descriptor = os.open(path, _FLAGS)
    except FileNotFoundError:
        raise no_such_file(path) from None
    except (OSError, ValueError) as error:  # ValueError: a null byte in the path
        raise _unreadable(path, error) from None
    with os.fdopen(_checked(descriptor, path, max_bytes), "rb") as stream:
        yield stream


def read_input(path: str | Path, max_bytes: int) -> bytes:
    """The content of the regular file at ``path``; raises like ``open_input``."""
    with open_input(path, max_bytes) as stream:
        try:
            content = stream.read(max_bytes + 1)
        except OSError as error:
            raise _unreadable(Path(path), error) from None
    if len(content) > max_bytes:  # it grew, or its file system knows no sizes
        raise _too_large(Path(path), max_bytes)
    return content


def read_input_text(path: str | Path, max_bytes: int) -> str:
    """The UTF-8 text in the regular file at ``path``, without a byte order mark.

    Raises:
        ConfigError: as ``open_input``, or the content is not UTF-8.

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
    """Whether ``path`` is a regular file; false as well for names that no file can have."""
    return stat.S_ISREG(_mode(path))


def is_folder(path: str | Path) -> bool:
    """Whether ``path`` is a folder; false as well for names that no folder can have."""
    return stat.S_ISDIR(_mode(path))


def shown_path(path: Path) -> str:
    """``path`` as error messages show it: relative to the working folder when it is inside."""
    try:
        return str(path.absolute().relative_to(Path.cwd()))
    except (ValueError, OSError):
        return str(path)


def no_such_file(path: Path) -> ConfigError:
    """The error for a ``path`` that is no regular file; names the nearest file of its suffix."""
    name = shown_path(path)
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


def _checked(descriptor: int, path: Path, max_bytes: int) -> int:
    """``descriptor``, of a regular file of at most ``max_bytes``; any other is closed."""
    about = os.fstat(descriptor)
    if stat.S_ISREG(about.st_mode) and about.st_size <= max_bytes:
        return descriptor
    os.close(descriptor)
    if stat.S_ISREG(about.st_mode):
        raise _too_large(path, max_bytes)
    raise no_such_file(path)


def _mode(path: str | Path) -> int:
    """The kind of file at ``path`` as in ``stat``; 0 where there is none."""
    try:
        return os.stat(path).st_mode  # noqa: PTH116 - Path.stat is the same call
    except (OSError, ValueError):
        return 0


def _unreadable(path: Path, error: OSError | ValueError) -> ConfigError:
    if isinstance(error, OSError) and not is_file(path) and _mode(path):
        return no_such_file(path)  # a socket, or a device that refuses
    reason = (error.strerror if isinstance(error, OSError) else None) or error
    return ConfigError(f"cannot read the file: {reason}", file=shown_path(path))


def _too_large(path: Path, max_bytes: int) -> ConfigError:
    return ConfigError(
        f"the file is too large: at most {max_bytes} bytes are read", file=shown_path(path)
    )


# --- JSON and TOML ----------------------------------------------------------------------------

_BESIDE_STRUCTURE = re.compile(
    r"""\"{3}[^"\\]*(?:(?:\\.|"(?!""))[^"\\]*)*(?:\"{3}|\Z)|"[^"\\\n]*(?:\\.[^"\\\n]*)*"?"""
    r"""|'{3}.*?(?:'{3}|\Z)|'[^'\n]*'?|#[^\n]*""",
    re.DOTALL,
)
"""Texts and comments, also without their end."""
_MAX_PARTS = 20
"""Largest number of parts of a dotted key, which costs their square."""
_CHAIN = re.compile(rf"(?<![\w-])(?:[\w-]+[ \t]*\.[ \t]*){{{_MAX_PARTS}}}")


def check_structure(text: str, file: str, kind: str) -> None:
    """Check depth and number of items of a JSON or TOML ``text`` without parsing it.

    A parser's memory grows with every item, and more than linearly with depth.

    Raises:
        ConfigError: ``text``, the content of ``file``, has more than a file of ``kind`` may have.

    """
    bare = _BESIDE_STRUCTURE.sub("x", text)
    bounds, depth = INPUT_BOUNDS[kind], 0
    for character in re.findall(r"[][{}]", bare):
        depth += 1 if character in "[{" else -1
        if depth > MAX_DEPTH:
            raise ConfigError(f"nested too deeply: more than {MAX_DEPTH} levels", file=file)
    if _CHAIN.search(bare):
        raise ConfigError(f"nested too deeply: a key of more than {_MAX_PARTS} parts", file=file)
    if bare.count(",") > bounds.items:
        raise ConfigError(f"too much content: more than {bounds.items} {bounds.unit}", file=file)


def read_json_object(path: str | Path) -> dict[str, Any]:
    """The JSON object in the file at ``path``.

    Raises:
        ConfigError: the file cannot be read, is not JSON, or holds something else than an object.

    """
    name = shown_path(Path(path))
    data = parse_json(read_input_text(path, INPUT_BOUNDS["JSON"].max_bytes), name)
    if not isinstance(data, dict):
        raise ConfigError("expected one JSON object", file=name)
    return data


def parse_json(text: str, file: str, kind: str = "JSON") -> Any:
    """The JSON value in ``text``; NaN and Infinity, which are not JSON, are refused.

    Raises:
        ConfigError: ``text``, the content of ``file``, is not JSON, with the line; or has more than
            a file of ``kind`` may have.

    """
    check_structure(text, file, kind)
    try:
        return json.loads(text, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        raise ConfigError(f"not valid JSON: {error.msg}", file=file, line=error.lineno) from None
    except ValueError as error:  # a constant, or an integer of thousands of digits
        raise ConfigError(f"not valid JSON: {error}", file=file) from None


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is not a number of JSON")
