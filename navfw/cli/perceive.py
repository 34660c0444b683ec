"""``navfw perceive SOURCE...``: OFFIS on real images: a folder, a video, image files."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from navfw.cli.output import print_json, quiet_stdout
from navfw.errors import InputError

if TYPE_CHECKING:
    from navfw.perceive.perceiver import Options, View
    from navfw.perceive.sources import Source

__all__ = ["add_to"]


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(perceive)


def perceive(
    source: Annotated[
        list[Path],
        typer.Argument(help="A folder of images, a video, or image files.", show_default=False),
    ],
    hfov: Annotated[
        float, typer.Option(help="Horizontal field of view in degrees; a phone has about 65.")
    ] = 65.0,
    speed: Annotated[
        float | None,
        typer.Option(
            help="Forward speed in m/s. Unknown or 0: times to contact only, unless --height is"
            " given and the floor is seen.",
            show_default=False,
        ),
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(
            help="Images a second; by default the video's, 10 for files.", show_default=False
        ),
    ] = None,
    height: Annotated[
        float | None,
        typer.Option(
            help="Camera above the floor in m; by default from floor and speed.",
            show_default=False,
        ),
    ] = None,
    pitch: Annotated[float, typer.Option(help="Camera's pitch, nose down, in degrees.")] = 0.0,
    gyro: Annotated[
        Path | None,
        typer.Option(
            help="CSV file: time (s), yaw_rate (rad/s) and, if known, pitch_rate, roll_rate; "
            "without it the turn is estimated from the flow.",
            show_default=False,
        ),
    ] = None,
    flow: Annotated[
        str, typer.Option(metavar="PLUGIN", help="The flow processor.")
    ] = "block_matching",
    grid: Annotated[str, typer.Option(metavar="ROWSxCOLUMNS", help="Grid of the flow.")] = "12x16",
    stride: Annotated[
        int | None,
        typer.Option(
            help="Images from the first to the second of a pair; by default chosen by the flow.",
            show_default=False,
        ),
    ] = None,
    overlay: Annotated[
        Path | None,
        typer.Option(
            metavar="OUT",
            help="Draw what is seen: a folder of PNG files, or an .mp4 or .avi.",
            show_default=False,
        ),
    ] = None,
    json: Annotated[
        bool, typer.Option("--json", help="A list of objects on stdout, one a pair of images.")
    ] = False,
) -> None:
    """Say what a camera that moves straight on sees: obstacles, distances, the situation."""
    with quiet_stdout():
        from navfw.perceive.gyro import load_gyro
        from navfw.perceive.perceiver import Options
        from navfw.perceive.sources import open_source

        rows, cols = _grid(grid)
        options = Options(
            hfov=hfov,
            speed=speed,
            height=height,
            pitch=pitch,
            flow=flow,
            rows=rows,
            cols=cols,
            stride=stride,
            gyro=None if gyro is None else load_gyro(gyro),
        )
        images = open_source(source, fps)
        views = _look(options, images, overlay)
    notes = [*_notes(options, views), *images.notes]
    if json:
        from navfw.perceive.report import as_data

        print_json([as_data(view) for view in views])
    else:
        from navfw.perceive.report import as_line

        typer.echo("    time    sure  contact  what is seen")
        for view in views:
            typer.echo(as_line(view))
        if overlay is not None:
            typer.echo(f"drawn to {overlay}")
    for note in notes:
        typer.echo(f"note: {note}", err=True)


def _look(options: Options, images: Source, overlay: Path | None) -> list[View]:
    """All views; drawn to ``overlay`` on the way."""
    from navfw.perceive.output import open_output
    from navfw.perceive.perceiver import Perceiver
    from navfw.plugins import default_registry

    perceiver = Perceiver(options, images, default_registry())
    if overlay is None:
        return [view for _, view in perceiver.views()]
    from navfw.perceive.overlay import draw

    views = []
    with open_output(overlay, images) as output:
        for shot, view in perceiver.views():
            assert perceiver.size is not None  # noqa: S101 - known from the first image on
            output.add(draw(shot.image, view, perceiver.size))
            views.append(view)
    return views


def _grid(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"\s*([0-9]{1,3})\s*[xX*]\s*([0-9]{1,3})\s*", text)
    if found is None:
        raise InputError(f"expected ROWSxCOLUMNS such as 12x16, got {text!r}", key="--grid")
    return int(found[1]), int(found[2])


def _notes(options: Options, views: list[View]) -> list[str]:
    """What a person should know about how the answers came about."""
    notes = []
    if not options.speed and not any(view.scale.metric for view in views):
        zero = "--speed 0 is taken as unknown" if options.speed == 0.0 else "no --speed given"
        notes.append(f"{zero}: near, middle and far go by the time to contact; no metres")
    if options.gyro is not None:
        if options.gyro.note is not None:
            notes.append(options.gyro.note)
        gaps = sum(view.turn_source != "gyro" for view in views)
        if gaps == len(views):
            raise InputError("covers none of the images' time", key="--gyro")
        if gaps:
            notes.append(f"the gyro's record has gaps in {gaps} of {len(views)} pairs")
    unknown = sum(not view.known for view in views)
    if unknown:
        notes.append(f"{unknown} of {len(views)} pairs say nothing")
    return notes
