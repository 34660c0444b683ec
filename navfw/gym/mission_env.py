"""A mission as an environment of Gymnasium: one step is one camera frame."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from navfw.config.overrides import Settings
from navfw.errors import InputError, UnknownNameError
from navfw.gym.agent_plugins import ACTIONS, Action, AgentChoice
from navfw.gym.episodes import Episodes
from navfw.gym.observation_kinds import KINDS, AgentView, Observation
from navfw.gym.reward import RemainingWay, RewardWeights, reward_terms
from navfw.missions.outcome import Outcome
from navfw.missions.stepped_session import SteppedSession, TickView
from navfw.signals import Image
from navfw.stack import Stack
from navfw.suite.suitefile import parse_seeds

Seen = dict[str, Any]
"""An observation: arrays by name."""


class MissionEnv(gymnasium.Env[Seen, Any]):
    """Drives missions step by step; an agent takes the place of fusion, or of the composite.

    Either ``family`` with its ``difficulty`` (a number, or a range that the seed draws from), or
    ``world`` and ``mission``. ``reset(seed=N)`` drives the run with seed N, with the same world and
    noise as ``navfw suite``; ``reset()`` draws N from ``seeds`` (``A:B``). ``changes`` are values
    as for ``--set``; ``reward`` weights of terms (``navfw.gym.reward.RewardWeights``).

    A step lasts one period of the camera, and an action takes effect with the decision on the next
    frame. The wheel drive's limits and the safety monitor stay between the agent and the wheels.
    The stack decides when it has arrived. Observations hold what the stack knows; truth is in
    reward and info only. An episode ends with its mission; by the mission's time limit it is
    truncated.

    Raises:
        InputError: one of the parameters is wrong; the message says which.

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
        render_mode: str | None = None,
    ) -> None:
        for what, name, known in (("observation", observation, KINDS), ("action", action, ACTIONS)):
            if name not in known:
                raise UnknownNameError(what, name, known, key=what)
        self._seeds = parse_seeds(seeds)
        self._weights = RewardWeights.of(reward or {})
        self._episodes = Episodes.of(
            action,
            family=family,
            difficulty=difficulty,
            world=world,
            mission=mission,
            stack=stack,
            changes=changes,
        )
        stack_like = self._episodes.session(self._seeds[0]).stack
        self._view = AgentView(KINDS[observation](stack_like), stack_like)
        self._action = ACTIONS[action](stack_like)
        self.observation_space = self._view.space
        self.action_space = self._action.space
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": stack_like.robot.camera.rate}
        self._run: SteppedSession | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Seen, dict[str, Any]]:
        """Begin a run, and drive it up to the stack's first decision.

        Raises:
            InputError: the seed is out of range.

        """
        super().reset(seed=seed)
        self.close()
        drawn = int(self.np_random.integers(self._seeds[0], self._seeds[-1], endpoint=True))
        self._seed = drawn if seed is None else seed
        session = self._episodes.session(self._seed)
        self._run = SteppedSession(session)
        self._run.__enter__()
        self._stack = session.stack
        robot = session.mission.spec.robot
        self._ticks = max(1, round(robot.control_rate / robot.camera.rate))
        self._way = RemainingWay(session)
        self._image = np.zeros((robot.camera.height, robot.camera.width), np.uint8)
        while (tick := self._tick()) is not None and tick.state.command is None:
            pass
        self._remaining = self._way.update(self._last.true_pose)
        return self._view.read(self._last, self._stack), self._info()

    def step(self, action: AgentChoice) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Let ``action`` hold for one period of the camera.

        Raises:
            InputError: there is no run; ``reset`` begins one.

        """
        if self._run is None:
            raise InputError("there is no run to step: call reset first")
        self._action.apply(self._stack, action)
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
        """The newest camera image as (height, width, 3), for the render mode ``rgb_array``."""
        if self.render_mode is None:
            return None
        return np.repeat(self._image[:, :, None], 3, axis=2)

    def close(self) -> None:
        """End the run; ``reset`` begins another."""
        if self._run is not None:
            self._run.__exit__(None, None, None)
            self._run = None

    @property
    def behaviors(self) -> tuple[str, ...]:
        """The behaviours of the run, in the order of the weights of an action."""
        return tuple(self._stack.mofis.behaviors)

    _stack: Stack
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
                "spl": result.metrics.spl,
                "command_hash": result.run.log.command_hash,
            }
        return info
