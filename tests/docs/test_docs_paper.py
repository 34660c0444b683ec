"""The paper in one file: the same sentence, command and wheels as the stack ``paper``."""

import re
import runpy
import shlex
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from cli_calls import put_file
from docs_pages import ROOT, blocks_of, files_of, load_module
from stack_samples import LINE, ROBOT, START

from navfw import open_session
from navfw.camera_geometry.rotations import derotate
from navfw.egomotion.pairing import camera_motion
from navfw.mofis.mofis import DecisionInputs
from navfw.numerics import Image
from navfw.offis.percept_explanation import PerceptExplanation
from navfw.plugins import default_registry
from navfw.signals import (
    Belief,
    Command,
    FlowField,
    Frame,
    FramePair,
    Odometry,
    Percept,
    Pose,
    Twist,
    Waypoint,
)
from navfw.stack import Stack

PAGE = ROOT / "docs" / "paper.md"
EXAMPLE = ROOT / "examples" / "paper_in_one_file.py"
PAPER = load_module(EXAMPLE)
same = partial(pytest.approx, rel=0.0, abs=1e-9)
GOALS = ((3.0, 0.0), (1.0, 1.5), (0.4, -0.1), (0.9, 0.3), (-1.0, -2.0))
"""Goals (ahead, left) [m]: in every term of the rules for bearing and distance."""


@dataclass(frozen=True)
class Moved:
    """Two images, and what gyro and wheels say of the motion from the first to the second."""

    past: Image
    now: Image
    pose: Pose  # of the past robot, in the present one's axes
    time: float
    speed: float

    def read(self) -> Any:
        """What the example perceives."""
        moved, turn = (-self.pose.x, -self.pose.y), -self.pose.yaw
        return PAPER.offis(self.past, self.now, moved, turn, self.speed)

    def flow(self, stack: Stack) -> FlowField:
        """The derotated flow of the stack."""
        motion = camera_motion(ROBOT, self.pose, START, self.time)
        pair = FramePair(Frame(0.0, self.past), Frame(self.time, self.now), motion)
        computed = stack.vision.flow.compute(pair)
        assert computed is not None
        return derotate(computed, ROBOT.camera)

    def percept(self, stack: Stack) -> Percept:
        """What the stack perceives."""
        percept = stack.vision.perception.perceive(self.flow(stack), Twist(self.speed, 0.0))
        assert percept is not None
        return percept


def command_of(stack: Stack, percept: Percept, goal: tuple[float, float]) -> Command:
    """The stack's first command, without any memory, toward ``goal`` in the robot's axes."""
    time, still = percept.time, Twist(0.0, 0.0)
    odometry = Odometry(time, START, still, 0.0, still=True)
    stack.mofis.reset()
    stack.local_map.reset()
    stack.local_map.update(odometry, (percept,), None, START)
    command = stack.mofis.decide(
        DecisionInputs(
            odometry,
            Belief(time, START, np.zeros((3, 3))),
            Waypoint(*goal, 0.3, "goal", "goal", final=True),
            percept,
        )
    )
    assert command is not None
    return command


def wheels_of(stack: Stack, command: Command) -> tuple[float, float]:
    """The wheels' speeds [rad/s] once LOCOM has reached the command."""
    odometry = Odometry(command.time, START, Twist(0.0, 0.0), 0.0, still=True)
    stack.controller.reset()
    for _ in range(200):
        twist = stack.controller.control(command, odometry, stack.period)
    return ROBOT.wheel_speeds(twist)


def table_of(percept: Percept) -> dict[str, float]:
    """The degrees of the entries of Tab. 1; the percept has them with the elementary situations."""
    assert isinstance(percept.explanation, PerceptExplanation)
    return percept.explanation._results.situations.table


def said(percept: Percept) -> str:
    """The sentence with what Tab. 1 says of the front, and without the floor."""
    table = table_of(percept)
    front = max(table, key=table.__getitem__)
    clauses = percept.sentence.removesuffix("; Floor in front").split("; ")
    named = front if front == "unknown" else f"a {front}"
    return "; ".join([*clauses[:-1], f"Front is {named}"])


def assert_equal(stack: Stack, moved: Moved, goal: tuple[float, float]) -> Any:
    """Percept, command and wheels of the example are the stack's; returns the example's percept."""
    percept, read = moved.percept(stack), moved.read()
    assert read.sentence == said(percept)
    assert set(read.parts) == set(percept.obstacles["layer2"])
    for quadrant, degrees in percept.quadrants.items():
        assert read.distances[quadrant] == same(degrees)
    assert read.situations == same(table_of(percept))
    command = command_of(stack, percept, goal)
    decided = PAPER.mofis(read, goal, percept.floor_in_front)
    assert decided == same((command.twist.v, command.twist.w))
    assert PAPER.locom(*decided) == same(wheels_of(stack, command))
    return read


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Stack:
    """The stack of the page: ``paper`` without what navfw adds to the paper."""
    ((_, text),) = files_of(PAGE).items()
    file = put_file(tmp_path_factory.mktemp("stacks"), "paper-alone.yaml", text)
    return Stack.load(file, ROBOT, LINE, default_registry())


def shipped() -> Moved:
    """The images beside the example."""
    past, now = (
        cv2.imread(str(EXAMPLE.parent / f"paper_{name}.png"), cv2.IMREAD_GRAYSCALE)
        for name in ("past", "now")
    )
    turn = np.radians(1.1)
    pose = Pose(-0.071 * np.cos(turn / 2), 0.071 * np.sin(turn / 2), -turn)
    return Moved(np.asarray(past, np.uint8), np.asarray(now, np.uint8), pose, 0.3, 0.071 / 0.3)


def test_it_computes_what_the_stack_computes(alone: Stack) -> None:
    for goal in GOALS:
        assert_equal(alone, shipped(), goal)


def test_its_flow_is_that_of_the_stack(alone: Stack) -> None:
    moved, size = shipped(), (PAPER.ROWS, PAPER.COLS)
    flow = moved.flow(alone)
    past = PAPER.derotate(moved.past, -moved.pose.yaw)
    past = np.pad(past, PAPER.SEARCH, constant_values=np.nan)
    found = np.array([PAPER.match(past, moved.now, r, c) for r, c in np.ndindex(size)])
    reliable = flow.confidence > 0.0
    assert ((found[:, 2] > 0.0) == reliable.ravel()).all()
    assert reliable.mean() > 0.5
    vectors = found[:, :2].reshape(*size, 2)
    assert vectors[reliable] == same(flow.vectors[reliable])
    points = np.stack([PAPER.X, PAPER.Y], axis=-1)
    assert points == same(flow.points)


def drive(seconds: float) -> Iterator[tuple[Moved, DecisionInputs]]:
    """Each second pair of images of a drive of the stack ``paper``, and what MOFIS was given."""
    with open_session("office", "lobby-to-lab", stack="paper", seed=1) as session:
        vision, mofis = session.session.stack.vision, session.session.stack.mofis
        given: list[tuple[FramePair, DecisionInputs]] = []
        decide = mofis.decide

        def spy(inputs: DecisionInputs) -> Command | None:
            given.extend((pair, inputs) for pair in vision._frames.pairs())
            return decide(inputs)

        mofis.decide = spy  # type: ignore[method-assign]
        for tick in session:
            if tick.time > seconds:
                break
    for pair, inputs in given[::2]:
        rotation, shift, lever = pair.motion.rotation, pair.motion.translation, PAPER.CAMERA_AHEAD
        turn = float(np.arctan2(rotation[0, 2], rotation[0, 0]))
        ahead = shift[2] - lever * (1.0 - np.cos(turn))
        left = -shift[0] - lever * np.sin(turn)
        images = pair.past.image, pair.now.image
        speed = inputs.odometry.twist.v
        yield Moved(*images, Pose(-ahead, -left, -turn), pair.motion.dt, speed), inputs


@pytest.mark.slow
def test_it_computes_what_the_stack_computes_along_a_drive(alone: Stack) -> None:
    views = list(drive(10.0))
    assert len(views) > 20
    turned = [abs(moved.pose.yaw) > 0.01 for moved, _ in views]
    assert sum(turned) > 5
    read = [assert_equal(alone, m, g) for (m, _), g in zip(views, cycle(GOALS), strict=False)]
    assert len({percept.sentence for percept in read}) > 8


@pytest.mark.thorough
def test_its_decisions_are_those_of_the_stack_with_all_that_navfw_adds() -> None:
    """Where ``keep_clear``, which the paper has not, has nothing to say."""
    usual = Stack.load("paper", ROBOT, LINE, default_registry())
    compared = 0
    for (_, inputs), goal in zip(drive(16.0), cycle(GOALS), strict=False):
        percept = inputs.percept
        assert percept is not None
        command = command_of(usual, percept, goal)
        memory = usual.mofis.proposals["keep_clear"]
        if memory.applicability > 0.0 or memory.prohibition.any():
            continue
        parts, distances = percept.obstacles["layer2"], percept.quadrants
        seen = PAPER.Percept(percept.sentence, parts, distances, None, None)
        decided = PAPER.mofis(seen, goal, percept.floor_in_front)
        assert decided == same((command.twist.v, command.twist.w))
        compared += 1
    assert compared > 10


def test_it_chooses_from_the_commands_of_the_stack(alone: Stack) -> None:
    commands = alone.mofis.commands
    assert commands.v == same(PAPER.TOP_SPEED * PAPER.SPEEDS)
    assert commands.w == same(PAPER.TOP_TURN * PAPER.TURNS)


def test_nothing_is_seen_without_translation_or_texture_of_its_own(alone: Stack) -> None:
    grey = np.full((PAPER.HEIGHT, PAPER.WIDTH), 128, np.uint8)
    other = np.full_like(grey, 127)  # equal ones would be those of a camera that hangs
    tile = np.random.default_rng(0).integers(0, 255, (8, 8), np.uint8)
    tiles = np.tile(tile, (PAPER.HEIGHT // 8, PAPER.WIDTH // 8))  # fit at several displacements
    for moved in (
        replace(shipped(), pose=START),
        replace(shipped(), past=other, now=grey),
        Moved(np.roll(tiles, 2, axis=1), tiles, Pose(-0.07, 0.0, 0.0), 0.3, 0.2),
    ):
        read = assert_equal(alone, moved, GOALS[0])
        assert "nearest object is unknown" in read.sentence


def test_walls_of_little_contrast_are_reliable_to_the_same_limit(alone: Stack) -> None:
    def faint(image: Image) -> Image:
        upper = image[: PAPER.HEIGHT // 2].astype(np.float64)
        dim = np.round(128.0 + 0.15 * (upper - 128.0)).astype(np.uint8)
        return np.concatenate([dim, image[PAPER.HEIGHT // 2 :]])

    moved = shipped()
    assert_equal(alone, replace(moved, past=faint(moved.past), now=faint(moved.now)), GOALS[0])


def test_objects_are_left_out_from_the_same_distance_on(alone: Stack) -> None:
    moved = shipped()
    for times in range(6, 24, 3):  # as far again as the robot has moved farther
        pose = Pose(times * moved.pose.x, times * moved.pose.y, moved.pose.yaw)
        assert_equal(alone, replace(moved, pose=pose), GOALS[0])


@pytest.mark.parametrize("turn", [0.0003, 0.00033])
def test_a_turn_too_small_to_be_seen_is_not_removed(turn: float, alone: Stack) -> None:
    moved = shipped()
    assert_equal(alone, replace(moved, pose=replace(moved.pose, yaw=-turn)), GOALS[0])


def test_the_page_shows_what_it_prints(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    (block,) = (block for block in blocks_of(PAGE) if block.language == "console")
    line, _, below = block.text.partition("\n")
    words = shlex.split(line.removeprefix("$ uv run python "))
    monkeypatch.setattr(sys, "argv", words)
    runpy.run_path(words[0], run_name="__main__")
    assert capsys.readouterr().out == below


def test_without_derotation_it_steers_the_other_way(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    images = (str(EXAMPLE.parent / f"paper_{name}.png") for name in ("past", "now"))
    monkeypatch.setattr(sys, "argv", [str(EXAMPLE), *images, "0.071", "0", "0.3"])
    runpy.run_path(str(EXAMPLE), run_name="__main__")
    (turn,) = re.findall(r", w (\S+ rad/s);", capsys.readouterr().out)
    assert f"`w` is {turn}" in PAGE.read_text(encoding="utf-8")


def test_images_of_another_size_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    cv2.imwrite("small.png", np.zeros((60, 80), np.uint8))
    monkeypatch.setattr(sys, "argv", [str(EXAMPLE), "small.png", "none.png", "0.1", "0", "0.3"])
    message = "expected two images of 160 x 120 pixels, got small.png and none.png"
    with pytest.raises(SystemExit, match=message):
        runpy.run_path(str(EXAMPLE), run_name="__main__")


def test_it_stays_short_and_needs_nothing_else() -> None:
    text = EXAMPLE.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 300
    imported = set(re.findall(r"^(?:import|from) ([\w.]+)", text, re.MULTILINE))
    assert imported - sys.stdlib_module_names == {"cv2", "numpy", "navfw.fuzzy"}
