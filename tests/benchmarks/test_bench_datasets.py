"""Benchmarks on small data sets made here with exact truth, on rendered pairs, and of planning."""

import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from cli_calls import put_file
from navfw_benchmarks.bench.flow_comparison import (
    all_processors,
    measure_set,
    recorded_sets,
)
from navfw_benchmarks.bench.perception_benchmark import match_windows, time_flow
from navfw_benchmarks.bench.planning_time import bench_planning, large_map
from navfw_benchmarks.bench.recorded_pairs import (
    FR1_DISTORTION,
    FR1_MATRIX,
    frame_pairs,
    tum_frames,
)
from navfw_benchmarks.bench.true_pairs import TruePair, load_worlds, rendered_pairs
from perceive_images import texture
from scipy.spatial.transform import Rotation

from navfw.errors import ConfigError, InputError
from navfw.flow.block_matching import BlockMatching
from navfw.flow.opencv_flow import Dis
from navfw.plugins import default_registry
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, FramePair

WALL = 2.0  # metres ahead of the first camera


@pytest.fixture(scope="module")
def tum(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three views of a wall, moving right and ahead and turning, seen through fr1's lens."""
    folder = tmp_path_factory.mktemp("data") / "tum_fr1"
    for name in ("rgb", "depth"):
        (folder / name).mkdir(parents=True)
    paint = texture(size=512)
    y, x = np.mgrid[:480, :640].astype(np.float64)
    flat = np.stack([x.ravel(), y.ravel()], axis=-1)[:, None]
    straight = np.asarray(cv2.undistortPoints(flat, FR1_MATRIX, FR1_DISTORTION))[:, 0]
    rays = np.concatenate([straight, np.ones((len(straight), 1))], axis=1)
    colour, depths, poses = [], [], []
    # depth is taken 10 ms later than colour, as by the real camera
    for tick in range(-1, 25):
        at = 0.01 * tick
        place = np.array([0.3 * at, 0.0, 0.4 * at])
        turned = Rotation.from_euler("y", 0.2 * at)  # the camera's y axis is down
        poses.append(" ".join(f"{number:.12g}" for number in (at, *place, *turned.as_quat())))
        if tick % 10 not in {0, 1} or tick < 0:
            continue
        ahead = turned.apply(rays)
        far = (WALL - place[2]) / ahead[:, 2]
        if tick % 10 == 0:
            hit = place + ahead * far[:, None]
            u, v = (200.0 * hit[:, :2]).T.reshape(2, 480, 640).astype(np.float32) % 511
            image = cv2.remap(paint, u, v, cv2.INTER_LINEAR)
            cv2.imwrite(str(folder / f"rgb/{tick}.png"), image)
            colour.append(f"{at:.4f} rgb/{tick}.png")
        else:
            grid = np.rint(5000.0 * far.reshape(480, 640)).astype(np.uint16)
            grid[:40, :40] = 0
            cv2.imwrite(str(folder / f"depth/{tick}.png"), grid)
            depths.append(f"{at:.4f} depth/{tick}.png")
    for name, lines in (("rgb", colour), ("depth", depths), ("groundtruth", poses)):
        put_file(folder, f"{name}.txt", "\n".join(["# time and what", *lines, ""]))
    return folder


def test_real_frames_geometry_is_right(tum: Path) -> None:
    """Lens, association, interpolation and signs: any of them wrong would be pixels off."""
    (chosen,) = recorded_sets(tum.parent)
    for pairs in (chosen.pairs, [replace(true, recording_error=None) for true in chosen.pairs]):
        robot, exact = chosen.robot, pairs is not chosen.pairs
        result = measure_set(
            replace(chosen, pairs=pairs),
            {"block_matching": BlockMatching(robot), "dis": Dis(robot)},
        )
        assert result["pairs"] == 3
        assert result["flow_median_px"] > 1.0
        for measured in result["processors"].values():
            assert measured["coverage"] > 0.5
            # this recording has no error: almost none is found
            assert measured["epe_median"] < 0.25 + 0.02 * exact


def tum_pairs(folder: Path, size: tuple[int, int]) -> list[TruePair]:
    return list(frame_pairs("tum_fr1", tum_frames(folder, size)[1]))


def test_depth_is_carried_to_the_colour_images_pose(tum: Path) -> None:
    first, second = tum_pairs(tum, (160, 120))
    known = second.depth > 0
    assert known.mean() > 0.7
    assert second.motion.translation[2] == pytest.approx(0.04, abs=0.002)
    assert second.motion.translation[0] == pytest.approx(0.03, abs=0.003)
    middle = first.depth[55:65, 75:85]
    assert np.median(middle[middle > 0]) == pytest.approx(WALL - 0.04, abs=0.01)


def test_a_recording_that_lacks_something_is_refused(tum: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"rgb\.txt: there is no such file"):
        tum_pairs(tmp_path, (160, 120))
    copy = tmp_path / "copy"
    shutil.copytree(tum, copy)
    put_file(copy, "groundtruth.txt", "0 1 2\nnonsense\n")
    with pytest.raises(InputError, match=r"groundtruth\.txt:1: has 3 columns .*expected time, tx"):
        tum_pairs(copy, (160, 120))
    shutil.rmtree(copy / "depth")
    shutil.copy(tum / "groundtruth.txt", copy)
    with pytest.raises(InputError, match="expected two colour images"):
        tum_pairs(copy, (160, 120))


# --- flow on rendered pairs -----------------------------------------------------------------------


ROBOT = RobotModel()


def test_every_processor_that_ships_is_measured() -> None:
    measured = {processor.name for processor in all_processors(ROBOT).values()}
    assert measured == {*default_registry().names("flow")} - {"ideal"}


def test_pairs_repeat_and_motions_are_what_they_are_called() -> None:
    worlds = load_worlds(["corridor"])
    first, second = (list(rendered_pairs(worlds, ROBOT, 1, seed=3)) for _ in range(2))
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a.pair.now.image, b.pair.now.image)
        np.testing.assert_array_equal(a.pair.past.image, b.pair.past.image)
        np.testing.assert_array_equal(a.pair.motion.rotation, b.pair.motion.rotation)
    by_name = {pair.name: pair for pair in first}
    assert by_name["8 cm"].motion.translation[2] == pytest.approx(0.08)
    assert np.trace(by_name["turn 8 deg"].motion.rotation) == pytest.approx(
        1 + 2 * np.cos(np.radians(8))
    )
    # the measured turn differs from the true one
    assert not np.allclose(by_name["8 cm"].pair.motion.rotation, np.eye(3), atol=1e-6)


def test_the_reference_loop_finds_the_same_peaks() -> None:
    drawn = next(iter(rendered_pairs(load_worlds(["corridor"]), ROBOT, 1))).pair
    # the loop foresees no rotation
    pair = FramePair(drawn.past, drawn.now, CameraMotion(np.eye(3), np.zeros(3), 0.2))
    matcher = BlockMatching(ROBOT, BlockMatching.Params(subpixel="peak"))
    peaks, flow = match_windows(matcher, pair), matcher.compute(pair)
    sure = flow.confidence > 0.3
    assert np.abs(flow.vectors - peaks)[sure].max() <= 0.5
    keys = "match_template_ms block_matching_ms block_matching_peak_ms block_matching_ratio"
    assert set(time_flow([pair])) == set(keys.split())


def test_the_map_is_as_large_as_asked_for_and_in_one_part() -> None:
    topo_map = large_map(900, np.random.default_rng(3))
    assert 850 <= len(topo_map.places) <= 900
    assert len(topo_map.parts) == 1
    again = large_map(900, np.random.default_rng(3))
    assert (again.places, again.passages) == (topo_map.places, topo_map.passages)


def test_plans_are_timed_and_as_cheap_as_those_of_networkx() -> None:
    result = bench_planning(places=400, repeats=3, seed=1)  # compares every cost
    for key in ("costs_ms", "first_plan_ms", "replan_ms", "networkx_ms"):
        assert 0.0 < result[key]["min"] <= result[key]["median"] <= result[key]["max"]
    ratio = result["first_plan_ms"]["median"] / result["networkx_ms"]["median"]
    assert result["first_plan_over_networkx"] == ratio
