"""``navfw map learn-landmarks`` and ``learn-situations``: what is learnt from drives."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from navfw.cli.options import Json, Mission, NoiseSeed, Stack, World
from navfw.cli.output import print_json, print_table, print_tables, quiet_stdout
from navfw.cli.progress_bar import ProgressBar, Quiet


def learn_landmarks(
    world: World,
    mission: Mission,
    stack: Stack = "default",
    out: Annotated[
        Path | None, typer.Option(help="Map file to write [default: MAP-learnt.yaml].")
    ] = None,
    seed: NoiseSeed = 0,
    least: Annotated[
        int, typer.Option(min=1, max=1000, help="Least number of observations of a landmark.")
    ] = 3,
    json: Json = False,
) -> None:
    """Add detected landmarks to a map. Drives a mission, and writes its map with them."""
    with quiet_stdout():
        from navfw.missions.learning_drives import learn_landmarks as learn
        from navfw.missions.session_setup import prepare
        from navfw.process.atomic import output_file
        from navfw.recording.run_folder import plain_json
        from navfw.topomap.map_formats import save_map

        session = prepare(world, mission, seed=seed, stack=stack)
        name = Path(session.stack.topo_map.name).name
        path = out or Path(f"{name}-learnt.yaml")
        output_file(path, "--out")
        drive = learn(session, least=least)
        save_map(drive.topo_map, path)
        result = plain_json({**drive.as_data(session), "file": str(path)})
    if json:
        print_json(result)
        return
    cells = [
        (
            row["identity"],
            f"{row['x']:.2f}",
            f"{row['y']:.2f}",
            str(row["observations"]),
            f"{row['sigma_m']:.2f}",
            "" if row["error_m"] is None else f"{row['error_m']:.2f}",
        )
        for row in result["landmarks"]
    ]
    print_table(
        ["landmark", "x", "y", "observations", "sigma [m]", "error [m]"], cells, "no landmarks"
    )
    typer.echo(f"{result['reason']}; {path}: {result['learnt']} landmarks learnt")


def learn_situations(
    suite: Annotated[
        str, typer.Argument(metavar="SUITE", help="Name or file of a suite.")
    ] = "situations",
    seeds: Annotated[str, typer.Option(metavar="A:B", help="Seeds from A to B - 1.")] = "7000:7005",
    out: Annotated[Path, typer.Option(help="File to write.")] = Path("situations.yaml"),
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Learn the situations at places. The table says how often OFFIS infers each (METHOD 4.4)."""
    with quiet_stdout():
        from navfw.bench.situation_learning import learn_situations, tables
        from navfw.plugins import default_registry
        from navfw.process.atomic import output_file, write_text
        from navfw.suite.suite_plan import plan_runs
        from navfw.suite.suitefile import load_suite, parse_seeds

        output_file(out, "--out")
        registry = default_registry()
        plan = plan_runs(load_suite(suite), parse_seeds(seeds), registry)
        with ProgressBar("learn", quiet=quiet) as bar:
            learnt = learn_situations(plan, registry, bar.show_part)
        provenance = f"navfw map learn-situations {suite} --seeds {seeds}: {learnt.drives} drives"
        write_text(out, learnt.table.text(provenance), parents=True)
    if json:
        print_json({"file": str(out), **learnt.as_data()})
    else:
        print_tables(tables(learnt))
        typer.echo(f"table: {out}; use it with --set topological.discrete.situations={out}")
