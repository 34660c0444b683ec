"""``navfw map learn``: drive a mission and add the detected landmarks to its map."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from navfw.cli.options import Json, Mission, NoiseSeed, Stack, World
from navfw.cli.output import print_json, print_table, quiet_stdout


def learn(
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
        from navfw.missions.landmark_learning_drive import learn_landmarks
        from navfw.missions.session import prepare
        from navfw.process.atomic import output_file
        from navfw.recording.run_folder import plain_json
        from navfw.topomap.map_formats import save_map

        session = prepare(world, mission, seed=seed, stack=stack)
        name = Path(session.stack.topo_map.name).name
        path = out or Path(f"{name}-learnt.yaml")
        output_file(path, "--out")
        drive = learn_landmarks(session, least=least)
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
