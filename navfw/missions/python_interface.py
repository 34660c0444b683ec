"""Missions from Python: ``navfw.run`` drives one, ``navfw.open_session`` steps through one.

>>> import navfw                                                             # doctest: +SKIP
>>> result = navfw.run("office", "lobby-to-lab", seed=3)                     # doctest: +SKIP
>>> result.outcome, result.metrics.min_clearance_m                           # doctest: +SKIP
>>> with navfw.open_session("office", "lobby-to-lab") as session:            # doctest: +SKIP
...     for tick in session:
...         print(tick.time, tick.command, tick.true_pose)
"""

from __future__ import annotations

from pathlib import Path

from navfw.config.overrides import Settings
from navfw.missions.session import MissionResult, prepare
from navfw.missions.stepped_session import SteppedSession


def run(
    world: str | Path,
    mission: str | Path,
    *,
    seed: int = 0,
    stack: str | Path | None = None,
    set: Settings = (),  # noqa: A002 - as on the command line
    record: bool = False,
) -> MissionResult:
    """Drive a mission to its end, as ``navfw run`` does; nothing is written.

    Without ``stack`` the mission's own drives, else ``floor_plan`` if the map has a floor plan,
    else ``default``. ``set`` changes values, by texts as for ``--set`` or by a mapping such as
    ``{"avoid.latency": 0.5}``. With ``record`` the result has a recording, for
    ``navfw.missions.run_report.write_run``.

    Raises:
        InputError: world, mission, stack or ``set`` is wrong, or the stack refuses the mission.
        KeyboardInterrupt: the user has stopped the run.

    """
    session = prepare(world, mission, seed=seed, stack=stack, overrides=set)
    result = session.run(record=record)
    if result.outcome == "cancelled":  # caught by the loop, and meant for the caller as well
        raise KeyboardInterrupt
    return result


def open_session(
    world: str | Path,
    mission: str | Path,
    *,
    seed: int = 0,
    stack: str | Path | None = None,
    set: Settings = (),  # noqa: A002 - as on the command line
) -> SteppedSession:
    """The same mission, to be stepped tick by tick: a context manager, and an iterator.

    Raises:
        InputError: world, mission, stack or ``set`` is wrong.

    """
    return SteppedSession(prepare(world, mission, seed=seed, stack=stack, overrides=set))
