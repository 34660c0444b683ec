"""``navfw tune``: searches better parameters of a stack on a suite, and validates them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from navfw.cli.options import (
    EngineName,
    Json,
    Limit,
    Memory,
    Scheduler,
    Stack,
    Suite,
    Workers,
    check_engine,
    from_options,
    option,
)
from navfw.cli.output import echo, print_json, quiet_stdout
from navfw.config.extras import require_extra
from navfw.process.atomic import writing
from navfw.process.target_lock import TargetLock

if TYPE_CHECKING:
    from optuna.trial import FrozenTrial


@dataclass(frozen=True, slots=True)
class TuneOptions:
    """Arguments and options of ``navfw tune``."""

    file: Suite
    stack: Stack
    trials: int = option(..., "Total number of trials.", min=1, max=100_000)
    seeds: str = option("0:8", "Training seeds from A to B - 1.", metavar="A:B")
    validate: str = option(
        "1000:1020", "Validation seeds; none of them for training.", metavar="A:B"
    )
    param: list[str] | None = option(
        None, "PLUGIN or PLUGIN.NAME to tune [default: all behaviours]. May be repeated."
    )
    rules: list[str] | None = option(
        None, "PLUGIN or PLUGIN.INPUT whose break points to tune. May be repeated."
    )
    variant: list[str] | None = option(
        None, "Values to choose from. May be repeated.", metavar="PATH=A|B"
    )
    minutes: float = option(math.inf, "Begin no trial after this time [min].", min=0.1)
    objective: list[str] | None = option(
        None,
        "success, spl, sct or clearance [default: success, spl]. May be repeated.",
        metavar="NAME[=WEIGHT]",
    )
    workers: Workers = 1
    limit: Limit = 900.0
    memory: Memory = 2000.0
    engine: EngineName = "processes"
    scheduler: Scheduler = None
    search_seed: int = option(0, "Seed of the search.", min=0)
    out: Path | None = option(None, "Folder of the study [default: runs/tune-SUITE].")
    resume: bool = option(False, "Go on with the study in --out.", "--resume")
    json: Json = False


@from_options
def tune(options: TuneOptions) -> None:
    """Tune parameters and break points of rules on a suite.

    Writes a stack file, and validates it; the stack itself is not changed. Needs the extra tune.
    """
    check_engine(options.engine, options.scheduler)
    with quiet_stdout():
        require_extra("tune", "optuna", key="navfw tune")
        from navfw.plugins import default_registry
        from navfw.suite.suite_run import engine_for
        from navfw.suite.suitefile import load_suite
        from navfw.tune.stack_study import StackStudy
        from navfw.tune.trials import driver

        suite = load_suite(options.file)
        study = StackStudy.plan(
            suite,
            options.stack,
            default_registry(),
            seeds=options.seeds,
            validate=options.validate,
            parameters=tuple(options.param or ()),
            rules=tuple(options.rules or ()),
            objectives=tuple(options.objective or ("success", "spl")),
            variants=tuple(options.variant or ()),
        )
        folder = options.out or Path("runs") / f"tune-{suite.name}"
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
        lock = TargetLock(folder.absolute() / "study")
        engine = options.scheduler, options.workers, options.limit, options.memory
        with lock, engine_for(study.cases, *engine) as runner:
            result = study.run(
                folder,
                driver(runner),
                options.trials,
                seed=options.search_seed,
                resume=options.resume,
                on_trial=_show,
                minutes=options.minutes,
            )
    if options.json:
        print_json(result)
    else:
        _print_validation(result)


def _show(trial: FrozenTrial) -> None:
    runs = trial.user_attrs.get("runs", 0)
    score = "" if trial.value is None else f", score {trial.value:.3f}"
    echo(f"trial {trial.number}: {trial.state.name.lower()} {runs} runs{score}", err=True)


def _print_validation(result: dict[str, Any]) -> None:
    low, high = result["interval"]
    for name in result["before"]:
        echo(f"{name:<10} {result['before'][name]:.3f} -> {result['after'][name]:.3f}")
    echo(
        f"score      {result['score_before']:.3f} -> {result['score_after']:.3f}  (difference"
        f" {result['difference']:+.3f}, 95 % [{low:+.3f}, {high:+.3f}], {result['runs']} runs)"
    )
    verdict = "better" if result["better"] else "not shown to be better"
    if result["importance"]:
        picture = Path(result["stack"]).with_name("importance.png")
        echo(f"what mattered: {picture}")
    echo(f"the best trial, {result['trial']}, is {verdict}; its stack: {result['stack']}")
