"""Shapes, clearances and shortest paths against exact geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.errors import WorldError
from navfw.numerics import Array
from navfw.sim import (
    BoxSpec,
    Circle,
    CylinderSpec,
    OpeningSpec,
    Rectangle,
    SceneGeometry,
    Shape,
    WallSpec,
    WorldSpec,
    gap_between,
    overlap_depth,
)

RADIUS = 0.18
places = st.floats(-2.0, 2.0)
sizes = st.floats(0.1, 1.0)
rectangles = st.builds(Rectangle, places, places, sizes, sizes, st.floats(-3.0, 3.0))
circles = st.builds(Circle, places, places, sizes)


def outline(shape: Shape) -> Array:
    """Points on the outline (N, 2)."""
    if isinstance(shape, Circle):
        angle = np.linspace(0, 2 * math.pi, 721)
        return np.stack(
            [shape.x + shape.radius * np.cos(angle), shape.y + shape.radius * np.sin(angle)], axis=1
        )
    corners = shape.corners
    share = np.linspace(0, 1, 401)[:, None]
    sides = zip(corners, np.roll(corners, -1, 0), strict=True)
    return np.vstack([a + share * (b - a) for a, b in sides])


@given(rectangles | circles, places, places)
@settings(max_examples=60, deadline=None)
def test_distance_is_that_to_the_outline(shape: Shape, x: float, y: float) -> None:
    signed = float(shape.distance(np.array([[x, y]]))[0])
    nearest = float(np.linalg.norm(outline(shape) - (x, y), axis=1).min())
    assert abs(signed) == pytest.approx(nearest, abs=0.01)


@given(rectangles | circles, rectangles | circles)
@settings(max_examples=80, deadline=None)
def test_overlap_agrees_with_sampled_points(a: Shape, b: Shape) -> None:
    depth = overlap_depth(a, b)
    assert depth == pytest.approx(overlap_depth(b, a), abs=1e-9)
    axis = np.linspace(-3.5, 3.5, 141)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    both = bool(((a.distance(grid) < 0) & (b.distance(grid) < 0)).any())
    if both:
        assert depth > 0.0
    elif depth > 0.15:
        pytest.fail(f"no common point found, but they overlap by {depth}")


@pytest.mark.parametrize(
    ("a", "b", "gap"),
    [
        (Circle(0, 0, 0.5), Circle(2, 0, 0.5), 1.0),
        (Circle(0, 0, 0.5), Rectangle(2, 0, 0.5, 3.0), 1.0),
        (Rectangle(0, 0, 1, 1), Rectangle(3, 0, 1, 1), 1.0),
        (Rectangle(0, 0, 1, 1), Rectangle(3, 3, 1, 1), np.sqrt(2.0)),
        (Rectangle(0, 0, 1, 1), Rectangle(0, 3, 1, 1, np.pi / 4), 2.0 - np.sqrt(2.0)),
        (Rectangle(0, 0, 3, 0.1), Rectangle(0, 0, 0.1, 3), -3.1),
    ],
)
def test_gap_between(a: Shape, b: Shape, gap: float) -> None:
    assert gap_between(a, b) == pytest.approx(gap)
    assert gap_between(b, a) == pytest.approx(gap)


def field(**solids: object) -> SceneGeometry:
    data = {"name": "field", "x": (-5, 5), "y": (-5, 5), **solids}
    return SceneGeometry.from_world(WorldSpec.model_validate(data))


def test_free_line_is_the_shortest_path() -> None:
    length, path = field().shortest_path((-4, -3), (4, 3), RADIUS)
    assert length == 10.0
    assert len(path) == 2


@pytest.mark.parametrize("radius", [0.18, 0.5])
def test_shortest_path_around_a_column(radius: float) -> None:
    plan = field(cylinders=(CylinderSpec(name="column", at=(0, 0), radius=1.0),))
    length, path = plan.shortest_path((-3, 0), (3, 0), radius)
    wide = 1.0 + radius
    tangent = math.sqrt(9.0 - wide**2)
    exact = 2 * tangent + wide * (math.pi - 2 * math.acos(wide / 3.0))
    assert exact * 0.998 < length < exact * 1.01
    assert plan.clearances(path).min() > radius - 0.002


def test_the_distance_field_has_the_lengths_of_the_shortest_paths() -> None:
    plan = field(cylinders=(CylinderSpec(name="column", at=(0, 0), radius=1.0),))
    distances = plan.distance_field((3.0, 0.0), RADIUS)
    rng = np.random.default_rng(0)
    places = rng.uniform(-4.5, 4.5, (40, 2))
    free = [(x, y) for x, y in places.tolist() if plan.clearance(x, y) > RADIUS + 0.05]
    assert len(free) > 25
    for at in free:
        exact = plan.shortest_path(at, (3.0, 0.0), RADIUS)[0]
        assert distances.at(*at) == pytest.approx(exact, rel=0.03, abs=0.06)
    # inside the column: as at the nearest place that the robot can take
    assert 1.8 <= distances.at(0.0, 0.0) <= distances.at(-1.25, 0.0)
    assert math.isfinite(distances.at(9.0, 9.0))


@given(st.floats(-2.0, 2.0), st.floats(-2.5, 2.5), st.floats(-2.5, 2.5))
@settings(max_examples=12, deadline=None)
def test_shortest_path_around_a_wall_end(end: float, y0: float, y1: float) -> None:
    """Over the rounded end of a thin wall: tangent, arc, tangent."""
    plan = field(walls=(WallSpec(name="wall", points=((0, -5), (0, end)), thickness=0.02),))
    start, goal = (-3.0, min(y0, end - 0.5)), (3.0, min(y1, end - 0.5))
    length, _ = plan.shortest_path(start, goal, RADIUS)
    # the two corners of the wall's end are 2 cm apart: a point between them is close enough
    exact = _around_point(start, goal, (0.0, end), RADIUS)
    assert exact - 0.03 < length < exact * 1.01 + 0.03


def _around_point(
    start: tuple[float, float], goal: tuple[float, float], pole: tuple[float, float], radius: float
) -> float:
    a, b = math.dist(start, pole), math.dist(goal, pole)
    angle_a = math.atan2(start[1] - pole[1], start[0] - pole[0]) % (2 * math.pi)
    angle_b = math.atan2(goal[1] - pole[1], goal[0] - pole[0])
    between = (angle_a - angle_b) % (2 * math.pi)  # around the top
    arc = between - math.acos(radius / a) - math.acos(radius / b)
    return math.sqrt(a * a - radius**2) + math.sqrt(b * b - radius**2) + radius * max(arc, 0.0)


def divided(width: float) -> SceneGeometry:
    gap = OpeningSpec(name="gap", at=(0, 2), width=width)
    wall = WallSpec(name="wall", points=((0, -5), (0, 5)), openings=(gap,))
    return field(walls=(wall,))


def test_shortest_path_needs_a_gap_wide_enough() -> None:
    assert divided(0.9).shortest_path((-2, 0), (2, 0), RADIUS)[0] > 5.0
    with pytest.raises(WorldError, match="cannot be reached"):
        divided(0.3).shortest_path((-2, 0), (2, 0), RADIUS)


def test_ends_must_be_free() -> None:
    with pytest.raises(WorldError, match=r"the goal \(0, 0\) is .* from 'wall'"):
        divided(0.9).shortest_path((-2, 0), (0, 0), RADIUS)
    with pytest.raises(WorldError, match=r"the start .* must lie on the floor"):
        divided(0.9).shortest_path((-7, 0), (2, 0), RADIUS)


def test_clearance_and_configuration_space() -> None:
    plan = field(boxes=(BoxSpec(name="box", at=(1, 1), size=(1, 1, 1)),))
    assert plan.clearance(3.5, 1) == pytest.approx(2.0)
    assert plan.clearance(1, 1) == pytest.approx(-0.5)
    assert plan.nearest_name(3, 3) == "box"
    grid = plan.configuration_space(cell=0.1)
    assert grid.occupied.sum() == 100
    assert grid.occupied[grid.index(1.2, 0.8)]
    assert not grid.occupied[grid.index(1.7, 0.8)]


def test_solids_above_the_robot_are_not_in_the_plan() -> None:
    shelf = BoxSpec(name="shelf", at=(1, 1), size=(1, 1, 0.3), base=1.2)
    assert field(boxes=(shelf,)).clearance(1, 1) == math.inf
