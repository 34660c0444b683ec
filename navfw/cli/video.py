"""The option ``--video``: the recording of a run written as a video, with its progress."""

from __future__ import annotations

from pathlib import Path

import typer

from navfw.cli.progress_bar import ProgressBar

VIDEO = "--video"
"""The option, for messages."""


def write_video(folder: Path, target: Path, *, quiet: bool) -> None:
    """Write the recording in a run folder as a video, and tell where on stderr.

    Raises:
        InputError: the recording is damaged, or the video cannot be written.

    """
    from navfw.report.run_video import write_run_video

    with ProgressBar("video", "pictures", quiet=quiet) as bar:
        write_run_video(folder, target, VIDEO, bar.update)
    if not quiet:
        typer.echo(f"video: {target}", err=True)
