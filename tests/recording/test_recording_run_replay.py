"""Honest sensing: a replay in a process without the simulator gives the same commands."""

import json
from collections.abc import Callable
from itertools import count
from pathlib import Path

import cv2
import numpy as np
import pytest
from cli_calls import invoke
from mcap_rewriting import rewrite
from processes import python

from navfw.errors import ConfigError, InputError
from navfw.missions import MissionResult
from navfw.numerics import Image
from navfw.recording import RECORDING, RESULT, read_result, ros_message
from navfw.recording.channel_list import CAMERA_IMAGE, DIGITS, RULES
from navfw.recording.explanations import explain_at
from navfw.recording.recorded_run import RecordedRun, image_of
from navfw.recording.run_folder import plain_json
from navfw.recording.run_replay import repeat_until, replay

# None in sys.modules makes the import of PyBullet fail.
ALONE = """
import json, sys
sys.modules["pybullet"] = None
sys.argv = ["navfw", "replay", sys.argv[1], "--json"]
import navfw.cli
try:
    navfw.cli.main()
finally:
    del sys.modules["pybullet"]
    loaded = [m for m in sys.modules if m.split(".")[0] == "pybullet"]
    loaded += [m for m in sys.modules if m.startswith(("navfw.sim", "navfw.missions"))]
    print(json.dumps(loaded), file=sys.stderr)
"""


Driven = tuple[MissionResult, Path]


@pytest.mark.thorough
def test_the_stack_without_simulator_gives_the_same_commands(driven: Driven) -> None:
    result, folder = driven
    done = python(ALONE, folder)
    assert done.returncode == 0, done.stderr
    answer, log = json.loads(done.stdout), result.log
    assert answer["command_hash"] == log.command_hash
    assert (answer["same"], answer["complete"]) == (True, True)
    assert answer["ticks"] == log.ticks > 300
    assert json.loads(done.stderr.splitlines()[-1]) == []
    assert abs(log.commands[:, 0]).max() > 0.1, "the robot should have driven"


def with_images(folder: Path, copy: Path, change: Callable[[int, Image], Image]) -> Path:
    """A copy of a run folder with its images changed, by their number."""
    for name in (RESULT, "map.yaml", "stack.yaml"):
        (copy / name).write_bytes((folder / name).read_bytes())
    messages = RecordedRun(folder / RECORDING).messages(CAMERA_IMAGE)
    numbers = count()

    def changed(topic: str, data: bytes) -> bytes:
        if topic != CAMERA_IMAGE:
            return data
        image = change(next(numbers), image_of(next(messages), folder))
        packed = cv2.imencode(".png", np.ascontiguousarray(image))[1].tobytes()
        fields = {"format": "png", "data": np.frombuffer(packed, np.uint8)}
        return ros_message("sensor_msgs/msg/CompressedImage", fields, 0)

    rewrite(folder / RECORDING, copy / RECORDING, changed)
    return copy


def test_images_of_another_size_are_refused_by_file(driven: Driven, tmp_path: Path) -> None:
    folder = with_images(driven[1], tmp_path, lambda _, image: image[:, 1:])
    with pytest.raises(ConfigError) as caught:
        replay(folder)
    assert caught.value.file == str(tmp_path / RECORDING)
    assert "159 x 120, those of the camera in result.json are 160 x 120" in str(caught.value)


def test_another_image_gives_other_commands(driven: Driven, tmp_path: Path) -> None:
    """A replay computes its commands; it does not return the recorded ones."""
    mirrored = with_images(driven[1], tmp_path, lambda n, image: image[:, :: -1 if n >= 30 else 1])
    again = replay(mirrored)
    assert not again.same
    assert again.first_difference is not None
    # the camera has 10 Hz, the control loop 60 Hz
    assert again.first_difference >= 30 * 6


def test_a_run_without_recording_is_refused_with_the_remedy(driven: Driven, tmp_path: Path) -> None:
    (tmp_path / RESULT).write_bytes((driven[1] / RESULT).read_bytes())
    with pytest.raises(ConfigError, match="contains no sensor readings; run again with --record"):
        replay(tmp_path)


@pytest.mark.parametrize(
    ("key", "value"), [("start", [0, 1]), ("goals", None), ("robot", {"radius": -1})]
)
def test_a_damaged_result_is_named_by_file_and_key(
    driven: Driven, tmp_path: Path, key: str, value: object
) -> None:
    result = read_result(driven[1])
    result["config"]["mission"][key] = value
    (tmp_path / RESULT).write_text(json.dumps(result))
    with pytest.raises(ConfigError, match=rf"result\.json: config\.mission\.{key}"):
        replay(tmp_path)


def test_every_command_is_explained_rule_by_rule(driven: Driven) -> None:
    explanation = explain_at(driven[1], 5.0)
    leader = explanation["behaviors"][explanation["leader"]]
    assert leader["rules"], "the leader's rules fired"
    assert all("IF" in rule["rule"] and 0.0 < rule["strength"] <= 1.0 for rule in leader["rules"])
    assert explanation["perception"]["sentence"].startswith("Layer1")
    weights = [behavior["weight"] for behavior in explanation["behaviors"].values()]
    assert sum(weights) == pytest.approx(1.0)
    assert explanation["composite"]["name"] == "travel"
    assert explanation["composite"]["weights"]["go_to_xy"] == 1.0
    assert "idle IS progressing" in explanation["composite"]["rules"][0]["rule"]
    assert json.loads(json.dumps(explanation)) == explanation, "it is plain data"
    printed = invoke("explain", driven[1], "--at", 5).stdout
    for text in ("go_to_xy", "IF bearing IS", "travel weights go_to_xy 1.00"):
        assert text in printed


@pytest.mark.parametrize("time", [-1.0, 0.5, 1000.0])
def test_a_time_without_a_command_cannot_be_explained(driven: Driven, time: float) -> None:
    with pytest.raises(InputError, match="no command was in force"):
        explain_at(driven[1], time)


LIGHT = """
import json, sys
from navfw.recording.explanations import explain_at
print(explain_at(sys.argv[1], 5.0)["leader"])
heavy = ("numba", "cv2", "navfw.stack.stack", "navfw.mofis.mofis")
print(json.dumps([name for name in heavy if name in sys.modules]))
"""


def without_rules(folder: Path, copy: Path) -> Path:
    """A copy of a run folder whose recording has no explanations."""
    for name in (RESULT, "map.yaml", "stack.yaml"):
        (copy / name).write_bytes((folder / name).read_bytes())
    rewrite(
        folder / RECORDING,
        copy / RECORDING,
        lambda topic, data: None if topic == RULES else data,
    )
    return copy


@pytest.mark.parametrize("time", [1.5, 3.0, 4.95, 5.0, 5.999])
def test_a_recorded_explanation_is_that_of_the_stack_run_again(driven: Driven, time: float) -> None:
    explanation, last = repeat_until(driven[1], time)
    explanation = plain_json(explanation, DIGITS)
    assert explain_at(driven[1], time, inference=True) == explanation
    inference = explanation["perception"].pop("inference")
    assert "regions" in inference
    assert explain_at(driven[1], time) == explanation
    assert explanation["time"] <= time <= last + 1.0


def test_a_recorded_explanation_needs_neither_stack_nor_kernels(driven: Driven) -> None:
    done = python(LIGHT, driven[1])
    assert done.returncode == 0, done.stderr
    leader, heavy = done.stdout.splitlines()
    assert leader == explain_at(driven[1], 5.0)["leader"]
    assert json.loads(heavy) == []


def test_without_recorded_explanations_the_stack_is_run_again(
    driven: Driven, tmp_path: Path
) -> None:
    explanation = explain_at(without_rules(driven[1], tmp_path), 5.0)
    assert explanation == explain_at(driven[1], 5.0, inference=True)


def test_a_recording_that_is_cut_off_is_explained_as_far_as_it_goes(
    driven: Driven, tmp_path: Path
) -> None:
    copy = without_rules(driven[1], tmp_path)
    data = (driven[1] / RECORDING).read_bytes()
    (copy / RECORDING).write_bytes(data[: len(data) * 3 // 4])
    explanation = explain_at(copy, 2.0)
    assert explanation["complete"] is False
    assert explanation["behaviors"] == explain_at(driven[1], 2.0)["behaviors"]
