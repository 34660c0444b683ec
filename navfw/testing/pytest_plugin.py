"""Missions as tests: the ``mission`` marker and the ``mission`` fixture.

::

    import pytest

    @pytest.mark.mission(world="office", mission="lobby-to-lab", seeds=[1, 2, 3])
    def test_reaches_the_lab(mission):
        assert mission.outcome == "reached"
        assert mission.metrics.min_clearance_m > 0.05

The marked test runs once for each seed. A failing test shows the outcome, the reason and the path
of the run's picture. Pytest loads this module in every session where navfw is installed, so it
imports other modules only when a mission is driven.
"""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import pytest

if TYPE_CHECKING:
    from navfw.missions.outcome import Outcome
    from navfw.missions.run_metrics import RunMetrics
    from navfw.missions.session import MissionResult
    from navfw.recording.run_log import RunLog
    from navfw.signals import Array

__all__ = ["MissionRun"]

_MARKER = (
    "mission(world, mission, seeds=(0,), stack='default', set=()): drive a mission (or each of a"
    " list of missions) once for each seed and hand the result to the `mission` fixture; `set` are"
    " overrides such as 'offis.layers=1'"
)
_KEYS = ("world", "mission", "seeds", "stack", "set")
_MISSION = "mission"


class MissionRun:
    """The value of the ``mission`` fixture: the result of one mission."""

    def __init__(self, result: MissionResult, folder: Path) -> None:
        self.result = result
        self._folder = folder

    def __repr__(self) -> str:
        session = self.result.session
        name = f"{session.world_name}/{session.mission_name}, seed {session.seed}"
        return f"<{name}: {self.outcome}: {self.reason}>"

    @property
    def outcome(self) -> Outcome:
        """The outcome; equal to its text: ``mission.outcome == "reached"``."""
        return self.result.outcome

    @property
    def reason(self) -> str:
        """The reason of the outcome, one sentence."""
        return self.result.reason

    @property
    def metrics(self) -> RunMetrics:
        """The metrics of the run."""
        return self.result.metrics

    @property
    def log(self) -> RunLog:
        """The log of the run, one row per control tick."""
        return self.result.run.log

    @property
    def path(self) -> Array:
        """(n, 3) true poses x, y [m], yaw [rad] in the map, one per control tick."""
        return self.log.true

    @property
    def commands(self) -> Array:
        """(n, 3) time [s], v [m/s], w [rad/s], one per control tick."""
        return self.log.command_stream

    @property
    def command_hash(self) -> str:
        """The hash of the commands, equal for bit-identical commands."""
        return self.log.command_hash

    @property
    def seed(self) -> int:
        """The seed of the run."""
        return self.result.session.seed

    def save(self) -> Path:
        """Write the run folder, unless it exists; returns its path."""
        from navfw.missions.run_report import write_run
        from navfw.recording.run_folder import RunFolder

        if not self._folder.exists():
            with RunFolder(self._folder) as target:
                write_run(self.result, target)
        return self._folder


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--mission-runs``."""
    parser.getgroup("navfw").addoption(
        "--mission-runs",
        metavar="DIR",
        default=None,
        help="keep the run folders of all missions in DIR [default: only those of failed tests, in"
        " pytest's temporary folder]",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker; trust the project whose tests are run, as they are its code, too."""
    config.addinivalue_line("markers", _MARKER)
    from navfw.config.lookup import project_folder
    from navfw.config.project_code import trusting
    from navfw.errors import InputError

    try:
        project = project_folder(config.rootpath)
    except InputError:  # a damaged pyproject.toml, told when something of it is used
        return
    if project is not None:
        trust = contextlib.ExitStack()
        trust.enter_context(trusting(project))
        config.add_cleanup(trust.close)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Make one test for each mission and seed of the marker."""
    if _MISSION not in metafunc.fixturenames:
        return
    marker = metafunc.definition.get_closest_marker(_MISSION)
    if marker is None:
        return  # the fixture reports it, with the name of the test
    metafunc.parametrize(_MISSION, list(_cases(marker, metafunc.definition.nodeid)), indirect=True)


def _cases(marker: pytest.Mark, where: str) -> Iterator[Any]:
    """A ``pytest.param`` for each run of the marker."""
    wrong = [name for name in marker.kwargs if name not in _KEYS]
    if wrong:
        from navfw.errors import did_you_mean

        _misuse(where, f"unknown argument {wrong[0]!r}: {did_you_mean(wrong[0], _KEYS)}")
    given = {**dict(zip(_KEYS, marker.args, strict=False)), **marker.kwargs}
    missing = [name for name in ("world", "mission") if name not in given]
    if missing:
        _misuse(where, f"missing argument: {' and '.join(missing)}")
    if len(marker.args) > len(_KEYS):
        _misuse(where, f"expected at most {len(_KEYS)} arguments, got {len(marker.args)}")
    missions = _several(given["mission"])
    seeds = list(given.get("seeds", (0,)))
    if not missions or not seeds:
        _misuse(where, "expected at least one mission and one seed")
    for mission in missions:
        for entry in seeds:
            # a seed may have marks: pytest.param(7, marks=pytest.mark.slow)
            param = entry if hasattr(entry, "marks") else pytest.param(entry)
            (seed,) = param.values
            if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
                _misuse(where, f"expected a seed that is a whole number >= 0, got {seed!r}")
            case = {
                "world": str(given["world"]),
                "mission": mission,
                "seed": seed,
                "stack": str(given.get("stack", "default")),
                "overrides": tuple(_several(given.get("set", ()))),
            }
            yield pytest.param(case, marks=param.marks, id=f"{Path(mission).stem}-seed{seed}")


def _several(value: str | Path | Iterable[str | Path]) -> list[str]:
    return [str(value)] if isinstance(value, str | Path) else [str(item) for item in value]


def _misuse(where: str, what: str) -> NoReturn:
    pytest.fail(f"{where}: @pytest.mark.mission: {what}", pytrace=False)


_RESULTS: pytest.StashKey[dict[tuple[Any, ...], MissionResult]] = pytest.StashKey()
_RUN: pytest.StashKey[MissionRun] = pytest.StashKey()


@pytest.fixture
def mission(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> MissionRun:
    """The result of the mission in the test's ``mission`` marker; see ``MissionRun``.

    Equal missions are driven once per session: the same seed gives the same commands.
    """
    case = getattr(request, "param", None)
    if case is None:
        pytest.fail("the mission fixture needs @pytest.mark.mission(world=..., mission=...)", False)
    results = request.config.stash.setdefault(_RESULTS, {})
    key = tuple(case.values())
    if key not in results:
        results[key] = _drive(case)
    keep = request.config.getoption("mission_runs")
    parent = Path(keep) if keep else tmp_path_factory.mktemp("mission", numbered=True)
    run = MissionRun(results[key], parent / _folder_name(case))
    request.node.stash[_RUN] = run
    if keep:
        run.save()
    return run


def _drive(case: dict[str, Any]) -> MissionResult:
    from navfw.errors import InputError
    from navfw.missions.session import prepare

    try:
        session = prepare(
            case["world"],
            case["mission"],
            seed=case["seed"],
            stack=case["stack"],
            overrides=case["overrides"],
        )
        result = session.run()
    except InputError as error:
        pytest.fail(f"the mission cannot be driven: {error}", pytrace=False)
    if result.outcome == "cancelled":  # caught by the runner; pytest has to stop as well
        raise KeyboardInterrupt
    return result


def _folder_name(case: dict[str, Any]) -> str:
    import hashlib

    name = f"{Path(case['world']).stem}-{Path(case['mission']).stem}-{case['seed']}"
    variant = (case["stack"], case["overrides"])
    if variant == ("default", ()):
        return name
    return f"{name}-{hashlib.sha256(repr(variant).encode()).hexdigest()[:6]}"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add outcome and picture of the mission to the report of a failed test."""
    report = yield
    run = item.stash.get(_RUN, None)
    if run is not None and call.when == "call" and report.failed:
        report.sections.append(("mission", "\n".join(_describe(run))))
    return report


def _describe(run: MissionRun) -> Iterator[str]:
    session, verdict = run.result.session, run.result.run.verdict
    yield f"{session.world_name}/{session.mission_name}, seed {session.seed}"
    leader = verdict.behavior or "none"
    yield f"outcome: {verdict.outcome} after {verdict.time:.1f} s, leading behaviour: {leader}"
    yield f"reason:  {verdict.reason}"
    try:
        yield f"picture: {run.save() / 'trajectory.png'}"
    except Exception as error:  # a missing picture must not hide the test's failure
        yield f"picture: none, {error}"
    if verdict.trace:
        yield verdict.trace
