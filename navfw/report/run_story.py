"""The story of a recorded run: the robot's task, and each time that it did not just drive on.

Consecutive decisions that look alike become one episode: held, standing, backing away, turning on
the spot, turning aside, giving way, slow, lost. Each is reported with its time and place, the
behaviour, its strongest rule, and the degree to which that rule was fulfilled.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

from navfw.config.input_file import is_file
from navfw.errors import InputError
from navfw.features.landmark_appearance import check_landmark_kind
from navfw.mofis.explanation_text import asks_for_nothing, with_inputs
from navfw.numerics.arrays import spans
from navfw.recording import channel_list as topics
from navfw.recording.recorded_run import RecordedRun, located_damage, open_run
from navfw.recording.run_folder import MAP, RESULT, read_result
from navfw.topomap import load_map

LINES = 29
"""Largest number of lines of a story, besides the line on how the run ended."""

_STANDING, _TURNING = 0.02, 0.1
"""Speed [m/s] and rate [rad/s] up to which a robot counts as standing, or as not turning."""

_TURNED_ASIDE = 0.17
"""Smallest turn [rad] of a robot that counts as turning aside."""

_SLOW = 0.6
"""Share of the top speed below which a robot counts as slow."""

_MIN_DURATION = {
    "held": 0.3, "lost": 0.2, "gave way": 0.5, "backed": 0.4, "stood": 1.0,
    "turned": 0.8, "aside": 0.5, "slow": 1.0,
}  # fmt: skip
"""Shortest duration [s] of an episode to report, by its kind, the most important first."""

EPISODES = tuple(_MIN_DURATION)
"""The kinds of episodes, the most important ones first."""

_CLOSER = 0.3
"""Factor on these durations in the story of a part of the run."""

_PAUSE = 0.6
"""Longest time [s] between two episodes of a kind that are merged."""

_AT, _NEAR = 0.6, 2.5
"""Distances [m] from a place up to which the robot is "at" it, and "near" it."""

_GOALS = 5
"""Largest number of goals that the story names."""

_GIVES_WAY, _ASIDE = ("give_way",), ("avoid",)
"""Behaviours that lead while the robot gives way, and while it turns aside."""


@dataclass(frozen=True, slots=True)
class StoryLine:
    """A sentence on what happened from ``time`` to ``until`` [s], with the ``kind`` of episode.

    ``point`` is x, y [m] of a contact.
    """

    time: float
    until: float
    kind: str
    text: str
    point: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class _Decision:
    """A decision: time [s], believed position [m], what was commanded, by whom and why."""

    time: float
    x: float
    y: float
    said: Mapping[str, Any]  # of ``topics.COMMAND``
    rules: Mapping[str, Any]  # of ``topics.RULES``
    speed: float  # to the wheels [m/s]

    @property
    def kind(self) -> str:
        """The kind of episode of only this decision; "" if the robot drives on."""
        v, w, leader = self.said["v"], self.said["w"], self.said["leader"]
        if self.said.get("lost"):
            return "lost"
        if self.said.get("held"):
            return "held"
        if leader in _GIVES_WAY:
            return "gave way"
        if v < -_STANDING:
            return "backed"
        if abs(v) <= _STANDING:
            return "stood" if abs(w) <= _TURNING else "turned"
        return "aside" if leader in _ASIDE and abs(w) > _TURNING else ""

    @property
    def bounded(self) -> bool:
        """Whether anything else than its acceleration kept the robot below its top speed."""
        return not self.said.get("slower", "").startswith("speeding up")


def read_story(
    run: RecordedRun,
    result: Mapping[str, Any],
    places: Mapping[str, tuple[float, float]],
    begin: float = 0.0,
    end: float = math.inf,
    lines: int = LINES,
) -> list[StoryLine]:
    """Summarize ``run`` in at most ``lines`` sentences, in the order of time.

    ``result`` is that of the run, ``places`` are x, y [m, ``map``] by name. If ``begin`` and
    ``end`` [s] select a part of the run, shorter episodes are reported as well.

    Raises:
        ConfigError: the recording or the result is damaged.

    """
    with located_damage(run.path, "a message"):
        everything = [*_decisions(run)]
    decisions = [one for one in everything if begin <= one.time <= end]
    with located_damage(Path(RESULT), "what the run was asked to do,"):
        told = [*_frame(result, decisions, places, run.complete), *_of_result(result)]
        top = float(result["config"]["mission"]["robot"]["max_v"])
    whole = begin <= 0.0 and math.isinf(end)
    shorter = 1.0 if whole else _CLOSER
    episodes = list(_episodes(decisions, top, shorter, places)) if decisions else []
    if decisions and not run.complete:
        last, text = decisions[-1].time, "here the recording ends, before its run did"
        told.append(StoryLine(last, last, "cut", text))
    told = [line for line in told if begin <= line.time <= end]
    episodes.sort(key=lambda one: (EPISODES.index(one.kind) > 4, one.time - one.until))
    told += episodes[: max(0, lines - len(told))]
    passed = [line for line in _passed(everything, places) if begin <= line.time <= end]
    told += passed[:: math.ceil(len(passed) / max(1, lines - len(told)))] if passed else []
    if decisions and not any(line.kind != "end" for line in told):
        leader = Counter(one.said["leader"] for one in decisions).most_common(1)[0][0]
        speed = fmean(one.speed for one in decisions)
        text = f"drove on at {speed:.2f} m/s, led by {leader}"
        told.append(StoryLine(decisions[0].time, decisions[-1].time, "drove", text))
    return sorted(told[:lines], key=lambda line: (line.time, line.kind == "end"))


def story_of(
    folder: Path, begin: float = 0.0, end: float = math.inf
) -> tuple[str, list[StoryLine]]:
    """Return ``headline`` and ``read_story`` of the run in ``folder``.

    Raises:
        InputError: there is no recording or it is damaged; nothing of it is from ``begin`` to
            ``end`` [s].

    """
    run, result = open_run(folder), read_result(folder)
    last = float(result.get("sim_time_s", math.inf))
    if not 0.0 <= begin < min(end, last + 1e-9):
        raise InputError(
            f"expected a part of the run's {last:.1f} s, with --from before --to; got {begin:g} s"
            + ("" if math.isinf(end) else f" to {end:g} s"),
            file=folder,
            key="--from",
        )
    places = {}
    if is_file(folder / MAP):
        topo_map = load_map(folder / MAP, check_landmark_kind)
        places = {name: (place.x, place.y) for name, place in topo_map.places.items()}
    return headline(result), read_story(run, result, places, begin, end)


def headline(result: Mapping[str, Any]) -> str:
    """Say in a sentence how the run ended, why it failed, and which plugins failed."""
    after = f" after {result['sim_time_s']:.1f} s" if "sim_time_s" in result else ""
    why = "; ".join([why_so(result), *result.get("objections", ())])
    return f"{result['outcome']}{after}{'' if why.startswith('because ') else ':'} {why}"


def why_so(result: Mapping[str, Any]) -> str:
    """Say why the run ended: the cause if it failed, and the reason."""
    reason, cause = str(result.get("reason", "")), result.get("cause")
    if not cause:
        return reason
    seen = result.get("cause_seen") or str(cause).replace("_", " ")
    return f"because {seen}: {reason}"


# --- reading -------------------------------------------------------------------------------------


def _decisions(run: RecordedRun) -> Iterator[_Decision]:
    """Yield the recorded decisions. The rules of one stand beside it, or are those before it."""
    x = y = math.nan
    rules: Mapping[str, Any] = {}
    speed = 0.0
    waiting: _Decision | None = None
    for message in run.messages(topics.POSE, topics.COMMAND, topics.RULES, topics.TWIST):
        content = message.content
        if message.topic == topics.TWIST:
            speed = float(content.twist.linear.x)
        elif message.topic == topics.POSE:
            x, y = content.pose.position.x, content.pose.position.y
        elif message.topic == topics.RULES:
            rules = content
            if waiting is not None:
                yield _Decision(*(waiting.time, x, y), waiting.said, rules, speed)
                waiting = None
        else:
            if waiting is not None:
                yield waiting
            waiting = _Decision(message.time, x, y, content, rules, speed)
    if waiting is not None:
        yield waiting


# --- episodes ------------------------------------------------------------------------------------


def _episodes(
    decisions: Sequence[_Decision],
    top: float,
    shorter: float,
    places: Mapping[str, tuple[float, float]],
) -> Iterator[StoryLine]:
    """Yield the episodes of all kinds; slow ones where no other is."""
    kinds = [one.kind for one in decisions]
    slow = [
        kind or ("slow" if max(one.said["v"], one.speed) < _SLOW * top and one.bounded else "")
        for kind, one in zip(kinds, decisions, strict=True)
    ]
    times = np.array([one.time for one in decisions])
    for wanted, shortest in _MIN_DURATION.items():
        for first, last in spans(times, np.array([kind == wanted for kind in slow]), _PAUSE):
            part = decisions[first : last + 1]
            took = part[-1].time - part[0].time + 0.1
            turned = abs(sum(one.said["w"] for one in part)) * 0.1
            if took >= shortest * shorter and (wanted != "aside" or turned >= _TURNED_ASIDE):
                place = _where(part[0], places)
                text = f"{place}: {_sentence(wanted, part, took)}"
                yield StoryLine(part[0].time, part[-1].time, wanted, text)


def _sentence(kind: str, part: Sequence[_Decision], took: float) -> str:
    """What the robot did in an episode, and why."""
    turn = math.degrees(0.1 * sum(one.said["w"] for one in part))
    side = "left" if turn > 0.0 else "right"
    if kind == "lost":
        return f"it did not know where it was for {took:.1f} s"
    if kind == "held":
        return f"held for {took:.1f} s: {_most(one.said['held'] for one in part)}"
    if kind == "slow":
        least = min(max(one.said["v"], 0.0) for one in part)
        return f"slowed to {least:.2f} m/s for {took:.1f} s; {_reason(part, slower=True)}"
    what = {
        "gave way": f"gave way for {took:.1f} s",
        "backed": f"backed away for {took:.1f} s",
        "stood": f"stood for {took:.1f} s",
        "turned": f"turned {side} on the spot by {abs(turn):.0f} degrees",
        "aside": f"turned aside to the {side} by {abs(turn):.0f} degrees",
    }
    return f"{what[kind]}; {_reason(part)}"


def _reason(part: Sequence[_Decision], *, slower: bool = False) -> str:
    """Return the behaviour that led, its strongest rule, the strength of that, and its inputs.

    ``slower`` asks for what kept the robot below its top speed instead, where that is recorded.
    """
    said = _most(one.said.get("slower", "") for one in part) if slower else ""
    name, _, rule = said.partition(": ")
    name = name or _most(one.said["leader"] for one in part)
    best: Mapping[str, Any] = {"strength": 0.0, "rule": rule}
    for one in part:
        for fired in one.rules.get("behaviors", {}).get(name, {}).get("rules", ()):
            says = not asks_for_nothing(fired["rule"]) and (not said or fired["rule"] == rule)
            if says and fired["strength"] > best["strength"]:
                best = fired
    if not best["rule"]:
        reason = _most(one.said["reason"] for one in part if one.said["leader"] == name)
        return f"{name}: {reason}" if reason else name
    strength = f" ({best['strength']:.2f})" if best["strength"] else ""
    return f"{name}: {with_inputs(best)}{strength}"


def _most(words: Any) -> str:
    """Return the most frequent word."""
    counted = Counter(word for word in words if word)
    return str(counted.most_common(1)[0][0]) if counted else ""


def _passed(
    decisions: Sequence[_Decision], places: Mapping[str, tuple[float, float]]
) -> Iterator[StoryLine]:
    """Yield the places at which the robot was on its way."""
    before = ""
    for one in decisions[:-1]:
        name, away = _nearest(one, places)
        if name != before and away <= _AT:
            if before:
                yield StoryLine(one.time, one.time, "passed", f"passed {name}")
            before = name


def _nearest(one: _Decision, places: Mapping[str, tuple[float, float]]) -> tuple[str, float]:
    """Return the place nearest to the robot, and its distance [m]; infinite without any."""
    if not places or math.isnan(one.x):
        return "", math.inf
    away, name = min((math.dist((one.x, one.y), at), name) for name, at in places.items())
    return name, away


def _where(one: _Decision, places: Mapping[str, tuple[float, float]]) -> str:
    """Where the robot believed to be: at or near a place, or at x, y."""
    name, away = _nearest(one, places)
    point = "somewhere" if math.isnan(one.x) else f"({one.x:.1f}, {one.y:.1f})"
    if away > _NEAR:
        return point
    return f"{'at' if away <= _AT else 'near'} {name} {point}"


# --- what the result says ------------------------------------------------------------------------


def _frame(
    result: Mapping[str, Any],
    decisions: Sequence[_Decision],
    places: Mapping[str, tuple[float, float]],
    complete: bool,
) -> Iterator[StoryLine]:
    """What was wanted, and how it ended, with the place if the recording is ``complete``."""
    mission = result["config"]["mission"]
    goals = [str(goal["place"] or f"({goal['x']:g}, {goal['y']:g})") for goal in mission["goals"]]
    more = [f"{len(goals) - _GOALS} more"] if len(goals) > _GOALS else []
    wanted = " then ".join([*goals[:_GOALS], *more]) if goals else "to observe all reachable floor"
    start = _where(decisions[0], places) if decisions else "nowhere"
    known = "" if mission.get("start_known", True) else ", a start that it did not know"
    yield StoryLine(0.0, 0.0, "start", f"{start}{known}: wanted {wanted}")
    end = float(result.get("sim_time_s", decisions[-1].time if decisions else 0.0))
    place = f"{_where(decisions[-1], places)}: " if decisions and complete else ""
    why = f", {result['reason']}" if result.get("reason") else ""
    yield StoryLine(end, end, "end", f"{place}{result.get('outcome', 'the end')}{why}")


def _of_result(result: Mapping[str, Any]) -> Iterator[StoryLine]:
    """Contacts, the mission's events, and changes of the building."""
    for contact in result.get("contacts", ()):
        time, x, y = (float(contact[name]) for name in ("time", "x", "y"))
        text = f"({x:.1f}, {y:.1f}): touched {contact['body']}"
        yield StoryLine(time, time, "contact", text, (x, y))
    for event in result.get("events", ()):
        what = ", ".join(f"{key} {_plain(value)}" for key, value in event["event"].items())
        ended = event.get("ended_s") or event["began_s"]
        yield StoryLine(event["began_s"], ended, "event", f"the mission's event: {what}")
    for change in result.get("map_changes", ()):
        if change.get("time") is not None:
            at = f"({change['x']:.1f}, {change['y']:.1f})"
            text = f"{at}: found {change['what']} {change['kind']} {change['detail']}".rstrip()
            sure = f", {change['certainty']:.0%} certain"
            yield StoryLine(change["time"], change["time"], "changed", text + sure)


def _plain(value: Any) -> str:
    """Return a value of an event as words."""
    if isinstance(value, Mapping):
        return " ".join(f"{key} {_plain(one)}" for key, one in value.items())
    return str(value)
