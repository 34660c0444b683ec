"""Signs and sizes of flow on frames rendered by the simulator, against its depth."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from flow_scene import cell_truth, true_flow

from navfw.config import find
from navfw.egomotion import camera_motion
from navfw.flow import BlockMatching, Dis
from navfw.interfaces import FlowProcessor
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import Frame, FramePair, Pose
from navfw.sim import Simulation, load_world

ROBOT = RobotModel()
CAMERA = ROBOT.camera
HERE = Pose(1.6, 1.4, 0.5)


@pytest.fixture(scope="module")
def office() -> Iterator[Simulation]:
    with Simulation(load_world(find("world", "office")), ROBOT, HERE, seed=1) as simulation:
        yield simulation


def rendered_pair(office: Simulation, step: Pose) -> tuple[FramePair, Array]:
    """Frames before and after ``step`` that ends at HERE, and the true flow."""
    past = HERE.compose(step.relative(Pose(0.0, 0.0, 0.0)))
    before, _ = office.render_from(past)
    after, depth = office.render_from(HERE)
    motion = camera_motion(ROBOT, past, HERE, 0.2)
    x, y = np.meshgrid(
        np.arange(CAMERA.width) + 0.5 - 0.5 * CAMERA.width,
        np.arange(CAMERA.height) + 0.5 - 0.5 * CAMERA.height,
    )
    rays = np.stack([x, y, np.full_like(x, CAMERA.focal)], axis=-1)
    far = np.where(np.isfinite(depth), depth, 50.0).astype(np.float64)
    flow = true_flow(rays, far, motion, CAMERA.focal)
    return FramePair(Frame(0.0, before), Frame(0.2, after), motion), flow


@pytest.mark.parametrize("processor", [BlockMatching(ROBOT), Dis(ROBOT)], ids=lambda p: p.name)
@pytest.mark.parametrize(
    ("step", "median"),
    [
        (Pose(0.0, 0.0, 0.06), 0.15),
        (Pose(0.0, 0.0, -0.06), 0.15),
        (Pose(0.05, 0.0, 0.0), 0.35),
        (Pose(-0.05, 0.0, 0.0), 0.35),
        (Pose(0.05, 0.001, 0.05), 0.35),
    ],
)
def test_flow_agrees_with_rendered_depth_and_true_motion(
    office: Simulation, processor: FlowProcessor, step: Pose, median: float
) -> None:
    pair, truth = rendered_pair(office, step)
    flow = processor.compute(pair)
    expected = cell_truth(truth, flow.points, CAMERA)
    trusted = flow.confidence > 0.3
    error = np.linalg.norm(flow.vectors - expected, axis=-1)[trusted]
    assert trusted.mean() > 0.4
    assert np.median(error) < median
    # the same vectors with the opposite sign would be far off
    assert np.median(np.linalg.norm(flow.vectors + expected, axis=-1)[trusted]) > 4 * median
