"""``navfw explain``: the story of a recorded run, and why one of its commands was given."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from navfw.cli.options import Json, Recorded
from navfw.cli.output import echo, print_json, print_result, quiet_stdout
from navfw.config.lookup import plugin_files, shipped_folder

_At = Annotated[
    float | None,
    typer.Option(help="Time since the start of the run [s]; without, the story of the drive."),
]
_From = Annotated[
    float,
    typer.Option(
        "--from", show_default=False, help="Tell the story in detail from this time on [s]."
    ),
]
_To = Annotated[
    float, typer.Option("--to", show_default=False, help="Tell the story up to this time [s].")
]
_Instead = Annotated[
    str | None,
    typer.Option(
        "--why-not",
        metavar="left|right|faster|slower|stop|V,W",
        help="With --at: what was against another command, and the smallest change that would have"
        " given it.",
    ),
]
_Inference = Annotated[
    bool,
    typer.Option(
        "--inference", help="With --at and --json: how OFFIS came to its sentence; repeats the run."
    ),
]


def explain(
    folder: Recorded,
    at: _At = None,
    begin: _From = 0.0,
    end: _To = math.inf,
    instead: _Instead = None,
    inference: _Inference = False,
    json: Json = False,
) -> None:
    """Tell the story of a drive, or explain its command at one moment, rule by rule."""
    if inference and (instead is not None or not json):
        raise typer.BadParameter(
            "needs --at and --json, without --why-not", param_hint="--inference"
        )
    of_moment = {"--inference": inference, "--why-not": instead is not None}
    of_story = {"--from": begin > 0.0, "--to": end < math.inf}
    for option, is_set in (of_story if at is not None else of_moment).items():
        if is_set:
            other = "cannot be given with --at" if at is not None else "needs --at"
            raise typer.BadParameter(other, param_hint=option)
    if at is None:
        _tell(folder, begin, end, json=json)
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


def _tell(folder: Path, begin: float, end: float, *, json: bool) -> None:
    """Print the story of a run."""
    with quiet_stdout():
        from navfw.report.run_story import story_of

        how, lines = story_of(folder, begin, end)
    told = [f"{line.time:7.1f} s  {line.text}" for line in lines]
    data = {"ended": how, "story": [asdict(line) for line in lines]}
    print_result(data, [how, *told], json=json)


def _not_heard(explanation: Mapping[str, Any]) -> Iterator[str]:
    """A line for each behaviour of the user's that desired another command and was outvoted."""
    shipped = {file.stem for file in plugin_files(shipped_folder() / "behaviors")}
    for name, rating in explanation["behaviors"].items():
        outvoted = rating["weight"] > _NO_SAY and rating["desirability"] < 0.5 * rating["best"]
        if outvoted and name not in shipped:
            yield f"{name} desired another command and was outvoted: see docs/not-heard.md"


_NO_SAY = 0.01
"""Weight up to which a behaviour counts as not applicable."""
