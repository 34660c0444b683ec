"""``navfw perceive SOURCE...``: OFFIS on recorded images: a folder, a video, image files."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from navfw.cli.output import print_json, quiet_stdout
from navfw.errors import InputError

if TYPE_CHECKING:
    from navfw.perceive.image_sources import ImageSource
    from navfw.perceive.pair_result import PairResult
    from navfw.perceive.perceiver_options import PerceiverOptions

__all__ = ["add_to"]


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(perceive)


Hfov = Annotated[
    float, typer.Option(help="Horizontal field of view [degrees]; about 65 for a phone.")
]
Speed = Annotated[
    float | None,
    typer.Option(
        help="Forward speed [m/s]. Unknown or 0: times to contact only, unless --height is given"
        " and the floor is visible.",
        show_default=False,
    ),
]
Fps = Annotated[
    float | None,
    typer.Option(
        help="Images per second; by default that of the video, 10 for files.", show_default=False
    ),
]
Height = Annotated[
    float | None,
    typer.Option(
        help="Height of the camera above the floor [m]; by default from floor and speed.",
        show_default=False,
    ),
]
Pitch = Annotated[float, typer.Option(help="Pitch of the camera, nose down positive [degrees].")]
GyroFile = Annotated[
    Path | None,
    typer.Option(
        help="CSV file: time [s], yaw_rate [rad/s] and, if known, pitch_rate, roll_rate; "
        "by default the rotation is estimated from the flow.",
        show_default=False,
    ),
]
FlowPlugin = Annotated[str, typer.Option(metavar="PLUGIN", help="Flow processor.")]
Grid = Annotated[str, typer.Option(metavar="ROWSxCOLUMNS", help="Grid of the flow.")]
Stride = Annotated[
    int | None,
    typer.Option(
        help="Distance between the images of a pair [images]; by default chosen by the flow.",
        show_default=False,
    ),
]
Overlay = Annotated[
    Path | None,
    typer.Option(
        metavar="OUT",
        help="Draw the results: a folder of PNG files, or an .mp4 or .avi file.",
        show_default=False,
    ),
]
JsonList = Annotated[
    bool, typer.Option("--json", help="Print a JSON list of objects, one per pair of images.")
]


def perceive(
    source: Annotated[
        list[Path],
        typer.Argument(help="A folder of images, a video, or image files.", show_default=False),
    ],
    hfov: Hfov = 65.0,
    speed: Speed = None,
    fps: Fps = None,
    height: Height = None,
    pitch: Pitch = 0.0,
    gyro: GyroFile = None,
    flow: FlowPlugin = "block_matching",
    grid: Grid = "12x16",
    stride: Stride = None,
    overlay: Overlay = None,
    json: JsonList = False,
) -> None:
    """Run perception on recorded images. Lists obstacles, distances and the situation."""
    with quiet_stdout():
        from navfw.perceive.gyro_record import load_gyro_record
        from navfw.perceive.image_sources import open_source
        from navfw.perceive.perceiver_options import PerceiverOptions

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
        _print(results, overlay)
    for note in notes:
        typer.echo(f"note: {note}", err=True)


def _print(results: list[PairResult], overlay: Path | None) -> None:
    from navfw.perceive.pair_report import as_line

    typer.echo("    time    sure  contact  perceived")
    for result in results:
        typer.echo(as_line(result))
    if overlay is not None:
        typer.echo(f"drawn to {overlay}")


def _perceive_all(
    options: PerceiverOptions, images: ImageSource, overlay: Path | None
) -> list[PairResult]:
    """The results of all pairs of images; also drawn to ``overlay`` if given."""
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
    """Remarks on the assumptions behind the results, and on gaps."""
    notes = []
    if not options.speed and not any(result.scale.metric for result in results):
        zero = "--speed 0 is taken as unknown" if options.speed == 0.0 else "no --speed given"
        notes.append(
            f"{zero}: near, middle and far refer to the time to contact; no distances in metres"
        )
    if options.gyro is not None:
        if options.gyro.note is not None:
            notes.append(options.gyro.note)
        gaps = sum(result.turn_source != "gyro" for result in results)
        if gaps == len(results):
            raise InputError(
                "expected readings within the time of the images, got none", key="--gyro"
            )
        if gaps:
            notes.append(f"the gyro's record has gaps in {gaps} of {len(results)} pairs of images")
    unknown = sum(not result.known for result in results)
    if unknown:
        notes.append(f"{unknown} of {len(results)} pairs of images give no result")
    return notes
