"""``navfw replay`` and ``navfw explain``: what a recorded run did; and the option ``--video``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from navfw.cli.options import Json, Recorded, Video
from navfw.cli.output import print_json, print_result, print_status, quiet_stdout
from navfw.cli.progress_bar import ProgressBar

VIDEO = "--video"
"""The option, for messages."""


def replay(folder: Recorded, video: Video = None, json: Json = False) -> None:
    """Run the stack on recorded readings. Exit with 1 if the commands differ."""
    with quiet_stdout():
        from navfw.recording.run_replay import replay as run_again
        from navfw.recording.video_output import check_video

        if video is not None:
            check_video(video, VIDEO)
        result = run_again(folder)
        if video is not None:
            write_video(folder, video, quiet=json)
    data = {
        "command_hash": result.command_hash,
        "recorded_hash": result.recorded_hash,
        "same": result.same,
        "ticks": result.ticks,
        "first_difference": result.first_difference,
        "complete": result.complete,
    }
    ending = "" if result.complete else " (the recording ends before its run did)"
    lines = [f"same commands in all {result.ticks} ticks{ending}"]
    if not result.same:
        first = result.first_difference
        lines = [f"different commands from tick {first} of {result.ticks} on{ending}"]
        lines.append(f"  recorded  {result.recorded_hash}")
    print_result(data, [*lines, f"  commands  {result.command_hash}"], json=json)
    raise typer.Exit(0 if result.same else 1)


def explain(
    folder: Recorded,
    at: Annotated[float, typer.Option("--at", help="Time since the start of the run [s].")],
    json: Json = False,
) -> None:
    """Explain the command at one moment. Lists the behaviours, and the rules that fired."""
    with quiet_stdout():
        from navfw.recording.run_replay import explain_at

        explanation = explain_at(folder, at)
    if json:
        print_json(explanation)
    else:
        from navfw.mofis.explanation import explanation_lines

        typer.echo("\n".join(explanation_lines(explanation)))


def write_video(folder: Path, target: Path, *, quiet: bool) -> None:
    """Write the recording in a run folder as a video, and say where on stderr.

    Raises:
        InputError: the recording is damaged, or the video cannot be written.

    """
    from navfw.report.run_video import write_run_video

    with ProgressBar("video", "pictures", quiet=quiet) as bar:
        write_run_video(folder, target, VIDEO, bar.update)
    if not quiet:
        print_status(f"video: {target}")
