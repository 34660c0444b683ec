"""``navfw replay RUN_FOLDER``: run the stack on recorded sensor readings."""

from __future__ import annotations

import typer

from navfw.cli.options import Json, Recorded, Video
from navfw.cli.output import print_json, quiet_stdout
from navfw.cli.video import VIDEO, write_video


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(replay)


def replay(
    folder: Recorded,
    video: Video = None,
    json: Json = False,
) -> None:
    """Run the stack on recorded readings. Exit with 1 if the commands differ."""
    with quiet_stdout():
        from navfw.recording.run_replay import replay as run_again
        from navfw.recording.video_output import check_video

        if video is not None:
            check_video(video, VIDEO)
        result = run_again(folder)
        if video is not None:
            write_video(folder, video, quiet=json)
    if json:
        print_json(
            {
                "command_hash": result.command_hash,
                "recorded_hash": result.recorded_hash,
                "same": result.same,
                "ticks": result.ticks,
                "first_difference": result.first_difference,
                "complete": result.complete,
            }
        )
    else:
        ending = "" if result.complete else " (the recording ends before its run did)"
        if result.same:
            typer.echo(f"same commands in all {result.ticks} ticks{ending}")
        else:
            first = result.first_difference
            typer.echo(f"different commands from tick {first} of {result.ticks} on{ending}")
            typer.echo(f"  recorded  {result.recorded_hash}")
        typer.echo(f"  commands  {result.command_hash}")
    raise typer.Exit(0 if result.same else 1)
