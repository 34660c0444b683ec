"""Draw the pictures of the README: the run that ``make run`` drives.

It drives the mission, then writes a picture of one moment beside the path of the run, and an
animation of the whole run::

    uv run python docs/draw_run.py

Both files carry the run's ``command_hash`` as a comment; a test compares it with the run's.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
from PIL import Image as Picture
from PIL.PngImagePlugin import PngInfo

from navfw.numerics import Image
from navfw.recording import channel_list as topics
from navfw.recording import palette
from navfw.recording.recorded_run import RecordedRun, image_of, recording_in
from navfw.recording.run_folder import read_result
from navfw.report.run_moments import SHOWN, newest_at_images
from navfw.report.run_timeline import read_timeline, robot_and_goals
from navfw.report.run_video import VideoPlan, draw_camera

IMAGES = Path(__file__).parent / "images"
MISSION = ("office", "lobby-to-lab")
"""World and mission that ``make run`` drives."""

MOMENT = 9.0
"""Time [s] of the picture: before the lobby's door."""

WIDTH, HEIGHT = 640, 720
"""Size of the camera's part of the picture [px]; the path has the same height."""

FRAMES, RATE = 60, 6
"""Pictures of the animation, and pictures per second."""
PALE = ((255, 255, 255), (217, 234, 221), (217, 210, 196))
"""Paper, floor that is mapped as free, furniture: red, green, blue."""


def draw_view(folder: Path, time: float) -> Image:
    """The last image before ``time`` [s] with flow, cells and sentence, (HEIGHT, WIDTH, 3) BGR."""
    run = RecordedRun(recording_in(folder))
    times = [message.time for message in run.messages(topics.CAMERA_IMAGE)]
    number = max(n for n, at in enumerate(times) if at <= time)
    newest = next(iter(newest_at_images(run, SHOWN, [number])))
    camera = newest[topics.CAMERA_IMAGE]
    content = {topic: message.content for topic, message in newest.items()}
    return draw_camera(camera.time, image_of(camera, run.path), content, (WIDTH, HEIGHT))


def draw_path(folder: Path) -> Image:
    """The picture of the path in ``folder``, reduced to HEIGHT [px], BGR."""
    path = cv2.imread(str(folder / "trajectory.png"))
    if path is None:
        raise FileNotFoundError(folder / "trajectory.png")
    width = round(path.shape[1] * HEIGHT / path.shape[0])
    return np.asarray(cv2.resize(path, (width, HEIGHT), interpolation=cv2.INTER_AREA))


def draw_frames(folder: Path, count: int) -> list[Image]:
    """``count`` moments of the run, evenly spaced: camera beside plan above the reason, BGR."""
    run = RecordedRun(recording_in(folder))
    radius, goals = robot_and_goals(read_result(folder))
    plan = VideoPlan(read_timeline(run, radius), goals, radius, (WIDTH, HEIGHT))
    images = sum(1 for _ in run.messages(topics.CAMERA_IMAGE))
    numbers = np.linspace(0, images - 1, count).round().astype(int).tolist()
    frames = []
    for newest in newest_at_images(run, (*SHOWN, topics.LOCAL_GOAL), numbers):
        camera = newest[topics.CAMERA_IMAGE]
        content = {topic: message.content for topic, message in newest.items()}
        image, half = image_of(camera, run.path), WIDTH // 2
        frame = np.full((294, WIDTH, 3), 255, dtype=np.uint8)
        seen = draw_camera(camera.time, image, content, (480, 600))[:360]
        frame[:240, :half] = cv2.resize(seen, (half, 240), interpolation=cv2.INTER_AREA)
        drawn = plan.draw(camera.time, content)[:412]
        frame[:206, half:] = cv2.resize(drawn, (half, 206), interpolation=cv2.INTER_AREA)
        frame[240:] = draw_camera(camera.time, image, content, (WIDTH, HEIGHT))[484:538]
        frames.append(frame)
    return frames


def colors() -> Picture.Image:
    """The colours of the animation: greys, and those of what is drawn over them."""
    names = [color for _, color in palette.camera_key()]
    names += [palette.FLOOR, palette.FREE, palette.OCCUPIED, palette.GOAL, palette.LOCAL_GOAL]
    names += [palette.behavior_color(name) for name in ("go_to_xy", "peek", "traverse_door")]
    greys = [(level, level, level) for level in range(20, 256, 32)]
    chosen = [*greys, *(palette.bgr(name)[::-1] for name in names), *PALE]
    made = Picture.new("P", (1, 1))
    made.putpalette([part for color in chosen for part in color])
    return made


def write_pictures(folder: Path, target: Path) -> None:
    """Write the picture and the animation of the run in ``folder`` to the folder ``target``."""
    command_hash = str(read_result(folder)["command_hash"])
    name = "-".join(MISSION)
    note = PngInfo()
    note.add_text("Comment", command_hash)
    picture = np.concatenate([draw_view(folder, MOMENT), draw_path(folder)], axis=1)
    rgb(picture).save(target / f"{name}.png", pnginfo=note, optimize=True)
    frames = [rgb(frame) for frame in draw_frames(folder, FRAMES)]
    first, *others = (f.quantize(palette=colors(), dither=Picture.Dither.NONE) for f in frames)
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
