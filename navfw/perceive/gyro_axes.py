"""Check whether a motion record turns as the camera does, and find the axes in which it would."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from navfw.egomotion.flow_egomotion import MotionKind, estimate_egomotion
from navfw.errors import InputError
from navfw.numerics import Array
from navfw.perceive.image_sources import ImageSource
from navfw.perceive.lens_estimate import MAX_PIXELS, MIN_POINTS
from navfw.perceive.motion_record import RATES, MotionRecord
from navfw.perceive.pair_motion import TrackImage, rotation_vector, track_points
from navfw.perceive.perceiver_options import PerceiverOptions, WorkingSize
from navfw.recording.static_frames import agreeing_axes, assumed_axes, axes_text

_TURNS = (0.02, 0.2)
"""Rotation [rad] between the images of a pair from which they are compared, and the largest."""
_COMPARED = (8, 40)
"""Least and largest number of pairs for a verdict."""
_DISAGREES, _DOUBTED = 0.6, 0.75
"""Agreement below which a record is not used, and is doubted; 0.88 and 0.90 of two real cars."""
_APART = 0.3
"""Time [s] after which images are compared that turned less."""


def turns_seen(
    record: MotionRecord, images: ImageSource, options: PerceiverOptions, tick: Callable[[], None]
) -> tuple[Array, Array]:
    """Return rotations (n, 3) [rad] of pairs about ahead, left, up: as seen, and by the record."""
    seen, measured = list[Array](), list[Array]()
    past: tuple[float, TrackImage] | None = None
    pixels = 0
    with contextlib.suppress(InputError):  # a bad image is reported when it is its turn
        for item in images:
            height, width = item.image.shape[:2]
            pixels += width * height
            if pixels > MAX_PIXELS or len(seen) == _COMPARED[1]:
                break
            tick()
            turn = None
            if past is not None and not item.after_gap:
                turn = record.rotation_between(past[0], item.time)
                small = turn is not None and np.linalg.norm(turn) < _TURNS[0]
                if small and item.time - past[0] < _APART:
                    continue
            now = TrackImage.of(item.image)
            if past is not None and turn is not None:
                size = WorkingSize.of(width, height, *options.grid_for(width, height))
                hfov = options.angle_of_view(width, height, images.hfov)
                camera = size.camera(hfov, 1.0, math.radians(options.pitch or 0.0), 1.0)
                tracks = track_points(past[1], now, size)
                motion = estimate_egomotion(tracks, camera.focal)
                known = len(tracks.points) >= MIN_POINTS and motion.kind is not MotionKind.UNKNOWN
                turned = rotation_vector(motion.rotation, camera)
                most = max(np.linalg.norm(turned), np.linalg.norm(turn))
                if known and np.linalg.norm(turned) < _TURNS[1] and most > _TURNS[0]:
                    seen.append(turned)
                    measured.append(turn)
            past = item.time, now
    return np.array(seen).reshape(-1, 3), np.array(measured).reshape(-1, 3)


def compared(
    record: MotionRecord,
    images: ImageSource,
    options: PerceiverOptions,
    *,
    given: bool,
    tick: Callable[[], None] = lambda: None,
) -> MotionRecord:
    """Return ``record`` in the axes in which it rotates as the camera of ``images`` does.

    These are assumed, and replace what it assumed of axes; if its axes are ``given``, or none
    agree, there is a note. Without any agreement nothing counts as measured.
    """
    seen, measured = turns_seen(record, images, options, tick)
    if len(seen) < _COMPARED[0]:
        return record
    better, agreement = agreeing_axes(seen, measured)
    text = "" if better is None else axes_text(better @ record.axes)
    if better is None or given:
        note = f"the {record.source} and the images do not turn alike (agreement {agreement:.2f})"
        if text:
            return replace(
                record, notes=(*record.notes, f"{note}; they would with --imu-axes {text}")
            )
        own = [name in record.measured for name in reversed(RATES)]
        agreement = agreeing_axes(np.where(own, seen, math.nan), measured)[1]
        if agreement >= _DISAGREES:
            doubts = (note,) if agreement < _DOUBTED else ()
            return replace(record, notes=(*record.notes, *doubts))
        note = f"{note}: the rotation is taken from the flow"
        return replace(record, notes=(*record.notes, note), measured=frozenset())
    reason = f"it then turns as the images do (agreement {agreement:.2f} in {len(seen)} pairs)"
    kept = [one for one in record.assumed if not one.what.startswith("axes of")]
    kept.append(assumed_axes(better @ record.axes, reason, record.source))
    return replace(record.turned(better), assumed=tuple(kept))
