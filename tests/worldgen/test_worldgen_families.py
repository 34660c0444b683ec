"""Every family: worlds are reproducible, traversable, and have the specified properties."""

from __future__ import annotations

import hashlib
import math
import subprocess
import sys
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from navfw.errors import InputError, UnknownNameError
from navfw.missions import load_mission
from navfw.robot import RobotModel
from navfw.signals import Pose
from navfw.sim import (
    STOCK,
    SceneGeometry,
    Simulation,
    WalkerSpec,
    gap_between,
    load_world,
    solids_of,
)
from navfw.topomap import load_map, map_text
from navfw.worldgen import FAMILIES, MAP_FILE, GeneratedWorld, WorldDraft, furnish, generate

ROBOT = RobotModel()
CASES = [
    (family, seed, difficulty)
    for family in FAMILIES
    for seed, difficulty in ((0, 0.0), (1, 0.5), (2, 1.0))
]
WITH_MAP = {"rooms", "corridors", "maze"}


@pytest.fixture(scope="module")
def made() -> dict[tuple[str, int, float], GeneratedWorld]:
    """One world for each case, generated once."""
    return {case: generate(*case) for case in CASES}


def start_of(world: GeneratedWorld) -> tuple[float, float]:
    start = world.mission.start
    assert isinstance(start, tuple)
    return start[:2]


def goal_of(world: GeneratedWorld) -> tuple[float, float]:
    goal = world.mission.goals[0]
    if isinstance(goal, str):
        place = world.topo_map.places[goal]
        return place.x, place.y
    return goal.x, goal.y


def connected(
    plan: SceneGeometry, a: tuple[float, float], b: tuple[float, float], wide: float
) -> bool:
    """Whether a disc of radius ``wide`` can move from a to b, by flood fill of the grid."""
    grid = plan.configuration_space(wide, cell=0.03)
    labels = ndimage.label(~grid.occupied)[0]
    first, last = labels[grid.index(*a)], labels[grid.index(*b)]
    return bool(first > 0 and first == last)


@pytest.mark.parametrize("case", CASES, ids=str)
def test_world_is_traversable_in_time(
    made: dict[tuple[str, int, float], GeneratedWorld], case: tuple[str, int, float]
) -> None:
    world = made[case]
    plan = SceneGeometry.from_world(world.world)
    assert connected(plan, start_of(world), goal_of(world), ROBOT.radius + 0.04)
    assert world.shortest >= 5.0
    # a quarter of the top speed suffices
    assert world.mission.timeout > world.shortest / (0.25 * ROBOT.max_v)


DIGESTS = {
    "rooms": "7421601d8a5f",
    "clutter": "b14d47cf1680",
    "corridors": "bd01adbfa879",
    "maze": "644f9f99c547",
    "moving": "227a6ddd4f04",
    "poles": "165474041852",
}
"""Of the worlds, missions and maps of CASES: results name worlds by family and seed alone."""


@pytest.mark.parametrize("family", FAMILIES)
def test_a_seed_gives_the_world_that_it_gave_before(
    made: dict[tuple[str, int, float], GeneratedWorld], family: str
) -> None:
    worlds = [world for case, world in made.items() if case[0] == family]
    texts = [
        world.world.model_dump_json() + world.mission.model_dump_json() + map_text(world.topo_map)
        for world in worlds
    ]
    assert hashlib.sha256("".join(texts).encode()).hexdigest().startswith(DIGESTS[family])


@pytest.mark.parametrize("family", FAMILIES)
def test_same_arguments_same_world(
    made: dict[tuple[str, int, float], GeneratedWorld], family: str
) -> None:
    again, other = generate(family, 1, 0.5), generate(family, 2, 0.5)
    world = made[(family, 1, 0.5)]
    assert again.world == world.world
    assert again.mission == world.mission
    assert list(again.topo_map.places.values()) == list(world.topo_map.places.values())
    assert other.world.model_dump(exclude={"name"}) != world.world.model_dump(exclude={"name"})


@pytest.mark.thorough
def test_same_world_in_a_fresh_process(tmp_path: Path) -> None:
    code = (
        "import sys; from navfw.worldgen import generate; "
        "generate('rooms', 3, 0.7).write(sys.argv[1])"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "a")], check=True)  # noqa: S603
    generate("rooms", 3, 0.7).write(tmp_path / "b")
    for file in ("world.yaml", MAP_FILE, "missions/cross.yaml"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


@pytest.mark.parametrize("case", CASES, ids=str)
def test_files_have_the_same_content(
    made: dict[tuple[str, int, float], GeneratedWorld], case: tuple[str, int, float], tmp_path: Path
) -> None:
    world = made[case]
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


@pytest.mark.parametrize("case", [c for c in CASES if c[0] in WITH_MAP], ids=str)
def test_passages_of_the_map_are_free(
    made: dict[tuple[str, int, float], GeneratedWorld], case: tuple[str, int, float]
) -> None:
    world = made[case]
    plan, topo_map = SceneGeometry.from_world(world.world), world.topo_map
    for passage in topo_map.passages:
        a, b = topo_map.places[passage.a], topo_map.places[passage.b]
        free = plan.clearances(np.linspace((a.x, a.y), (b.x, b.y), 200)).min()
        assert free > ROBOT.radius + 0.05, passage
        assert passage.width <= 2 * free + 0.02, passage
    assert topo_map.part_of("goal") == frozenset(topo_map.places)
    # a place can be reached straight from the start
    start = Pose(*start_of(world), 0.0)
    assert any(
        plan.straight_path_free(np.array([start.x, start.y]), np.array([p.x, p.y]), ROBOT.radius)
        for p in topo_map.places.values()
    )


@settings(max_examples=8)
@given(
    st.sampled_from(sorted(FAMILIES)),
    st.integers(0, 2**63 - 1),
    st.floats(0, 1, allow_nan=False),
)
def test_any_seed_gives_a_traversable_world(family: str, seed: int, difficulty: float) -> None:
    world = generate(family, seed, difficulty)
    plan = SceneGeometry.from_world(world.world)
    assert plan.shortest_path(start_of(world), goal_of(world), ROBOT.radius + 0.04)[0] >= 5.0


# --- properties of each family ----------------------------------------------------------------


def test_rooms(made: dict[tuple[str, int, float], GeneratedWorld]) -> None:
    for (family, _, _), world in made.items():
        if family != "rooms":
            continue
        spec = world.world
        doors = [opening for wall in spec.walls for opening in wall.openings]
        assert 2 <= len(spec.rooms) <= 6
        assert len(doors) >= len(spec.rooms) - 1
        assert all(0.8 <= door.width <= 1.0 for door in doors)
        assert spec.boxes
        rooms = [
            next(
                room.name
                for room in spec.rooms
                if room.x[0] < x < room.x[1] and room.y[0] < y < room.y[1]
            )
            for x, y in (start_of(world), goal_of(world))
        ]
        assert rooms[0] != rooms[1]
        assert {p.name for p in world.topo_map.places.values() if p.kind == "door"} == {
            door.name for door in doors
        }


def test_furniture_along_a_wall_stands_two_centimetres_from_it() -> None:
    draft = WorldDraft.empty(np.random.default_rng(0), 8.0, 6.0)
    furnish(draft, [("hall", (0.0, 8.0), (0.0, 6.0))], 0.3, 0.6)
    gaps = []
    for shape in draft.shapes:
        x0, y0, x1, y1 = shape.bounds
        gaps.append(min(x0, y0, 8.0 - x1, 6.0 - y1))
    along = [gap for gap in gaps if gap < 0.3]
    assert len(along) >= 3
    assert along == pytest.approx([0.02] * len(along), abs=1e-6)
    assert min(gap for gap in gaps if gap >= 0.3) >= 0.6


def test_clutter(made: dict[tuple[str, int, float], GeneratedWorld]) -> None:
    counts = []
    for (family, _, difficulty), world in made.items():
        if family != "clutter":
            continue
        spec = world.world
        assert 8.0 <= spec.x[1] - spec.x[0] <= 12.0
        things = [s for s in solids_of(spec) if s.kind in ("box", "cylinder")]
        gaps = [gap_between(a.shape, b.shape) for a, b in combinations(things, 2)]
        assert min(gaps) >= 1.2 - 0.45 * difficulty - 0.003
        counts.append(len(things))
    assert counts == sorted(counts)
    assert counts[-1] > 1.5 * counts[0]


def test_maze(made: dict[tuple[str, int, float], GeneratedWorld]) -> None:
    for (family, _, _), world in made.items():
        if family != "maze":
            continue
        plan = SceneGeometry.from_world(world.world)
        for place in world.topo_map.places.values():
            cell = 2 * plan.clearance(place.x, place.y) + 0.1
            assert cell > 1.1 - 0.002
            # at a junction only the wall ends at its corners are near
            assert cell < 1.6 + 0.002 or place.kind == "junction"


def test_corridors(made: dict[tuple[str, int, float], GeneratedWorld]) -> None:
    kinds = set()
    for (family, _, _), world in made.items():
        if family != "corridors":
            continue
        plan = SceneGeometry.from_world(world.world)
        for place in world.topo_map.places.values():
            kinds.add(place.kind)
            if place.kind == "corridor":
                assert 2 * plan.clearance(place.x, place.y) <= 2.01
    assert {"junction", "corner", "corridor"} <= kinds


def test_poles(made: dict[tuple[str, int, float], GeneratedWorld]) -> None:
    for (family, _, difficulty), world in made.items():
        if family != "poles":
            continue
        poles = world.world.cylinders
        assert all(0.05 <= pole.radius <= 0.1 for pole in poles)
        # BARN has 30 to 160 poles on 20 m^2 between its rows; this field is a fifth longer
        assert 30 <= len(poles) <= 200
        if difficulty == 1.0:
            assert len(poles) > 90


def test_moving(made: dict[tuple[str, int, float], GeneratedWorld]) -> None:
    movers: list[WalkerSpec] = []
    for (family, _, _), world in made.items():
        if family != "moving":
            continue
        start = np.array(start_of(world))
        assert world.mission.robot.seen_aside > math.radians(90.0)
        for mover in world.world.movers:
            assert 0.2 <= mover.speed <= 0.6
            assert (mover.radius, mover.height) == (0.25, 1.7)
            assert min(np.hypot(*(np.array(point) - start)) for point in mover.path) > 1.2
        movers += world.world.movers
    assert {mover.yields for mover in movers} == {True, False}


@pytest.mark.parametrize("family", FAMILIES)
def test_can_be_simulated_and_rendered(
    made: dict[tuple[str, int, float], GeneratedWorld], family: str
) -> None:
    world = made[(family, 1, 0.5)]
    start = world.mission.start
    assert isinstance(start, tuple)
    with Simulation(world.world, ROBOT, Pose(*start), 0) as sim:
        frame = sim.read().frame
        for _ in range(6):
            sim.advance(1.0 / 60.0)
        assert sim.contacts == ()
    assert frame is not None
    assert frame.image[60:].std() > 15.0  # the floor in front of the robot has texture


@pytest.mark.parametrize(("contrast", "least", "most"), [(0.0, 0.0, 0.7), (6.0, 3.0, 8.0)])
def test_a_given_contrast_is_that_of_every_surface_and_all_else_is_the_same(
    made: dict[tuple[str, int, float], GeneratedWorld], contrast: float, least: float, most: float
) -> None:
    usual, bare = made[("rooms", 1, 0.5)], generate("rooms", 1, 0.5, contrast)
    without = {"textures"}
    assert bare.world.model_dump(exclude=without) == usual.world.model_dump(exclude=without)
    assert bare.mission == usual.mission
    assert {spec.contrast for spec in bare.world.textures.values()} == {contrast}
    assert set(STOCK) | set(usual.world.textures) == set(bare.world.textures)
    start = bare.mission.start
    assert isinstance(start, tuple)
    with Simulation(bare.world, ROBOT, Pose(*start), 0) as sim:
        image, _ = sim.render_from(Pose(*start))
    assert least <= image[-20:, 60:100].std() <= most  # the floor right before the robot


# --- bad input --------------------------------------------------------------------------------


def test_bad_input() -> None:
    with pytest.raises(UnknownNameError, match=r"'poels': did you mean 'poles'\?"):
        generate("poels", 0, 0.5)
    for seed in (-1, 2**63):
        with pytest.raises(InputError, match="seed: expected a seed from 0"):
            generate("poles", seed, 0.5)
    for contrast in (-0.1, 60.1, math.nan):
        with pytest.raises(InputError, match="contrast: expected 0 to 60 grey levels"):
            generate("poles", 0, 0.5, contrast)
    for difficulty in (-0.1, 1.1, math.nan, math.inf):
        with pytest.raises(InputError, match="difficulty: expected 0 to 1"):
            generate("poles", 0, difficulty)


def test_write_overwrites_generated_folders_only(tmp_path: Path) -> None:
    world = generate("moving", 0, 0.0)
    world.write(tmp_path / "a")
    world.write(tmp_path / "a")
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "thesis.txt").write_text("all of it", encoding="utf-8")
    with pytest.raises(InputError, match="not made by navfw"):
        world.write(tmp_path / "b")
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "world.yaml").write_text("name: mine\n", encoding="utf-8")
    with pytest.raises(InputError, match="not made by navfw"):
        world.write(tmp_path / "c")
    with pytest.raises(InputError, match="is a file"):
        world.write(tmp_path / "b" / "thesis.txt")
    # a map of the previous world is removed
    generate("maze", 0, 0.0).write(tmp_path / "a")
    assert (tmp_path / "a" / MAP_FILE).exists()
    world.write(tmp_path / "a")
    assert not (tmp_path / "a" / MAP_FILE).exists()
