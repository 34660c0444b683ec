"""Small ray casters: textured planes with exact depth and flow; boards on a textured floor."""

from dataclasses import dataclass, field
from functools import cache

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

from navfw.camera_geometry.rotations import rotate_points
from navfw.flow import grid_points
from navfw.numerics import Array, Image
from navfw.robot import CameraModel
from navfw.signals import CameraMotion, FlowField, Frame, FramePair, Pose

TILE = 2.0  # period of the textures [m]
TEXELS = 256


def rotational_flow(points: Array, rotation: Array, focal: float) -> Array:
    """Flow (..., 2) [px] at current ``points`` of a camera that only rotates by ``rotation``.

    It is independent of depth. The exact form of METHOD 2.3; ``rotation`` maps past to current
    axes, as in CameraMotion.
    """
    return points - rotate_points(points, rotation.T, focal)


def smooth_texture(rng: np.random.Generator) -> Array:
    """A periodic (TEXELS, TEXELS) texture: octaves of smooth noise, nothing finer than 3 cm."""
    total = np.zeros((TEXELS, TEXELS))
    frequency = np.fft.fftfreq(TEXELS)
    squared = frequency[:, None] ** 2 + frequency**2
    for sigma in (2.0, 4.0, 8.0):
        # a Gaussian blur, by its spectrum: periodic
        spectrum = np.fft.fft2(rng.normal(size=(TEXELS, TEXELS)))
        blurred = np.fft.ifft2(spectrum * np.exp(-2.0 * (np.pi * sigma) ** 2 * squared)).real
        total += blurred / blurred.std()
    return np.asarray(total / total.std())


@dataclass(frozen=True)
class Plane:
    """All points with normal . X = offset, in the first camera's axes."""

    normal: Array
    offset: float
    texture: Array

    def axes(self) -> tuple[Array, Array]:
        n = self.normal / np.linalg.norm(self.normal)
        u = np.cross(n, [0.0, 1.0, 0.0] if abs(n[1]) < 0.9 else [1.0, 0.0, 0.0])
        u /= np.linalg.norm(u)
        return u, np.cross(n, u)


@dataclass
class Scene:
    """Planes, seen from camera poses given in the axes of the first camera."""

    camera: CameraModel
    planes: list[Plane] = field(default_factory=list)

    def rays(self, scale: int = 1) -> Array:
        w, h = self.camera.width * scale, self.camera.height * scale
        x = (np.arange(w) + 0.5) / scale - 0.5 * self.camera.width
        y = (np.arange(h) + 0.5) / scale - 0.5 * self.camera.height
        xs, ys = np.meshgrid(x, y)
        return np.stack([xs, ys, np.full_like(xs, self.camera.focal)], -1) / self.camera.focal

    def render(self, attitude: Array, position: Array, scale: int = 2) -> tuple[Image, Array]:
        """Image and depth from ``position``; ``attitude`` turns camera axes into scene axes."""
        rays = self.rays(scale) @ attitude.T
        depth = np.full(rays.shape[:2], np.inf)
        grey = np.zeros(rays.shape[:2])
        for plane in self.planes:
            with np.errstate(divide="ignore"):
                t = (plane.offset - position @ plane.normal) / (rays @ plane.normal)
            seen = (t > 0.05) & (t < depth)
            depth[seen] = t[seen]
            where = position + rays[seen] * t[seen][:, None]
            u, v = plane.axes()
            grey[seen] = _sample(plane.texture, where @ u, where @ v)
        image = cv2.resize(
            128.0 + 40.0 * grey,
            (self.camera.width, self.camera.height),
            interpolation=cv2.INTER_AREA,
        )
        return np.clip(np.round(image), 0, 255).astype(np.uint8), depth

    def pair(self, motion: CameraMotion, noise: float = 0.0) -> tuple[FramePair, Array]:
        """Frames before and after ``motion``, and the true flow (height, width, 2) [px].

        The current camera is the first camera of the scene; ``motion`` determines the past one.
        """
        _, depth = self.render(np.eye(3), np.zeros(3), 1)
        now, _ = self.render(np.eye(3), np.zeros(3))
        past, _ = self.render(motion.rotation, -motion.translation)
        if noise:
            rng = np.random.default_rng(5)
            past, now = (
                np.clip(np.round(i + rng.normal(0, noise, i.shape)), 0, 255).astype(np.uint8)
                for i in (past, now)
            )
        flow = true_flow(self.rays() * self.camera.focal, depth, motion, self.camera.focal)
        return FramePair(Frame(0.0, past), Frame(motion.dt, now), motion), flow


def true_flow(rays: Array, depth: Array, motion: CameraMotion, focal: float) -> Array:
    """Flow at current points (..., 3: x, y, focal) seen at ``depth``: now - past [px]."""
    now = rays / focal * depth[..., None]
    past = (now + motion.translation) @ motion.rotation
    return np.asarray(rays[..., :2] - focal * past[..., :2] / past[..., 2:])


def _sample(texture: Array, u: Array, v: Array) -> Array:
    places = np.stack([v, u]) / TILE * TEXELS
    return np.asarray(map_coordinates(texture, places, order=1, mode="grid-wrap"))


def cell_truth(flow: Array, points: Array, camera: CameraModel) -> Array:
    """The true flow (rows, cols, 2) at grid points: mean of the four pixels around each."""
    x = points[..., 0] + 0.5 * camera.width
    y = points[..., 1] + 0.5 * camera.height
    x0, y0 = np.floor(x - 0.5).astype(int), np.floor(y - 0.5).astype(int)
    x1, y1 = np.floor(x).astype(int), np.floor(y).astype(int)
    return np.asarray((flow[y0, x0] + flow[y0, x1] + flow[y1, x0] + flow[y1, x1]) / 4.0)


@cache
def wall(camera: CameraModel, distance: float = 1.5, seed: int = 1) -> Scene:
    """A textured wall straight ahead."""
    texture = smooth_texture(np.random.default_rng(seed))
    return Scene(camera, [Plane(np.array([0.0, 0.0, 1.0]), distance, texture)])


@cache
def room(camera: CameraModel, seed: int = 2) -> Scene:
    """A corridor 1.8 m wide with floor, ceiling and an end wall 4 m ahead."""
    rng = np.random.default_rng(seed)
    walls = [
        ((1.0, 0.0, 0.0), 0.9),
        ((-1.0, 0.0, 0.0), 0.9),
        ((0.0, 1.0, 0.0), camera.mount_height),
        ((0.0, -1.0, 0.0), 2.0),
        ((0.0, 0.0, 1.0), 4.0),
    ]
    return Scene(camera, [Plane(np.array(n), d, smooth_texture(rng)) for n, d in walls])


STILL = CameraMotion(np.eye(3), np.zeros(3), 0.2)


def pair_of(past: Image, now: Image, motion: CameraMotion = STILL) -> FramePair:
    return FramePair(Frame(0.0, past), Frame(0.2, now), motion)


def blurred_noise(
    seed: int, sigma: float = 2.0, contrast: float = 40.0, shape: tuple[int, int] = (120, 160)
) -> Image:
    """An image of that contrast [grey levels], smooth over ``sigma`` [px]."""
    noise = np.random.default_rng(seed).normal(size=shape)
    smooth = cv2.GaussianBlur(noise, (0, 0), sigma)
    return np.asarray(np.clip(128 + contrast * smooth / smooth.std(), 0, 255), dtype=np.uint8)


def turn_about(axis: int, angle: float) -> Array:
    """Rotation by ``angle`` [rad] about one of the axes."""
    vector = np.zeros(3)
    vector[axis] = angle
    return np.asarray(cv2.Rodrigues(vector)[0])


def exact_field(camera: CameraModel, motion: CameraMotion, depth: Array) -> FlowField:
    """Exact flow of static points of ``depth`` (12, 16) [m] on a grid, with confidence 1."""
    points = grid_points(camera, 12, 16)
    rays = np.concatenate([points, np.full((12, 16, 1), camera.focal)], axis=-1)
    vectors = true_flow(rays, depth, motion, camera.focal)
    return FlowField(0.0, points, vectors, np.ones((12, 16)), np.full((12, 16), 0.1), motion)


TEXEL = 0.02
"""Side of a texel [m]."""


@dataclass(frozen=True)
class Board:
    """An upright board across odom's x axis: place, width, height [m], velocity [m/s]."""

    x: float
    y: float
    width: float = 0.4
    height: float = 1.2
    vx: float = 0.0
    vy: float = 0.0

    def at(self, time: float) -> tuple[float, float]:
        """Centre (x, y) [m] at ``time`` [s]."""
        return self.x + self.vx * time, self.y + self.vy * time


@cache
def grain(seed: int) -> Image:
    """A (600, 600) image of smooth noise."""
    noise = np.random.default_rng(seed).random((600, 600)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 1.5)
    low, high = float(smooth.min()), float(smooth.max())
    return np.asarray(20 + 215 * (smooth - low) / (high - low), dtype=np.uint8)


def sampled_grain(seed: int, u: Array, v: Array) -> Array:
    """The texture at (u, v) [m]."""
    x, y = ((value / TEXEL + 300).astype(np.float32) for value in (u, v))
    return np.asarray(
        cv2.remap(grain(seed), x, y, cv2.INTER_LINEAR, None, cv2.BORDER_WRAP), dtype=np.float64
    )


def board_image(
    camera: CameraModel, pose: Pose, time: float = 0.0, boards: tuple[Board, ...] = ()
) -> Image:
    """The image of ``camera`` on a robot at odom ``pose`` on a textured floor with boards."""
    base = Scene(camera).rays() @ camera.base_from_camera.T
    c, s = np.cos(pose.yaw), np.sin(pose.yaw)
    east, north = c * base[..., 0] - s * base[..., 1], s * base[..., 0] + c * base[..., 1]
    up = base[..., 2]
    eye_x, eye_y = pose.to_parent(camera.mount_forward, 0.0)
    depth = camera.mount_height / np.maximum(-up, 1e-6)
    near = depth < 40.0
    floor = np.minimum(depth, 40.0)
    image = np.where(near, sampled_grain(0, eye_x + floor * east, eye_y + floor * north), 128.0)
    depth = np.where(near, depth, np.inf)
    for number, board in enumerate(boards):
        at_x, at_y = board.at(time)
        along = (at_x - eye_x) / np.where(np.abs(east) < 1e-9, 1e-9, east)
        aside = eye_y + along * north - at_y
        height = camera.mount_height + along * up
        hit = (along > 0.0) & (along < depth) & (np.abs(aside) < 0.5 * board.width)
        hit &= (height > 0.0) & (height < board.height)
        image = np.where(hit, sampled_grain(1 + number, aside, height), image)
        depth = np.where(hit, along, depth)
    return np.asarray(np.clip(image, 0, 255), dtype=np.uint8)
