"""The family ``hard``: frozen, its hazards listed, and always with a way to the goal."""

import hashlib
from collections import Counter
from pathlib import Path

import networkx as nx
import pytest
from suite_samples import row

from navfw.robot import RobotModel
from navfw.sim import SceneGeometry, WorldSpec, load_world
from navfw.suite import load_suite
from navfw.suite.case import draw_difficulty
from navfw.suite.suite_summary import summarize
from navfw.worldgen import generate
from navfw.worldgen.generation import GeneratedWorld

RADIUS = RobotModel().radius


@pytest.fixture(scope="module")
def made() -> list[GeneratedWorld]:
    """Worlds of the first public seeds, with the difficulties that the suite draws."""
    return [generate("hard", seed, draw_difficulty((0.0, 1.0), seed) or 0.0) for seed in range(20)]


def with_doors_closed(world: GeneratedWorld) -> WorldSpec:
    """The world after all events of its mission."""
    closed = {event.door.name for event in world.mission.events if event.door is not None}
    doors = tuple(
        door.model_copy(update={"state": "closed"}) if door.name in closed else door
        for door in world.world.doors
    )
    return world.world.model_copy(update={"doors": doors})


def test_worlds_are_those_of_navfw_hard_v1(made: list[GeneratedWorld], tmp_path: Path) -> None:
    digest = hashlib.sha256()
    for world in made[:5]:
        assert world.world.description.startswith("navfw-hard-v1: ")
        folder = world.write(tmp_path / world.world.name)
        for file in sorted(folder.rglob("*.yaml")):
            digest.update(file.read_bytes())
    assert digest.hexdigest()[:12] == "22c79e324efc"  # another world is another version


def test_the_goal_can_be_reached_before_and_after_a_door_has_closed(
    made: list[GeneratedWorld],
) -> None:
    for world in made:
        start, goal = world.mission.start, world.topo_map.places["goal"]
        assert isinstance(start, tuple)
        for spec in (world.world, with_doors_closed(world)):
            plan = SceneGeometry.from_world(spec)
            length, _ = plan.shortest_path(start[:2], (goal.x, goal.y), RADIUS + 0.06)
            assert world.mission.timeout > length / 0.125


def test_the_map_has_a_route_beside_the_door_that_closes(made: list[GeneratedWorld]) -> None:
    for world in made:
        graph = world.topo_map.graph
        graph.remove_nodes_from(e.near.place for e in world.mission.events if e.near is not None)
        assert nx.has_path(graph, "start", "goal")


def test_every_hazard_is_in_a_share_of_the_worlds_that_list_it(
    made: list[GeneratedWorld], tmp_path: Path
) -> None:
    counts = Counter(name for world in made for name in world.world.hazards)
    assert len(counts) == 7
    assert all(4 <= count <= 16 for count in counts.values()), counts
    assert load_world(made[0].write(tmp_path / "made") / "world.yaml").hazards
    for world in made:
        hazards, spec = set(world.world.hazards), world.world
        doors = [door for wall in spec.walls for door in wall.openings]
        assert ("narrow doors" in hazards) == (max(door.width for door in doors) < 0.8)
        places = world.topo_map.places
        off = [places[door.name].distance(*door.at) for door in doors]
        assert (min(off) > 0.05) == (max(off) > 0.05) == ("moved doors" in hazards)
        assert bool(world.mission.events) == ("closing door" in hazards)
        assert bool(spec.movers) == ("walkers" in hazards)
        assert not any(walker.yields for walker in spec.movers)
        contrast = max(texture.contrast for texture in spec.textures.values())
        assert (contrast < 15.0) == ("low contrast" in hazards)
        assert (spec.light.diffuse > 0.4) == ("glare" in hazards)


def test_its_suite_has_the_variants_of_ablations_and_a_rocking_body() -> None:
    variants = dict(load_suite("hard").variants)
    assert variants.pop("rocking").robot == "rocking"
    others = {n: v and v.model_copy(update={"package": None}) for n, v in variants.items()}
    assert others == load_suite("ablations").variants
    packages = {variant.package for variant in variants.values() if variant is not None}
    assert packages == {None, "navfw-benchmarks"}


def test_failures_are_counted_by_hazard() -> None:
    rows = [
        row(0, hazards="glare"),
        row(1, "stuck", hazards="glare, walkers"),
        row(2, "collided", hazards="walkers"),
        row(3),
    ]
    by_hazard = summarize(rows)["by_hazard"]
    assert {name: of["reached"] for name, of in by_hazard.items()} == {"glare": 1, "walkers": 0}
    assert by_hazard["walkers"]["causes"] == {"collided: slow": 1, "stuck: slow": 1}
    assert "by_hazard" not in summarize([row(3)])
