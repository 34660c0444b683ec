"""``navfw demo``: five drives, one after the other, on one live page; nothing is written."""

from __future__ import annotations

import time
from functools import partial

import typer

from navfw.cli.options import option
from navfw.cli.output import echo, print_table, quiet_stdout
from navfw.cli.progress_bar import ProgressBar, Quiet
from navfw.cli.run import live_server, show_tick, shown_live
from navfw.cli.warm import compile_with_progress
from navfw.process.interruption import INTERRUPTED

_SPEED = 1.5
"""Largest simulated time per wall time: the five drives of 134 s take 90 s, loading the rest."""

DRIVES = (
    ("paper-room", "into-the-room", "through a door, around a column"),
    ("lounge", "to-the-hall", "furniture of many shapes"),
    ("office", "stairs", "stairs that are not on the map"),
    ("office", "door-closes", "a door that closes in front of the robot"),
    ("office", "workshop-to-office-a", "a corridor, and a room on its other side"),
)
"""World, mission, and what the drive shows."""


def demo(
    port: int = option(8765, "Port of the page; 0 takes a free one.", min=0, max=65535),
    speed: float = option(_SPEED, "Simulated per wall time, at most; 1 is real time."),
    quiet: Quiet = False,
) -> None:
    """Drive five missions in about two minutes, on one live page. Nothing is written.

    Exit with 1 if the robot does not reach a goal.
    """
    rows, server = [], None
    with quiet_stdout():
        from navfw.missions.pilot import watcher_of
        from navfw.missions.session_setup import prepare

        for number, (world, mission, about) in enumerate(DRIVES, 1):
            session = prepare(world, mission)
            compile_with_progress(loaded=True, quiet=quiet)
            if server is None:
                server = live_server(session, port, speed=speed)
            else:
                server.follow(*shown_live(session))
            echo(f"{number} of {len(DRIVES)}: {about} ({world} {mission})", err=True)
            with ProgressBar(quiet=quiet) as bar:
                show = partial(show_tick, bar, session.mission.goals[-1], time.monotonic())
                result = session.run(watcher_of(server.observe), show)
            server.tell_end(f"{result.outcome}: {result.reason}")
            if result.exit_code == INTERRUPTED:
                raise KeyboardInterrupt
            measured = result.path_length_m, result.sim_time_s, result.min_clearance_m
            row = f"{world} {mission}", about, str(result.outcome)
            rows.append((*row, *(f"{value:.2f}" for value in measured), result.command_hash[:8]))
        if server is not None:
            server.close()
    columns = ("mission", "what it shows", "outcome", "path", "time", "clearance", "commands")
    print_table(columns, rows, "nothing was driven")
    echo("path and clearance [m], time [s]")
    echo("next: navfw run office lobby-to-lab --record --out lab; navfw explain lab")
    if any(row[2] != "reached" for row in rows):
        raise typer.Exit(1)
