"""A YAML file as a validated pydantic model; whatever is wrong in it is said in one error.

>>> from navfw.config.yamlfile import load_model
>>> world = load_model("worlds/office/world.yaml", WorldSpec)  # doctest: +SKIP
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from navfw.config.document import KeyPath, Origin, YamlDocument, key_text, load_yaml, parse_yaml
from navfw.config.overrides import Override, apply_overrides
from navfw.config.problems import Problem, config_error, explain

__all__ = [
    "KeyPath",
    "Origin",
    "Problem",
    "YamlDocument",
    "check",
    "config_error",
    "key_text",
    "load_model",
    "load_yaml",
    "parse_yaml",
    "validate",
]

ModelT = TypeVar("ModelT", bound=BaseModel)


def load_model(
    path: str | Path, model: type[ModelT], overrides: Sequence[str | Override] = ()
) -> ModelT:
    """The file at ``path``, with ``overrides`` (``a.b=c``) applied, as a ``model``.

    Raises:
        ConfigError: the file cannot be read, an override does not fit into it, or the result
            breaks the model; the message lists every problem with file, line and key.

    """
    return validate(apply_overrides(load_yaml(path), overrides), model)


def validate(document: YamlDocument, model: type[ModelT], at: KeyPath = ()) -> ModelT:
    """The part of ``document`` at path ``at`` as a ``model``; a null part counts as empty.

    Raises:
        ConfigError: the message lists every problem with file, line and key.

    """
    result, problems = check(document, model, at)
    if result is None:
        raise config_error(problems)
    return result


def check(
    document: YamlDocument, model: type[ModelT], at: KeyPath = ()
) -> tuple[ModelT | None, list[Problem]]:
    """Like ``validate``, but hands the problems back, for who wants to collect more of them."""
    data = document.at(at)
    try:
        # Strict, so that a text is no number and yes is no 1; by JSON, because only there does
        # strict mean the data model of files (a list may fill a tuple, a text an enum).
        text = json.dumps({} if data is None else data)
        return model.model_validate_json(text, strict=True), []
    except ValidationError as error:
        return None, explain(error, document, model, at)
