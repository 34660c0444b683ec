"""``navfw perceive SOURCE...``: run OFFIS on recorded images: a folder, a video, image files."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from navfw.cli.options import ImuAxes, LivePort, Topic, argument, from_options, option
from navfw.cli.output import echo, print_assumed, print_json_list, quiet_stdout, quietly
from navfw.cli.progress_bar import ProgressBar, Quiet
from navfw.errors import InputError, locating
from navfw.process.atomic import write_text
from navfw.recording.run_folder import is_bag

if TYPE_CHECKING:
    from navfw.assumption import Assumption
    from navfw.lenses import CameraCalibration
    from navfw.perceive.bag_source import BagInputs
    from navfw.perceive.image_sources import ImageSource
    from navfw.perceive.lens_estimate import LensEstimate
    from navfw.perceive.motion_record import MotionRecord
    from navfw.perceive.pair_result import PairResult
    from navfw.perceive.perceiver import Perceiver
    from navfw.perceive.perceiver_options import PerceiverOptions
    from navfw.recording import Bag
    from navfw.report.perceive_live import PerceiveServer
    from navfw.report.report_page import PerceivePage


@dataclass(frozen=True, slots=True)
class PerceiveOptions:
    """Arguments and options of ``navfw perceive``."""

    source: list[Path] | None = argument(
        None,
        "A folder of images, a video, image files, or a bag; without one, the webcam --camera N.",
        show_default=False,
    )
    topic: Topic = None
    hfov: float | None = option(
        None,
        "Horizontal field of view [degrees]; by default estimated from turns of the camera, or 65"
        " along the longer side of the images, as of a phone.",
    )
    calibration: Path | None = option(
        None,
        "Calibration of the camera instead of --hfov: of OpenCV, ROS, Kalibr, EuRoC, VINS or"
        " ORB-SLAM. Its lens distortion is removed; by default it is estimated.",
        metavar="FILE",
    )
    camera: str | None = option(
        None,
        "Which camera of a calibration of several: its name or topic. Without a source: the number"
        " of a webcam, from 0 on.",
    )
    speed: float | None = option(
        None,
        "Forward speed [m/s]. Unknown or 0: times to contact only, unless --height is given and"
        " the floor is visible.",
    )
    fps: float | None = option(
        None, "Images per second; by default that of the video, 10 for files."
    )
    times: Path | None = option(
        None,
        "Times of image files instead of --fps: lines of a time [s] and, if known, the file.",
        metavar="FILE",
    )
    height: float | None = option(
        None, "Height of the camera above the floor [m]; by default from floor and speed."
    )
    pitch: float | None = option(
        None, "Pitch of the camera, nose down positive [degrees]; by default 0."
    )
    gyro: Path | None = option(
        None,
        "CSV file: time [s], yaw_rate [rad/s] and, if known, pitch_rate, roll_rate; units may be"
        " named in the header. By default the rotation is estimated from the flow.",
        metavar="FILE",
    )
    poses: Path | None = option(
        None,
        "Poses of the camera instead of --gyro, in TUM format: time [s], tx ty tz [m], qx qy qz"
        " qw, or of EuRoC. They give rotation and speed.",
        metavar="FILE",
    )
    imu_axes: ImuAxes = None
    flow: str = option("registered", "Flow processor.", metavar="PLUGIN")
    grid: str | None = option(
        None,
        "Grid of the flow; by default 12x16, and 16x12 for upright images.",
        metavar="ROWSxCOLUMNS",
    )
    stride: int | None = option(
        None, "Distance between the images of a pair [images]; by default chosen by the flow."
    )
    overlay: Path | None = option(
        None,
        "Draw the results: a folder of PNG files, or an .mp4 file (extra video).",
        metavar="OUT",
    )
    page: Path | None = option(
        None,
        "Write a page to scroll through: pictures, sentences, nearness (extra report).",
        metavar="FILE",
    )
    live: bool = option(
        False,
        "Serve that page to this machine alone while the images come, at their own speed, from the"
        " first viewer on (extra report).",
        "--live",
    )
    port: LivePort = 8765
    json: bool = option(False, "Print a JSON list of objects, one per pair of images.", "--json")
    quiet: Quiet = False


@from_options
def perceive(options: PerceiveOptions) -> None:
    """Run perception on recorded images. Lists obstacles, distances and the situation."""
    source = options.source or []
    if len(source) != 1 or not is_bag(source[0]):
        if options.topic is not None:
            raise InputError("is for a bag", key="--topic")
        _perceive(options)
        return
    with contextlib.ExitStack() as stack:
        with quiet_stdout():
            from navfw.perceive.bag_source import unpacked_bag
            from navfw.recording.bag_reader import Bag

            bag = Bag(source[0], options.topic, options.imu_axes)
            pitch = math.radians(options.pitch or 0.0)
            own = stack.enter_context(unpacked_bag(bag, pitch))
        with locating(file=bag.file):
            _perceive(options, bag, own)
    for note in bag.notes:
        echo(f"note: {note}", err=True)


def _perceive(given: PerceiveOptions, bag: Bag | None = None, own: BagInputs | None = None) -> None:
    """Run perception on the sources that are ``given``, or on the inputs ``own`` of a ``bag``."""
    with quiet_stdout():
        from navfw.perceive.image_sources import open_source
        from navfw.perceive.image_times import load_image_times
        from navfw.perceive.pair_result import as_data
        from navfw.perceive.perceiver import Perceiver
        from navfw.perceive.perceiver_options import PerceiverOptions, parse_grid
        from navfw.perceive.webcam import Webcam, webcam_number
        from navfw.plugins import default_registry

        for one, other in (("hfov", "calibration"), ("fps", "times"), ("gyro", "poses")):
            if getattr(given, one) is not None and getattr(given, other) is not None:
                raise InputError(f"give --{one} or --{other}, not both", key=f"--{other}")
        same = ("hfov", "speed", "height", "pitch", "flow", "stride")
        options = PerceiverOptions(
            **{name: getattr(given, name) for name in same},
            grid=None if given.grid is None else parse_grid(given.grid),
        )
        listed = None if given.times is None else load_image_times(given.times)
        if own is not None and given.fps is None:
            listed = listed or own.times
        source = given.source if own is None else [own.folder]
        opened: Callable[[CameraCalibration | None], ImageSource]
        if source:
            opened = partial(open_source, source, given.fps, listed=listed)
        else:
            recorded = [n for n in ("fps", "times", "gyro", "poses") if getattr(given, n)]
            opened = partial(Webcam, webcam_number(given.camera, recorded))
        options = replace(options, gyro=_motion_record(given, own, opened))
    with ProgressBar("perceive", quiet=given.quiet) as bar:
        with quiet_stdout():
            topic = given.camera or (None if bag is None else bag.image_topic)
            calibration, view, lens = _lens(opened, replace(given, camera=topic), own, bar)
            compared = partial(opened, calibration)
            options = _compared(replace(options, hfov=view), compared, given, bar)
            images = opened(calibration)
            perceiver = Perceiver(options, images, default_registry())
        counter = _ResultCounter(perceiver, bar, [] if bag is None else bag.assumed)
        page, server = _pages(given, images, lambda: perceiver.assumed(counter.assumed))
        if server is not None:
            bar.show_part("waiting for the first viewer")
        pages = [one for one in (page, server) if one is not None]
        with (
            contextlib.nullcontext() if server is None else contextlib.closing(server),
            contextlib.closing(_results(perceiver, given.overlay, pages)) as results,
        ):
            shown = counter.counted(quietly(results))
            if given.json:
                estimated = None if lens is None else lens.as_data()
                own_data = (counter.as_data() | as_data(result) for result in shown)
                print_json_list(data | {"estimated": estimated} for data in own_data)
            else:
                _print(shown, lens, given.overlay)
    notes = [*counter.notes(), *images.notes]
    for note in notes:
        echo(f"note: {note}", err=True)
    if given.page is not None and page is not None:
        assumed = (f"assumed: {one}" for one in counter.assumed)
        write_text(given.page, page.render([*assumed, *notes]))


def _print(results: Iterable[PairResult], lens: LensEstimate | None, overlay: Path | None) -> None:
    from navfw.perceive.lens_estimate import estimate_line
    from navfw.perceive.pair_result import as_line

    for number, result in enumerate(results):
        if number == 0 and lens is not None:
            echo(estimate_line(lens))
        if number == 0:
            echo("    time    sure  contact  perceived")
        echo(as_line(result))
    if overlay is not None:
        echo(f"drawn to {overlay}")


def _lens(
    opened: Callable[[CameraCalibration | None], ImageSource],
    given: PerceiveOptions,
    own: BagInputs | None,
    bar: ProgressBar,
) -> tuple[CameraCalibration | None, float | None, LensEstimate | None]:
    """Return the lens, the images' field of view [deg], and an estimate of a lens not given."""
    from navfw.lenses import load_calibration
    from navfw.perceive.lens_estimate import estimate_lens

    if given.calibration is not None:
        return load_calibration(given.calibration, given.camera), None, None
    if own is not None and own.lens is not None and given.hfov is None:
        return own.lens, None, None
    if not given.source:
        return None, given.hfov, None
    estimate = estimate_lens(opened(None), given.hfov, lambda: bar.show_part("estimating the lens"))
    return estimate.calibration, estimate.known_hfov(given.hfov), estimate


def _results(
    perceiver: Perceiver, overlay: Path | None, pages: Sequence[PerceivePage | PerceiveServer]
) -> Generator[PairResult]:
    """Yield the result of each pair of images; draw it to ``overlay`` and ``pages``."""
    from navfw.perceive.overlay import draw, open_output
    from navfw.perceive.pair_result import as_data

    nothing = contextlib.nullcontext(None)
    with nothing if overlay is None else open_output(overlay, perceiver.source) as output:
        for item, result in perceiver.results():
            if output is not None or pages:
                assert perceiver.size is not None  # noqa: S101 - known from the first image on
                picture = draw(item.image, result, perceiver.size)
            if output is not None:
                output.add(picture)
            for page in pages:
                page.add(picture, as_data(result))
            yield result


def _pages(
    given: PerceiveOptions, images: ImageSource, assumed: Callable[[], list[Assumption]]
) -> tuple[PerceivePage | None, PerceiveServer | None]:
    """Return the page to write and the live one, None if they are not wanted."""
    page = server = None
    title = f"Perceived: {given.source[0] if given.source else images}"
    if given.page is not None:
        from navfw.report.report_page import PerceivePage

        page = PerceivePage(title)
    if given.live:
        from navfw.report.perceive_live import PerceiveServer

        server = PerceiveServer(title, given.port, assumed)
        echo(f"live: {server.url} (the first viewer begins it)", err=True)
    return page, server


def _motion_record(
    given: PerceiveOptions,
    own: BagInputs | None,
    opened: Callable[[CameraCalibration | None], ImageSource],
) -> MotionRecord | None:
    """Return the record of the camera's motion, with times since the first image."""
    from navfw.perceive.motion_record import load_gyro_record, load_pose_record
    from navfw.recording.static_frames import axes_of

    record = None if own is None or given.fps is not None else own.record
    axes = None if given.imu_axes is None else axes_of(given.imu_axes)
    if given.gyro is not None:
        record = load_gyro_record(given.gyro, axes)
    elif given.poses is not None:
        record = load_pose_record(given.poses, math.radians(given.pitch or 0.0), axes)
    return None if record is None else record.on_clock_of(opened(None))


def _compared(
    options: PerceiverOptions,
    images: Callable[[], ImageSource],
    given: PerceiveOptions,
    bar: ProgressBar,
) -> PerceiverOptions:
    """Return the options with a record, if any, in the axes in which it turns as the images do.

    That of a bag's wheels was compared before.
    """
    from navfw.perceive.gyro_axes import compared

    if options.gyro is None or (options.gyro.source == "poses" and given.poses is None):
        return options
    tick = partial(bar.show_part, "comparing the axes of the gyro")
    is_given = given.imu_axes is not None
    record = compared(options.gyro, images(), options, given=is_given, tick=tick)
    if not record.measured:
        echo(f"note: {record.notes[-1]}", err=True)
        return replace(options, gyro=None)
    return replace(options, gyro=record.without_offsets())


class _ResultCounter:
    """Counts results of ``perceiver`` as they pass, and shows on ``bar`` how many are done.

    With the first result, the assumptions are printed, those ``known`` before included.
    """

    def __init__(self, perceiver: Perceiver, bar: ProgressBar, known: Sequence[Assumption]) -> None:
        self._perceiver, self._bar, self.assumed = perceiver, bar, known
        self._pairs = self._metric = self._unmeasured = self._unknown = 0

    def counted(self, results: Iterable[PairResult]) -> Iterator[PairResult]:
        for result in results:
            if not self._pairs:
                self.assumed = self._perceiver.assumed(self.assumed)
                print_assumed(self.assumed)
            self._pairs += 1
            self._metric += result.scale.metric
            self._unmeasured += result.motion.turn_source == "flow"
            self._unknown += not result.known
            self._bar.show_part("images", self._pairs + 1, self._perceiver.source.total)
            yield result

    def as_data(self) -> dict[str, Any]:
        return {"assumed": [one.as_data() for one in self.assumed]}

    def notes(self) -> list[str]:
        """Return remarks on the assumptions behind the results, and on gaps."""
        notes, options = [], self._perceiver.options
        if not options.speed and not self._metric:
            zero = "--speed 0 is taken as unknown" if options.speed == 0.0 else "no --speed given"
            what = "near, middle and far refer to the time to contact; no distances in metres"
            notes.append(f"{zero}: {what}")
        if options.gyro is not None:
            notes += options.gyro.notes
            pairs = f"{self._unmeasured} of {self._pairs} pairs of images"
            what = f"the {options.gyro.source} record has gaps in {pairs}"
            notes += [what] if self._unmeasured else []
        if self._unknown:
            notes.append(f"{self._unknown} of {self._pairs} pairs of images give no result")
        return notes
