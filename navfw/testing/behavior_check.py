"""Conformance tests for user behaviours and composites: ``check_behavior(MyBehavior)``.

Run as a module, it prints the answers of plugins: in another process, with another hash seed, sets
are ordered differently, and objects have other addresses.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, TypeAlias, TypeVar

import numpy as np

from navfw.config.input_file import shown_path
from navfw.context import Context
from navfw.errors import PluginError
from navfw.guard import PluginCallError, PluginGuard
from navfw.guard.answers import AnswerError
from navfw.guard.plugin_guard import error_text
from navfw.guard.stage_answers import check_proposal, check_weights
from navfw.interfaces import Behavior, Composite, Plugin
from navfw.plugins import default_registry
from navfw.plugins.verification import source_file, verify
from navfw.recording.run_folder import plain_json
from navfw.robot import RobotModel
from navfw.signals import Pose, Proposal
from navfw.testing.behavior_scenes import SCENES, contexts_of

PluginT = TypeVar("PluginT", bound=Plugin)
Digests: TypeAlias = dict[str, str]
"""A digest of each part of a plugin's answers in one scene."""
Answers: TypeAlias = Mapping[str, Digests]
"""The digests by name of the scene."""
Answered: TypeAlias = tuple[list[str], Digests]
"""The problems found in a scene, and the digests."""

_BUDGET = 0.05
"""Largest median computing time [s] of a proposal: half of a camera period."""

_TIME = 60.0
"""Wall time limit of all scenes [s]."""

_ROBOT = RobotModel()
_ELSEWHERE = Pose(5.0, -3.0, 2.0)
_LAYERS = ("applicability", "desirability", "prohibition")
_CHANCE = {
    "in a new instance": "use no random numbers, clock or id, keep no state outside the instance",
    "after reset()": "clear all state in reset(), use no random numbers or clock",
    "in another process": "let nothing depend on the order of a set, hash(), id, clock or threads",
}
"""The remedy, by where answers to the same contexts differed."""
_TO_TURN = ("no waypoint", "goal on the left", "goal behind")
"""Scenes in which left and right differ."""

_SAME = 0.01
"""Largest difference of degrees that counts as equal."""

_FRAMES = (
    "its proposals change when robot and waypoint are moved and turned together: waypoint.x and"
    " waypoint.y are in the map; context.waypoint_local is the waypoint as seen from the robot"
)
_LIMIT = 12
"""Largest number of problems listed in an error."""


def check_behavior(
    cls: type[Behavior], *, budget: float = _BUDGET, elsewhere: Answers | None = None
) -> None:
    """Run a behaviour in many scenes, and raise if it breaks the contract of behaviours.

    Besides what registration verifies: every parameter has a description; the behaviour can be
    built with its defaults; in each scene of ``navfw.testing.behavior_scenes`` it returns a valid
    proposal, with a reason of one line and an explanation in plain data; its proposals are the same
    in a new instance and after ``reset()``, and do not change when robot and waypoint are moved
    together in the map (unless the behaviour depends on the place); and its median computing time
    is at most ``budget`` [s]. ``elsewhere`` are its ``scene_answers`` in another process, which
    must be the same as well.

    >>> def test_my_behavior():
    ...     check_behavior(MyBehavior)

    Raises:
        PluginError: it breaks the contract; the message lists everything that was found.

    """
    durations: list[float] = []
    propose = partial(_propose, durations=durations)
    problems = _problems(cls, propose, elsewhere)
    if not problems and _reads_map_as_robot(cls(_ROBOT)):
        problems.append(_FRAMES)
    if durations and median(durations) > budget:
        usual = 1e3 * median(durations)
        problems.append(
            f"a proposal takes {usual:.0f} ms (median); the limit is {1e3 * budget:.0f} ms"
        )
    _raise_if_any(cls, "behaviour", problems)


def check_composite(cls: type[Composite], *, elsewhere: Answers | None = None) -> None:
    """Run a composite in many scenes, and raise if it breaks the contract of composites.

    As in ``check_behavior``: in each scene its weights are numbers in [0, 1] by names of behaviours
    that exist, the same in a new instance and after ``reset()``, and ``explain()`` returns plain
    data.

    Raises:
        PluginError: it breaks the contract; the message lists everything that was found.

    """
    _raise_if_any(cls, "composite", _problems(cls, _weighing(), elsewhere))


def scene_answers(cls: type[Plugin]) -> Answers:
    """Digests of the answers of a behaviour or composite in each scene, to compare processes."""
    plugin: Any = cls(_ROBOT)
    run: Any = _weighing() if issubclass(cls, Composite) else partial(_propose, durations=[])
    return {scene.name: run(plugin, contexts_of(scene))[1] for scene in SCENES}


def _raise_if_any(cls: type[Plugin], kind: str, problems: Sequence[str]) -> None:
    if not problems:
        return
    file = source_file(cls)
    listed = "".join(f"\n- {problem}" for problem in problems[:_LIMIT])
    more = len(problems) - _LIMIT
    rest = f"\n- and {more} more" if more > 0 else ""
    raise PluginError(
        f"does not keep the contract of a {kind}:{listed}{rest}",
        file=None if file is None else shown_path(file),
        key=f"class {cls.__qualname__}",
    )


def _problems(
    cls: type[PluginT],
    run: Callable[[PluginT, Sequence[Context]], Answered],
    elsewhere: Answers | None,
) -> list[str]:
    """Problems of a plugin; ``run`` gives those in the contexts of a scene, and its answers."""
    verify(cls)

    def in_scenes() -> list[str]:
        problems = [
            f"Params.{name} has no description: Field(description=...), with its unit"
            for name, info in cls.Params.model_fields.items()
            if not info.description
        ]
        try:
            plugin, other = cls(_ROBOT), cls(_ROBOT)
        except Exception as error:  # the class may do anything
            return [*problems, f"{cls.__name__}(robot) raised {error_text(error)}"]
        scenes: dict[str, list[str]] = {}
        for scene in SCENES:
            contexts = contexts_of(scene)
            wrong, first = run(plugin, contexts)
            if not wrong:
                again = {
                    "in a new instance": run(other, contexts)[1],
                    "after reset()": run(plugin, contexts)[1],
                    "in another process": first
                    if elsewhere is None
                    else elsewhere.get(scene.name, {}),
                }
                wrong = [
                    f"its {part} differs {where}: {_CHANCE[where]}"
                    for where, answers in again.items()
                    for part in first
                    if answers.get(part) != first[part]
                ][:1]
            for what in wrong:
                scenes.setdefault(what, []).append(scene.name)
        for what, names in scenes.items():
            more = f" and {len(names) - 1} more" if len(names) > 1 else ""
            problems.append(f"in the scene {names[0]!r}{more} {what}")
        return problems

    guard = PluginGuard(_TIME, _TIME)
    try:
        with guard.watchdog.on_duty():
            return guard.call(cls.__name__, in_scenes, check=list)
    except PluginCallError as error:
        return [str(error)]


def _reads_map_as_robot(behavior: Behavior) -> bool:
    """Whether proposals change when robot and waypoint are moved and turned together.

    A behaviour that depends on its place in the map also does so without a waypoint: it may.
    """
    changed = {True: False, False: False}
    for scene in (scene for scene in SCENES if scene.name in _TO_TURN):
        blind = replace(scene, perceives=False)  # the cells of the local map lie elsewhere
        layers = []
        for start in (Pose(0.0, 0.0, 0.0), _ELSEWHERE):
            behavior.reset()
            proposals = [behavior.propose(c) for c in contexts_of(blind, start=start)]
            layers.append(
                np.array([(p.applicability * p.desirability, p.prohibition) for p in proposals])
            )
        if not np.allclose(layers[0], layers[1], atol=_SAME):
            changed[scene.waypoint is not None] = True
    return changed[True] and not changed[False]


def _weighing() -> Callable[[Composite, Sequence[Context]], Answered]:
    return partial(_weigh, known=default_registry().names("behavior"))


def _weigh(composite: Composite, contexts: Sequence[Context], known: list[str]) -> Answered:
    """What is wrong in one scene, and a digest of the weights in all contexts, after a reset."""
    digest = hashlib.sha256()
    try:
        composite.reset()
        for context in contexts:
            weights = check_weights(composite.weigh(context), known)
            json.dumps(plain_json([dict(rule) for rule in composite.explain()]), allow_nan=False)
            digest.update(json.dumps(weights, sort_keys=True).encode())
    except AnswerError as error:
        return [str(error)], {}
    except Exception as error:  # a plugin may raise anything
        return [f"it raised {error_text(error)}"], {}
    return [], {"weight of a behaviour": digest.hexdigest()}


def _propose(behavior: Behavior, contexts: Sequence[Context], durations: list[float]) -> Answered:
    """Problems in one scene, and digests of all proposals by layer, after a reset."""
    problems: dict[str, None] = {}
    digests = {name: hashlib.sha256() for name in _LAYERS}
    try:
        behavior.reset()
    except Exception as error:  # a plugin may raise anything
        return [f"reset() raised {error_text(error)}"], {}
    for context in contexts:
        began = time.perf_counter()
        try:
            proposal: object = behavior.propose(context)
        except Exception as error:
            problems[f"propose raised {error_text(error)}"] = None
            continue
        durations.append(time.perf_counter() - began)
        problems.update(dict.fromkeys(_faults(proposal, context)))
        if isinstance(proposal, Proposal):
            for name, digest in digests.items():
                digest.update(np.asarray(getattr(proposal, name), dtype=np.float64).tobytes())
    return list(problems), {name: digest.hexdigest() for name, digest in digests.items()}


def _faults(proposal: object, context: Context) -> Iterator[str]:
    """Problems of a proposal: the first that MOFIS finds, and those of reason and explanation."""
    try:
        check_proposal(proposal, context.commands.shape)
    except AnswerError as error:
        yield str(error)
    if not isinstance(proposal, Proposal):
        return
    if not isinstance(proposal.reason, str) or not proposal.reason.strip():
        yield "the proposal has no reason: give one line of text"
    elif "\n" in proposal.reason:
        yield "the reason has several lines: give one line of text"
    try:
        explanation = [dict(rule) for rule in proposal.explain(0, 0)]
        json.dumps(plain_json(explanation), allow_nan=False)
    except Exception as error:  # a plugin may return anything
        yield f"explain(0, 0) does not give plain data: {error_text(error)}"


# --- in another process ---------------------------------------------------------------------------

_SECONDS = 300.0
"""Longest wall time of all answers in the other process [s]."""

Names = Sequence[tuple[str, str]]
"""Kind and name of each plugin."""


def answers_elsewhere(folders: Sequence[Path], plugins: Names) -> list[Answers]:
    """Compute in another process the ``scene_answers`` of ``plugins``, some in ``folders``.

    Raises:
        OSError: the process cannot be started, takes too long, or dies; the message says why.

    """
    seed = "2" if os.environ.get("PYTHONHASHSEED") == "1" else "1"
    environment = {**os.environ, "PYTHONHASHSEED": seed, "NAVFW_TRUST": "1"}
    asked = json.dumps([[str(folder.absolute()) for folder in folders], list(plugins)])
    words = [sys.executable, "-P", "-m", __name__, asked]
    try:
        # S603: fixed words and names of plugins, no shell
        done = subprocess.run(  # noqa: S603
            words, env=environment, capture_output=True, text=True, timeout=_SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        raise OSError(f"took more than {_SECONDS:g} s") from None
    try:
        answers: list[Answers] = json.loads(done.stdout.splitlines()[-1])
    except (ValueError, IndexError):
        raise OSError((done.stderr.splitlines() or [f"exit code {done.returncode}"])[-1]) from None
    return answers


def _print_answers(folders: Sequence[str], plugins: Names) -> None:
    registry = default_registry()
    for folder in folders:
        registry.discover_folder(folder)
    answers = []
    for kind, name in plugins:
        try:
            answers.append(scene_answers(registry.get(kind, name)))
        except Exception:  # of the plugin, in this process only
            answers.append({"": {}})
    sys.stdout.write(f"\n{json.dumps(answers)}\n")


if __name__ == "__main__":
    _print_answers(*json.loads(sys.argv[1]))
