"""``navfw world show``: the floor plan of a world, and what the camera sees in it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from cli_calls import invoke
from typer.testing import Result


def show(*arguments: str) -> Result:
    return invoke("world", "show", *arguments)


def read_picture(file: str) -> npt.NDArray[Any]:
    picture = cv2.imread(file, cv2.IMREAD_UNCHANGED)
    assert picture is not None, file
    return np.asarray(picture)


def test_the_floor_plan_is_drawn(tmp_path: Path) -> None:
    done = show("office", "--out", str(tmp_path / "plan.png"), "--json")
    assert done.exit_code == 0, done.output
    summary = json.loads(done.stdout)
    assert summary["size_m"] == [16.0, 10.0]
    assert {"lobby", "lab"} <= set(summary["rooms"])
    assert "lobby-to-lab" in summary["missions"]
    height, width, _ = read_picture(summary["picture"]).shape
    assert abs(width / height - 1.6) < 0.1


def test_the_camera_sees_the_wall_ahead_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = show("office", "--at", "1.2,1.2,0.6")
    assert done.exit_code == 0, done.output
    assert "picture office-camera.png, from 1.2,1.2,0.6 by the camera of default" in done.stdout
    ahead = read_picture("office-camera.png")
    assert (ahead.shape, ahead.dtype.name) == ((120, 160), "uint8")
    assert show("office", "--at", "1.2,1.2,2.2", "--out", "back.png").exit_code == 0
    assert np.abs(ahead.astype(float) - read_picture("back.png")).mean() > 10.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("offic",), "unknown world 'offic': did you mean 'office'?"),
        (("office", "--at", "1,2"), "--at: expected X,Y,YAW, got '1,2'"),
        (("office", "--at", "0,0,0"), "--at: the start (0, 0) must lie on the floor"),
        (("office", "--at", "1.2,1.2,0", "--robot", "hus"), "--robot: unknown robot 'hus'"),
        (("office", "--out", "."), ".: --out: expected a file to write"),
    ],
)
def test_what_is_wrong_is_said(arguments: tuple[str, ...], message: str, tmp_path: Path) -> None:
    done = show(*arguments)
    assert (done.exit_code, done.stdout) == (2, "")
    assert message in done.stderr
