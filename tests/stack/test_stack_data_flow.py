"""Data flow one way: what vision hands on, and what the stack makes of it."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from architecture_sources import ROOT, imports, tree_of
from flow_scene import rotational_flow
from scripted_run import FakeSimulator
from stack_samples import GOAL, OFFIS, ROBOT, START, context_of, drive, sample_stack, wall_view

from navfw.egomotion import Odometer
from navfw.egomotion.floor_odometry import FloorOdometry
from navfw.guard import PluginGuard
from navfw.guard.guarded_stages import GuardedFlow, GuardedPerception
from navfw.interfaces import FlowProcessor
from navfw.signals import (
    CameraMotion,
    FlowField,
    Frame,
    FramePair,
    Odometry,
    Pose,
    Twist,
    YawCorrection,
)
from navfw.stack.stack import TIMED
from navfw.stack.stackfile import StackSettings
from navfw.stack.vision import View, Vision
from navfw.testing.behavior_scenes import wall_flow


def test_behaviours_get_the_newest_flow_and_percept() -> None:
    shown = [False, True, False, True]

    def script(frame: Frame, odometry: Odometry) -> View:
        return wall_view(frame.time) if shown[round(10 * frame.time)] else View()

    stack, contexts = sample_stack(script=script), []
    simulator: FakeSimulator | None = None
    for _ in shown:
        simulator = drive(stack, 0.1, simulator)
        contexts.append(context_of(stack))
    none, first, same, second = contexts
    assert (none.flow, none.percept) == (None, None)
    assert first.flow is not None
    assert first.percept is not None
    assert first.flow.time == pytest.approx(0.1, abs=0.001)
    assert first.flow.derotated
    assert same.flow is first.flow
    assert same.percept is first.percept
    assert second.flow is not first.flow
    assert second.percept is not first.percept
    # a new mission starts without any
    shown[0] = False
    stack.start(START, [GOAL])
    drive(stack, 0.1)
    assert (context_of(stack).flow, context_of(stack).percept) == (None, None)


# --- yaw corrections -----------------------------------------------------------------------------


class TurnedFlow(FlowProcessor):
    """Exact flow of a wall, of a camera that turned by ``yaw`` [rad] more than was measured."""

    name = "turned_flow"
    yaw = 0.01

    def compute(self, pair: FramePair) -> FlowField:
        """Flow of a wall 2 m ahead, with the part of the turn that was not measured."""
        flow = wall_flow(ROBOT, pair.now.time, 2.0, 1.0, 1.0)
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        # now from past: the image turns against the camera
        turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
        vectors = flow.vectors + rotational_flow(flow.points, turn, ROBOT.camera.focal)
        return replace(flow, vectors=vectors, derotated=False)


def vision_of(settings: StackSettings, timings: dict[str, float]) -> Vision:
    """Vision with the turned flow."""
    guard = PluginGuard()
    flow = GuardedFlow(guard, TurnedFlow(ROBOT))
    return Vision(ROBOT, settings, flow, GuardedPerception(guard, OFFIS), timings)


def view_of(*, gyro_stale: bool = False, **settings: bool) -> View:
    """The view of a camera that moves straight on, by vision with these settings."""
    timings = dict.fromkeys(TIMED, 0.0)
    vision = vision_of(StackSettings.model_validate(settings), timings)
    image = np.zeros((ROBOT.camera.height, ROBOT.camera.width), np.uint8)
    view = View()
    for k in range(4):
        pose = Pose(0.03 * k, 0.0, 0.0)
        odometry = Odometry(0.1 * k, pose, Twist(0.3, 0.0), 0.0, False, gyro_stale=gyro_stale)
        view = vision.process(Frame(0.1 * k, image), odometry)
    return view


def test_a_view_carries_the_yaw_that_the_flow_adds_with_its_sigma() -> None:
    view = view_of()
    assert len(view.yaw_corrections) == len(view.flows) >= 1
    for correction in view.yaw_corrections:
        assert correction.yaw == pytest.approx(TurnedFlow.yaw, abs=0.002)
        assert 0.0 < correction.sigma < 0.005
        assert np.array_equal(correction.motion.rotation, np.eye(3)), "the motion as measured"


def test_without_gyro_the_measured_yaw_is_less_certain() -> None:
    usual, stale = (view_of(gyro_stale=stale).yaw_corrections[0] for stale in (False, True))
    assert stale.motion.yaw_sigma == pytest.approx(0.1 * stale.motion.baseline)
    assert stale.motion.yaw_sigma > usual.motion.yaw_sigma


@pytest.mark.parametrize("setting", ["derotate", "refine"])
def test_without_refinement_there_is_nothing_to_correct(setting: str) -> None:
    view = view_of(**{setting: False})
    assert view.yaw_corrections == ()
    assert all(flow.derotated for flow in view.flows)


def recorded(
    monkeypatch: pytest.MonkeyPatch, kind: type[Odometer] | type[FloorOdometry]
) -> list[YawCorrection]:
    """The corrections that objects of that kind are given from now on."""
    corrections: list[YawCorrection] = []
    correct = kind.correct

    def record(instance: Any, correction: YawCorrection) -> None:
        corrections.append(correction)
        correct(instance, correction)

    monkeypatch.setattr(kind, "correct", record)
    return corrections


MOTION = CameraMotion(np.eye(3), np.array([0.0, 0.0, 0.08]), 0.2)


def test_the_stack_applies_every_yaw_correction_once_in_order(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    applied = recorded(monkeypatch, Odometer)
    given: list[YawCorrection] = []

    def script(frame: Frame, odometry: Odometry) -> View:
        assert applied == given, "vision has corrected nothing itself"
        new = tuple(YawCorrection(0.01 * k, 0.001, MOTION) for k in (len(given), len(given) + 1))
        given.extend(new)
        return View(yaw_corrections=new)

    drive(sample_stack(script=script), 0.45)
    assert len(given) == 10
    assert [id(correction) for correction in applied] == list(map(id, given))


def test_the_floor_odometry_takes_the_yaw_corrections_where_there_is_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    by_wheels, by_floor = (recorded(monkeypatch, kind) for kind in (Odometer, FloorOdometry))
    correction = YawCorrection(0.01, 0.001, MOTION)
    stack = sample_stack(script=lambda frame, odometry: View(yaw_corrections=(correction,)))
    stack.floor_odometry = FloorOdometry(ROBOT)
    drive(stack, 0.25)
    assert by_floor[:2] == [correction, correction]
    assert by_wheels == []


def test_vision_knows_no_odometer() -> None:
    used = {name for module, name in imports(tree_of(ROOT / "navfw" / "stack" / "vision.py"))}
    assert "Odometer" not in used
    vision = vision_of(StackSettings(), {})
    assert not [value for value in vars(vision).values() if isinstance(value, Odometer)]


def test_of_several_flows_of_a_view_behaviours_get_the_newest() -> None:
    flows = tuple(wall_flow(ROBOT, time, 2.0, 20.0, 20.0) for time in (0.0, 0.1))
    stack = sample_stack(script=lambda frame, odometry: View(flows=flows))
    drive(stack, 0.1)
    assert context_of(stack).flow is flows[1]
