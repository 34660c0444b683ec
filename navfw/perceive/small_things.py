"""See small things by the residual to the floor's motion, at the image's own resolution.

An image is compared with one taken a camera height before: as floor, as a mirror image in it, and
as things of some heights, each of which moves by its own homography ("plane plus parallax", Sawhney
1994). A map of evidence for each height moves along with it: only what goes on moving like one
height is seen. Where the floor itself does not register well (blur, few pixels), nothing is known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from navfw.numerics import Array, Image
from navfw.numerics.arrays import Floats, Mask
from navfw.perceive.floor_motion import OUTSIDE, FloorMotion
from navfw.robot import CameraModel
from navfw.signals import CameraMotion, Frame, Percept

_WIDTH, _FRAMES, _CHAINS, _REACH, _AHEAD = 320, 14, 3, 9.0, math.radians(10.0)  # chosen
"""Largest width of images [px], number of images of a chain and of chains, farthest floor [camera
heights], bearing that is ahead."""
_BASELINES, _MIN_BASELINE, _WHOLE = (1.1, 0.7, 0.45), 0.4, 0.95  # measured
"""Baselines to compare by [camera heights], each for what is outside the image of the one before;
the least one, and the share of the floor that is enough."""
_FLOORS, _THINGS = (0.0, -0.4, -0.18), np.array([0.06, 0.12, 0.2, 0.3, 0.43, 0.6, 0.85])  # chosen
"""Shares h / (H - h) of the camera's way by which things of height h move along below a camera at
height H: floor and mirror images, and things of 6, 11, 17, 23, 30, 38 and 46 % of H."""
_BLUR, _OPTICS, _SAMPLING = 0.6, (0.08, 0.36, 0.8, 1.6), 0.1  # chosen
"""Standard deviation of the smoothing of images [px]; variances by a lens that are tried, of which
0.08 is rendered images', and by interpolation."""
_WINDOW, _AREA, _TEXTURED, _ENOUGH = 5, 16, 4.0, 200  # chosen
"""Side of a window of comparison and least area of a thing [px, px^2]; mean squared gradient of
windows that judge the registration [grey levels^2/px^2], and least number of pixels that do."""
_MAX_ERROR, _ALIKE = 0.055, 0.2  # measured
"""Largest error of the registration as a share of the floor's motion: 0.02 to 0.06 on rendered
floors, 0.05 to 0.15 on 160 x 120 px. Largest difference of the images' squared gradients."""
_NOISE, _SHARE, _FIT, _CLEAR = 0.8, 0.3, 2.5, 1.0  # measured
"""Variance that says nothing: a constant [grey levels^2] and a share of the floor's. A thing fits
up to a multiple of it, or from a log ratio of the floor's variance to the thing's."""
_USUAL, _BOUNDS = 0.3, (-0.5, 1.0)  # measured
"""Log ratio at which floor and thing are as likely; bounds of evidence."""
_DECAY, _SEEN, _COMPARED = 0.95, 2.1, 3  # measured
"""Share of the evidence left at the next image, the sum from which a thing is seen, and the least
number of comparisons that can reach it."""

_LEVEL, _FOOT = 0.15, 0.85  # measured
"""Descent of rays per depth about the horizon; nearness there, relative to that of a thing, from
which it is a foot: 95 % of feet of walls and furniture are above 0.89, of low things below 0.91."""


@dataclass(frozen=True, slots=True)
class SmallThing:
    """A thing on the floor; lengths are in camera heights.

    ``distance`` is along the floor to its foot, ``bearing`` [rad] that of its middle, left
    positive; ``height`` is the least. ``box``: left, top, right, bottom as shares of the image.
    ``ahead`` is how far ahead its foot is in the median of the image's columns.
    """

    distance: float
    bearing: float
    width: float
    height: float
    box: tuple[float, float, float, float]
    ahead: float = math.inf


def nearest_clause(thing: SmallThing) -> str:
    """Return the clause of a sentence on a ``thing``, its distance in half heights."""
    bearing, far = thing.bearing, 0.5 * round(2.0 * thing.distance)
    side = "ahead" if abs(bearing) < _AHEAD else f"on the {'left' if bearing > 0.0 else 'right'}"
    return f"Small thing {side}, {far:g} camera heights away"


def without_feet(
    things: tuple[SmallThing, ...] | None,
    percept: Percept,
    camera: CameraModel,
    height: float,
    pitch: float,
) -> tuple[SmallThing, ...] | None:
    """Return ``things`` but the feet of what reaches the height of the camera, as walls do.

    Above a foot, at the horizon, the ``percept`` is as near. ``height`` is the camera's [m], as in
    the percept, ``pitch`` [rad] nose down.
    """
    if not things:
        return things
    fall = np.abs(camera.fall_per_depth(percept.points, pitch))
    level = (fall < _LEVEL) & (percept.confidence > 0.0)
    columns = (np.arange(fall.shape[1]) + 0.5) / fall.shape[1]
    half, kept = 0.5 / columns.size, []
    for thing in things:
        left, _, right, _ = thing.box
        above = level & (columns > left - half) & (columns < right + half)
        if not above.any() or np.median(percept.nearness[above]) * height * thing.ahead < _FOOT:
            kept.append(thing)
    return tuple(kept)


@dataclass(frozen=True, slots=True)
class _Placed:
    """An image, sharp and smoothed; rotation (3, 3) and place (3,) [heights] of its camera."""

    sharp: Floats
    grey: Floats
    rotation: Array
    place: Array


class SmallThings:
    """Finds small things in the images of one sequence. ``focal`` is in widths of the image."""

    def __init__(self, focal: float) -> None:
        self._focal = focal
        self._chains: list[dict[float, _Placed]] = []  # by time; the last one is compared
        self._evidence: Floats | None = None
        self._compared = 0
        self._found: tuple[SmallThing, ...] | None = None

    def find(
        self, now: Frame, past: Frame, motion: CameraMotion, floor: FloorMotion | None
    ) -> tuple[SmallThing, ...] | None:
        """Find things in ``now`` after ``motion`` from ``past``; the nearest one is first.

        None if nothing is known: without a floor, before enough motion, or where it does not
        register. Pairs make chains: that of another chain shows what the last one did, until the
        chain that is compared ends.
        """
        if floor is None:
            self._chains, self._evidence, self._compared, self._found = [], None, 0, None
            return None
        chain = next((views for views in reversed(self._chains) if past.time in views), None)
        if chain is None:
            chain = {past.time: _place(past.image, np.eye(3), np.zeros(3))}
            self._chains = [chain, *self._chains][-_CHAINS:]
        before, last = chain[past.time], chain[max(chain)]
        way = floor.ratio * motion.translation / max(motion.baseline, 1e-12)
        rotation = before.rotation @ motion.rotation.T
        view = _place(now.image, rotation, rotation @ way + before.place)
        if chain is not self._chains[-1] and past.time >= max(self._chains[-1]):
            self._chains = [one for one in self._chains if one is not chain] + [chain]
            self._evidence, self._compared = None, 0
        chain[now.time] = view
        if len(chain) > _FRAMES:
            del chain[min(chain)]
        if chain is self._chains[-1]:
            self._found = self._seen(view, last, floor)
        return self._found

    def _seen(
        self, now: _Placed, last: _Placed, floor: FloorMotion
    ) -> tuple[SmallThing, ...] | None:
        plane = _Plane(now.grey.shape, self._focal * now.grey.shape[1], floor)
        sums = np.zeros((_THINGS.size, *plane.shape), np.float32)
        if self._evidence is not None:
            for k, share in enumerate(_THINGS.tolist()):
                before = np.zeros_like(now.grey)
                before[-self._evidence.shape[1] :] = self._evidence[k]
                sums[k] = _DECAY * plane.warp(before, plane.homography(now, last, share), 0.0)
        self._evidence = sums
        free, seen = sums.max(axis=0) < _SEEN, np.zeros(plane.shape, np.bool_)
        for baseline, past in self._compared_with(now):
            evidence = plane.evidence(now, past, baseline, free)
            if evidence is not None:
                sums += np.where(seen, 0.0, evidence[0])
                seen |= evidence[1]
            if seen.mean() > _WHOLE:
                break
        if not seen.any():
            return None
        self._compared += 1
        if self._compared < _COMPARED:
            return None
        return plane.things(sums.max(axis=0) > _SEEN, _THINGS[sums.argmax(axis=0)])

    def _compared_with(self, now: _Placed) -> list[tuple[float, _Placed]]:
        """Return baselines and views to compare ``now`` with: nearer ones show what was outside."""
        views = self._chains[-1].values()
        baselines = [(float(np.linalg.norm(now.place - view.place)), view) for view in views]
        chosen = {}
        for wanted in _BASELINES:
            baseline, view = min(baselines, key=lambda one: abs(one[0] - wanted))
            if baseline >= _MIN_BASELINE:
                chosen[baseline] = view
        return list(chosen.items())


class _Plane:
    """The part (rows, width) of images of ``size`` (height, width) that shows near floor."""

    def __init__(self, size: tuple[int, ...], focal: float, floor: FloorMotion) -> None:
        (height, width), pitch = size, floor.pitch
        y = (np.arange(height) - 0.5 * (height - 1)) / focal
        fall = math.cos(pitch) * y + math.sin(pitch)
        self._top = min(int(np.searchsorted(fall, 1.0 / _REACH)), height - _WINDOW)
        self._depth = 1.0 / np.maximum(fall[self._top :], 1.0 / _REACH)
        self._ahead = (math.cos(pitch) - math.sin(pitch) * y[self._top :]) * self._depth
        self.shape, self._size = (height - self._top, width), (height, width)
        whole = cv2.resize(floor.cells.astype(np.uint8), (width, height), interpolation=0)
        self._floor = np.asarray(whole[self._top :] > 0)
        self._focal, self._normal = focal, np.array([0.0, math.cos(pitch), math.sin(pitch)])
        self._camera = np.diag([focal, focal, 1.0])
        self._camera[:2, 2] = 0.5 * (width - 1), 0.5 * (height - 1)
        self._rays = np.linalg.inv(self._camera - np.outer([0, self._top, 0], [0, 0, 1]))

    def homography(self, now: _Placed, past: _Placed, share: float) -> Array:
        """Return where ``past`` shows what is seen ``now``, if it moves along by ``share``."""
        turn = past.rotation.T @ now.rotation
        way = past.rotation.T @ (now.place - past.place)
        plane = turn + (1.0 + share) * np.outer(way, self._normal)
        return np.asarray(self._camera @ plane @ self._rays)

    def warp(self, image: Floats, homography: Array, outside: float = OUTSIDE) -> Floats:
        """Return ``image`` (height, width) as it would be seen now."""
        flags, border = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, cv2.BORDER_CONSTANT
        size = self.shape[::-1]
        warped = cv2.warpPerspective(image, homography, size, None, flags, border, (outside,))
        return np.asarray(warped, np.float32)

    def _as_sharp(self, sharp: Floats, baseline: float, like: Floats, where: Mask) -> Floats:
        """Return the part of ``sharp`` as sharp as ``like``, a past image after its warp, is.

        The lens is chosen by ``where`` it shows floor. Otherwise sharpness passes for motion.
        """
        wanted, tried = _steepness(like), []
        for lens in _OPTICS:
            grey = self._blurred(sharp, baseline, lens)
            gradient = _steepness(grey)
            textured = where & (gradient > _TEXTURED)
            off = np.log(wanted[textured] / gradient[textured]) if textured.any() else [np.inf]
            tried.append((abs(float(np.median(off))), grey))
        return min(tried, key=lambda one: one[0])[1]

    def _blurred(self, sharp: Floats, baseline: float, lens: float) -> Floats:
        """Return the part of ``sharp``, blurred as the past image is after its warp.

        A pixel of that one covers more of the floor. ``lens`` is the variance by the lens.
        """
        above = min(4 * _WINDOW, self._top)
        grow = 1.0 + baseline / np.pad(self._depth, (above, 0), mode="edge")
        spread = _BLUR**2 + lens + _SAMPLING
        row = np.arange(grow.size)
        down = spread * grow[:, None] ** 4 - lens
        weights = np.exp(-0.5 * (row[:, None] - row) ** 2 / down)
        weights = (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)
        part = weights @ sharp[self._top - above :]
        aside = (spread * float(np.median(grow)) ** 2 - lens) ** 0.5
        return np.asarray(cv2.GaussianBlur(part, (0, 0), aside, sigmaY=0.01), np.float32)[above:]

    def _registered(self, grey: Floats, past: Floats, guess: Array, free: Mask) -> Array | None:
        """Return ``guess`` corrected by robust least squares on grey levels of ``free`` pixels."""
        rows, cols = (3 * index + 2 for index in np.nonzero(free[2:-2:3, 2:-2:3]))
        scale = 2.0 / self.shape[1]
        x, y = scale * cols - 1.0, scale * rows
        unit = np.array([[scale, 0.0, -1.0], [0.0, scale, 0.0], [0.0, 0.0, 1.0]])
        prior = np.diag([100.0] * 6 + [1000.0] * 2 + [1.0] * 2)
        for _ in range(2):
            seen = self.warp(past, guess)
            right, down = (slope[rows, cols] / scale for slope in _slopes(seen))
            value = seen[rows, cols]
            inside = (np.abs(right) + np.abs(down) < 100.0 / scale) & (value > 0.5 * OUTSIDE)
            if inside.sum() < _ENOUGH:
                return None
            off = np.where(inside, grey[rows, cols] - value, 0.0)
            out, one = right * x + down * y, np.ones_like(value)
            terms = [right * x, right * y, right, down * x, down * y, down, -out * x, -out * y]
            slopes = np.stack([*terms, value / 50.0, one])  # the last ones of brightness
            sigma = max(1.48 * float(np.median(np.abs(off[inside] - np.median(off[inside])))), 0.7)
            weighted = slopes * np.where(inside, 1.0 / (1.0 + (0.5 * off / sigma) ** 2), 0.0)
            step = np.append(np.linalg.solve(weighted @ slopes.T + prior, weighted @ off)[:8], 0.0)
            guess = guess @ np.linalg.inv(unit) @ (np.eye(3) + step.reshape(3, 3)) @ unit
        return guess

    def evidence(
        self, now: _Placed, past: _Placed, baseline: float, free: Mask
    ) -> tuple[Floats, Mask] | None:
        """Return the evidence (n, rows, width) for ``_THINGS``, and where ``past`` shows it.

        None if the floor is unclear.
        """
        guess, free = self.homography(now, past, 0.0), free & self._floor
        seen = self.warp(past.grey, guess)
        place = _mean(seen < 0.5 * OUTSIDE) == 0.0
        grey = self._as_sharp(now.sharp, baseline, seen, free & place)
        floor = self._registered(grey, past.grey, guess, free)
        if floor is None:
            return None
        fix, left = np.linalg.inv(guess) @ floor, []
        for share in (*_FLOORS, *_THINGS.tolist()):
            seen = self.warp(past.grey, self.homography(now, past, share) @ fix)
            hidden = seen < 0.5 * OUTSIDE
            off = np.where(hidden, 0.0, grey - seen)
            left.append(_mean(off * off) - _mean(off) ** 2 - OUTSIDE * (_mean(hidden) > 0.0))
        place = left[0] < -0.5 * OUTSIDE
        gradient = _steepness(grey)
        textured = place & free & (gradient > _TEXTURED)
        if textured.sum() < _ENOUGH:
            return None
        sharpness = _steepness(self.warp(past.grey, floor))[textured] / gradient[textured]
        error = float(np.median(left[0][textured] / gradient[textured]))
        motion = self._focal * baseline / (self._depth + baseline) ** 2  # of the share 1
        usual = float(np.median(motion[np.nonzero(textured)[0]]))
        if abs(float(np.median(sharpness)) - 1.0) > _ALIKE or error**0.5 > _MAX_ERROR * usual:
            return None
        noise = _NOISE + _SHARE * (float(np.median(left[0][place])) + error * gradient)
        things = np.array(left[len(_FLOORS) :])
        ratio = np.log(np.min(left[: len(_FLOORS)], axis=0) + noise) - np.log(things + noise)
        fits = (things < _FIT * noise) | (ratio > _CLEAR)
        ratio = np.minimum(ratio - _USUAL, np.where(fits, np.inf, 0.0))
        return np.where(place, np.clip(ratio, *_BOUNDS), 0.0).astype(np.float32), place

    def things(self, seen: Mask, shares: Array) -> tuple[SmallThing, ...]:
        """Return the connected regions of ``seen``, whose pixels move along by ``shares``."""
        joined = cv2.morphologyEx(seen.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
        _, labels, stats, _ = cv2.connectedComponentsWithStats(joined)
        (height, width), edge, regions = self._size, _WINDOW // 2, []
        for k in (np.flatnonzero(stats[1:, 4] >= _AREA) + 1).tolist():
            x, y, wide, high, _ = stats[k].tolist()
            region = labels == k
            low, share = np.quantile(shares[region], [0.0, 0.9]).tolist()
            foot = max(y + high - 1 - edge, y)
            feet = high - 1 - np.argmax(region[y : y + high, x : x + wide][::-1], axis=0) - edge
            middle = float(np.median(self._ahead[np.maximum(y + feet, y)])) / (1.0 + low)
            # where the thing stands, before the floor that its lowest part hides
            depth, ahead = (float(v[foot]) / (1.0 + low) for v in (self._depth, self._ahead))
            left = 0.5 * (width - wide - 2 * x) / self._focal * depth
            wider, top = max(wide - 2 * edge, 1) / self._focal * depth, y + self._top
            box = (x / width, top / height, (x + wide) / width, (top + high) / height)
            far, bearing = math.hypot(ahead, left), math.atan2(left, ahead)
            regions.append(SmallThing(far, bearing, wider, share / (1.0 + share), box, middle))
        return tuple(sorted(regions, key=lambda thing: thing.distance))


def _place(image: Image, rotation: Array, place: Array) -> _Placed:
    scale = min(_WIDTH / image.shape[1], 1.0)
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    sharp = np.asarray(small, np.float32)
    blurred = cv2.GaussianBlur(sharp, (0, 0), _BLUR)
    return _Placed(sharp, np.asarray(blurred, np.float32), rotation, place)


def _mean(values: Floats | Mask) -> Floats:
    return np.asarray(cv2.blur(np.asarray(values, np.float32), (_WINDOW, _WINDOW)), np.float32)


def _steepness(image: Floats) -> Floats:
    right, down = _slopes(image)
    return _mean(right * right + down * down)


def _slopes(image: Floats) -> list[Floats]:
    slopes = (cv2.Sobel(image, cv2.CV_32F, x, 1 - x, scale=0.125) for x in (1, 0))
    return [np.asarray(slope, np.float32) for slope in slopes]
