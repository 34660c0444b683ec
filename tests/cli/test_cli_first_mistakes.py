"""Mistakes of people who begin: what they typed is named, with what to do."""

import json
from pathlib import Path

import pytest
from cli_calls import invoke, put_file, refusal

import navfw
from navfw.errors import InputError, PluginError
from navfw.plugins import default_registry
from navfw.worldgen import generate

COMPOSITE = """from typing import ClassVar
from navfw import Composite, Context

class Hurry(Composite):
    \"\"\"Hurry: less caution.\"\"\"

    name: ClassVar[str] = "hurry"

    def weigh(self, context: Context) -> dict[str, float]:
        return {"avodi": 0.5}
"""


@pytest.mark.parametrize("seed", [None, 1.5, "1", -1, True, 2**63])
def test_a_seed_that_is_no_whole_number_is_refused(seed: object) -> None:
    wrong = {"seed": seed}
    calls = (
        lambda: navfw.run("empty", "straight", **wrong),  # type: ignore[arg-type]
        lambda: navfw.open_session("empty", "straight", **wrong),  # type: ignore[arg-type]
        lambda: navfw.run_generated("rooms", **wrong),  # type: ignore[arg-type]
        lambda: generate("rooms", **wrong),  # type: ignore[arg-type]
    )
    for call in calls:
        with pytest.raises(InputError, match="seed: expected a seed from 0 to"):
            call()


def test_a_plugin_named_as_a_shipped_one_is_not_left_out_in_silence(project: Path) -> None:
    text = (project / "behaviors" / "cautious.py").read_text(encoding="utf-8")
    put_file(project, "behaviors/avoid.py", text.replace('"cautious"', '"avoid"'))
    said = refusal("run", "den", "next-room")
    assert "behaviors/avoid.py" in said
    assert "the behavior name 'avoid' is already taken" in said
    put_file(project, "behaviors/avoid.py", "def\n")
    with pytest.raises(PluginError, match=r"behaviors/avoid.py.*cannot be imported"):
        default_registry().get("behavior", "avoid")


def test_a_composite_that_weighs_an_unknown_behaviour_is_named(project: Path) -> None:
    put_file(project, "behaviors/hurry.py", COMPOSITE)
    stack = "base: careful\ncomposite: {hurry: }\n"
    put_file(project, "stacks/hasty.yaml", stack)
    named = "weighs 'avodi', which is no behaviour: did you mean 'avoid'?"
    assert named in invoke("check", "behaviors/hurry.py").stdout
    words = ("run", "den", "next-room", "--stack", "hasty", "--set", "mission.timeout=2")
    result = invoke(*words, "--json")
    assert result.exit_code == 1
    assert any(named in fault for fault in json.loads(result.stdout)["faults"])


def test_files_that_end_in_yml_are_found(project: Path) -> None:
    for name in ("robots/mine", "stacks/own", "maps/flat", "worlds/den/missions/back"):
        put_file(project, f"{name}.yml", "description: x\n")
        kind = name.split("/")[-2]
        known = invoke("list", *((kind, "den") if kind == "missions" else (kind,)), "--json")
        assert name.split("/")[-1] in known.stdout, name
    put_file(project, "worlds/attic/world.yml", "description: x\n")
    checked = json.loads(invoke("check", "--json").stdout)
    errors = {row["source"]: row["error"] for row in checked}
    assert errors["robots/mine.yml"] is None
    assert "rename it to world.yaml" in errors["worlds/attic/world.yml"]


def test_the_number_of_seeds_is_given_as_json(folder: Path) -> None:
    put_file(folder, "s.yaml", "entries: [{world: empty, missions: [straight]}]\n")
    result = invoke("suite", "s.yaml", "--seeds", "0:1", "--power", "5%", "--json")
    answer = json.loads(result.stdout)
    assert (answer["success"], answer["difference"], answer["runs"]) == (0.9, 0.05, 0)
    assert [need["seeds"] for need in answer["needs"]] == [
        need["pairs"] for need in answer["needs"]
    ]
    assert (
        f"{answer['needs'][0]['seeds']} seeds: "
        in invoke("suite", "s.yaml", "--seeds", "0:1", "--power", "5%").stdout
    )


def test_what_is_wrong_with_a_mission_is_named_with_its_unit(project: Path) -> None:
    mission = project / "worlds" / "den" / "missions" / "next-room.yaml"
    world = project / "worlds" / "den" / "world.yaml"
    text, walls = mission.read_text(encoding="utf-8"), world.read_text(encoding="utf-8")
    mission.write_text(text.replace("[0.8, 0.8, 0.5]", "[0.8, 0.8, 9.5]"))
    assert "start[2]: expected a number >= -6.28319 and <= 6.28319 [rad], got 9.5" in check(mission)
    mission.write_text(text.replace("map: den", "map: office").replace("[east]", "[lab]"))
    said = check(mission)
    assert "places of the map 'office' lie off the world's floor" in said
    assert "it is the map of another world" in said
    mission.write_text(text)
    world.write_text(walls.replace("width: 0.95", "width: 0.3"))
    assert "no path is 0.36 m wide; too narrow: 'door' (0.3 m)" in check(mission)


def check(file: Path) -> str:
    return invoke("check", file).stdout
