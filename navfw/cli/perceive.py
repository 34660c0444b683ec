"""``navfw perceive SOURCE...``: OFFIS on real images: a folder, a video, image files."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from navfw.cli.output import print_json, quiet_stdout
from navfw.errors import InputError

if TYPE_CHECKING:
    from navfw.perceive.image_sources import ImageSource
    from navfw.perceive.perceiver import PairResult, PerceiverOptions

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
        from navfw.perceive.gyro_record import load_gyro_record
        from navfw.perceive.image_sources import open_source
        from navfw.perceive.perceiver import PerceiverOptions

        rows, cols = _grid(grid)
        options = PerceiverOptions(
            hfov=hfov,
            speed=speed,
            height=height,
            pitch=pitch,
            flow=flow,
            rows=rows,
            cols=cols,
            stride=stride,
            gyro=None if gyro is None else load_gyro_record(gyro),
        )
        images = open_source(source, fps)
        results = _perceive_all(options, images, overlay)
    notes = [*_notes(options, results), *images.notes]
    if json:
        from navfw.perceive.pair_report import as_data

        print_json([as_data(result) for result in results])
    else:
        from navfw.perceive.pair_report import as_line

        typer.echo("    time    sure  contact  what is seen")
        for result in results:
            typer.echo(as_line(result))
        if overlay is not None:
            typer.echo(f"drawn to {overlay}")
    for note in notes:
        typer.echo(f"note: {note}", err=True)


def _perceive_all(
    options: PerceiverOptions, images: ImageSource, overlay: Path | None
) -> list[PairResult]:
    """All results; drawn to ``overlay`` on the way."""
    from navfw.perceive.overlay_output import open_output
    from navfw.perceive.perceiver import Perceiver
    from navfw.plugins import default_registry

    perceiver = Perceiver(options, images, default_registry())
    if overlay is None:
        return [result for _, result in perceiver.results()]
    from navfw.perceive.overlay import draw

    results = []
    with open_output(overlay, images) as output:
        for item, result in perceiver.results():
            assert perceiver.size is not None  # noqa: S101 - known from the first image on
            output.add(draw(item.image, result, perceiver.size))
            results.append(result)
    return results


def _grid(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"\s*([0-9]{1,3})\s*[xX*]\s*([0-9]{1,3})\s*", text)
    if found is None:
        raise InputError(f"expected ROWSxCOLUMNS such as 12x16, got {text!r}", key="--grid")
    return int(found[1]), int(found[2])


def _notes(options: PerceiverOptions, results: list[PairResult]) -> list[str]:
    """What a person should know about how the answers came about."""
    notes = []
    if not options.speed and not any(result.scale.metric for result in results):
        zero = "--speed 0 is taken as unknown" if options.speed == 0.0 else "no --speed given"
        notes.append(f"{zero}: near, middle and far go by the time to contact; no metres")
    if options.gyro is not None:
        if options.gyro.note is not None:
            notes.append(options.gyro.note)
        gaps = sum(result.turn_source != "gyro" for result in results)
        if gaps == len(results):
            raise InputError("covers none of the images' time", key="--gyro")
        if gaps:
            notes.append(f"the gyro's record has gaps in {gaps} of {len(results)} pairs")
    unknown = sum(not result.known for result in results)
    if unknown:
        notes.append(f"{unknown} of {len(results)} pairs say nothing")
    return notes
