"""A YAML file as a validated pydantic model; one error lists all its problems.

>>> from navfw.config.yamlfile import load_model
>>> world = load_model("worlds/office/world.yaml", WorldSpec)  # doctest: +SKIP
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from navfw.config.document import KeyPath, YamlDocument, load_yaml
from navfw.config.overrides import Override, apply_overrides
from navfw.config.problems import FileProblem, config_error, problems_of

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
) -> tuple[ModelT | None, list[FileProblem]]:
    """Like ``validate``, but returns the problems, so that the caller can add further ones."""
    data = document.at(at)
    try:
        # Strict: text is not converted to a number, nor a truth value to 1. Through JSON, because
        # strict JSON mode accepts a list for a tuple and text for an enum.
        text = json.dumps({} if data is None else data)
        return model.model_validate_json(text, strict=True), []
    except ValidationError as error:
        return None, problems_of(error, document, model, at)
