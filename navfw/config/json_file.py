"""JSON files of one object, as navfw itself writes them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from navfw.config.input_file import read_input_text, shown_path
from navfw.errors import ConfigError

MAX_BYTES = 16_000_000
"""Largest size of a JSON file [byte]: the result of a run of 2 h with 1000 events has 1 MB."""


def read_json_object(path: str | Path, max_bytes: int = MAX_BYTES) -> dict[str, Any]:
    """The JSON object in the file at ``path``.

    Raises:
        ConfigError: the file cannot be read, is not JSON, or holds something else than an object.

    """
    name = shown_path(Path(path))
    data = parse_json(read_input_text(path, max_bytes), name)
    if not isinstance(data, dict):
        raise ConfigError("expected one JSON object", file=name)
    return data


def parse_json(text: str, file: str) -> Any:
    """The JSON value in ``text``; NaN and Infinity, which are not JSON, are refused.

    Raises:
        ConfigError: ``text``, the content of ``file``, is not JSON; with the line.

    """
    try:
        return json.loads(text, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        raise ConfigError(f"not valid JSON: {error.msg}", file=file, line=error.lineno) from None
    except RecursionError:
        raise ConfigError("not valid JSON: nested too deeply", file=file) from None
    except ValueError as error:  # a constant, or an integer of thousands of digits
        raise ConfigError(f"not valid JSON: {error}", file=file) from None


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is not a number of JSON")
