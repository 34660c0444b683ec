"""The video of a recorded run: camera with flow and percept beside the plan."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from navfw.errors import ConfigError
from navfw.recording import channel_list as topics
from navfw.recording.recorded_run import RecordedMessage, RecordedRun, image_of, recording_in
from navfw.recording.run_folder import read_result
from navfw.recording.video_output import VideoOutput
from navfw.report.run_moments import newest_at_images
from navfw.report.run_timeline import read_timeline, robot_and_goals
from navfw.report.video_camera import draw_camera
from navfw.report.video_plan import VideoPlan
from navfw.signals import Array, Image

_SIZE = (640, 720)
"""Width and height of each half of a picture [px]."""
_MAX_AGE = 2.0
"""Age of a message from which it is no longer shown [s]."""
_MAX_REPEATS = 600
"""Largest number of times that a picture is repeated while the camera gives no other."""
_OF_DAMAGED_MESSAGES = (
    ArithmeticError,
    AttributeError,
    IndexError,
    KeyError,
    TypeError,
    ValueError,
)
"""Errors while a message is drawn whose fields are missing, or have impossible values."""
_SHOWN = (
    topics.CAMERA_IMAGE,
    topics.FLOW,
    topics.CELLS,
    topics.PERCEPT,
    topics.COMMAND,
    topics.LOCAL_MAP,
    topics.LOCAL_GOAL,
    topics.OBSTACLES,
    topics.TRANSFORMS,
    topics.POSE,
    topics.TRUE_POSE,
    topics.PATH,
)


def write_run_video(
    folder: Path, target: Path, option: str, progress: Callable[[int, int], None]
) -> None:
    """Write the recording in a run folder as a video, a picture for each image of the camera.

    ``option`` is the option that names ``target``. ``progress`` is called with the number of
    pictures so far and in all.

    Raises:
        ConfigError: the folder has no recording, or its files are damaged.
        InputError: the video cannot be written (``VideoOutput``).

    """
    radius, goals = robot_and_goals(read_result(folder))
    run = RecordedRun(recording_in(folder))
    timeline = read_timeline(run, radius)
    times = np.array([message.time for message in run.messages(topics.CAMERA_IMAGE)])
    if not len(times) or not len(timeline.time):
        raise ConfigError(
            "has no camera images or no commands; record the run again", file=run.path
        )
    plan = VideoPlan(timeline, goals, radius, _SIZE)
    rate = _rate(times)
    repeats = np.clip(np.rint(np.diff(times, append=times[-1]) * rate), 1, _MAX_REPEATS)
    with VideoOutput(target, rate, option) as video:
        moments = newest_at_images(run, _SHOWN, range(len(times)))
        for number, newest in enumerate(moments):
            picture = _picture(newest, plan, run)
            for _ in range(int(repeats[number])):
                video.add(picture)
            progress(number + 1, len(times))


def _rate(times: Array) -> float:
    """The usual number of images per second."""
    return 1.0 / float(np.median(np.diff(times))) if len(times) > 1 else 1.0


def _picture(newest: dict[str, RecordedMessage], plan: VideoPlan, run: RecordedRun) -> Image:
    camera = newest[topics.CAMERA_IMAGE]
    content = {
        topic: message.content
        for topic, message in newest.items()
        if camera.time - message.time < _MAX_AGE
    }
    try:
        left = draw_camera(camera.time, image_of(camera, run.path), content, _SIZE)
        return np.concatenate([left, plan.draw(camera.time, content)], axis=1)
    except (*_OF_DAMAGED_MESSAGES, cv2.error) as error:
        what = f"a message before {camera.time:.2f} s is damaged ({type(error).__name__}: {error})"
        raise ConfigError(what, file=run.path) from None
