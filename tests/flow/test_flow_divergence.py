from __future__ import annotations

import math

import numpy as np
import pytest
from flow_scene import wall
from hypothesis import given
from hypothesis import strategies as st

from navfw.flow import BlockMatching, ContactFilter, Expansion, fit_expansion, grid_points
from navfw.numerics import Array
from navfw.robot import CameraModel, RobotModel
from navfw.signals import CameraMotion, FlowField

CAMERA = CameraModel()
POINTS = grid_points(CAMERA, 12, 16)
STILL = CameraMotion(np.eye(3), np.zeros(3), 0.1)


def field(vectors: Array, confidence: Array | None = None) -> FlowField:
    sure = np.ones((12, 16)) if confidence is None else confidence
    return FlowField(0.0, POINTS, vectors, sure, np.full((12, 16), 0.1), STILL)


@given(
    rate=st.floats(-0.3, 0.5).filter(lambda r: abs(r) > 0.01),
    focus=st.tuples(st.floats(-60, 60), st.floats(-40, 40)),
)
def test_growth_and_focus_are_found_exactly(rate: float, focus: tuple[float, float]) -> None:
    found = fit_expansion(field(rate * (POINTS - np.array(focus))))
    assert found is not None
    assert found.rate == pytest.approx(rate, abs=1e-9)
    np.testing.assert_allclose(found.focus, focus, atol=1e-5)
    assert found.support == 1.0
    # depth now / depth past is 1 - rate: what is left, at a step of it in 0.1 s
    assert found.time_to_contact(0.1) == pytest.approx(0.1 * (1 - rate) / rate)


def test_a_quarter_of_wild_vectors_does_no_harm() -> None:
    rng = np.random.default_rng(0)
    vectors = 0.05 * POINTS + rng.normal(0, 0.1, POINTS.shape)
    wild = rng.random((12, 16)) < 0.25
    vectors[wild] = rng.uniform(-8, 8, (int(wild.sum()), 2))
    found = fit_expansion(field(vectors))
    assert found is not None
    assert found.rate == pytest.approx(0.05, abs=0.003)
    assert 0.6 < found.support < 0.9


def test_its_sigma_covers_the_errors() -> None:
    rng = np.random.default_rng(1)
    ratios = []
    for _ in range(60):
        found = fit_expansion(field(0.04 * POINTS + rng.normal(0, 0.2, POINTS.shape)))
        assert found is not None
        ratios.append((found.rate - 0.04) / found.sigma)
    # vectors of windows that overlap share errors; these do not: on the careful side
    assert 0.3 < np.std(ratios) < 1.2


def test_too_few_vectors_say_nothing() -> None:
    confidence = np.zeros((12, 16))
    confidence[3, :7] = 1.0
    assert fit_expansion(field(0.1 * POINTS, confidence)) is None
    confidence[:] = 0.0
    assert fit_expansion(field(0.1 * POINTS, confidence)) is None


def test_time_to_contact_of_a_wall() -> None:
    motion = CameraMotion(np.eye(3), np.array([0.0, 0.0, 0.06]), 0.2)
    pair, _ = wall(CAMERA, distance=1.5).pair(motion, noise=2.0)
    found = fit_expansion(BlockMatching(RobotModel()).compute(pair))
    assert found is not None
    assert found.time_to_contact(0.2) == pytest.approx(1.5 / 0.3, rel=0.03)


def test_what_does_not_grow_is_never_reached() -> None:
    assert Expansion(0.0, 0.01, np.zeros(2), 1.0).time_to_contact(0.1) == math.inf
    smoother = ContactFilter()
    smoother.update(0.1, Expansion(0.05, 0.002, np.zeros(2), 1.0), 0.1)
    assert math.isfinite(smoother.time_to_contact)
    assert smoother.update(0.1, Expansion(-0.05, 0.002, np.zeros(2), 1.0), 0.1) == math.inf


def test_the_filter_runs_down_and_averages() -> None:
    rng = np.random.default_rng(3)
    smoother, raw, smooth = ContactFilter(change=0.05), [], []
    for k in range(60):
        true = 8.0 - 0.1 * k
        rate = 0.1 / (true + 0.1) * (1 + 0.15 * rng.normal())
        found = Expansion(rate, 0.15 * rate, np.zeros(2), 1.0)
        raw.append(found.time_to_contact(0.1) - true)
        smooth.append(smoother.update(0.1, found, 0.1) - true)
    assert np.std(smooth[15:]) < 0.6 * np.std(raw[15:])
    before = smoother.time_to_contact
    assert smoother.update(0.3, None, 0.1) == pytest.approx(before - 0.3)
    smoother.reset()
    assert smoother.time_to_contact == math.inf
