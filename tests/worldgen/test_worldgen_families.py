"""Every family: worlds are reproducible, traversable, and have the specified properties."""

import hashlib
import math
from functools import cache
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from cli_calls import put_files
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from sim_worlds import drive

from navfw.errors import InputError, UnknownNameError
from navfw.missions.missionfile import load_mission
from navfw.robot import RobotModel
from navfw.signals import Pose
from navfw.sim import SceneGeometry, Simulation, load_world
from navfw.sim.shapes import gap_between
from navfw.sim.solids import solids_of
from navfw.sim.textures import STOCK
from navfw.sim.worldspec import Look, WalkerSpec
from navfw.suite.suitefile import EntrySpec
from navfw.topomap import load_map
from navfw.worldgen import generate
from navfw.worldgen.generation import FAMILIES, GeneratedWorld
from navfw.worldgen.looks import LOOKS
from navfw.worldgen.rooms import furnish
from navfw.worldgen.world_draft import MAP_FILE, WorldDraft

Case = tuple[str, int, float]
Point = tuple[float, float]

ROBOT = RobotModel()
CASES = [(family, seed, 0.5 * seed) for family in FAMILIES for seed in range(3)]
WITH_MAP = {"rooms", "corridors", "maze", "hard"}


made = cache(generate)


def of_family(name: str) -> list[tuple[float, GeneratedWorld]]:
    """The worlds of a family with their difficulties."""
    return [(case[2], made(*case)) for case in CASES if case[0] == name]


def pose_of(world: GeneratedWorld) -> Pose:
    start = world.mission.start
    assert isinstance(start, tuple)
    return Pose(*start)


def start_of(world: GeneratedWorld) -> Point:
    return pose_of(world).x, pose_of(world).y


def goal_of(world: GeneratedWorld) -> Point:
    goal = world.mission.goals[0]
    place = world.topo_map.places[goal] if isinstance(goal, str) else goal
    return place.x, place.y


def connected(plan: SceneGeometry, a: Point, b: Point, wide: float) -> bool:
    """Whether a disc of radius ``wide`` can move from a to b, by flood fill of the grid."""
    grid = plan.configuration_space(wide, cell=0.03)
    labels = ndimage.label(~grid.occupied)[0]
    steps = [(np.array(end) - grid.origin) // grid.cell for end in (a, b)]
    first, last = (labels[int(row), int(column)] for column, row in steps)
    return bool(first > 0 and first == last)


@pytest.mark.parametrize("case", CASES, ids=str)
def test_world_is_traversable_in_time(case: Case) -> None:
    world = made(*case)
    plan = SceneGeometry.from_world(world.world)
    assert connected(plan, start_of(world), goal_of(world), ROBOT.radius + 0.04)
    assert world.shortest >= 5.0
    # a quarter of the top speed suffices
    assert world.mission.timeout > world.shortest / (0.25 * ROBOT.max_v)


DIGESTS = {
    "rooms": "5f7254f1f034",
    "clutter": "eae512b59465",
    "corridors": "b41df6282cca",
    "maze": "6b87709aeba5",
    "moving": "0f4d793e6929",
    "poles": "d36661fb6074",
    "hard": "0c35f74fa5a3",
    "plain": "edd6eca23d59",
    "photo": "a93120086384",
}
"""Of written files: results are those of worlds by their seeds. Renewed if a family changes."""


def digest_of(*folders: Path) -> str:
    files = [file for folder in folders for file in sorted(folder.rglob("*.yaml"))]
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:12]


@pytest.mark.parametrize("family", FAMILIES)
def test_worlds_are_those_of_their_seeds(family: str, tmp_path: Path) -> None:
    worlds = of_family(family)
    folders = [world.write(tmp_path / f"{difficulty}") for difficulty, world in worlds]
    assert digest_of(*folders) == DIGESTS[family]


@pytest.mark.parametrize("case", CASES, ids=str)
def test_files_have_the_same_content(case: Case, tmp_path: Path) -> None:
    world = made(*case)
    folder = world.write(tmp_path / "made")
    assert load_world(folder / "world.yaml") == world.world
    mission = load_mission(folder / "missions" / "cross.yaml")
    assert mission.spec == world.mission
    plan = SceneGeometry.from_world(world.world)
    assert mission.check(plan) == pytest.approx(world.shortest)
    assert mission.topo_map.places == world.topo_map.places
    assert (folder / MAP_FILE).exists() == world.has_map == (case[0] in WITH_MAP)
    if world.has_map:
        assert len(load_map(folder / MAP_FILE).passages) == len(world.topo_map.passages)


@pytest.mark.parametrize("case", [c for c in CASES if c[0] in WITH_MAP - {"hard"}], ids=str)
def test_passages_of_the_map_are_free(case: Case) -> None:
    world = made(*case)
    plan, topo_map = SceneGeometry.from_world(world.world), world.topo_map
    for passage in topo_map.passages:
        a, b = topo_map.places[passage.a], topo_map.places[passage.b]
        free = plan.clearances(np.linspace((a.x, a.y), (b.x, b.y), 200)).min()
        assert free > ROBOT.radius + 0.05, passage
        assert passage.width <= 2 * free + 0.02, passage
    assert topo_map.part_of("goal") == frozenset(topo_map.places)
    # a place can be reached straight from the start
    start = np.array(start_of(world))
    assert any(
        plan.straight_path_free(start, np.array([p.x, p.y]), ROBOT.radius)
        for p in topo_map.places.values()
    )


@settings(max_examples=8)
@given(
    st.sampled_from(sorted(FAMILIES)), st.integers(0, 2**63 - 1), st.floats(0, 1, allow_nan=False)
)
def test_any_seed_gives_a_traversable_world(family: str, seed: int, difficulty: float) -> None:
    world = generate(family, seed, difficulty)
    plan = SceneGeometry.from_world(world.world)
    assert plan.shortest_path(start_of(world), goal_of(world), ROBOT.radius + 0.04)[0] >= 5.0


def test_rooms() -> None:
    for _, world in of_family("rooms"):
        spec = world.world
        doors = [opening for wall in spec.walls for opening in wall.openings]
        assert 2 <= len(spec.rooms) <= 6
        assert len(doors) >= len(spec.rooms) - 1
        assert all(0.8 <= door.width <= 1.0 for door in doors)
        assert spec.boxes
        ends = start_of(world), goal_of(world)
        rooms = [
            room.name
            for x, y in ends
            for room in spec.rooms
            if room.x[0] < x < room.x[1] and room.y[0] < y < room.y[1]
        ]
        assert len(set(rooms)) == len(rooms) == 2
        places = world.topo_map.places.values()
        assert {p.name for p in places if p.kind == "door"} == {door.name for door in doors}


def test_furniture_along_a_wall_stands_two_centimetres_from_it() -> None:
    draft = WorldDraft.empty(np.random.default_rng(0), 8.0, 6.0)
    furnish(draft, [("hall", (0.0, 8.0), (0.0, 6.0))], 0.3, 0.6)
    bounds = [shape.bounds for shape in draft.shapes]
    gaps = [min(x0, y0, 8.0 - x1, 6.0 - y1) for x0, y0, x1, y1 in bounds]
    along = [gap for gap in gaps if gap < 0.3]
    assert len(along) >= 3
    assert along == pytest.approx([0.02] * len(along), abs=1e-6)
    assert min(gap for gap in gaps if gap >= 0.3) >= 0.6


def test_clutter() -> None:
    counts = []
    for difficulty, world in of_family("clutter"):
        spec = world.world
        assert 8.0 <= spec.x[1] - spec.x[0] <= 12.0
        things = [s for s in solids_of(spec) if s.kind in ("box", "cylinder")]
        gaps = [gap_between(a.shape, b.shape) for a, b in combinations(things, 2)]
        assert min(gaps) >= 1.2 - 0.45 * difficulty - 0.003
        counts.append(len(things))
    assert counts == sorted(counts)
    assert counts[-1] > 1.5 * counts[0]


def test_maze() -> None:
    for _, world in of_family("maze"):
        plan = SceneGeometry.from_world(world.world)
        for place in world.topo_map.places.values():
            cell = 2 * plan.clearance(place.x, place.y) + 0.1
            assert cell > 1.1 - 0.002
            # at a junction only the wall ends at its corners are near
            assert cell < 1.6 + 0.002 or place.kind == "junction"


def test_corridors() -> None:
    kinds = set()
    for _, world in of_family("corridors"):
        plan = SceneGeometry.from_world(world.world)
        for place in world.topo_map.places.values():
            kinds.add(place.kind)
            if place.kind == "corridor":
                assert 2 * plan.clearance(place.x, place.y) <= 2.01
    assert {"junction", "corner", "corridor"} <= kinds


def test_poles() -> None:
    for difficulty, world in of_family("poles"):
        poles = world.world.cylinders
        assert all(0.05 <= pole.radius <= 0.1 for pole in poles)
        # BARN has 30 to 160 poles on 20 m^2 between its rows; this field is a fifth longer
        assert 30 <= len(poles) <= 200
        if difficulty == 1.0:
            assert len(poles) > 90


def test_moving() -> None:
    movers: list[WalkerSpec] = []
    for _, world in of_family("moving"):
        start = np.array(start_of(world))
        assert world.mission.robot.seen_aside > math.radians(90.0)
        for mover in world.world.movers:
            assert 0.2 <= mover.speed <= 0.6
            assert (mover.radius, mover.height) == (0.25, 1.7)
            assert min(np.hypot(*(np.array(point) - start)) for point in mover.path) > 1.2
        movers += world.world.movers
    assert {mover.yields for mover in movers} == {True, False}


@pytest.mark.parametrize("family", FAMILIES)
def test_can_be_simulated_and_rendered(family: str) -> None:
    world = made(family, 1, 0.5)
    with Simulation(world.world, ROBOT, pose_of(world), 0) as sim:
        frame = sim.read().frame
        drive(sim, 0.1, 0.0, 0.0)
        assert sim.contacts == ()
    assert frame is not None
    assert frame.image[60:].std() > 15.0  # the floor in front of the robot has texture


@pytest.mark.parametrize(("contrast", "least", "most"), [(0.0, 0.0, 0.7), (6.0, 3.0, 8.0)])
def test_a_contrast_is_that_of_all_surfaces_alone(
    contrast: float, least: float, most: float
) -> None:
    usual, bare = made("rooms", 1, 0.5), generate("rooms", 1, 0.5, contrast)
    without = {"textures"}
    assert bare.world.model_dump(exclude=without) == usual.world.model_dump(exclude=without)
    assert bare.mission == usual.mission
    assert {spec.contrast for spec in bare.world.textures.values()} == {contrast}
    assert set(STOCK) | set(usual.world.textures) == set(bare.world.textures)
    with Simulation(bare.world, ROBOT, pose_of(bare), 0) as sim:
        image, _ = sim.render_from(pose_of(bare))
    assert least <= image[-20:, 60:100].std() <= most  # the floor right before the robot


def test_bad_input() -> None:
    with pytest.raises(UnknownNameError, match=r"'poels': did you mean 'poles'\?"):
        generate("poels", 0, 0.5)
    for key, message, values in (
        ("seed", "expected a seed from 0", (-1, 2**63)),
        ("contrast", "expected 0 to 60 grey levels", (-0.1, 60.1, math.nan)),
        ("difficulty", "expected 0 to 1", (-0.1, 1.1, math.nan, math.inf)),
    ):
        for value in values:
            with pytest.raises(InputError, match=f"{key}: {message}"):
                generate("poles", **{"seed": 0, key: value})  # type: ignore[arg-type]
    with pytest.raises(UnknownNameError, match="unknown look 'plane': did you mean 'plain'"):
        generate("rooms", 0, 0.5, look="plane")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="contrast: a look has contrasts of its own"):
        generate("rooms", 0, 0.5, 3.0, "plain")
    with pytest.raises(ValueError, match="look is for a family"):
        EntrySpec(world="office", look="plain")


def test_write_overwrites_generated_folders_only(tmp_path: Path) -> None:
    world = generate("moving", 0, 0.0)
    world.write(tmp_path / "a")
    world.write(tmp_path / "a")
    put_files(tmp_path, {"b/thesis.txt": "all of it", "c/world.yaml": "name: mine\n"})
    for folder in ("b", "c"):
        with pytest.raises(InputError, match="not made by navfw"):
            world.write(tmp_path / folder)
    with pytest.raises(InputError, match="is a file"):
        world.write(tmp_path / "b" / "thesis.txt")
    # a map of the previous world is removed
    generate("maze", 0, 0.0).write(tmp_path / "a")
    assert (tmp_path / "a" / MAP_FILE).exists()
    world.write(tmp_path / "a")
    assert not (tmp_path / "a" / MAP_FILE).exists()


SURFACES = {"textures", "skirting", "door_frames"}


@pytest.mark.parametrize("look", LOOKS)
def test_a_look_changes_surfaces_alone_and_is_the_seeds(look: Look, tmp_path: Path) -> None:
    usual, made = generate("rooms", 3, 0.5), generate("rooms", 3, 0.5, look=look)
    assert made.world.model_dump(exclude=SURFACES) == usual.world.model_dump(exclude=SURFACES)
    assert made.mission == usual.mission
    assert set(usual.world.textures) <= set(made.world.textures)
    assert generate("rooms", 3, 0.5, look=look).world == made.world
    folder = made.write(tmp_path / "made")
    assert load_world(folder / "world.yaml") == made.world
    assert digest_of(folder) == DIGESTS[look]


def test_plain_walls_have_less_contrast_than_noise_and_boards_that_stand_out() -> None:
    for seed in range(4):
        world = generate("corridors", seed, 0.5, look="plain").world
        walls = {world.textures[wall.texture] for wall in world.walls}
        assert all(wall.contrast <= 4.0 for wall in walls)
        assert world.skirting is not None
        board = world.textures[world.skirting.texture]
        assert all(abs(wall.brightness - board.brightness) > 20.0 for wall in walls)
        assert world.door_frames is not None


def test_photo_surfaces_are_materials() -> None:
    world = generate("rooms", 5, 0.5, look="photo").world
    styles = {texture.style for texture in world.textures.values()}
    assert styles <= {"concrete", "brick", "parquet", "rug", "roughcast"}
    assert len(styles) >= 3
    assert world.skirting is None
