"""Draw the pictures of the README: the run that ``make run`` drives.

It drives the mission, then writes a picture of one moment, as videos have it, and an animation of
the whole run::

    uv run python docs/draw_run.py

Both files carry the run's ``command_hash`` as a comment; a test compares it with the run's.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
from PIL import Image as Picture
from PIL.PngImagePlugin import PngInfo

from navfw.cli.recordings import chase_of
from navfw.numerics import Image
from navfw.recording import channel_list as topics
from navfw.recording.recorded_run import open_run
from navfw.recording.run_folder import read_result
from navfw.report.run_moments import SHOWN, newest_at_images
from navfw.report.run_timeline import read_timeline, robot_and_goals
from navfw.report.run_video import CHASE_SIZE, VideoPlan, draw_moment

IMAGES = Path(__file__).parent / "images"
MISSION = ("office", "lobby-to-lab")
"""World and mission that ``make run`` drives."""

MOMENT = 12.0
"""Time [s] of the picture: in the corridor."""

WIDTH, HEIGHT = 640, 720
"""Size of the camera's half of the picture [px]."""

FRAMES, RATE = 30, 3
"""Pictures of the animation, and pictures per second."""


def moments(folder: Path, numbers: Sequence[int]) -> Iterator[Image]:
    """The pictures of the run's video at these images of the camera, BGR."""
    result = read_result(folder)
    run = open_run(folder, chase_of(folder, CHASE_SIZE, fine=2))
    radius, goals = robot_and_goals(result)
    size = (WIDTH, HEIGHT - CHASE_SIZE[1])
    plan = VideoPlan(read_timeline(run, radius), goals, radius, size)
    for newest in newest_at_images(run, (*SHOWN, topics.LOCAL_GOAL), numbers):
        yield draw_moment(newest, plan, run)


def draw_frames(folder: Path, count: int) -> list[Image]:
    """``count`` moments of the run: camera, view from behind and reason, BGR."""
    images = sum(1 for _ in open_run(folder).messages(topics.CAMERA_IMAGE))
    numbers = np.linspace(0, images - 1, count).round().astype(int).tolist()
    frames = []
    for picture in moments(folder, numbers):
        frame = np.full((214, WIDTH, 3), 255, dtype=np.uint8)
        seen, behind = picture[60:420, :WIDTH], picture[: CHASE_SIZE[1], WIDTH:]
        frame[:160, :284] = cv2.resize(seen, (284, 160), interpolation=cv2.INTER_AREA)
        frame[:160, 288:] = cv2.resize(behind, (352, 176), interpolation=cv2.INTER_AREA)[8:168]
        frame[160:] = picture[484:538, :WIDTH]
        frames.append(frame)
    return frames


def write_pictures(folder: Path, target: Path) -> None:
    """Write the picture and the animation of the run in ``folder`` to the folder ``target``."""
    command_hash = str(read_result(folder)["command_hash"])
    name = "-".join(MISSION)
    note = PngInfo()
    note.add_text("Comment", command_hash)
    times = [message.time for message in open_run(folder).messages(topics.CAMERA_IMAGE)]
    (picture,) = moments(folder, [max(n for n, at in enumerate(times) if at <= MOMENT)])
    rgb(picture).quantize(256).save(target / f"{name}.png", pnginfo=note, optimize=True)
    frames = [rgb(frame) for frame in draw_frames(folder, FRAMES)]
    palette = rgb(np.concatenate([np.asarray(f)[..., ::-1] for f in frames[::12]])).quantize(64)
    first, *others = (f.quantize(palette=palette, dither=Picture.Dither.NONE) for f in frames)
    first.save(
        target / f"{name}.gif",
        save_all=True,
        append_images=others,
        duration=1000 // RATE,
        loop=0,
        comment=command_hash.encode(),
    )


def rgb(image: Image) -> Picture.Image:
    """A BGR image for Pillow."""
    return Picture.fromarray(np.ascontiguousarray(image[..., ::-1]))


def main() -> None:
    """Drive the mission and write its pictures."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "run"
        drive = [sys.executable, "-m", "navfw", "run", *MISSION, "--record", "--out", str(folder)]
        subprocess.run(drive, check=True)  # noqa: S603 - words of our own
        write_pictures(folder, IMAGES)


if __name__ == "__main__":
    main()
