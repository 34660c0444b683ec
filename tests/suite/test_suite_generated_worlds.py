"""Families of generated worlds, with a generator in the test: one room, one box."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from navfw import worldgen
from navfw.errors import InputError, UnknownNameError, WorldError
from navfw.missions import MissionSpec
from navfw.plugins import default_registry
from navfw.sim import BoxSpec, Look, TextureSpec, WorldSpec
from navfw.suite import Job, SuitePlan, load_suite, plan_runs, run_job
from navfw.topomap import Passage, Place, TopoMap


@dataclass(frozen=True)
class Made:
    world: WorldSpec
    mission: MissionSpec
    topo_map: TopoMap


def fake_generate(
    family: str,
    seed: int,
    difficulty: float,
    contrast: float | None = None,
    look: Look | None = None,
) -> Made:
    """The box moves with the seed and grows with the difficulty; seed 13 is impossible.

    Its texture has the contrast, or is brick in a look.
    """
    if family != "boxes":
        raise UnknownNameError("family of worlds", family, ["boxes"])
    if seed == 13:
        raise WorldError("no way through after 100 tries")
    textures = {} if contrast is None else {"wood": TextureSpec(contrast=contrast)}
    if look is not None:
        textures = {"wood": TextureSpec(style="brick")}
    box = BoxSpec(name="box", at=(0.0, 1.0 + 0.1 * seed), size=(0.2 + difficulty, 0.3, 0.8))
    places = [Place("start", -2.0, 0.0), Place("end", 2.0, 0.0)]
    return Made(
        world=WorldSpec(
            name="boxes",
            x=(-4.0, 4.0),
            y=(-4.0, 4.0),
            boxes=(box,),
            textures=textures,
        ),
        mission=MissionSpec(start=(-2.0, 0.0, 0.0), goals=("end",), timeout=40.0),
        topo_map=TopoMap("boxes", places, [Passage("start", "end", 4.0)]),
    )


@pytest.fixture(autouse=True)
def _generator(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worldgen, "generate", fake_generate)


def planned(folder: Path, entry: str, seeds: range) -> SuitePlan:
    file = folder / "mine.yaml"
    file.write_text(f"entries:\n  - {entry}\n")
    return plan_runs(load_suite(file), seeds, default_registry())


def test_the_seed_determines_the_world_and_overrides_apply_to_the_mission(tmp_path: Path) -> None:
    entry = "{family: boxes, difficulty: [0.1, 0.9], set: {mission.timeout: 7, robot.max_v: 0.3}}"
    plan = planned(tmp_path, entry, range(3, 6))
    assert [case.key[:4] for case in plan.cases] == [
        ("boxes", "boxes-3", "cross", 3),
        ("boxes", "boxes-4", "cross", 4),
        ("boxes", "boxes-5", "cross", 5),
    ]
    sessions = [case.session(default_registry()) for case in plan.cases]
    assert [session.world.boxes[0].at[1] for session in sessions] == pytest.approx([1.3, 1.4, 1.5])
    sizes = [session.world.boxes[0].size[0] for session in sessions]
    assert sizes == pytest.approx([0.2 + (case.difficulty or 0.0) for case in plan.cases])
    assert len(set(sizes)) == 3
    session = sessions[0]
    assert (session.task.timeout, session.task.robot.max_v) == (7.0, 0.3)
    assert [goal.place for goal in session.mission.goals] == ["end"]
    assert session.shortest == pytest.approx(4.0)


def test_rounds_drops_and_unknown_starts_hold_in_generated_worlds(tmp_path: Path) -> None:
    drop = "{name: pit, x: [1.0, 1.5], y: [-3.0, -2.0]}"
    changes = f"mission.rounds: 2, mission.start: unknown, mission.drops: [{drop}]"
    (case,) = planned(tmp_path, f"{{family: boxes, set: {{{changes}}}}}", range(1)).cases
    session = case.session(default_registry())
    assert [goal.place for goal in session.mission.goals] == ["end", "end"]
    assert not session.task.start_known
    assert (session.mission.start.x, session.mission.start.y) == (-2.0, 0.0)
    assert session.mission.start.yaw != 0.0
    assert session.task.drops == {"pit"}


@pytest.mark.parametrize(("given", "contrast"), [("", None), (", contrast: 3", 3.0)])
def test_the_contrast_of_an_entry_is_that_of_its_worlds(
    given: str, contrast: float | None, tmp_path: Path
) -> None:
    (case,) = planned(tmp_path, f"{{family: boxes{given}}}", range(1)).cases
    textures = case.session(default_registry()).world.textures
    assert [spec.contrast for spec in textures.values()] == ([] if contrast is None else [contrast])


def test_the_look_of_an_entry_is_that_of_its_worlds(tmp_path: Path) -> None:
    plan = planned(tmp_path, "{family: boxes, look: photo}", range(1))
    world = plan.cases[0].session(default_registry()).world
    assert world.textures["wood"].style == "brick"


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (
            "{family: boxxes}",
            "mine.yaml:2: entries[0].family: unknown family of worlds 'boxxes': did you",
        ),
        ("{family: boxes, set: {mission.timeout: -1}}", "--set mission.timeout=-1"),
        ("{family: boxes, set: {ovoid.margin: 1}}", "did you mean 'avoid'?"),
        (
            "{family: boxes, set: {mission.goals: [and]}}",
            "entries[0]: --set mission.goals=[\"and\"]: unknown place 'and': did you mean 'end'?",
        ),
        ("{family: boxes, stack: defalt}", "entries[0].stack: unknown stack"),
    ],
)
def test_impossible_entries_are_refused_before_any_run(
    entry: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as caught:
        planned(tmp_path, entry, range(2))
    assert message in str(caught.value)


def test_an_impossible_seed_is_a_fault_of_its_run(tmp_path: Path) -> None:
    plan = planned(tmp_path, "{family: boxes}", range(12, 14))
    row = run_job(Job(plan.cases[1], tmp_path))
    assert (row.seed, row.outcome, row.cause) == (13, "fault", "bad_input")
    assert row.reason == "no way through after 100 tries"


def test_a_generated_run_gives_a_full_row_and_its_picture(tmp_path: Path) -> None:
    failing = "[{at: 1, lasting: 1, behavior: {name: avoid, does: raises}}]"
    entry = f"{{family: boxes, set: {{mission.timeout: 4}}, events: {failing}}}"
    plan = planned(tmp_path, entry, range(1))
    row = run_job(Job(plan.cases[0], tmp_path))
    assert (row.entry, row.family, row.world) == ("boxes", "boxes", "boxes-0")
    assert (row.outcome, row.cause) == ("timeout", "slow")
    assert row.shortest_path_m == pytest.approx(4.0)
    assert len(row.command_hash) == 64
    assert row.plugin_faults == 0, "injected ones do not count"
    assert row.cpu_time_s is not None
    assert row.cpu_time_s > 0.1
    assert row.memory_mb is not None
    assert (tmp_path.parent / row.picture).is_file()


def test_an_exception_in_a_run_is_a_fault_with_its_source_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = planned(tmp_path, "{family: boxes}", range(1))

    def broken(
        family: str, seed: int, difficulty: float, contrast: float | None, look: Look | None
    ) -> Made:
        raise ZeroDivisionError("of the generator")

    monkeypatch.setattr(worldgen, "generate", broken)
    row = run_job(Job(plan.cases[0], tmp_path))
    assert (row.outcome, row.cause) == ("fault", "exception")
    place = "test_suite_generated_worlds.py:"
    assert row.reason.startswith(f"ZeroDivisionError: of the generator ({place}")
    assert "Traceback" in capsys.readouterr().err
