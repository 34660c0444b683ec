"""The view from behind: the robot in its world, for people."""

import json
from pathlib import Path

import numpy as np
import pytest
from cli_calls import put_file
from sim_worlds import world_of

from navfw.cli.recordings import chase_of
from navfw.numerics import Image
from navfw.robot import RobotModel
from navfw.signals import Pose
from navfw.sim.chase_view import ChaseView

SIZE = (160, 90)


@pytest.fixture(scope="module")
def office() -> ChaseView:
    return ChaseView(world_of("office", 0), RobotModel(), SIZE)


def orange(picture: Image) -> np.ndarray:
    """Where the robot's body is seen."""
    blue, _, red = picture.astype(int).transpose(2, 0, 1)
    return np.asarray(red - blue > 140)


def test_the_robot_is_below_the_middle_of_a_picture_in_colour(office: ChaseView) -> None:
    picture = office.draw(Pose(8.0, 5.0, 0.0))
    assert picture.shape == (SIZE[1], SIZE[0], 3)
    rows, columns = np.nonzero(orange(picture))
    assert len(rows) > 100
    assert rows.mean() > 0.6 * SIZE[1]
    assert columns.mean() == pytest.approx(0.5 * SIZE[0], abs=2.0)


def test_the_camera_stays_in_front_of_walls_behind_the_robot(office: ChaseView) -> None:
    # 0.3 m in front of the corridor's wall, through which the camera would look
    for pose in (Pose(0.4, 5.0, 0.0), Pose(8.0, 4.55, 1.57), Pose(5.3, 0.4, 1.57)):
        picture = office.draw(pose)
        assert (picture == 255).all(axis=2).mean() < 0.02, "nothing is seen beyond the world"
        assert picture.std() > 20.0


def test_walkers_are_drawn_where_they_are() -> None:
    world = world_of("moving", 3)
    view = ChaseView(world, RobotModel(), SIZE)
    (x0, x1), (y0, y1) = world.x, world.y
    pose = Pose(0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.0)
    ahead, away = (pose.x + 1.0, pose.y, 0.25), (x0 - 50.0, y0 - 50.0, 0.25)
    near, gone = (view.draw(pose, [at] * len(world.movers)) for at in (ahead, away))
    assert (near != gone).any(axis=2).mean() > 0.01


def test_a_run_whose_world_is_not_found_has_no_view(tmp_path: Path) -> None:
    robot = RobotModel().model_dump(mode="json")
    result = {"world": "office", "config": {"mission": {"robot": robot}}}
    for changes, known in (({}, True), ({"world": "atlantis"}, False), ({"config": {}}, False)):
        put_file(tmp_path, "result.json", json.dumps(result | changes))
        assert (chase_of(tmp_path, SIZE) is not None) == known
