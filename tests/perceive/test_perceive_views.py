"""The command perceive: an approaching wall, images without information, overlays."""

import hashlib
import math
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from cli_calls import put_file, refusal
from perceive_calls import APPROACH, DISTANCES, PICTURE, perceive
from perceive_images import HEIGHT, WIDTH, assert_ahead, save, texture, total, wall_at

from navfw.egomotion.flow_egomotion import Egomotion, MotionKind
from navfw.numerics import Image
from navfw.offis import Offis
from navfw.perceive import overlay, pair_motion
from navfw.perceive.floor_motion import FloorFinder
from navfw.perceive.image_sources import open_source
from navfw.perceive.overlay import COLOURS
from navfw.perceive.pair_motion import PairMotion, ScaleEstimator
from navfw.perceive.pair_result import PairResult
from navfw.perceive.perceiver import NO_FLOOR, Perceiver
from navfw.perceive.perceiver_options import PerceiverOptions, WorkingSize
from navfw.perceive.sentence_evidence import Statement
from navfw.perceive.small_things import SmallThing
from navfw.plugins import default_registry
from navfw.recording import run_folder
from navfw.robot import RobotModel
from navfw.signals import Twist
from navfw.testing.behavior_scenes import wall_flow


def refused(*arguments: str | Path) -> str:
    lines = refusal("perceive", *arguments).splitlines()
    (line,) = (line for line in lines if not line.startswith("perceive: "))
    assert line.startswith("navfw: ")
    return line


@pytest.fixture(scope="module")
def approach(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save(tmp_path_factory.mktemp("approach"), APPROACH)


def test_wall_that_comes_nearer(approach: Path) -> None:
    views = perceive(approach, "--fps", "10", "--speed", "0.5")
    assert [view["frames"][1] for view in views] == [f"image_{n}.png" for n in range(2, 6)]
    for view, distance in zip(views, DISTANCES[1:], strict=True):
        # 0.05 of the distance's unit in 0.1 s: contact in distance / 0.5 seconds
        assert view["ttc_s"] == pytest.approx(distance / 0.5, rel=0.1)
        assert view["situation"] == "wall"
        assert view["confidence"] > 0.7
        assert_ahead(view, WIDTH, HEIGHT)
        for quadrant in view["distances"].values():
            assert quadrant["distance_m"] == pytest.approx(distance, rel=0.15)
    sums = [338.515, 326.2831, 312.4088, 340.2372]
    assert [total(view) for view in views] == pytest.approx(sums, rel=1e-5)


def test_without_speed_only_times(approach: Path) -> None:
    for extra in ((), ("--speed", "0")):
        view = perceive(approach, "--fps", "10", *extra)[-1]
        assert view["ttc_s"] == pytest.approx(3.6, rel=0.1)
        assert view["scale"] == {"source": "none", "speed_m_s": None, "camera_height_m": None}
        quadrants = view["distances"].values()
        assert {(q["distance_m"], q["term"]) for q in quadrants} == {(None, "middle")}


def test_the_nearest_object_is_named_only_if_the_motion_is_known_well_enough(
    approach: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pair_motion, "DEVIATION", 100.0)
    view = perceive(approach, "--fps", "10")[-1]
    assert view["known"]
    assert view["situation"] == "wall"
    assert "nearest object is unknown" in view["sentence"]
    assert not any(view["obstacles"].values())


def test_without_the_floor_seen_before_no_object_is_the_nearest(
    approach: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def find(finder: FloorFinder, *_: object) -> None:
        finder.lost = True

    monkeypatch.setattr(FloorFinder, "find", find)
    view = perceive(approach, "--fps", "10")[-1]
    assert view["known"]
    assert view["notes"] == [NO_FLOOR]
    assert "nearest object is unknown" in view["sentence"]


def test_camera_that_rolls(tmp_path: Path) -> None:
    images = [wall_at(d, PICTURE, 0.8 * k) for k, d in enumerate(DISTANCES[:4])]
    views = perceive(save(tmp_path / "roll", images), "--fps", "10")
    for view, distance in zip(views, DISTANCES[1:4], strict=True):
        assert view["ttc_s"] == pytest.approx(2 * distance, rel=0.1)
        # the image turns by the angle, counter-clockwise: the camera rolled the other way
        assert view["rotation_deg"]["roll"] == pytest.approx(8.0 * view["dt"], abs=0.15)
    sums = [341.2355, 338.4074, 337.3172]
    assert [total(view) for view in views] == pytest.approx(sums, rel=1e-5)


def test_camera_that_backs(approach: Path) -> None:
    paths = [approach / f"image_{n}.png" for n in (5, 4, 3, 2, 1)]
    for view in perceive(*paths, "--fps", "10", "--speed", "0.5"):
        assert view["notes"] == ["the camera moves backward"]
        assert view["ttc_s"] is None


def test_images_too_far_apart_are_taken_nearer_again(tmp_path: Path) -> None:
    picture = texture()
    still = [wall_at(2.0, picture)] * 12
    # then the wall flies past, and nothing is seen in two images twice after six of them
    moving = [picture[100:340, 60 * k : 60 * k + WIDTH] for k in range(1, 13)]
    views = perceive(save(tmp_path, [*still, *moving]), "--fps", "10")
    apart = [round(10.0 * view["dt"]) for view in views]
    assert max(apart) > 8
    assert apart[-1] <= 2
    assert [view["heading"]["motion"] for view in views[11:16]].count("unknown") >= 2


NOISE = np.random.default_rng(0).integers(0, 256, (3, HEIGHT, WIDTH), dtype=np.uint8)


@pytest.mark.parametrize(
    ("images", "note"),
    [
        ([np.zeros((HEIGHT, WIDTH), np.uint8)] * 3, "too little texture"),
        (list(140 + NOISE // 120), "texture"),
        (list(NOISE), "nothing in common"),
        ([APPROACH[0]] * 3, "no motion"),
        ([wall_at(2.0, PICTURE, 0.2 * k) for k in range(3)], "only rotates"),
        ([texture(k)[:HEIGHT, :WIDTH] for k in range(3)], "nothing in common"),
    ],
    ids=["black", "flat and noisy", "snow", "still", "rolling", "unrelated"],
)
def test_never_confident_about_nothing(tmp_path: Path, images: list[Image], note: str) -> None:
    views = perceive(save(tmp_path / "images", images), "--fps", "10", "--speed", "0.3")
    assert len(views) == 2
    for view in views:
        assert (view["known"], view["confidence"], view["ttc_s"]) == (False, 0.0, None)
        assert view["situations"]["unknown"] == 1.0
        assert view["situation"] == "unknown"
        assert "nearest object is unknown" in view["sentence"]
        assert note in "; ".join(view["notes"])


@pytest.mark.parametrize(
    ("height", "expected"),
    [
        (0.1, (2.2, 2.0, 0.02, 0.035, 10.0)),
        (0.5, (2.2, 2.0, 0.05, 0.08, 10.0)),
        (3.0, (3.8, 10.5, 0.05, 0.08, 30.0)),
        (20.0, (1e6, 2.0, 0.05, 0.08, 200.0)),
    ],
)
def test_distances_are_judged_by_the_height_of_the_camera(
    approach: Path, height: float, expected: tuple[float, ...]
) -> None:
    perceiver = Perceiver(PerceiverOptions(), open_source([approach], 10.0), default_registry())
    next(perceiver.results())
    offis = perceiver._offis_at(ScaleEstimator(0.3, height).update(None))
    p = offis.params
    sizes = (p.wall_height, p.path_length, p.obstacle_height, p.drop_depth)
    assert (*sizes, p.farthest) == pytest.approx(expected)
    assert offis.robot.height == max(0.4, height + 0.05)
    assert perceiver._offis_at(ScaleEstimator(40.0, 3.0).update(None)).params.farthest == 200.0


@pytest.mark.parametrize(("known", "digest"), [(True, "e0b3955e192a"), (False, "94bea4b1fb6e")])
def test_a_result_is_drawn_always_the_same(known: bool, digest: str) -> None:
    robot, note = RobotModel(), "the camera is near something, and this note is long " * 3
    flow = wall_flow(robot, 0.2, 0.8, 2.0, 0.5)
    ahead, covariance = np.array([0.0, 0.0, 1.0]), 1e-4 * np.eye(5)
    egomotion = Egomotion(MotionKind.FORWARD, np.eye(3), ahead, covariance, 0.02)
    motion = PairMotion(egomotion, 0.2, "flow", ())
    result = PairResult(
        *(1, "a.png", "b.png", 0.4, motion, ScaleEstimator(0.3, 1.2).update(None), flow),
        percept=Offis(robot).perceive(flow, Twist(0.3, 0.0)),
        front={"wall": 0.9, "other": 0.1},
        small=(SmallThing(2.3, -0.1, 0.2, 0.1, (0.4, 0.7, 0.5, 0.9)),),
        statements=(Statement("front", "Front is a corridor", 0.8, 0.3),),
        rotation_vector=np.zeros(3),
        focus=(170.0, 110.0) if known else None,
        focal=251.0,
        contact=3.2,
        quadrant_contact={"P1": 1.5, "P2": 2.5, "P3": 200.0, "P4": math.inf},
        confidence=0.8,
        known=known,
        notes=(note,),
    )
    grey = np.full((HEIGHT, WIDTH, 3), 120, np.uint8)
    picture = overlay.draw(grey, result, WorkingSize.of(WIDTH, HEIGHT, 12, 16))
    assert hashlib.sha256(picture.tobytes()).hexdigest().startswith(digest)
    cut, wide = WorkingSize.of(700, 500, 12, 16), np.full((500, 700, 3), 120, np.uint8)
    held = replace(result, percept=replace(result.percept, sentence="Front is a corridor"))
    drawn = [overlay.draw(wide, one, cut) for one in (result, held)]
    planes = [(one[:700] == (255, 255, 160)).all(axis=2).any() for one in drawn]
    assert planes == [known, False]


def test_gyro(approach: Path, tmp_path: Path) -> None:
    rows = "".join(f"{0.01 * k},0\n" for k in range(25))
    record = put_file(tmp_path, "gyro.csv", f"time,yaw_rate\n{rows}")
    views = perceive(approach, "--fps", "10", "--gyro", record)
    assert [view["rotation_deg"]["source"] for view in views] == ["gyro", "gyro", "flow", "flow"]
    assert "gap" in views[-1]["notes"][0]
    record.write_text("100,0\n101,0\n")
    assert "expected readings within the time of the images" in refused(approach, "--gyro", record)


def test_grid_and_processor(approach: Path) -> None:
    view = perceive(approach, "--fps", "10", "--grid", "10x15", "--flow", "dis")[-1]
    assert view["ttc_s"] == pytest.approx(3.6, rel=0.1)


def test_overlay_folder(approach: Path, tmp_path: Path) -> None:
    out = tmp_path / "new" / "overlay"
    images = [approach / f"image_{n}.png" for n in (1, 2, 3)]
    perceive(*images, "--fps", "10", "--overlay", out)
    perceive(*images[:2], "--fps", "10", "--overlay", out)  # our own pictures may be replaced
    pictures = sorted(out.iterdir())
    assert [path.name for path in pictures] == ["view-00001.png"]
    picture = cv2.imread(str(pictures[-1]))
    assert picture is not None
    assert picture.shape[1] == 1024
    assert picture.shape[0] > 768
    assert list(out.parent.iterdir()) == [out]
    # the quadrants carry the colour of their distance, blue-green-red (0, 159, 230)
    part = picture[30:80, 300:400].reshape(-1, 3).mean(axis=0)
    assert part[2] - part[0] > 25.0
    key = picture[-40:].reshape(-1, 3).astype(int)
    for name, colour in COLOURS.items():
        assert (np.abs(key - np.array(colour)).max(axis=1) < 3).sum() > 50, name


def test_the_pictures_of_a_run_folder_are_no_images_of_a_camera(
    approach: Path, tmp_path: Path
) -> None:
    for name in (run_folder.RESULT, run_folder.PICTURE):
        shutil.copy(approach / "image_1.png", tmp_path / name)
    assert "is a run folder without images" in refused(tmp_path)
    for number in (1, 2):
        shutil.copy(approach / f"image_{number}.png", tmp_path)
    (view,) = perceive(tmp_path)
    assert view["frames"] == ["image_1.png", "image_2.png"]
    assert view["known"]


def test_overlay_video(approach: Path, tmp_path: Path) -> None:
    av = pytest.importorskip("av", reason="needs the extra video")
    out = tmp_path / "seen.mp4"
    perceive(approach, "--fps", "10", "--overlay", out)
    with av.open(out) as video:
        (stream,) = video.streams.video
        assert stream.codec_context.name == "h264"
        assert stream.average_rate == 10
        pictures = [frame.to_ndarray(format="bgr24") for frame in video.decode(stream)]
    perceive(approach, "--fps", "10", "--overlay", tmp_path / "seen")
    drawn = [cv2.imread(str(file)) for file in sorted((tmp_path / "seen").iterdir())]
    assert len(pictures) == len(drawn) == 4
    for shown, image in zip(pictures, drawn, strict=True):
        assert image is not None
        rows, columns = shown.shape[:2]
        assert np.abs(image[:rows, :columns].astype(float) - shown).mean() < 8.0
    assert "exists" in refused(approach, "--overlay", out)


def test_overlay_leaves_the_work_of_others_alone(approach: Path, tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("work")
    assert "contains 'thesis.txt'" in refused(approach, "--overlay", tmp_path)
    assert (tmp_path / "thesis.txt").read_text() == "work"
    # an image alone leaves nothing behind
    folder = save(tmp_path / "images", [APPROACH[0], APPROACH[2][:200]])
    assert "has 1 image of one size" in refused(folder, "--overlay", tmp_path / "out")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["images", "thesis.txt"]
