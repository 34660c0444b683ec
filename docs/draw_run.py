"""Draw what the camera saw at a moment of a recorded run beside the path of the run.

The picture of the README::

    uv run navfw run office lobby-to-lab --seed 0 --record --out runs/readme
    uv run python docs/draw_run.py runs/readme --at 9 --out docs/images/office-lobby-to-lab.png
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np

from navfw.numerics import Image
from navfw.recording import channel_list as topics
from navfw.recording.recorded_run import RecordedRun, image_of, recording_in
from navfw.report.run_moments import newest_at_images
from navfw.report.run_video import draw_camera

WIDTH, HEIGHT = 640, 720
"""Size of the camera's part [px]; the path has the same height."""

SHOWN = (topics.CAMERA_IMAGE, topics.FLOW, topics.CELLS, topics.PERCEPT, topics.COMMAND)
"""Channels of the recording that the camera's part shows."""


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


def main() -> None:
    """Write the picture."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, help="run folder with a recording")
    parser.add_argument("--at", type=float, required=True, help="moment of the run [s]")
    parser.add_argument("--out", type=Path, required=True, help="PNG file to write")
    arguments = parser.parse_args()
    picture = np.concatenate(
        [draw_view(arguments.folder, arguments.at), draw_path(arguments.folder)], axis=1
    )
    cv2.imwrite(str(arguments.out), picture, [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    main()
