"""``navfw explain``: the story of a recorded run, and why one of its commands was given."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import typer

from navfw.cli.options import Json, Recorded, option
from navfw.cli.output import echo, print_json, print_result, quiet_stdout
from navfw.config.lookup import plugin_files, shipped_folder


def explain(
    folder: Recorded,
    at: float | None = option(
        None, "Time since the start of the run [s]; without, the story of the drive."
    ),
    begin: float = option(
        0.0, "Tell the story in detail from this time on [s].", "--from", show_default=False
    ),
    end: float = option(
        math.inf, "Tell the story up to this time [s].", "--to", show_default=False
    ),
    instead: str | None = option(
        None,
        "With --at: what was against another command, and the smallest change that would have"
        " given it.",
        "--why-not",
        metavar="left|right|faster|slower|stop|V,W",
    ),
    inference: bool = option(
        False,
        "With --at and --json: how OFFIS came to its sentence; repeats the run.",
        "--inference",
    ),
    json: Json = False,
) -> None:
    """Tell the story of a drive, or explain its command at one moment, rule by rule."""
    if inference and (instead is not None or not json):
        raise typer.BadParameter(
            "needs --at and --json, without --why-not", param_hint="--inference"
        )
    of_moment = {"--inference": inference, "--why-not": instead is not None}
    of_story = {"--from": begin > 0.0, "--to": end < math.inf}
    for name, is_set in (of_story if at is not None else of_moment).items():
        if is_set:
            other = "cannot be given with --at" if at is not None else "needs --at"
            raise typer.BadParameter(other, param_hint=name)
    if at is None:
        with quiet_stdout():
            from navfw.report.run_story import story_of

            how, story = story_of(folder, begin, end)
        told = [f"{line.time:7.1f} s  {line.text}" for line in story]
        data = {"ended": how, "story": [asdict(line) for line in story]}
        print_result(data, [how, *told], json=json)
    elif instead is None:
        _explain_at(folder, at, inference, json=json)
    else:
        with quiet_stdout():
            from navfw.recording.recorded_decisions import moment_at
            from navfw.recording.why_not import why_not, why_not_lines

            answer = why_not(moment_at(folder, at), instead)
        print_result(asdict(answer), why_not_lines(answer), json=json)


def _explain_at(folder: Path, at: float, inference: bool, *, json: bool) -> None:
    """Print why the command at a moment was given."""
    with quiet_stdout():
        from navfw.recording.explanations import explain_at

        explanation = explain_at(folder, at, inference=inference)
    if not explanation.get("complete", True):
        echo("note: the recording ends before its run did", err=True)
    if json:
        print_json(explanation)
    else:
        from navfw.mofis.explanation_text import explanation_lines

        echo("\n".join([*explanation_lines(explanation), *_not_heard(explanation)]))


def _not_heard(explanation: Mapping[str, Any]) -> Iterator[str]:
    """A line for each behaviour of the user's that desired another command and was outvoted."""
    shipped = {file.stem for file in plugin_files(shipped_folder() / "behaviors")}
    for name, rating in explanation["behaviors"].items():
        outvoted = rating["weight"] > _NO_SAY and rating["desirability"] < 0.5 * rating["best"]
        if outvoted and name not in shipped:
            yield f"{name} desired another command and was outvoted: see docs/not-heard.md"


_NO_SAY = 0.01
"""Weight up to which a behaviour counts as not applicable."""
