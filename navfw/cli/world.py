"""``navfw world``: generates worlds, imports them, and draws them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from navfw.cli.import_world import import_
from navfw.cli.options import Json, World, argument, command_group, numbers_of, option
from navfw.cli.output import print_result, quiet_stdout
from navfw.config.lookup import find, list_missions
from navfw.errors import WorldError, locating
from navfw.process.atomic import atomic_file, output_file

if TYPE_CHECKING:
    from navfw.sim.worldspec import WorldSpec


group = command_group("Generate, import and show worlds.")


@group.command()
def new(
    family: str = argument(..., "Family: see navfw list plugins --kind family."),
    seed: int = option(0, "Seed; the same one gives the same world."),
    difficulty: float = option(0.5, "Difficulty from 0 (easy) to 1."),
    contrast: float | None = option(
        None, "Contrast of every surface [grey levels] [default: each its own]."
    ),
    look: Literal["plain", "photo"] | None = option(
        None, "Surfaces: painted walls with skirting; or like photographs."
    ),
    out: Path | None = option(None, "Folder to write [default: generated/FAMILY-SEED]."),
    json: Json = False,
) -> None:
    """Generate a world from a seed. Drive in it with navfw run FOLDER cross."""
    from navfw.worldgen import generate as make
    from navfw.worldgen.world_draft import MISSION

    with quiet_stdout():
        made = make(family, seed, difficulty, contrast, look)
        folder = made.write(out or Path("generated") / f"{family}-{seed}")
    world = made.world
    data = {
        "folder": str(folder),
        "family": family,
        "seed": seed,
        "difficulty": difficulty,
        "contrast": contrast,
        "look": look,
        "mission": MISSION,
        "map": made.has_map,
        "description": world.description,
        "shortest_path_m": made.shortest,
        "timeout_s": made.mission.timeout,
        "size_m": [world.x[1] - world.x[0], world.y[1] - world.y[0]],
        "boxes": len(world.boxes),
        "cylinders": len(world.cylinders),
        "movers": len(world.movers),
        "attempts": made.attempt + 1,
    }
    way = f"{made.shortest:.1f} m from start to goal; navfw run {folder} {MISSION}"
    print_result(data, (f"{folder}: {world.description}", way), json=json)


group.command("import")(import_)


@group.command()
def show(
    world: World,
    at: str | None = option(
        None, "Draw what the camera sees there instead [m, rad].", metavar="X,Y,YAW"
    ),
    robot: str = option(
        "default", "With --at: name or file of the robot with the camera.", kind="robot"
    ),
    out: Path | None = option(
        None, "PNG file to write [default: WORLD-plan.png, or WORLD-camera.png]."
    ),
    json: Json = False,
) -> None:
    """Draw the floor plan of a world, or with --at what a robot's camera sees in it."""
    pose = numbers_of("--at", at, ("X", "Y", "YAW"))
    file = find("world", world)
    path = out or Path(f"{file.parent.name}-{'plan' if pose is None else 'camera'}.png")
    output_file(path, "--out")
    with quiet_stdout():
        from navfw.sim.worldfile import load_world

        spec = load_world(file)
        if pose is None:
            _draw_plan(path, spec)
        else:
            _draw_view(path, spec, pose, robot)
    width, height = spec.x[1] - spec.x[0], spec.y[1] - spec.y[0]
    missions = [mission.name for mission in list_missions(world)]
    data = {
        "world": spec.name,
        "description": spec.description,
        "size_m": [width, height],
        "rooms": [room.name for room in spec.rooms],
        "missions": missions,
        "at": None if pose is None else list(pose),
        "picture": str(path),
    }
    lines = (
        f"{spec.name}, {width:g} x {height:g} m: {spec.description}",
        f"missions {', '.join(missions) or 'none'}",
        f"picture {path}" + ("" if at is None else f", from {at} by the camera of {robot}"),
    )
    print_result(data, lines, json=json)


def _draw_plan(path: Path, world: WorldSpec) -> None:
    import numpy as np

    from navfw.missions.run_drawing import outline_of
    from navfw.recording.plan_picture import draw_shapes, plan_axes
    from navfw.sim.scene_geometry import SceneGeometry

    x0, y0, x1, y1 = (plan := SceneGeometry.from_world(world)).bounds
    scale = min(16.0 / (x1 - x0), 11.0 / (y1 - y0))
    size = (x1 - x0) * scale + 0.8, (y1 - y0) * scale + 0.8
    frame = (0.4 / size[0], 0.4 / size[1], 1.0 - 0.8 / size[0], 1.0 - 0.8 / size[1])
    figure, axes = plan_axes(size, frame, np.array([x0, y0]), np.array([x1, y1]))
    axes.set_title(world.name)
    draw_shapes(axes, outline_of(plan).shapes(), zorder=1.0)
    for room in world.rooms:
        axes.text(sum(room.x) / 2.0, sum(room.y) / 2.0, room.name, ha="center", color="#3A3A3A")
    with atomic_file(path, parents=True) as part:
        metadata = {"Software": "navfw"}
        figure.savefig(part, dpi=110, format="png", bbox_inches="tight", metadata=metadata)


def _draw_view(path: Path, world: WorldSpec, pose: tuple[float, ...], robot: str) -> None:
    """Write the first frame of ``robot``'s camera at ``pose`` (x, y [m], yaw [rad]) as PNG."""
    import cv2

    from navfw.robot.robotfile import load_robot
    from navfw.signals import Pose
    from navfw.sim.simulation import Simulation

    with locating(key="--robot"):
        model = load_robot(robot)
    with (
        locating(key="--at", only=WorldError),
        Simulation(world, model, Pose(*pose), seed=0) as sim,
    ):
        frame = sim.read().frame
    assert frame is not None  # noqa: S101 - the camera's clock begins with the simulation
    with atomic_file(path, parents=True) as part:
        part.write_bytes(cv2.imencode(".png", frame.image)[1].tobytes())
