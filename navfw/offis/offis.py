"""OFFIS as a plugin: from a derotated flow field to a percept (paper sec 4 and 5)."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from navfw.interfaces import Perception
from navfw.offis.blind_borders import find_blind_borders
from navfw.offis.distances import TERMS, find_distances
from navfw.offis.elementary_situations import FLOOR_IN_FRONT, find_situations, front_features
from navfw.offis.floor import FloorModel
from navfw.offis.grid_geometry import GridGeometry
from navfw.offis.nearest_objects import nearest_objects
from navfw.offis.nearness import triangulate
from navfw.offis.object_cells import find_objects, object_channels, raw_channels
from navfw.offis.percept_explanation import PerceptExplanation
from navfw.offis.planes import find_planes, pairs_of
from navfw.offis.pyramid import NEIGHBOURS, QUADRANTS, RegionStatistics
from navfw.offis.report_sentence import report
from navfw.offis.slopes import SIDES, slopes_of_means, slopes_of_walls
from navfw.offis.walls import find_walls
from navfw.robot import RobotModel
from navfw.signals import Array, FlowField, Percept, Twist

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
        longest_flow: Annotated[
            Positive,
            Field(description="longest vector that the flow processor finds: its search [px]"),
        ] = 8.0
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
        height, label = self._floor.classify(flow.points, seen, geometry.fall)
        camera, params = self.robot.camera, self.params
        objects = find_objects(geometry, seen, label, params.minimum_confidence)
        walls = find_walls(geometry, seen, objects.wall_weight, camera.mount_height)
        borders = find_blind_borders(flow, geometry, camera.focal, params.longest_flow)
        paper = params.mode == "paper"
        if paper:
            channels = raw_channels(flow, camera.focal, params.minimum_baseline)
        else:
            channels = object_channels(
                geometry,
                seen,
                objects,
                walls,
                borders,
                camera,
                params.wall_height,
                params.minimum_confidence,
            )
        regions = pyramid.statistics(channels)
        size = self._size(regions)
        region_nearness = regions.mean if paper else regions.nearest
        present = (regions.objects > 0.0) & (region_nearness > 1.0 / FARTHEST)
        planes = find_planes(self._pairs, regions, size)
        # the last four "regions" are the halves of the planes, which have no distance of their own
        distances = find_distances(region_nearness[:-4], regions.known[:-4], twist.v)
        obstacles = nearest_objects(pyramid, size, present, planes, distances)

        slopes = slopes_of_means(regions) if paper else slopes_of_walls(walls)
        situations = find_situations(slopes, front_features(geometry, walls, objects))

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
                situations.floor_in_front >= FLOOR_IN_FRONT,
                bool(distances.degrees[:, :4].any()),
            ),
            explanation=PerceptExplanation(
                self.params.mode,
                pyramid,
                regions,
                planes,
                distances,
                obstacles,
                borders,
                walls,
                slopes,
                situations,
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
