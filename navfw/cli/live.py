"""The live server of ``navfw run --live`` and ``navfw demo``: its content and its address."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from navfw.cli.output import echo

if TYPE_CHECKING:
    from navfw.missions.session import Session
    from navfw.recording.channel_list import SeenRun
    from navfw.recording.live_server import LiveServer


def shown_live(session: Session) -> tuple[SeenRun, str]:
    """Return the content of the live server for a run: what it draws, and its page."""
    from navfw.report import live_page
    from navfw.sim.chase_view import ChaseView

    title = f"{session.world_name} / {session.mission_name}, seed {session.seed}"
    goals = [(goal.x, goal.y) for goal in session.mission.goals]
    chase = ChaseView(session.world, session.mission.spec.robot, (480, 270)).draw
    return replace(session.seen, chase=chase), live_page(title, session.seen, goals)


def live_server(
    session: Session,
    port: int,
    origins: tuple[str, ...] = (),
    *,
    speed: float | None = None,
    wait: bool = False,
) -> LiveServer:
    """Start the live server of a run, and print its address; arguments as of ``LiveServer``."""
    from navfw.recording.live_server import LiveServer

    seen, page = shown_live(session)
    server = LiveServer(seen, port, page=page, origins=origins, speed=speed, wait=wait)
    # printed with --quiet as well: without its token the address is of no use
    waits = " (the run begins with the first viewer)" if wait else ""
    echo(f"live: {server.url}{waits}", err=True)
    if origins:
        address = server.url.replace("http", "ws", 1)
        echo(f"live: {address} for Foxglove and Lichtblick", err=True)
    return server
