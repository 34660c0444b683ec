"""The dataset benchmarks, on small folders of the same form made here with exact truth."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from perceive_images import texture
from scipy.io import savemat

from navfw.bench import (
    FR1_DISTORTION,
    FR1_MATRIX,
    TruePair,
    bench_approach,
    frame_pairs,
    measure_set,
    recorded_sets,
    tum_frames,
)
from navfw.errors import ConfigError, InputError
from navfw.flow import BlockMatching, Dis

# --- approach ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def approach(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """24 frames, 2.5 s to 0.2 s before the impact on a wall."""
    folder = tmp_path_factory.mktemp("approach")
    wall = texture()
    y, x = np.mgrid[:128, :128].astype(np.float32) - 63.5
    for number in range(1, 25):
        left = 2.6 - 0.1 * number
        scale = left * 2.0
        image = cv2.remap(wall, 600 + scale * x, 600 + scale * y, cv2.INTER_AREA)
        cv2.imwrite(str(folder / f"image_{number}.jpg"), image)
    savemat(folder / "TTI.mat", {"TTI": np.linspace(2.6, 0.0, 27)[:, None]})
    return folder


@pytest.mark.thorough
def test_time_to_contact_of_an_approach(approach: Path) -> None:
    result = json.loads(json.dumps(bench_approach(approach)))
    assert result["frames"] == 24
    assert result["values"] == 27
    assert result["step_s"] == pytest.approx(0.1)
    assert result["ttc_median_rel_error"] < 0.03
    assert result["raw_median_rel_error"] < 0.03
    assert abs(result["pairing_offset_frames"]) < 0.2
    assert result["other_pairing_median_rel_error"] > 0.05
    assert len(result["truth_s"]) == len(result["smoothed_s"]) == 23


def test_an_approach_that_lacks_something_is_refused(approach: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"expected image_1\.jpg"):
        bench_approach(tmp_path)
    gap = tmp_path / "gap"
    shutil.copytree(approach, gap)
    (gap / "image_7.jpg").unlink()
    with pytest.raises(ConfigError, match="do not go with frames 1 to 24"):
        bench_approach(gap)
    broken = tmp_path / "broken"
    shutil.copytree(approach, broken)
    (broken / "image_3.jpg").write_bytes(b"no image")
    with pytest.raises(ConfigError, match="not a readable image"):
        bench_approach(broken)


# --- TUM -----------------------------------------------------------------------------------------

WALL = 2.0  # metres ahead of the first camera


def quaternion(yaw: float) -> tuple[float, float, float, float]:
    """About the camera's y axis (down)."""
    return 0.0, float(np.sin(0.5 * yaw)), 0.0, float(np.cos(0.5 * yaw))


@pytest.fixture(scope="module")
def tum(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three views of a wall, moving right and ahead and turning, seen through fr1's lens."""
    folder = tmp_path_factory.mktemp("data") / "tum_fr1"
    folder.mkdir()
    (folder / "rgb").mkdir()
    (folder / "depth").mkdir()
    paint = texture(size=512)
    y, x = np.mgrid[:480, :640].astype(np.float64)
    flat = np.stack([x.ravel(), y.ravel()], axis=-1)[:, None]
    straight = np.asarray(cv2.undistortPoints(flat, FR1_MATRIX, FR1_DISTORTION))[:, 0]
    rays = np.concatenate([straight, np.ones((len(straight), 1))], axis=1)
    colour, depths, poses = [], [], []
    # depth is taken 10 ms later than colour, as by the real camera
    for tick in range(-1, 25):
        at = 0.01 * tick
        place, yaw = np.array([0.3 * at, 0.0, 0.4 * at]), 0.2 * at
        poses.append(f"{at:.4f} {' '.join(map(str, place))} {' '.join(map(str, quaternion(yaw)))}")
        if tick % 10 not in {0, 1} or tick < 0:
            continue
        c, s = np.cos(yaw), np.sin(yaw)
        axes = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        ahead = rays @ axes.T
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
        text = "# time and what\n" + "\n".join(lines) + "\n"
        (folder / f"{name}.txt").write_text(text, encoding="utf-8")
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
    (copy / "groundtruth.txt").write_text("0 1 2\nnonsense\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"groundtruth\.txt:1: has 3 columns .*expected time, tx"):
        tum_pairs(copy, (160, 120))
    shutil.rmtree(copy / "depth")
    shutil.copy(tum / "groundtruth.txt", copy)
    with pytest.raises(InputError, match="expected two colour images"):
        tum_pairs(copy, (160, 120))
