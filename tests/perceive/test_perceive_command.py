"""The command perceive: calibration, poses, what is assumed, and output as it comes."""

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import cli_calls
import cv2
import numpy as np
import pytest
from cli_calls import put_file, put_files, sole_refusal
from perceive_calls import APPROACH, DISTANCES, PICTURE, perceive
from perceive_images import HEIGHT, WIDTH, assert_ahead, save, wall_at

from navfw.cli import progress_bar
from navfw.cli.output import print_json_list
from navfw.numerics import Image

invoke = partial(cli_calls.invoke, "perceive")
FOCAL = 0.5 * WIDTH / np.tan(np.radians(32.5))
MATRIX = np.array([[FOCAL, 0, 0.5 * WIDTH], [0, FOCAL, 0.5 * HEIGHT], [0, 0, 1.0]])
BARREL = np.array([-0.35, 0.1, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def approach(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save(tmp_path_factory.mktemp("approach"), APPROACH)


def through_barrel_lens(distance: float) -> Image:
    """The wall at ``distance``, as a camera with MATRIX and the distortion BARREL shows it."""
    margin = 200
    image = wall_at(distance, PICTURE, margin=margin)
    pixels = np.stack(np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT)), axis=-1)
    rays = cv2.undistortPoints(pixels.reshape(-1, 1, 2).astype(np.float64), MATRIX, BARREL)
    places = (np.asarray(rays)[:, 0] @ MATRIX[:2, :2] + MATRIX[:2, 2]).astype(np.float32)
    places = places.reshape(HEIGHT, WIDTH, 2) + np.float32(margin)
    return np.asarray(cv2.remap(image, places[..., 0], places[..., 1], cv2.INTER_LINEAR), np.uint8)


def calibration(folder: Path, width: int = WIDTH, height: int = HEIGHT) -> Path:
    text = (
        f"image_width: {width}\nimage_height: {height}\n"
        f"camera_matrix: {{rows: 3, cols: 3, data: {MATRIX.ravel().tolist()}}}\n"
        f"dist_coeffs: {BARREL.tolist()}\n"
    )
    return put_file(folder, "camera.yaml", text)


def test_images_of_a_calibrated_camera(tmp_path: Path) -> None:
    folder = save(tmp_path / "images", [through_barrel_lens(d) for d in DISTANCES])
    options = ("--fps", "10", "--speed", "0.5", "--stride", "1", "--pitch", "0")
    views = perceive(folder, "--calibration", calibration(tmp_path), *options)
    known = [(v, d) for v, d in zip(views, DISTANCES[1:], strict=True) if v["known"]]
    assert len(known) >= len(views) - 1, "from one pair, a plane may not tell the heading"
    for view, distance in known:
        assert view["ttc_s"] == pytest.approx(distance / 0.5, rel=0.1)
        assert_ahead(view, WIDTH, HEIGHT)
        assert not view["assumed"]
        assert view["estimated"] is None
    half = [cv2.resize(through_barrel_lens(d), None, fx=0.5, fy=0.5) for d in DISTANCES]
    smaller = save(tmp_path / "half", [np.asarray(image, np.uint8) for image in half])
    done = invoke(smaller, "--calibration", calibration(tmp_path), *options)
    assert done.exit_code == 0
    assert "is for images of 320 x 240 px, not 160 x 120: scaled by 0.5" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--calibration", "none.yaml"), "none.yaml: there is no such file"),
        (("--calibration", "wide.yaml"), "wide.yaml: --calibration: is for images of 640 x 360 px"),
        (("--calibration", "wide.yaml", "--hfov", "65"), "give --hfov or --calibration, not both"),
        (("--fps", "10", "--times", "t.csv"), "--times: give --fps or --times, not both"),
        (("--poses", "poses.txt", "--gyro", "gyro.csv"), "give --gyro or --poses, not both"),
        (("--poses", "poses.txt"), "poses.txt: --poses: expected readings within the time of the"),
        (("--gyro", "gyro.csv"), "gyro.csv:1: a rate of 90 rad/s is above 10; are these degrees"),
        (("--hfov", "200"), "--hfov: must be between 15 and 155 deg, got 200"),
        (("--hfov", "nan"), "--hfov: must be between"),
        (("--speed", "-1"), "--speed: must be between 0 and 100 m/s, got -1"),
        (("--height", "0"), "--height: must be between"),
        (("--pitch", "60"), "--pitch: must be between"),
        (("--grid", "12"), "--grid: expected ROWSxCOLUMNS such as 12x16"),
        (("--grid", "1x2"), "--grid rows: must be between"),
        (("--stride", "99"), "--stride: must be between"),
        (("--flow", "diss"), "did you mean 'dis'?"),
        (("--flow", "ideal"), "needs the true depth"),
        (("--overlay", "view.gif"), "neither a .mp4 nor the name of a folder"),
    ],
)
def test_what_is_wrong_costs_one_message(
    approach: Path, workdir: Path, arguments: tuple[str, ...], message: str
) -> None:
    calibration(workdir, 640, 360).rename("wide.yaml")
    poses = "100 0 0 0 0 0 0 1\n101 0 0 0 0 0 0 1\n"
    put_files(workdir, {"gyro.csv": "0,90\n1,90\n", "poses.txt": poses})
    said = sole_refusal("perceive", approach, *arguments, "--quiet")
    assert said.startswith("navfw: ")
    assert message in said
    assert said.count("\n") == 1


def test_poses_give_rotation_and_speed(tmp_path: Path) -> None:
    start = 1305031449.0
    folder = tmp_path / "images"
    folder.mkdir()
    for k, image in enumerate(APPROACH):
        cv2.imwrite(str(folder / f"{start + 0.1 * k:.6f}.png"), image)
    lines = [f"{start + 0.05 * k:.4f} 1 2 {0.025 * k:.4f} 0 0 0 1" for k in range(20)]
    views = perceive(folder, "--poses", put_file(tmp_path, "poses.txt", "\n".join(lines)))
    for view, distance in zip(views, DISTANCES[1:], strict=True):
        assert view["rotation_deg"]["source"] == "poses"
        assert view["scale"]["speed_m_s"] == pytest.approx(0.5, abs=1e-3)
        for quadrant in view["distances"].values():
            assert quadrant["distance_m"] == pytest.approx(distance, rel=0.15)


def test_what_is_assumed_is_said(approach: Path, tmp_path: Path) -> None:
    (view,) = perceive(approach / "image_1.png", approach / "image_2.png")
    assert view["estimated"]["focal_px"] is None, "a few images without turns"
    assert [(each["what"], each["taken"]) for each in view["assumed"]] == [
        ("horizontal field of view", "65 degrees"),
        ("lens distortion", "none"),
        ("pitch", "0 degrees until the floor shows it"),
        ("frame rate", "10 images a second"),
    ]
    done = invoke(approach, "--hfov", "60", "--pitch", "0", "--fps", "10")
    said = [line for line in done.stderr.splitlines() if line.startswith("assumed: ")]
    assert said == ["assumed: lens distortion: none (--calibration)"]
    assert "Front is a wall" in done.stdout
    assert "no --speed given" in done.stderr
    # of upright images the longer side shows 65 degrees
    upright = save(tmp_path, [np.ascontiguousarray(np.rot90(image)) for image in APPROACH])
    views = perceive(upright, "--fps", "10")
    for view, distance in zip(views, DISTANCES[1:], strict=True):
        assert view["assumed"][0]["taken"] == "51.1 degrees"
        assert view["ttc_s"] == pytest.approx(2 * distance, rel=0.15)
        assert_ahead(view, HEIGHT, WIDTH)


def test_progress_is_told_on_stderr(approach: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress_bar, "LINE_PERIOD", -1.0)
    done = invoke(approach, "--fps", "10", "--json")
    told = [line for line in done.stderr.splitlines() if line.startswith("perceive: ")]
    lens = "perceive: estimating the lens"
    assert told[0] == lens
    counted = [line.partition(",")[0] for line in told if line != lens]
    assert counted == [f"perceive: images: {k} of 5" for k in (2, 3, 4, 5)]
    assert len(json.loads(done.stdout)) == 4
    assert "perceive: " not in invoke(approach, "--quiet").stderr


def test_list_is_printed_item_by_item(capsys: pytest.CaptureFixture[str]) -> None:
    def items() -> Iterator[dict[str, int]]:
        yield {"a": 1}
        assert capsys.readouterr().out == '[{"a": 1}\n'
        yield {"a": 2}
        assert capsys.readouterr().out == ',{"a": 2}\n'

    print_json_list(items())
    assert capsys.readouterr().out == "]\n"
    print_json_list([])
    assert capsys.readouterr().out == "[]\n"


def test_broken_image_and_gap_in_a_sequence(tmp_path: Path) -> None:
    folder = save(tmp_path, APPROACH[:4] * 2)
    (folder / "image_2.png").write_bytes(b"")
    done = invoke(folder, "--fps", "10", "--json", "--stride", "1")
    assert done.exit_code == 0
    views = json.loads(done.stdout)
    assert views[0]["frames"] == ["image_1.png", "image_3.png"]
    assert views[0]["dt"] == pytest.approx(0.2)
    assert views[0]["ttc_s"] == pytest.approx(2 * 1.9, rel=0.15)
    assert "1 of 8 images left out: " in done.stderr
    for k in (3, 4, 5, 6):
        (folder / f"image_{k}.png").unlink()
    stamped = [f"{0.1 * k:.2f}" for k in (1, 2, 10, 11)]
    for name, stamp in zip(sorted(folder.iterdir()), stamped, strict=True):
        cv2.imwrite(str(folder / f"{stamp}.png"), APPROACH[int(stamp[-1]) % 2])
        name.unlink()
    pairs = [" ".join(view["frames"]) for view in perceive(folder)]
    assert pairs == ["0.10.png 0.20.png", "1.00.png 1.10.png"]
