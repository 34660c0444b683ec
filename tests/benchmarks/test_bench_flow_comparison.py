"""``navfw bench flow``, on a small recorded walk made here with exact truth."""

import json
import shutil
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import cv2
import numpy as np
import pytest
from cli_calls import answer, output, refusal
from flow_scene import room, turn_about
from navfw_benchmarks.bench import flow_comparison
from navfw_benchmarks.bench.flow_comparison import (
    PARTS,
    PlainDense,
    PlainPoints,
    TrueSet,
    bench_flow_sets,
    measure_set,
    plain_processors,
    recorded_sets,
    rendered_set,
)
from navfw_benchmarks.bench.true_pairs import TruePair, true_flow, with_recording_error

from navfw.errors import ConfigError
from navfw.flow import grid_points
from navfw.flow.block_matching import BlockMatching
from navfw.flow.grid_flow import MatchedFlow
from navfw.interfaces import FlowProcessor
from navfw.numerics import Array, Image
from navfw.perceive.perceiver_options import PerceiverOptions
from navfw.plugins import default_registry
from navfw.robot import CameraModel, RobotModel
from navfw.signals import CameraMotion, FlowField, Frame, FramePair

WIDE = CameraModel(width=352, height=248)
STILL = CameraMotion(np.eye(3), np.zeros(3), 0.1)
CUT = 16  # rows cut off at the top: the principal point is not in the middle


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a walk of four frames through a room, ahead and turning by 1 degree a frame."""
    folder = tmp_path_factory.mktemp("data")
    walk = folder / "hololens_office"
    (walk / "images").mkdir(parents=True)
    (walk / "depth").mkdir()
    scene, poses = room(WIDE), np.empty((4, 16))
    for k in range(4):
        pose = np.eye(4)
        pose[:3, :3] = turn_about(1, 0.0175 * k)
        pose[:3, 3] = 0.01 * k, 0.0, 0.05 * k
        image, _ = scene.render(pose[:3, :3], pose[:3, 3])
        _, depth = scene.render(pose[:3, :3], pose[:3, 3], 1)
        grid = np.rint(1000.0 * np.minimum(depth, 60.0)).astype(np.uint16)
        grid[:80, :80] = 0
        cv2.imwrite(str(walk / f"images/{k:03d}.png"), np.repeat(image[CUT:, :, None], 3, axis=2))
        cv2.imwrite(str(walk / f"depth/{k:03d}.png"), grid[CUT:])
        poses[k] = pose.ravel()
    np.savetxt(walk / "poses.txt", poses)
    matrix = [[WIDE.focal, 0.0, 175.5], [0.0, WIDE.focal, 123.5 - CUT], [0.0, 0.0, 1.0]]
    np.savetxt(walk / "K.txt", np.array(matrix))
    return folder


def few(robot: RobotModel) -> dict[str, FlowProcessor]:
    return {"block_matching": BlockMatching(robot), "cv_lk_15": PlainPoints(robot, 15, 3)}


def test_the_geometry_of_a_recorded_walk_is_right(data: Path) -> None:
    """Crop, scale, focal length and signs: any of them wrong would be pixels off."""
    (walk,) = recorded_sets(data)
    assert [true.name for true in walk.pairs] == ["stride 1"] * 3 + ["stride 2"] * 2
    assert (walk.pairs[0].depth == 0.0).mean() > 0.05
    assert not walk.pairs[0].pair.motion.translation.any()  # nothing is given away
    result = json.loads(json.dumps(bench_flow_sets([walk], few)))
    facts, processors = result["sets"]["hololens_office"], result["hololens_office"]
    assert facts["pairs"] == 5
    assert facts["flow_median_px"] > 2.0
    assert 0 < facts["common"] <= 5 * 192
    for measured in processors.values():
        assert measured["epe_median"] < 0.15
        assert measured["coverage"] > 0.6
        assert measured["ms"] > 0.0
    assert processors["cv_lk_15"]["within_2_sigma"] is None
    (table,) = flow_comparison.tables(result)
    assert table.title.startswith("hololens_office: 5 pairs of ")
    assert [row[0] for row in table.rows] == ["block_matching", "cv_lk_15"]
    assert all(len(row) == len(table.head) for row in table.rows)


def test_parts_share_no_pair(data: Path) -> None:
    (odd,), (even,) = recorded_sets(data, PARTS["odd"]), recorded_sets(data, PARTS["even"])
    times = [[true.pair.now.time for true in part.pairs] for part in (odd, even)]
    assert times == [pytest.approx([0.1, 0.3, 0.2]), pytest.approx([0.2, 0.3])]


def black_pair(motion: CameraMotion) -> FramePair:
    image = np.zeros((120, 160), np.uint8)
    return FramePair(Frame(0.0, image), Frame(0.1, image), motion)


def half_hidden() -> tuple[TruePair, CameraModel]:
    """A camera that has moved left: a near board, left of it a strip that was behind the board."""
    camera = CameraModel(width=160, height=120)
    depth = np.full((120, 160), 4.0, np.float32)
    past = depth.copy()
    depth[:, 80:], past[:, 60:] = 1.0, 1.0  # 0.25 m at 1 m are 20 px
    depth[:30, :30] = 0.0
    motion = CameraMotion(np.eye(3), np.array([-20.0 / camera.focal, 0.0, 0.0]), 0.1)
    return TruePair("boards", "left", black_pair(motion), motion, depth, past), camera


def test_what_is_hidden_or_without_depth_has_no_truth() -> None:
    true, camera = half_hidden()
    points = grid_points(camera, 12, 16)
    vectors, known = true_flow(points, true, camera)
    assert not known[:3, :3].any()
    assert known[3:, :5].all()
    # the background at columns 65 to 80 was at 60 to 75 in the past frame, behind the board
    assert not known[:, 7].any()
    assert known[:, 8:].all()
    np.testing.assert_allclose(vectors[5, 10], [20.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(vectors[5, 4], [5.0, 0.0], atol=1e-9)


def test_an_error_of_the_recorded_pose_is_found_by_flow() -> None:
    """What the flow shows is the truth of the pose; a few wrong vectors change nothing."""
    true, camera = half_hidden()
    points = grid_points(camera, 12, 16)
    vectors, known = true_flow(points, true, camera)
    seen = np.where(known[..., None], vectors, 0.0)
    seen[4, 4:8] += 9.0
    shape = points.shape[:2]
    flow = FlowField(0.1, points, seen, np.ones(shape), np.ones(shape), true.pair.motion)
    turned = turn_about(1, 0.004) @ turn_about(2, 0.003)
    motion = CameraMotion(turned, true.motion.translation + np.array([0.0, 0.005, 0.01]), 0.1)
    wrong = replace(true, motion=motion)
    assert np.abs(true_flow(points, wrong, camera)[0] - vectors)[known].max() > 0.4
    corrected, _ = true_flow(points, with_recording_error(wrong, flow, camera), camera)
    assert np.abs(corrected - vectors)[known].max() < 0.05


class Off(MatchedFlow):
    """Answers the truth of ``half_hidden`` with a given error, after a given time."""

    name: ClassVar[str] = "off"

    def __init__(self, robot: RobotModel, error: float, seconds: float) -> None:
        super().__init__(robot)
        self._error, self._seconds = error, seconds

    def _match(
        self, now: Image, past: Image, visible: tuple[int, int, int, int]
    ) -> tuple[Array, Array, Array]:
        end = time.thread_time() + self._seconds
        while time.thread_time() < end:
            pass
        true, camera = half_hidden()
        vectors, _ = true_flow(self._points, true, camera)
        confidence = np.ones(self._points.shape[:2])
        confidence[:, :8] = 0.0
        vectors = vectors + np.array([self._error, 0.0])
        return vectors, confidence, np.where(self._points[..., 1] < 0, 1.0, 9.0)


def figures(**processors: tuple[float, float]) -> dict[str, Any]:
    true, camera = half_hidden()
    robot = RobotModel(camera=camera)
    names = {"fast": "cv_lk_11", "slow": "cv_lk_21"}
    made = {names.get(k, k): Off(robot, *v) for k, v in processors.items()}
    # the images are alike, but nothing is measured as frozen: the motion is given away to none
    unaided = replace(true, pair=black_pair(STILL))
    found: dict[str, Any] = measure_set(TrueSet("boards", robot, [unaided] * 3), made)
    return dict(found["processors"])


def test_a_processor_is_beaten_by_what_costs_less_and_errs_less() -> None:
    found = figures(own=(2.5, 0.003), fast=(2.0, 0.0), slow=(1.0, 0.006))
    assert found["own"]["beaten_by"] == ["cv_lk_11"]
    assert found["own"]["epe"] == found["own"]["epe_common"] == pytest.approx(2.5)
    assert found["cv_lk_11"]["epe_at_first"] == pytest.approx(2.0)
    assert found["own"]["within_1_sigma"] == 0.5
    assert found["own"]["within_2_sigma"] == 0.5  # sigma is 1 px in the upper half, 9 px below
    assert found["own"]["coverage"] == pytest.approx(96 / 159)
    assert figures(own=(1.5, 0.003), fast=(2.0, 0.0), slow=(1.0, 0.006))["own"]["beaten_by"] == []


def test_plain_dense_flow_is_sampled_at_the_centres_of_the_cells() -> None:
    robot = RobotModel(camera=CameraModel(width=160, height=120))
    y, x = np.mgrid[:120, :160].astype(np.float32)
    processor = PlainDense(robot, lambda _now, _past: np.stack([0.1 * x, 0.1 * y], axis=-1))
    flow = processor.compute(black_pair(STILL))
    pixels = flow.points + np.array([79.5, 59.5])
    np.testing.assert_allclose(flow.vectors, -0.1 * pixels, atol=0.01)


def test_rendered_pairs_keep_the_gyro() -> None:
    drawn = rendered_set(1, 0, PARTS["even"], ("corridor",))
    assert len(drawn.pairs) == 5
    assert any(not np.allclose(t.pair.motion.rotation, np.eye(3)) for t in drawn.pairs)


@pytest.mark.slow
def test_the_default_flow_is_not_beaten_and_its_sigma_is_true() -> None:
    """Costs are measured by the command: here the errors, beside processors of OpenCV."""
    drawn = rendered_set(1, 3)
    plain = plain_processors(drawn.robot)
    rivals = ("cv_dis_ultrafast_0", "cv_dis_fast_1", "cv_dis_medium_1", "cv_lk_15")
    plugin: Any = default_registry().get("flow", PerceiverOptions().flow)
    flow = plugin(drawn.robot)
    found = measure_set(drawn, {"own": flow, **{name: plain[name] for name in rivals}})
    own = found["processors"]["own"]
    assert own["coverage"] > 0.7
    assert 0.36 < own["within_1_sigma"] < 0.55
    assert 0.82 < own["within_2_sigma"] < 0.91
    for name in rivals:
        assert own["epe"] < 0.8 * found["processors"][name]["epe_at_first"]


def test_the_command(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(flow_comparison, "_every_processor", few)
    words = ("bench", "flow", "--data", data, "--places", "0")
    result = answer(*words, "--part", "odd")
    assert result["sets"]["hololens_office"]["pairs"] == 3
    assert result["provenance"]["command"].startswith("navfw bench flow")
    table = output(*words)
    assert "hololens_office: 5 pairs of " in table
    assert "cv_lk_15" in table


def test_bad_input(data: Path, tmp_path: Path) -> None:
    for arguments, said in (
        (("--data", str(tmp_path)), "--data: holds none of hololens_office, tum_fr1"),
        (("--part", "third"), "--part: must be one of all, odd, even, got 'third'"),
        (("--places", "0"), "--places: must be at least 1 without --data"),
    ):
        assert said in refusal("bench", "flow", *arguments)


@pytest.mark.parametrize(
    ("file", "text", "said"),
    [
        ("poses.txt", "1 2 3\n", "expected rows of 16 numbers: 3 columns"),
        ("poses.txt", " ".join("1" * 16) + "\n", "1 rows for 4 images"),
        ("K.txt", "1 2 3\n", "expected 3 rows of 3 numbers"),
        ("K.txt", "one two three\n", "expected rows of 3 numbers"),
        ("depth/002.png", None, r"002\.png: there is no such file"),
    ],
)
def test_a_walk_that_is_damaged_is_refused(
    data: Path, tmp_path: Path, file: str, text: str | None, said: str
) -> None:
    shutil.copytree(data, tmp_path / "data")
    damaged = tmp_path / "data/hololens_office" / file
    damaged.unlink()
    if text is not None:
        damaged.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=said):
        recorded_sets(tmp_path / "data")
