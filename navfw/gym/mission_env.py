"""A mission as a Gymnasium environment: one step is one camera frame."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from pydantic import Field

from navfw.config.document import YamlDocument
from navfw.config.lookup import find, find_mission
from navfw.config.overrides import Settings, override_texts
from navfw.config.strict_model import StrictModel
from navfw.config.yamlfile import validate
from navfw.errors import InputError, UnknownNameError
from navfw.gym.agent_spaces import ACTIONS, KINDS, Action, AgentChoice, AgentView, Observation
from navfw.missions.outcome import GoalChecker, Outcome
from navfw.missions.pilot import TickView
from navfw.missions.session import Session, SteppedSession
from navfw.numerics import Array, Image
from navfw.plugins import default_registry
from navfw.signals import Pose
from navfw.suite.case import Case
from navfw.suite.suitefile import EntrySpec, parse_seeds

COARSE = ("robot.control_rate=10",)
"""The settings of a ``coarse`` environment: one control tick per frame."""
UNDRAWN = ("oracle=true", "flow={ideal: {noisy: true}}", "movers.detect=false", "stixels=false")
"""The settings of an environment that is not ``drawn``: flow from the simulator's truth with
measured noise, and no stage that needs images."""

_MAX_KEPT = 4
"""Number of sessions that are kept for a reset with the same seed."""


def _first_case(
    family: str | None,
    difficulty: float | tuple[float, float],
    world: str | None,
    mission: str | None,
) -> Case:
    """Return the run of seed 0 of a family, or of a world's mission."""
    case = Case(0, family or world or "")
    if family is not None and world is None and mission is None:
        checked = EntrySpec(family=family, difficulty=difficulty)
        return replace(case, family=family, difficulty=checked.difficulty)
    if family is None and world is not None and mission is not None:
        files = [find("world", world).absolute(), find_mission(world, mission).absolute()]
        return replace(case, world=str(files[0]), mission=str(files[1]))
    raise InputError(
        "expected either a family, or a world and a mission: "
        'gymnasium.make("navfw/Mission-v0", world="office", mission="lobby-to-lab")'
    )


class RewardWeights(StrictModel):
    """The weight of each term of the reward."""

    progress: float = Field(
        1.0, description="of each metre by which the way through all goals gets shorter"
    )
    time: float = Field(-0.1, description="of each second")
    reached: float = Field(10.0, description="once, if the mission succeeds")
    collided: float = Field(-10.0, description="once, at a collision or fall")
    failed: float = Field(
        -5.0, description="once, if the mission ends otherwise, but for its time limit"
    )


def reward_terms(
    weights: RewardWeights, progress: float, time: float, outcome: Outcome | None
) -> dict[str, float]:
    """Compute the terms of the reward of a step with ``time`` [s] and ``progress`` [m].

    ``outcome`` is the mission's; None while it goes on.
    """
    terms = {"progress": weights.progress * progress, "time": weights.time * time}
    if outcome is not None and outcome.succeeded:
        terms["reached"] = weights.reached
    elif outcome is Outcome.COLLIDED:
        terms["collided"] = weights.collided
    elif outcome is not None and outcome is not Outcome.TIMEOUT:
        terms["failed"] = weights.failed
    return terms


class RemainingWay:
    """Computes the length [m] of the shortest path through the remaining goals, from the true pose.

    Doors that an event closes count as they are at the start.
    """

    def __init__(self, session: Session) -> None:
        task, plan = session.task, session.plan
        goals, radius = [(goal.x, goal.y) for goal in task.goals], task.robot.radius
        self._checker = GoalChecker(task.goals, task.success_radius)
        self._fields = [plan.distance_field(goal, radius) for goal in goals]
        legs = [field.at(*goal) for goal, field in zip(goals, self._fields[1:], strict=False)]
        self._behind = [sum(legs[index:]) for index in range(len(goals))]

    def update(self, pose: Array) -> float:
        """Return the length [m] from the true ``pose`` (3,): x, y [m], yaw [rad]."""
        place = Pose(*pose.tolist())
        self._checker.update(place)
        index = min(self._checker.next, len(self._fields) - 1)
        return self._fields[index].at(place.x, place.y) + self._behind[index]


Seen = dict[str, Any]
"""An observation: arrays by name."""


class MissionEnv(gymnasium.Env[Seen, Any]):
    """Drives missions step by step; an agent replaces fusion, or the composite.

    Give either ``family`` with its ``difficulty`` (a number, or a range that the seed draws from),
    or ``world`` and ``mission``. ``reset(seed=N)`` drives the run with seed N, with the same world
    and noise as ``navfw suite``; ``reset()`` draws N from ``seeds`` (``A:B``). ``changes`` are
    values as for ``--set``; ``reward`` has weights of terms (``RewardWeights``). If ``coarse``,
    physics and control take longer steps: faster, and not quite the run of ``navfw suite``. If not
    ``drawn``, no images are rendered, and flow is that of ``UNDRAWN``; results are marked as
    ``oracle``.

    A step lasts one period of the camera, and an action takes effect with the decision on the next
    frame. The wheel drive's limits and the safety monitor stay between the agent and the wheels.
    The stack decides when it has arrived. Observations hold only what the stack knows; truth is in
    reward and info. An episode ends with its mission; at the mission's time limit it is truncated.

    Raises:
        InputError: a parameter is wrong; the message says which.

    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012 - as Env has it

    def __init__(
        self,
        *,
        family: str | None = None,
        difficulty: float | tuple[float, float] = (0.0, 1.0),
        world: str | None = None,
        mission: str | None = None,
        stack: str | None = None,
        observation: Observation = "local_map",
        action: Action = "twist",
        seeds: str = "0:1000",
        changes: Settings = (),
        reward: dict[str, float] | None = None,
        drawn: bool = True,
        coarse: bool = False,
        render_mode: str | None = None,
    ) -> None:
        if not drawn and (observation == "image" or render_mode is not None):
            raise InputError("there are no images without drawing: leave drawn=False out")
        for what, name, names in (("observation", observation, KINDS), ("action", action, ACTIONS)):
            if name not in names:
                raise UnknownNameError(what, name, names, key=what)
        self._seeds = parse_seeds(seeds)
        self._weights = validate(YamlDocument("reward", reward or {}), RewardWeights)
        coarse = coarse or not drawn
        changes = *(() if drawn else UNDRAWN), *(COARSE if coarse else ()), *override_texts(changes)
        self._agent_class = agent = ACTIONS[action]
        self._case = replace(
            _first_case(family, difficulty, world, mission),
            stack="" if stack is None else str(find("stack", stack).absolute()),
            overrides=(*changes, f"{agent.kind}={agent.name}"),
        )
        self._registry = default_registry()
        self._changed: dict[str, Any] = {"drawn": drawn, "coarse": coarse}
        for plugin in ACTIONS.values():
            self._registry.register(plugin, "navfw.gym")
        self._kept: dict[int, Session] = {}
        self._stack = stack_like = self._session(self._seeds[0]).stack
        self._view = AgentView(KINDS[observation](stack_like), stack_like)
        self.observation_space = self._view.space
        self.action_space = self._agent_class.action_space(stack_like)
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": stack_like.robot.camera.rate}
        self._run: SteppedSession | None = None
        self._compiled = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Seen, dict[str, Any]]:
        """Begin a run, and drive it up to the stack's first decision.

        Without ``seed`` it takes the next of the random sequence of seeds, as Gymnasium does: the
        same after ``reset(seed=N)``, a different one each time if no reset had a seed.

        Raises:
            InputError: the seed is out of range.

        """
        super().reset(seed=seed)
        self.close()
        drawn = int(self.np_random.integers(self._seeds[0], self._seeds[-1], endpoint=True))
        self._seed = drawn if seed is None else seed
        session = self._session(self._seed)
        self._run = SteppedSession(session, compiled=self._compiled)
        self._compiled = True
        self._stack = session.stack
        stages = (self._stack.mofis.fusion, self._stack.mofis.composite)
        self._agent = next(stage for stage in stages if isinstance(stage, self._agent_class))
        robot = session.mission.spec.robot
        self._ticks = max(1, round(robot.control_rate / robot.camera.rate))
        self._way = RemainingWay(session)
        self._image = np.zeros((robot.camera.height, robot.camera.width), np.uint8)
        while (tick := self._tick()) is not None and tick.state.command is None:
            pass
        self._remaining = self._way.update(self._last.true_pose)
        return self._view.read(self._last, self._stack), self._info()

    def step(self, action: AgentChoice) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Apply ``action`` for one period of the camera.

        Raises:
            InputError: there is no run; ``reset`` begins one.
            ValueError: the action has another shape, or is not made of finite real numbers.

        """
        if self._run is None:
            raise InputError("there is no run to step: call reset first")
        values, shape = np.asarray(action), self.action_space.shape
        if (
            values.shape != shape
            or values.dtype.kind not in "fiub"
            or not np.isfinite(values).all()
        ):
            raise ValueError(f"expected an action of {shape} finite real numbers, got {action!r}")
        self._agent.act(self._stack, action)
        before, began = self._remaining, self._last.time
        for _ in range(self._ticks):
            if self._tick() is None:
                break
        self._remaining = self._way.update(self._last.true_pose)
        outcome = self._run.result.outcome if self._run.ended else None
        took = self._last.time - began
        terms = reward_terms(self._weights, before - self._remaining, took, outcome)
        truncated = outcome is Outcome.TIMEOUT
        info = {**self._info(), "reward_terms": terms}
        seen = self._view.read(self._last, self._stack)
        return seen, sum(terms.values()), outcome is not None and not truncated, truncated, info

    def render(self) -> Image | None:
        """Return the newest camera image (height, width, 3) in mode ``rgb_array``, else None."""
        if self.render_mode is None:
            return None
        return np.repeat(self._image[:, :, None], 3, axis=2)

    def close(self) -> None:
        """End the run; ``reset`` begins another one."""
        if self._run is not None:
            self._run.__exit__(None, None, None)
            self._run = None

    @property
    def behaviors(self) -> tuple[str, ...]:
        """The behaviours of the stack, in the order of the weights of an action."""
        return tuple(self._stack.mofis.behaviors)

    def _session(self, seed: int) -> Session:
        """Return the run of ``seed``, which determines the world of a family, and all noise."""
        parse_seeds(f"{seed}:{seed + 1}")
        if seed not in self._kept:
            made = replace(self._case, seed=seed).session(self._registry)
            while len(self._kept) >= _MAX_KEPT:
                del self._kept[next(iter(self._kept))]
            self._kept[seed] = replace(made, **self._changed)
        return self._kept[seed]

    _last: TickView

    def _tick(self) -> TickView | None:
        """One control tick; None once the mission has ended."""
        tick = None if self._run is None else self._run.step()
        if tick is not None:
            self._last = tick
            self._image = self._image if tick.image is None else tick.image
        return tick

    def _info(self) -> dict[str, Any]:
        """Seed, time [s], true pose, way left [m]; at the end outcome, reason, SPL as well."""
        info: dict[str, Any] = {
            "seed": self._seed,
            "time": self._last.time,
            "true_pose": self._last.true_pose,
            "remaining_m": self._remaining,
            "leader": self._last.leader,
        }
        if self._run is not None and self._run.ended:
            result = self._run.result
            info |= {
                "outcome": str(result.outcome),
                "reason": result.reason,
                "spl": result.spl,
                "command_hash": result.command_hash,
            }
        return info
