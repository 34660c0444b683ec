"""Studies: the search space, trials with a made-up score, the files, and what is refused."""

import csv
import json
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_calls import refusal

from navfw.config import find
from navfw.config.overrides import parse_override
from navfw.errors import InputError, RuleBaseError, UnknownNameError
from navfw.fuzzy import load_rule_base
from navfw.missions.outcome import Cause
from navfw.plugins import default_registry
from navfw.robot import RobotModel
from navfw.stack import load_stack
from navfw.suite import load_suite
from navfw.suite.case import Case
from navfw.suite.run_row import RunRow
from navfw.suite.worker_pool import WorkerFailure

pytest.importorskip("optuna", reason="needs the extra tune: uv sync --extra tune")

from navfw.suite.suite_run import engine_for
from navfw.tune.search_spaces import BreakPoints, search_space
from navfw.tune.stack_study import StackStudy, open_study
from navfw.tune.trials import Objectives, driver

DETUNED = "base: default\nbehaviors:\n  avoid: {spare: 0.9}\n"
OTHER = "entries: [{world: empty, missions: [turn-back]}]\n"
BEST = 0.06
Files = tuple[Path, Path]
"""A suite and a stack."""


@pytest.fixture
def files(tmp_path: Path) -> Files:
    suite, stack = tmp_path / "short.yaml", tmp_path / "detuned.yaml"
    suite.write_text("entries: [{world: empty, missions: [straight]}]\n", encoding="utf-8")
    stack.write_text(DETUNED, encoding="utf-8")
    return suite, stack


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "out"


def planned(files: Files, **changed: Any) -> StackStudy:
    seeds: dict[str, Any] = {"seeds": "0:6", "validate": "100:110"}
    what = {"parameters": ("avoid.spare",), "rules": (), "objectives": ("spl",)}
    suite, stack = load_suite(files[0]), str(files[1])
    return StackStudy.plan(suite, stack, default_registry(), **(seeds | what | changed))


@dataclass
class FakeRuns:
    """Rows whose SPL falls with the distance of avoid.spare from BEST, with noise by seed."""

    driven: list[Case] = field(default_factory=list)
    stop_after: int = 10**9

    def __call__(self, cases: Sequence[Case]) -> Iterator[RunRow]:
        for case in cases:
            if len(self.driven) >= self.stop_after:
                raise KeyboardInterrupt
            self.driven.append(case)
            overrides = map(parse_override, case.overrides)
            settings = {".".join(map(str, o.path)): o.value for o in overrides}
            spare = float(str(settings.get("avoid.spare", 0.9)))
            spl = 1.0 - abs(spare - BEST) - 0.01 * (case.seed % 3)
            yield RunRow(**case.columns, outcome="reached", spl=spl)


def table_of(folder: Path) -> list[dict[str, str]]:
    text = (folder / "trials.csv").read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines()))


def test_variants_are_chosen_from_and_no_trial_begins_after_the_time(
    files: Files, folder: Path
) -> None:
    study = planned(files, parameters=(), variants=("avoid.spare=0.9|0.5|0.06",))
    found = study.run(folder, FakeRuns(), 12)
    assert found["settings"] == {"avoid.spare": BEST}
    assert float(table_of(folder)[0]["avoid.spare"]) == 0.9
    short = folder / "short"
    study.run(short, FakeRuns(), 12, minutes=0.0)
    assert len(table_of(short)) == 1


@pytest.mark.thorough
def test_tuning_brings_a_detuned_parameter_back(files: Files, folder: Path) -> None:
    found = planned(files).run(folder, FakeRuns(), 30)
    tuned = load_stack(folder / "stack.yaml", default_registry())
    spare = tuned.behaviors["avoid"].params.model_dump()["spare"]
    assert spare == pytest.approx(BEST, abs=0.05)
    assert found["settings"] == {"avoid.spare": spare}
    assert found["better"]
    assert found["interval"][0] > 0.7
    # nothing else of the stack has changed
    wanted = load_stack(files[1], default_registry(), [f"avoid.spare={spare}"])
    assert tuned.as_data() == wanted.as_data()
    assert json.loads((folder / "validation.json").read_text(encoding="utf-8")) == found
    assert (folder / "importance.png").read_bytes().startswith(b"\x89PNG")
    rows = table_of(folder)
    assert len(rows) == 30
    assert float(rows[0]["avoid.spare"]) == 0.9, "the first trial is the stack as it is"
    pruned = [row for row in rows if row["state"] == "pruned"]
    assert pruned, "trials that are worse run by run end early"
    assert all(int(row["runs"]) < 6 for row in pruned)


def test_training_and_validation_share_no_run(files: Files, folder: Path) -> None:
    runs = FakeRuns()
    planned(files).run(folder, runs, 3)
    seeds = [case.seed for case in runs.driven]
    assert set(seeds[:-20]) == set(range(6))
    assert seeds[-20:] == 2 * list(range(100, 110))
    with pytest.raises(InputError, match="--validate: 5:9 has seeds of the training, 0:6"):
        planned(files, validate="5:9")


@pytest.mark.thorough
def test_a_study_goes_on_where_it_was(files: Files, folder: Path) -> None:
    study = planned(files)
    with pytest.raises(KeyboardInterrupt):
        study.run(folder, FakeRuns(stop_after=14), 8)
    with pytest.raises(InputError, match="there is a study in it; --resume goes on"):
        study.run(folder, FakeRuns(), 8)
    rest = FakeRuns()
    study.run(folder, rest, 8, resume=True)
    rows = table_of(folder)
    assert len(rows) == len({row["trial"] for row in rows}) == 8
    assert int(rows[0]["runs"]) == 6, "the first trial is kept"
    assert len(rest.driven) - 20 < sum(int(row["runs"]) for row in rows)


@pytest.mark.parametrize(
    ("changed", "what"),
    [
        ({"seeds": "0:7"}, "another seeds: "),
        ({"objectives": ("sct",)}, "another objective: "),
        ({"parameters": ("avoid.weight",)}, "another parameters: "),
        ({"suite": "other.yaml"}, 'another suite: "short", not "other"'),
    ],
)
def test_a_study_of_other_runs_is_refused(
    files: Files, folder: Path, changed: dict[str, Any], what: str
) -> None:
    open_study(folder, planned(files).identity, resume=False, seed=0)
    files[0].with_name("other.yaml").write_text(OTHER, encoding="utf-8")
    files = files[0].with_name(changed.pop("suite", files[0].name)), files[1]
    with pytest.raises(InputError, match=what):
        planned(files, **changed).run(folder, FakeRuns(), 2, resume=True)


def test_a_file_that_is_no_study_is_told(folder: Path) -> None:
    with pytest.raises(InputError, match="there is no study to resume"):
        open_study(folder, {}, resume=True, seed=0)
    folder.mkdir()
    (folder / "study.db").write_bytes(b"not a database" * 100)
    with pytest.raises(InputError, match=r"study\.db: expected a study of navfw tune: "):
        open_study(folder, {}, resume=True, seed=0)


@pytest.mark.parametrize(
    ("changed", "error", "message"),
    [
        ({"parameters": ("avoid.spar",)}, UnknownNameError, "parameter of avoid 'spar'.*'spare'"),
        ({"parameters": ("avid",)}, UnknownNameError, "--param: unknown plugin.*'avoid'"),
        ({"parameters": ("avoid.terms",)}, InputError, "no number with both bounds.*avoid.spare"),
        ({"rules": ("avoid.reserv",)}, UnknownNameError, "input of avoid 'reserv'.*'reserve'"),
        ({"rules": ("papfis",)}, InputError, "--rules: papfis has no rule base"),
        ({"variants": ("avoid.spare=0.5",)}, InputError, "expected PATH=A|B with two values"),
        ({"variants": ("avoid.spar=0.5|0.6",)}, InputError, "unknown key; did you mean 'spare'"),
        ({"objectives": ("spk",)}, UnknownNameError, "--objective: unknown objective 'spk'"),
        ({"objectives": ("spl=-1",)}, InputError, "a positive weight, got 'spl=-1'"),
    ],
)
def test_mistakes_are_told_before_the_first_trial(
    files: Files, changed: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        planned(files, **changed)


def test_without_optuna_the_remedy_is_told(files: Files, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in list(sys.modules):
        if name.partition(".")[0] == "optuna" or name.startswith("navfw.tune"):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "optuna", None)
    words = ("tune", files[0], "--stack", files[1], "--trials", 1)
    assert "uv sync --extra tune" in refusal(*words)


def all_break_points() -> list[BreakPoints]:
    config = load_stack(find("stack", "default"), default_registry())
    space = search_space(config, (), ("avoid", "go_to_xy", "travel", "escape"), RobotModel())
    return [part for part in space.coordinates if isinstance(part, BreakPoints)]


def test_break_points_keep_their_order_their_meetings_and_the_cover() -> None:
    rng = np.random.default_rng(0)
    parts = all_break_points()
    assert len(parts) > 8
    covered = 0
    for part in parts:
        shapes = {name: list(shape.corners) for name, shape in part.variable.terms.items()}
        same = part.moved([1.0] * (len(part.points) + 1))
        assert same.keys() == shapes.keys()
        assert all(same[name] == pytest.approx(shapes[name]) for name in same)
        try:
            moved = part.moved(np.exp(rng.uniform(-0.69, 0.69, len(part.points) + 1)).tolist())
        except RuleBaseError:
            continue
        covered += 1
        assert moved != same
        for name, corners in moved.items():
            assert all(a <= b for a, b in pairwise(corners))
            met = [a == b for a, b in pairwise(shapes[name])]
            assert [a == b for a, b in pairwise(corners)] == met
        load_rule_base(str(part.base.file), {part.variable.name: moved})
    assert covered > 0.8 * len(parts)


def test_a_tuned_rule_base_is_a_setting_of_the_stack(files: Files, folder: Path) -> None:
    study = planned(files, parameters=(), rules=("travel.idle",))
    study.run(folder, FakeRuns(), 3)
    tuned = load_stack(folder / "stack.yaml", default_registry()).stages["composite"]
    corners = tuned.params.model_dump()["terms"]["idle"]
    assert corners["progressing"][2] == corners["stuck"][0]
    assert tuned.plugin(RobotModel(), tuned.params)
    wrong = tuned.plugin.Params.model_validate({"terms": {"idle": {"stuk": [0, 1, 2, 3]}}})
    with pytest.raises(RuleBaseError, match="no term of idle called 'stuk': did you mean 'stuck'"):
        tuned.plugin(RobotModel(), wrong)


@dataclass
class FakeEngine:
    """Answers jobs in reverse order; the first run of ``dies`` dies, of ``late`` takes too long."""

    dies: int = -1
    late: int = -1
    batches: list[list[int]] = field(default_factory=list)
    capacity: int = 2

    def run(self, cases: Iterable[Case]) -> Iterator[tuple[Case, RunRow | WorkerFailure]]:
        given = list(cases)
        seeds = [case.seed for case in given]
        first = not any(self.dies in batch for batch in self.batches)
        self.batches += [seeds] if seeds else []
        for case in reversed(given):
            row = RunRow(**case.columns, outcome="reached")
            if case.seed == self.dies and first:
                yield case, WorkerFailure("died")
            elif case.seed == self.late:
                yield case, WorkerFailure("too long", Cause.TOO_LONG)
            else:
                yield case, row


def test_runs_come_in_order_a_batch_at_a_time(files: Files) -> None:
    cases, engine = planned(files, seeds="0:5").training, FakeEngine(dies=1, late=3)
    rows = driver(engine)(cases)
    assert next(rows).seed == 0
    assert engine.batches == [[0, 1], [1]], "a run that died is driven again before the next ones"
    rest = list(rows)
    assert [row.seed for row in rest] == [1, 2, 3, 4]
    assert [row.outcome for row in rest] == ["reached", "reached", "fault", "reached"]
    assert engine.batches[2:] == [[2, 3], [4]], "a run that took too long is not driven again"


def test_scores_are_weighed_means() -> None:
    row = RunRow(entry="e", world="w", mission="m", seed=0, stack="s", outcome="reached", spl=0.5)
    assert Objectives.parse(["success=3", "spl"]).score(row) == pytest.approx(0.875)
    assert Objectives.parse(["clearance", "sct"]).score(row) == 0.0


@pytest.mark.slow
def test_tuning_by_real_runs_brings_the_speed_back(files: Files, folder: Path) -> None:
    study = planned(files, seeds="0:2", validate="10:12", objectives=("sct",))
    with engine_for((), None, 2, 300.0, 2000.0) as engine:
        result = study.run(folder, driver(engine), 8)
    assert result["score_after"] > result["score_before"]
    assert result["settings"]["avoid.spare"] < 0.9
