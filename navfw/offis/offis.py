"""OFFIS as a plugin: from a derotated flow field to a percept (paper sec 4 and 5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, ClassVar, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from navfw.interfaces import Perception
from navfw.numerics import Array
from navfw.offis import nearness
from navfw.offis.elementary_situations import (
    FLOOR_IN_FRONT,
    find_objects,
    find_situations,
    object_channels,
    raw_channels,
)
from navfw.offis.grid_geometry import FloorModel, GridGeometry, find_blind_borders
from navfw.offis.percept_explanation import OffisResults, PerceptExplanation, report
from navfw.offis.pyramid import NEIGHBOURS, QUADRANTS, RegionStatistics
from navfw.offis.walls import SIDES, find_walls, slopes_of_means, slopes_of_walls
from navfw.robot import RobotModel
from navfw.signals import FlowField, Percept, Twist

HEADROOM = 0.05  # chosen
"""Clearance above the robot [m]."""

Positive = Annotated[float, Field(gt=0.0, le=100.0)]
"""Lengths [m], of vectors [px], and multiples of sigma: beyond 100 nothing changes any more."""
Share = Annotated[float, Field(ge=0.0, le=1.0)]


class Offis(Perception):
    """Optical-flow fuzzy inference system: nearest objects, planes, slopes, situations.

    In mode ``nearness`` the inputs of the fuzzy systems are means of nearness, from which the floor
    and the growth of flow with the distance from the focus of expansion are removed (METHOD
    TRAP 1-3). In mode ``paper`` they are the raw means of |u| and |v|, as in the paper.
    """

    name: ClassVar[str] = "offis"

    class Params(Perception.Params):
        """Parameters of OFFIS."""

        mode: Literal["nearness", "paper"] = Field(
            "nearness", description="inputs of the fuzzy systems"
        )
        layers: int = Field(2, ge=1, le=3, description="layers of the pyramid")
        metric: Literal["auto", "nearest", "mean", "mean_variance"] = Field(
            "auto",
            description="size of a region: mean of its nearest eighth (auto in mode "
            "nearness), its mean (auto in mode paper), or mean plus standard deviation",
        )
        obstacle_height: Positive = Field(0.05, description="least height of an obstacle [m]")
        drop_depth: Positive = Field(0.08, description="least depth of a drop below the floor [m]")
        wall_height: float = Field(
            2.2, gt=0.0, le=1e6, description="height of walls; above are ceiling and sky [m]"
        )
        longest_flow: Positive = Field(8.0, description="search range of the flow processor [px]")
        path_length: Positive = Field(
            2.0, description="length of the path checked for floor in front [m]"
        )

        farthest: float = Field(
            10.0,
            gt=0.0,
            le=1e6,
            description="greatest distance of an object [m]: beyond it, sparse flow cannot "
            "distinguish objects from noise",
        )

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
            top=robot.height + HEADROOM,
            obstacle_height=self.params.obstacle_height,
            drop_depth=self.params.drop_depth,
        )
        self._geometry: GridGeometry | None = None
        self._pairs = np.empty((0, 2), dtype=np.int64)

    def perceive(
        self, flow: FlowField, twist: Twist, alternatives: Sequence[FlowField] = ()
    ) -> Percept:
        """Interpret a derotated ``flow`` field as obstacles, planes and situations.

        The forward speed of the measured ``twist`` gives times to contact. ``alternatives`` are the
        same flow, derotated for other camera motions that the data allow: a quadrant is named as
        nearest only if all agree; degrees do not depend on them. Without translation or texture
        ``unknown`` has degree 1, all other degrees are 0 and no floor is reported.
        """
        geometry = self._geometry_of(flow.points)
        seen, height, label = self._cells(flow, geometry)
        results = self._infer(flow, twist, geometry, seen, label)
        if alternatives:
            results = self._settle(results, alternatives, twist, geometry)
        degrees, situations = results.distances.degrees, results.situations
        return Percept(
            time=flow.time,
            points=flow.points,
            nearness=seen.nearness,
            sigma=seen.sigma,
            confidence=seen.confidence,
            height=height,
            label=label,
            obstacles=results.obstacles,
            quadrants={
                quadrant: dict(zip(nearness.TERMS, degrees[:, i].tolist(), strict=True))
                for i, quadrant in enumerate(QUADRANTS)
            },
            planes={
                f"{QUADRANTS[i]}-{QUADRANTS[j]}": float(results.planes.plane[k])
                for k, (i, j) in enumerate(NEIGHBOURS)
            },
            slopes=dict(zip(SIDES, results.slopes.codes, strict=True)),
            situations=situations.degrees,
            floor_in_front=situations.floor_in_front,
            sentence=report(
                results.obstacles,
                situations.front,
                situations.floor_in_front >= FLOOR_IN_FRONT,
                results.known,
            ),
            explanation=PerceptExplanation(results),
        )

    def _cells(
        self, flow: FlowField, geometry: GridGeometry
    ) -> tuple[nearness.Nearness, Array, npt.NDArray[np.int8]]:
        """Nearness, height [m] and label of each cell."""
        seen = nearness.triangulate(flow, self.robot.camera.focal)
        return (seen, *self._floor.classify(flow.points, seen, geometry.fall))

    def _settle(
        self,
        results: OffisResults,
        alternatives: Sequence[FlowField],
        twist: Twist,
        geometry: GridGeometry,
    ) -> OffisResults:
        """Return ``results`` with the nearest objects that all ``alternatives`` show, too."""
        others = []
        for flow in alternatives:
            seen, _, label = self._cells(flow, geometry)
            others.append(self._infer(flow, twist, geometry, seen, label))
        obstacles = nearness.common_regions(
            results.obstacles, [other.obstacles for other in others]
        )
        empty = all(other.known and not other.obstacles["layer1"] for other in (results, *others))
        return replace(
            results,
            obstacles=obstacles,
            known=results.known and (bool(obstacles["layer1"]) or empty),
        )

    def _infer(
        self,
        flow: FlowField,
        twist: Twist,
        geometry: GridGeometry,
        seen: nearness.Nearness,
        label: npt.NDArray[np.int8],
    ) -> OffisResults:
        """The fuzzy part: from nearness and labels to objects, planes, slopes and situations."""
        camera, params = self.robot.camera, self.params
        pyramid = geometry.pyramid
        objects = find_objects(geometry, seen, label)
        walls = find_walls(geometry, seen, objects.wall_weight)
        borders = find_blind_borders(flow, geometry, camera.focal, params.longest_flow)
        paper = params.mode == "paper"
        if paper:
            channels = raw_channels(flow, camera.focal)
        else:
            channels = object_channels(geometry, seen, objects, walls, borders)
        regions = pyramid.statistics(channels)
        size = self._size(regions)
        region_nearness = regions.mean if paper else regions.nearest
        present = (regions.objects > 0.0) & (region_nearness > 1.0 / params.farthest)
        planes = nearness.find_planes(self._pairs, regions, size)
        # the last four regions are the halves of the planes, for which no distance is inferred
        distances = nearness.find_distances(region_nearness[:-4], regions.known[:-4], twist.v)
        slopes = slopes_of_means(regions) if paper else slopes_of_walls(walls)
        return OffisResults(
            mode=params.mode,
            pyramid=pyramid,
            regions=regions,
            planes=planes,
            distances=distances,
            obstacles=nearness.nearest_objects(pyramid, size, present, planes, distances),
            known=bool(distances.degrees[:, :4].any()),
            borders=borders,
            walls=walls,
            slopes=slopes,
            situations=find_situations(geometry, slopes, walls, objects),
        )

    def _geometry_of(self, points: Array) -> GridGeometry:
        """The geometry of the grid ``points``, cached: a flow processor's grid does not change."""
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
            self._pairs = nearness.pairs_of(geometry.pyramid)
        return geometry

    def _size(self, regions: RegionStatistics) -> Array:
        """Size (n_regions,) of the regions; the largest is chosen."""
        if self.params.mode == "paper":
            mean = np.hypot(regions.mu_u, regions.mu_v)
            variance = regions.var_u + regions.var_v
        elif self.params.metric in ("auto", "nearest"):
            return regions.nearest
        else:
            mean, variance = regions.mean, regions.variance
        return mean + np.sqrt(variance) if self.params.metric == "mean_variance" else mean
