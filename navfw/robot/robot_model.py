"""Model the robot: dimensions, limits, cameras; shared by stack and simulator."""

from __future__ import annotations

import math
from typing import Annotated, Any

from pydantic import Field, model_validator

from navfw.config.strict_model import StrictModel
from navfw.robot import camera_models
from navfw.signals import Twist

Speed = Annotated[float, Field(gt=0.0, le=10.0)]
"""[m/s]; the figures of all stages were chosen for robots up to 2 m/s."""
Acceleration = Annotated[float, Field(gt=0.0, le=50.0)]
"""[m/s^2]; tyres give 10."""
GyroSigma = Annotated[float, Field(ge=0.0, le=1.0)]
"""[rad/s]; the gyro of a telephone has 0.002."""

JointNames = Annotated[tuple[str, ...], Field(min_length=1, max_length=10)]

_RADIUS = 0.18  # chosen
"""Radius of the default robot [m]."""
_RIM_INSET = 0.2  # chosen
"""Distance of the centres of the discs along a footprint's rim from the rim, in half widths."""
_MAX_LENS_ANGLE = math.radians(110.0)  # chosen
"""Largest half angle of view [rad]: fisheye lenses reach 220 degrees in all."""


class OdometrySheet(StrictModel):
    """Error model of gyro and wheels, from their data sheets.

    The stack knows these figures, but never the errors of the simulated sensors.
    """

    gyro_noise: GyroSigma = Field(
        default=math.radians(0.1), description="standard deviation of one reading [rad/s]"
    )
    gyro_bias_walk: GyroSigma = Field(
        default=math.radians(0.005),
        description="random walk of the bias [rad/s per square root of s]",
    )
    slip: float = Field(
        default=0.02,
        ge=0.0,
        le=0.5,
        description="standard deviation of a wheel's slip, part of way",
    )
    slip_mean: float = Field(
        default=0.005, ge=0.0, le=0.5, description="mean slip, of both wheels, part of the way"
    )
    slip_time: float = Field(
        default=0.5, ge=0.0, le=60.0, description="slip keeps its value for about so long [s]"
    )


class Footprint(StrictModel):
    """The ground that a body covers: a rectangle around base_link, along its axes."""

    front: float = Field(ge=0.02, le=3.0, description="reach ahead of base_link [m]")
    rear: float = Field(ge=0.02, le=3.0, description="reach behind base_link [m]")
    width: float = Field(ge=0.06, le=4.0, description="[m]")


class DrivenUrdf(StrictModel):
    """A URDF file that describes the robot's body, and how its wheel joints drive it."""

    file: str = Field(
        min_length=1,
        max_length=1000,
        description="URDF or xacro, relative to the robot file, or pybullet_data:FILE of"
        " PyBullet's own",
    )
    packages: tuple[str, ...] = Field(
        default=(),
        max_length=100,
        description="folders with the packages of ROS of its meshes (`package://`), relative to"
        " the robot file; besides those of ROS_PACKAGE_PATH and AMENT_PREFIX_PATH",
    )
    args: tuple[str, ...] = Field(
        default=(), max_length=100, description="arguments of a xacro file, name:=value"
    )
    left: JointNames = Field(
        default=(), description="wheel joints of the left side; left out: by their places"
    )
    right: JointNames = Field(default=(), description="those of the right side")
    camera: str | None = Field(
        default=None,
        description="link at which the camera is mounted, x ahead; gives mount and pitch",
    )
    casters: tuple[str, ...] = Field(
        default=(),
        max_length=100,
        description="joints of casters and idle wheels: they turn freely and slide; all other"
        " joints are held at 0",
    )
    torque: float = Field(
        default=5.0, gt=0.0, le=10_000.0, description="torque limit of one wheel [N m]"
    )
    side_friction: float = Field(
        default=1.0,
        gt=0.0,
        le=1.0,
        description="grip of the wheels along their axle, as a share of that along the way; of"
        " skid steer below 1",
    )
    turning_point: float = Field(
        default=0.0,
        ge=-3.0,
        le=3.0,
        description="base_link, where it turns on the spot: ahead of the wheels' middle [m]",
    )


def _half_the_width(values: dict[str, Any]) -> float:
    """Return the radius [m] of a robot for which none is given."""
    footprint = values.get("footprint")
    return 0.5 * footprint.width if isinstance(footprint, Footprint) else _RADIUS


def _steps(begin: float, end: float, longest: float) -> list[float]:
    """Return evenly spaced values from ``begin`` to ``end``, at most ``longest`` apart."""
    count = max(1, math.ceil((end - begin) / longest - 1e-9))
    return [begin + (end - begin) * index / count for index in range(count + 1)]


class RobotModel(StrictModel):
    """A differential-drive robot with one camera, a gyro and wheel encoders.

    The body is round, or covers the rectangle ``footprint``; ``radius`` is then half its width.
    """

    footprint: Footprint | None = Field(default=None, description="of a body that is not round")
    radius: float = Field(
        default_factory=_half_the_width,
        ge=0.03,
        le=2.0,
        description="of the round body [m]; 0.18, or half the footprint's width",
    )
    urdf: DrivenUrdf | None = Field(
        default=None, description="the body in the simulator; without: two wheels"
    )
    height: float = Field(
        default=0.40, ge=0.03, le=100.0, description="of the body with camera [m]"
    )
    wheel_radius: float = Field(default=0.05, ge=0.005, le=1.0, description="[m]")
    track: float = Field(
        default=0.28, ge=0.02, le=4.0, description="distance between the wheels [m]"
    )
    skid: float = Field(
        default=0.0,
        ge=0.0,
        le=1.0,
        description="standard deviation of the point about which it turns, along the body [m]:"
        " wheels that skid move it",
    )
    ticks_per_turn: int = Field(
        default=2048, ge=16, le=1_000_000, description="encoder ticks a wheel turn"
    )
    max_v: Speed = Field(default=0.5, description="top forward speed [m/s]")
    max_reverse: Speed = Field(default=0.15, description="top backward speed [m/s]")
    max_w: float = Field(default=1.6, gt=0.0, le=20.0, description="top turning rate [rad/s]")
    max_accel: Acceleration = Field(default=0.6, description="usual acceleration [m/s^2]")
    max_brake: Acceleration = Field(default=1.2, description="hardest braking [m/s^2]")
    max_turn_accel: float = Field(default=4.0, gt=0.0, le=200.0, description="[rad/s^2]")
    max_lateral: Acceleration = Field(default=0.6, description="lateral acceleration [m/s^2]")
    control_rate: float = Field(
        default=60.0, ge=1.0, le=240.0, description="LOCOM ticks, up to those of physics [Hz]"
    )
    camera: camera_models.CameraModel = camera_models.CameraModel()
    side_views: camera_models.SideViews | None = Field(
        default=None, description="what a wider lens shows beside the camera's image"
    )
    landmark_camera: camera_models.LandmarkCamera = Field(
        default=camera_models.LandmarkCamera(),
        description="how the camera is read out for landmarks",
    )
    camera_effects: camera_models.CameraEffects = Field(
        default=camera_models.CameraEffects(), description="of a real camera, in all its images"
    )
    odometry: OdometrySheet = Field(
        default=OdometrySheet(), description="error model of gyro and wheels"
    )

    @model_validator(mode="after")
    def _as_wide_as_its_footprint(self) -> RobotModel:
        if self.footprint is not None and abs(self.radius - 0.5 * self.footprint.width) > 1e-6:
            raise ValueError(
                f"radius {self.radius} m is not half the footprint's width"
                f" ({0.5 * self.footprint.width} m): leave out radius"
            )
        return self

    @model_validator(mode="after")
    def _wheels_under_body(self) -> RobotModel:
        # the effective track of a skid steer may be wider
        if self.urdf is None and self.track > 2.0 * self.radius:
            raise ValueError(f"track {self.track} m is wider than the body ({2 * self.radius} m)")
        return self

    @model_validator(mode="after")
    def _lens_can_be(self) -> RobotModel:
        if self.seen_aside > _MAX_LENS_ANGLE:
            raise ValueError(
                f"side views reach {math.degrees(self.seen_aside):.0f} degrees to either side, no"
                f" lens sees more than {math.degrees(_MAX_LENS_ANGLE):.0f}: make them narrower"
            )
        return self

    @model_validator(mode="after")
    def _exposed_within_a_frame(self) -> RobotModel:
        taken = self.camera_effects.shutter_time
        if taken > 1.0 / self.camera.rate + 1e-9:
            raise ValueError(
                f"exposure and readout take {taken:g} s, at {self.camera.rate:g} Hz a frame has"
                f" {1.0 / self.camera.rate:.3g} s: shorten camera_effects.exposure_time or"
                " readout_time, or lower camera.rate"
            )
        return self

    @property
    def discs(self) -> tuple[tuple[float, float, float], ...]:
        """Discs that represent the body: centre x, y in base_link and radius [m].

        A round body is one disc. A rectangle has small ones along its whole rim, which reach beyond
        it by 8 % of its half width, and large ones along its middle.
        """
        if self.footprint is None:
            return ((0.0, 0.0, self.radius),)
        front, rear = self.footprint.front, self.footprint.rear
        half = 0.5 * min(self.footprint.width, front + rear)
        inset = _RIM_INSET * half
        columns = _steps(-rear + inset, front - inset, 2.0 * inset)
        side = 0.5 * self.footprint.width - inset
        rows = _steps(-side, side, 2.0 * inset)
        rim = [(x, y) for x in columns for y in (-side, side)]
        rim += [(x, y) for x in (columns[0], columns[-1]) for y in rows[1:-1]]
        inner = [(x, 0.0, half) for x in _steps(half - rear, front - half, half)]
        return (*((x, y, self.disc_radius) for x, y in rim), *inner)

    @property
    def disc_radius(self) -> float:
        """Radius [m] of the discs in ``discs`` that form the rim."""
        if self.footprint is None:
            return self.radius
        half = 0.5 * min(self.footprint.width, self.footprint.front + self.footprint.rear)
        return math.sqrt(2.0) * _RIM_INSET * half

    @property
    def reach(self) -> float:
        """Radius [m] of the smallest circle about base_link that contains the body."""
        if self.footprint is None:
            return self.radius
        footprint = self.footprint
        return math.hypot(max(footprint.front, footprint.rear), 0.5 * footprint.width)

    @property
    def side_cameras(self) -> tuple[camera_models.SideCamera, ...]:
        """Virtual cameras of the side views, left and right; empty without side views."""
        if self.side_views is None:
            return ()
        camera, sides = self.camera, self.side_views
        half = math.atan(0.5 * sides.width / camera.focal)
        turn = 0.5 * camera.hfov - sides.overlap + half
        view = camera.model_dump() | {"width": sides.width, "hfov": 2.0 * half}
        view["calibration"] = None  # they are straight
        return tuple(camera_models.SideCamera(**view, turn=side * turn) for side in (1.0, -1.0))

    @property
    def seen_aside(self) -> float:
        """Angle [rad] from straight ahead to the edge of the view, side views included."""
        if self.side_views is None:
            return 0.5 * self.camera.hfov
        left = self.side_cameras[0]
        return left.turn + 0.5 * left.hfov

    def with_camera(self, camera: camera_models.CameraModel) -> RobotModel:
        """Return the same robot with ``camera`` and no side views."""
        return self.model_copy(update={"camera": camera, "side_views": None})

    def with_reduced_images(self) -> RobotModel:
        """Return the same robot with the stack's reduced images (``CameraModel.reduction``)."""
        camera, views = self.camera, self.side_views
        factor = camera.reduction
        if factor == 1:
            return self
        size = {"width": camera.width // factor, "height": camera.height // factor}
        if views is not None:
            views = views.model_copy(update={"width": round(views.width / factor)})
        update = {"camera": camera.model_copy(update=size), "side_views": views}
        return self.model_copy(update=update)

    @property
    def landmark_view(self) -> camera_models.CameraModel:
        """Model of the camera as it takes landmark frames: ``camera`` of other size and rate."""
        wanted = self.landmark_camera
        return self.camera.model_copy(
            update={"width": wanted.width, "height": wanted.height, "rate": wanted.rate}
        )

    def wheel_speeds(self, twist: Twist) -> tuple[float, float]:
        """Compute the wheels' angular speeds (left, right) [rad/s] for a twist of the body."""
        half = 0.5 * self.track * twist.w
        return (twist.v - half) / self.wheel_radius, (twist.v + half) / self.wheel_radius

    def twist(self, left: float, right: float) -> Twist:
        """Compute the body's twist for wheel speeds [rad/s]: the inverse of ``wheel_speeds``."""
        r = self.wheel_radius
        return Twist(0.5 * r * (left + right), r * (right - left) / self.track)
