"""``navfw rules FILE|BEHAVIOR``: a page to look at rules and edit them."""

from __future__ import annotations

from pathlib import Path

from navfw.cli.options import argument, option
from navfw.cli.output import echo, quiet_stdout


def rules(
    name: str = argument(
        ..., "A file of rules, or a behaviour or composite by name.", metavar="FILE|BEHAVIOR"
    ),
    run: Path | None = option(
        None, "Run folder written by navfw run --record: its moments, and Drive."
    ),
    port: int = option(0, "Port of the page; 0 takes a free one.", min=0, max=65535),
) -> None:
    """Serve a page to look at rules and edit them, to this machine alone, until Ctrl-C."""
    with quiet_stdout():
        from navfw.mofis.rules import BehaviorRules
        from navfw.recording.rules_file import find_rules
        from navfw.recording.rules_run import RulesRun
        from navfw.recording.rules_server import RulesServer
        from navfw.report.report_page import render_page

        file = find_rules(name)
        page = render_page("rules_page.html", title=f"Rules: {file.path.stem}")
        recorded = None if run is None else RulesRun(run, BehaviorRules(file.path))
        server = RulesServer(file, port, page=page, run=recorded)
    echo(f"rules: {server.url}", err=True)
    if server.unsaved:
        echo(f"note: {server.unsaved}", err=True)
    server.stay()
    server.close()
