"""OFFIS as a plugin: from a derotated flow field to a percept (paper sec 4 and 5)."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from navfw.kinds import Perception
from navfw.offis.distances import TERMS, find_distances
from navfw.offis.explanation import Explanation
from navfw.offis.floor import FloorModel
from navfw.offis.geometry import GridGeometry
from navfw.offis.nearness import Nearness, triangulate
from navfw.offis.obstacles import nearest_objects
from navfw.offis.planes import find_planes, pairs_of
from navfw.offis.pyramid import NEIGHBOURS, QUADRANTS, Channels, RegionStatistics
from navfw.offis.report import report
from navfw.offis.situations import find_situations, look_ahead
from navfw.offis.slopes import SIDES, fit_planes, slopes_of_fits, slopes_of_means
from navfw.robot import RobotModel
from navfw.signals import Array, FlowField, Label, Percept, Twist

__all__ = ["Offis"]

Positive = Annotated[float, Field(gt=0.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]

FARTHEST = 10.0
"""Distance [m] beyond which nothing counts as an object: sparse flow cannot tell it from noise."""


class Offis(Perception):
    """Optical-flow fuzzy inference system: nearest objects, planes, slopes, situations.

    Mode ``nearness`` feeds the fuzzy systems with nearness, from which the growth of flow with the
    distance from the focus of expansion and the floor have been removed (METHOD TRAP 1-3). Mode
    ``paper`` feeds them with the raw means of |u| and |v|, as the paper does.
    """

    name: ClassVar[str] = "offis"

    class Params(Perception.Params):
        """Parameters of OFFIS."""

        mode: Annotated[
            Literal["nearness", "paper"], Field(description="what the fuzzy systems are fed with")
        ] = "nearness"
        layers: Annotated[int, Field(ge=1, le=3, description="layers of the pyramid")] = 2
        metric: Annotated[
            Literal["auto", "nearest", "mean", "mean_variance"],
            Field(
                description="what makes a region biggest: the mean of its nearest eighth (auto in "
                "mode nearness), its mean (auto in mode paper), or mean plus standard deviation"
            ),
        ] = "auto"
        minimum_confidence: Annotated[Share, Field(description="cells with less are unknown")] = (
            0.15
        )
        minimum_baseline: Annotated[
            Positive, Field(description="translation below which flow says nothing [m]")
        ] = 0.005
        rejection: Annotated[
            Positive, Field(description="standard deviations that contradict the motion [1]")
        ] = 3.0
        obstacle_height: Annotated[
            Positive, Field(description="lowest thing that counts as an obstacle [m]")
        ] = 0.05
        headroom: Annotated[float, Field(ge=0.0, description="kept free above the robot [m]")] = (
            0.05
        )
        drop_depth: Annotated[
            Positive, Field(description="depth below the floor that counts as a drop [m]")
        ] = 0.08
        wall_height: Annotated[
            Positive,
            Field(description="what is seen higher than this is no wall, but ceiling or sky [m]"),
        ] = 2.2
        path_length: Annotated[
            Positive, Field(description="how far 'floor in front' looks [m]")
        ] = 2.0

        @model_validator(mode="after")
        def _metric_fits_mode(self) -> Offis.Params:
            if self.mode == "paper" and self.metric == "nearest":
                raise ValueError("metric nearest needs mode nearness")
            return self

    params: Params

    def __init__(self, robot: RobotModel, params: Perception.Params | None = None) -> None:
        super().__init__(robot, params)
        self._floor = FloorModel(
            robot.camera,
            top=robot.height + self.params.headroom,
            minimum_confidence=self.params.minimum_confidence,
            obstacle_height=self.params.obstacle_height,
            drop_depth=self.params.drop_depth,
        )
        self._geometry: GridGeometry | None = None
        self._pairs = np.empty((0, 2), dtype=np.int64)

    def perceive(self, flow: FlowField, twist: Twist) -> Percept:
        """Interpret ``flow`` (derotated); ``twist`` is the measured egomotion at its time.

        Where nothing is known (no translation, no texture) situations say ``unknown``, all other
        degrees are 0 and no floor is reported.
        """
        geometry = self._geometry_of(flow.points)
        pyramid = geometry.pyramid
        seen = triangulate(
            flow,
            self.robot.camera.focal,
            minimum_baseline=self.params.minimum_baseline,
            rejection=self.params.rejection,
        )
        height, label = self._floor.classify(flow.points, seen)
        objects = self._object_weight(geometry, seen, label)

        regions = pyramid.statistics(self._channels(flow, seen, objects))
        size = self._size(regions)
        paper = self.params.mode == "paper"
        region_nearness = regions.mean if paper else regions.nearest
        present = (regions.objects > 0.0) & (region_nearness > 1.0 / FARTHEST)
        planes = find_planes(self._pairs, regions, size)
        # the last four "regions" are the halves of the planes, which have no distance of their own
        distances = find_distances(region_nearness[:-4], regions.known[:-4], twist.v)
        obstacles = nearest_objects(pyramid, size, present, planes, distances)

        # surely higher than any wall: ceiling, or the far side of a room seen over a partition
        low_enough = seen.nearness + 2.0 * seen.sigma > geometry.wall_top
        walls = objects * low_enough * geometry.wall_share
        flat, weight, sigma = seen.nearness.ravel(), walls.ravel(), seen.sigma.ravel()
        fits = fit_planes(geometry, flat, weight, sigma)
        slopes = slopes_of_means(regions) if paper else slopes_of_fits(fits)
        is_floor = (label == Label.FLOOR).ravel().astype(np.float64)
        ahead = look_ahead(geometry, fits, flat, weight, sigma, is_floor)
        situations = find_situations(slopes, ahead)

        return Percept(
            time=flow.time,
            points=flow.points,
            nearness=seen.nearness,
            sigma=seen.sigma,
            confidence=seen.confidence,
            height=height,
            label=label,
            obstacles=obstacles,
            quadrants={
                quadrant: dict(zip(TERMS, distances.degrees[:, i].tolist(), strict=True))
                for i, quadrant in enumerate(QUADRANTS)
            },
            planes={
                f"{QUADRANTS[i]}-{QUADRANTS[j]}": float(planes.plane[k])
                for k, (i, j) in enumerate(NEIGHBOURS)
            },
            slopes=dict(zip(SIDES, slopes.codes, strict=True)),
            situations=situations.degrees,
            floor_in_front=situations.floor_in_front,
            sentence=report(
                obstacles,
                situations.front,
                situations.floor_in_front >= 0.5,
                bool(distances.degrees[:, :4].any()),
            ),
            explanation=Explanation(
                self.params.mode, pyramid, regions, planes, distances, fits, slopes, situations
            ),
        )

    def _geometry_of(self, points: Array) -> GridGeometry:
        """The geometry of the grid; flow processors keep theirs, so it is computed once."""
        geometry = self._geometry
        if geometry is None or not (
            geometry.points is points or np.array_equal(geometry.points, points)
        ):
            geometry = GridGeometry.of(
                points,
                self.params.layers,
                self.robot,
                self.params.path_length,
                self.params.wall_height,
            )
            self._geometry = geometry
            self._pairs = pairs_of(geometry.pyramid)
        return geometry

    def _object_weight(self, geometry: GridGeometry, seen: Nearness, label: np.ndarray) -> Array:
        """Confidence of the cells that show an object, 0 elsewhere.

        Floor and drops are no objects (TRAP 2), nor is what might be either. Above the horizon
        there is no floor: whatever is seen there well enough counts, also what passes overhead.
        """
        shown = (
            (label == Label.OBSTACLE)
            | (label == Label.ABOVE)
            | (geometry.upward & (seen.confidence >= self.params.minimum_confidence))
        )
        return np.where(shown, seen.confidence, 0.0)

    def _channels(self, flow: FlowField, seen: Nearness, objects: Array) -> Channels:
        """What muU, muV and the mean nearness are the means of, in the present mode."""
        if self.params.mode == "paper":
            return self._raw_channels(flow)
        # nearness, weighted by how much of the flow it makes along U and V: a mean of |u| or |v|
        # without the part that only tells where in the image the cell lies (TRAP 1)
        across = np.abs(flow.points)
        weights = np.stack([objects, objects * across[..., 0], objects * across[..., 1]])
        known = seen.confidence >= self.params.minimum_confidence
        return Channels(np.stack([seen.nearness] * 3), weights, known.astype(np.float64))

    def _raw_channels(self, flow: FlowField) -> Channels:
        """|u| and |v| of all valid vectors, floor and all, and |d|/|e| for the distance."""
        shift = flow.motion.translation
        foe_vector = flow.points * shift[2] - self.robot.camera.focal * shift[:2]
        expected = np.hypot(foe_vector[..., 0], foe_vector[..., 1])
        valid = (flow.confidence > 0.0) & np.isfinite(flow.vectors).all(-1)
        valid &= flow.motion.baseline >= self.params.minimum_baseline
        length = np.where(valid[..., None], np.abs(flow.vectors), 0.0)
        nearness = np.hypot(length[..., 0], length[..., 1]) / np.maximum(expected, 1e-9)
        known = valid.astype(np.float64)
        values = np.stack([nearness, length[..., 0], length[..., 1]])
        return Channels(values, np.stack([known * expected, known, known]), known)

    def _size(self, regions: RegionStatistics) -> Array:
        """(n_regions,) what "biggest" is judged by."""
        if self.params.mode == "paper":
            mean = np.hypot(regions.mu_u, regions.mu_v)
            variance = regions.var_u + regions.var_v
        elif self.params.metric in ("auto", "nearest"):
            return regions.nearest
        else:
            mean, variance = regions.mean, regions.variance
        return mean + np.sqrt(variance) if self.params.metric == "mean_variance" else mean
