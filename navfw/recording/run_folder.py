"""The folder of a run's results, written atomically."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from navfw.atomic import AtomicTarget
from navfw.errors import ConfigError, InputError

__all__ = ["FILES", "RESULT", "RunFolder", "plain_json", "read_result"]

RESULT = "result.json"
"""The file with outcome, metrics and configuration of a run."""

FILES = frozenset({RESULT, "trajectory.png", "recording.npz", "map.yaml", "stack.yaml"})
"""The files of a run folder; a folder with any other file in it is never replaced."""

_MAX_RESULT = 16_000_000
"""Largest size of a result file [byte]."""


def plain_json(value: Any) -> Any:
    """``value`` with numpy scalars, tuples and paths as JSON values; inf and nan become null."""
    if isinstance(value, Mapping):
        return {str(key): plain_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain_json(item) for item in value]
    if hasattr(value, "tolist"):  # a numpy scalar or array
        return plain_json(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    return str(value)


class RunFolder(AtomicTarget):
    """A context manager: files are written to ``path`` beside the target, then renamed into place.

    ``with RunFolder(target) as folder:`` gives a folder whose ``path`` is temporary; leaving the
    block without an exception moves it to ``target`` (see ``final``), leaving it with one removes
    it. An earlier run at ``target`` is replaced; anything else there is refused. With
    ``numbered=True`` the target's name gets ``-2``, ``-3``, ... until it is free.

    Raises:
        InputError: the target exists and is not a run folder, or cannot be written.

    """

    def __init__(self, target: str | Path, *, numbered: bool = False) -> None:
        super().__init__(Path(target))
        self.numbered = numbered
        self.final: Path | None = None
        if not numbered:
            _refuse_foreign(self.target)

    def write_json(self, name: str, value: Any) -> None:
        """Write ``value`` as indented JSON (see ``plain_json``)."""
        text = json.dumps(plain_json(value), indent=2, allow_nan=False)
        (self.path / name).write_text(text + "\n", encoding="utf-8")

    def write_yaml(self, name: str, value: Any) -> None:
        """Write plain data as YAML, in its subset JSON, which keeps all digits of numbers."""
        self.write_json(name, value)

    def _move_into_place(self) -> None:
        number = 1
        while True:
            place = self.target
            if self.numbered and number > 1:
                place = self.target.with_name(f"{self.target.name}-{number}")
            # checked once: if another run creates the folder after this, the rename fails
            if place.exists():
                if self.numbered:
                    number += 1
                    continue
                _refuse_foreign(place)
                shutil.rmtree(place)
            try:
                self.path.rename(place)
            except OSError:
                if not (self.numbered and place.exists()):  # created by another run in the meantime
                    raise
                continue
            self.final = place
            return


def _refuse_foreign(target: Path) -> None:
    if not target.exists():
        return
    if not target.is_dir():
        raise InputError("is a file; the run needs a folder", file=target)
    names = {entry.name for entry in target.iterdir()}
    if not names:
        return
    foreign = sorted(names - FILES)
    if RESULT not in names or foreign:
        found = f"it contains {foreign[0]!r}" if foreign else f"it has no {RESULT}"
        raise InputError(
            f"is not a run folder ({found}), so it is not overwritten; choose another --out",
            file=target,
        )


def read_result(folder: str | Path) -> dict[str, Any]:
    """The ``result.json`` of a run folder.

    Raises:
        ConfigError: the folder is not a run folder, or its result cannot be read.

    """
    path = Path(folder) / RESULT
    try:
        if path.stat().st_size > _MAX_RESULT:
            raise ConfigError(f"is larger than {_MAX_RESULT} bytes", file=path)
        result = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ConfigError(f"is not a run folder: it has no {RESULT}", file=folder) from None
    except (OSError, ValueError, RecursionError) as error:
        raise ConfigError(f"cannot be read: {error}", file=path) from error
    if not isinstance(result, dict):
        raise ConfigError("expected one JSON object", file=path)
    return result
