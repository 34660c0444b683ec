"""The video of a run: camera beside the plan; refused before the drive where it cannot be."""

import shutil
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from cli_calls import invoke, output, put_files, refusal
from mcap_rewriting import rewrite
from picture_colors import share_of

from navfw.numerics import Array
from navfw.recording import RECORDING, palette, read_result
from navfw.recording.channel_list import LOCAL_MAP
from navfw.recording.recorded_run import open_run

av = pytest.importorskip("av", reason="needs the extra video")

RUN = ("run", "paper-room", "through-the-door", "--set", "mission.timeout=5")
WIDTH, HEIGHT = 1280, 720


@pytest.fixture(scope="module")
def filmed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run, and its video."""
    folder = tmp_path_factory.mktemp("video")
    done = invoke(*RUN, "--out", folder / "run", "--video", folder / "run.mp4")
    assert done.exit_code == 1, done.output  # 5 s are too short for the mission
    assert "video: " in done.stderr
    return folder


def pictures(file: Path) -> list[Array]:
    with av.open(file) as video:
        (stream,) = video.streams.video
        assert stream.codec_context.name == "h264"
        assert stream.codec_context.pix_fmt == "yuv420p", "the one that browsers play"
        return [frame.to_ndarray(format="rgb24").astype(float) for frame in video.decode(stream)]


def test_the_video_shows_the_run_in_simulated_time(filmed: Path) -> None:
    shown = pictures(filmed / "run.mp4")
    images = len(list(open_run(filmed / "run").messages("/camera/image")))
    assert len(shown) == images
    with av.open(filmed / "run.mp4") as video:
        assert video.streams.video[0].average_rate == 10
    first, last = shown[0], shown[-1]
    share = partial(share_of, tolerance=40.0)  # a video's colours are not exact
    assert first.shape == (HEIGHT, WIDTH, 3)
    camera, behind, plan = np.s_[:480, :640], np.s_[:320, 640:], np.s_[320:650, 640:]
    assert (last[behind][..., 0] - last[behind][..., 2] > 140.0).mean() > 0.01, "the robot"
    assert np.abs(first[behind] - last[behind]).mean() > 5.0
    assert np.abs(first[camera] - last[camera]).mean() > 5.0, "the camera moves"
    assert share(last[camera], palette.FLOW) > 1e-3 > share(first[camera], palette.FLOW)
    assert share(last[plan], palette.WALL) > 0.01
    # the path so far and the way ahead
    path = palette.behavior_color("go_to_xy")
    assert share(last[plan], path) > 5e-4 > 5.0 * share(first[plan], path)
    assert share(last[plan], palette.LOCAL_GOAL) > 1e-5


def test_a_video_changes_no_command_and_the_run_is_recorded(filmed: Path, tmp_path: Path) -> None:
    assert (filmed / "run" / RECORDING).is_file()
    plain = invoke(*RUN, "--out", tmp_path / "plain")
    assert plain.exit_code == 1
    hashes = {read_result(f)["command_hash"] for f in (filmed / "run", tmp_path / "plain")}
    assert len(hashes) == 1


@pytest.mark.slow
def test_a_replay_writes_the_same_video(filmed: Path, tmp_path: Path) -> None:
    output("replay", filmed / "run", "--video", tmp_path / "again.mp4")
    again, first = pictures(tmp_path / "again.mp4"), pictures(filmed / "run.mp4")
    assert len(again) == len(first)
    assert all(np.array_equal(a, b) for a, b in zip(again, first, strict=True))
    assert [path.name for path in tmp_path.iterdir()] == ["again.mp4"]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("run.gif", "--video: expected a file .mp4, got .gif"),
        ("run", "--video: expected a file .mp4, got no suffix"),
        ("file/run.mp4", "cannot be written"),
        ("folder.mp4", "--video: expected a file to write, got a folder"),
    ],
)
def test_what_cannot_be_written_is_refused_before_the_drive(
    tmp_path: Path, name: str, message: str
) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "folder.mp4").mkdir()
    (told,) = refusal(*RUN, "--out", tmp_path / "run", "--video", tmp_path / name).splitlines()
    assert message in told
    assert not (tmp_path / "run").exists()


def test_without_the_extra_the_remedy_is_told_before_the_drive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    words = ("--out", tmp_path / "run", "--video", tmp_path / "run.mp4")
    assert "uv sync --extra video" in refusal(*RUN, *words)
    assert list(tmp_path.iterdir()) == []


def test_a_run_without_a_recording_gives_no_video(filmed: Path, tmp_path: Path) -> None:
    result = (filmed / "run" / "result.json").read_text()
    put_files(tmp_path / "run", {"result.json": result})
    told = refusal("replay", tmp_path / "run", "--video", tmp_path / "run.mp4")
    assert "run again with --record" in told
    assert not (tmp_path / "run.mp4").exists()


def test_a_damaged_message_is_told_and_leaves_no_video(filmed: Path, tmp_path: Path) -> None:
    shutil.copytree(filmed / "run", tmp_path / "run")

    def emptied(topic: str, data: bytes) -> bytes:
        return b"" if topic == LOCAL_MAP else data

    rewrite(filmed / "run" / RECORDING, tmp_path / "run" / RECORDING, emptied)
    told = refusal("replay", tmp_path / "run", "--video", tmp_path / "run.mp4")
    assert "is damaged (ValueError" in told
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
