"""The video of a recorded run: camera with flow and percept beside the plan."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from navfw.errors import ConfigError
from navfw.numerics import Array, Image
from navfw.perceive.lettering import write, write_key
from navfw.recording import channel_list as topics
from navfw.recording import palette
from navfw.recording.recorded_run import RecordedMessage, RecordedRun, image_of, recording_in
from navfw.recording.run_folder import read_result
from navfw.recording.video_output import VideoOutput
from navfw.report.run_moments import (
    located_damage,
    newest_at_images,
    read_timeline,
    robot_and_goals,
)
from navfw.report.video_plan import VideoPlan

_TEXT_HEIGHT = 240
"""Height of the text below the camera's image [px]."""
_LETTERS, _LINE = 14.0, 20
"""Size of letters, and distance of lines [px]."""
_LETTER_WIDTH = 0.57
"""Mean width of a letter over its size."""
_MARGIN = 12
_SHIFT = 4
"""Bits of a pixel's fraction in OpenCV's drawing."""
_PAPER, _INK, _FAINT = (255, 255, 255), (36, 28, 28), (117, 102, 91)


def draw_camera(
    time: float, image: Image, content: Mapping[str, Any], size: tuple[int, int]
) -> Image:
    """The camera's ``image`` (height, width) at ``time`` [s] and the text, in ``size`` [px].

    ``content`` has what is newest on each channel.
    """
    width, height = size
    panel = np.full((height, width, 3), _PAPER, dtype=np.uint8)
    shown = panel[: height - _TEXT_HEIGHT]
    shown[:] = _INK
    scale = min(shown.shape[1] / image.shape[1], shown.shape[0] / image.shape[0])
    wide, high = (round(scale * side) for side in image.shape[::-1])
    left, top = (shown.shape[1] - wide) // 2, (shown.shape[0] - high) // 2
    large = cv2.resize(image, (wide, high), interpolation=cv2.INTER_CUBIC)
    scene = shown[top : top + high, left : left + wide]
    scene[:] = cv2.cvtColor(large, cv2.COLOR_GRAY2BGR)
    if topics.FLOW in content:
        _draw_flow(scene, content[topics.FLOW], scale)
    if topics.CELLS in content:
        _draw_cells(scene, content[topics.CELLS], scale)
    _write_text(panel, height - _TEXT_HEIGHT, time, content)
    return panel


def _draw_cells(scene: Image, annotations: Any, scale: float) -> None:
    """Each flow cell as a dot in the colour of what it shows."""
    for group in annotations.points:
        fill = group.outline_color
        color = tuple(round(255.0 * part) for part in (fill.b, fill.g, fill.r))
        for at in _fixed(group, scale).tolist():
            for radius, ink in ((5, _INK), (4, color)):
                cv2.circle(scene, at, radius << _SHIFT, ink, cv2.FILLED, cv2.LINE_AA, _SHIFT)


def _draw_flow(scene: Image, annotations: Any, scale: float) -> None:
    """Flow vectors as arrows from where each point was to where it is."""
    pairs = _fixed(annotations.points[0], scale).reshape(-1, 2, 2)
    for color, thickness in ((_INK, 4), (palette.bgr(palette.FLOW), 2)):
        for start, end in pairs.tolist():
            cv2.arrowedLine(scene, start, end, color, thickness, cv2.LINE_AA, _SHIFT, 0.3)


def _fixed(group: Any, scale: float) -> Any:
    """The points of an annotation as OpenCV's fixed-point coordinates (n, 2)."""
    points = np.array([(point.x, point.y) for point in group.points]).reshape(-1, 2)
    return np.rint(scale * points * (1 << _SHIFT)).astype(np.int32)


def _write_text(panel: Image, top: int, time: float, content: Mapping[str, Any]) -> None:
    """Time, command and its reason, the sentence, and the key of the image."""
    command = content.get(topics.COMMAND, {})
    leader = command.get("leader", "")
    drive = f"v {command['v']:+.2f} m/s   w {command['w']:+.2f} rad/s" if command else "no command"
    y = top + 26
    write(panel, f"{time:5.1f} s", (_MARGIN, y), 17.0, _INK, bold=True)
    color = palette.bgr(palette.behavior_color(leader))
    cv2.rectangle(panel, (100, y - 13), (114, y + 1), color, cv2.FILLED)
    write(panel, leader or "no behaviour", (120.0, y), 17.0, _INK, bold=True)
    write(panel, drive, (330.0, y), _LETTERS, _FAINT)
    letters = int((panel.shape[1] - 2 * _MARGIN) / (_LETTER_WIDTH * _LETTERS))
    reason = textwrap.wrap(command.get("reason", ""), letters, max_lines=2, placeholder=" ...")
    sentence = content.get(topics.PERCEPT, {}).get("sentence", "")
    seen = textwrap.wrap(sentence, letters, max_lines=5, placeholder=" ...")
    for line, ink in (*((text, _FAINT) for text in reason), *((text, _INK) for text in seen)):
        y += _LINE
        write(panel, line, (_MARGIN, y), _LETTERS, ink)
    key = [(name, palette.bgr(color)) for name, color in palette.camera_key()]
    write_key(panel, key, (float(_MARGIN), panel.shape[0] - 14.0), 12.0, _INK)


_SIZE = (640, 720)
"""Width and height of each half of a picture [px]."""
_MAX_AGE = 2.0
"""Age of a message from which it is no longer shown [s]."""
_MAX_REPEATS = 600
"""Largest number of times that a picture is repeated while the camera gives no other."""
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
    with located_damage(run, f"a message before {camera.time:.2f} s"):
        left = draw_camera(camera.time, image_of(camera, run.path), content, _SIZE)
        return np.concatenate([left, plan.draw(camera.time, content)], axis=1)
