"""Obstacles too near to be matched: blind columns at the border of the image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from offis_scenes import Scene, ideal_flow, wall_ahead

from navfw.numerics import Array
from navfw.offis import GridGeometry, Offis, find_blind_borders
from navfw.robot import RobotModel
from navfw.signals import FlowField, Twist

ROBOT = RobotModel()
CAMERA = ROBOT.camera
SLOW = Twist(0.3, 0.0)


def blinded(flow: FlowField, left: int = 0, right: int = 0) -> FlowField:
    """``flow`` without matches in some columns at its borders."""
    confidence = flow.confidence.copy()
    confidence[:, :left] = 0.0
    confidence[:, confidence.shape[1] - right :] = 0.0
    return replace(flow, confidence=confidence)


def hidden(flow: FlowField) -> Array:
    geometry = GridGeometry.of(flow.points, 2, ROBOT, 2.0, 2.2)
    return find_blind_borders(flow, geometry, CAMERA.focal, 8.0).hidden


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("columns", [2, 3])
def test_several_blind_columns_hide_something_near(side: str, columns: int) -> None:
    flow, _ = ideal_flow(Scene((wall_ahead(2.0),)))
    found = hidden(blinded(flow, **{side: columns}))
    at = np.s_[:columns] if side == "left" else np.s_[16 - columns :]
    assert (found[1, at] > 0.9).all()
    assert found[1].sum() == pytest.approx(found[1, at].sum())
    # a point there moves by more than 8 px, which bounds its nearness from below
    innermost = abs(flow.points[0, columns - 1, 0])
    assert found[0].max() >= 8.0 / (innermost * flow.motion.baseline)


def test_one_blind_column_needs_fast_flow_beside_it() -> None:
    slow, _ = ideal_flow(Scene((wall_ahead(3.0),)))
    fast, _ = ideal_flow(Scene((wall_ahead(0.5),)))
    assert hidden(blinded(slow, left=1))[1].max() == 0.0
    assert hidden(blinded(fast, left=1))[1, 0] > 0.9
    assert hidden(slow)[1].max() == 0.0


def test_what_the_past_camera_did_not_see_hides_nothing() -> None:
    flow, _ = ideal_flow(Scene((wall_ahead(2.0),)))
    c, s = np.cos(0.2), np.sin(0.2)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    # the camera turned to the left: its left border was outside the past image
    turned = replace(flow, motion=replace(flow.motion, rotation=turn))
    assert hidden(blinded(turned, left=2))[1].max() == 0.0
    assert hidden(blinded(turned, right=2))[1].max() > 0.9


def test_a_blind_image_hides_nothing_in_particular() -> None:
    flow, _ = ideal_flow(Scene((wall_ahead(2.0),)))
    assert hidden(blinded(flow, left=8, right=8))[1].max() == 0.0


def test_the_nearest_object_may_be_the_one_that_was_not_matched() -> None:
    flow, _ = ideal_flow(Scene((wall_ahead(2.5),)), sigma=0.1)
    percept = Offis(ROBOT).perceive(blinded(flow, left=2), SLOW)
    assert set(percept.obstacles["layer1"]) <= {"P2", "P3"}
    assert set(percept.obstacles["layer1"].values()) == {"near"}
    explained = percept.explain()["border"]["left"]
    assert explained["inputs"]["blind"] == 2.0
    assert explained["rules"][0]["rule"] == "IF blind IS several THEN border IS near"
    # unknown cells stay unknown in the metric part
    assert (percept.confidence[:, :2] == 0.0).all()
