"""Missions as tests: the ``mission`` marker and fixture, and mission files as tests.

::

    import pytest

    @pytest.mark.mission(world="office", mission="lobby-to-lab", seeds=[1, 2, 3])
    def test_reaches_the_lab(mission):
        assert mission.outcome == "reached"
        assert mission.min_clearance_m > 0.05

The marked test runs once for each seed. Errors in world, mission, stack or overrides are reported
when tests are collected. A test fails when a plugin failed, unless its marker allows it. A failing
test shows the outcome, the reason, the last decisions, and the paths of picture and recording.
Unchanged missions are not driven again: their runs are in pytest's cache.

``pytest worlds`` drives the mission files that ``navfw_missions`` names, each once for each seed of
``--mission-seeds``, by default with seed 0::

    [tool.pytest.ini_options]
    testpaths = ["tests", "worlds"]
    navfw_missions = ["worlds/*/missions/*.yaml"]

Pytest loads this module in every session where navfw is installed, so it imports other modules
only when a mission is collected or driven.
"""

from __future__ import annotations

import contextlib
import itertools
import sys
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from navfw.errors import InputError
from navfw.testing.mission_case import MARKER, MissionCase, cases_of, widened

if TYPE_CHECKING:
    from navfw.testing.mission_cache import MissionCache
    from navfw.testing.mission_run import MissionRun


_RUN: pytest.StashKey[MissionRun] = pytest.StashKey()
"""Key of the run of a test in the stash of its item."""

CACHE: pytest.StashKey[MissionCache] = pytest.StashKey()
"""Key of the session's runs in the stash of its configuration."""


_MISSION = "mission"
_FILES = "navfw_missions"

_SEEDS = pytest.StashKey[tuple[int, ...]]()
_CHECKED = pytest.StashKey[set[tuple[object, ...]]]()


class MissionYaml(pytest.File):
    """A mission file; its items are one per seed. An item passes if the robot reaches its goals."""

    def collect(self) -> Iterator[MissionItem]:
        """Yield one item for each seed.

        Raises:
            CollectError: the mission, its world or its stack is wrong.

        """
        world, seeds = self.path.parents[1], self.config.stash[_SEEDS]
        named = str(world) if (world / "world.yaml").is_file() else world.name
        cases = [MissionCase(named, str(self.path), seed) for seed in widened([0], seeds)]
        try:
            cases[0].prepare()
        except InputError as error:
            raise self.CollectError(str(error)) from None
        for case in cases:
            yield MissionItem.from_parent(self, name=f"seed{case.seed}", case=case)


class MissionItem(pytest.Item):
    """A test that drives a mission file with one seed."""

    def __init__(self, *, case: MissionCase, **options: Any) -> None:
        super().__init__(**options)
        self.case = case

    def runtest(self) -> None:
        """Drive the mission; the hooks of the plugin check faults and report."""
        run = run_for(self, self.case)
        if not run.outcome.succeeded:
            pytest.fail(f"expected the goal to be reached; {run.verdict}", pytrace=False)

    def reportinfo(self) -> tuple[Path, None, str]:
        """Return the file and the name of the test."""
        return self.path, None, f"{self.path.stem}, {self.name}"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the command-line options, and the ini option ``navfw_missions``."""
    group = parser.getgroup("navfw")
    group.addoption(
        "--mission-runs",
        metavar="DIR",
        default=None,
        help="keep the run folders of all missions in DIR [default: only those of failed tests, in"
        " pytest's temporary folder]",
    )
    group.addoption(
        "--mission-seeds",
        metavar="A:B",
        default=None,
        help="drive every mission with the seeds from A to B - 1 as well",
    )
    group.addoption(
        "--mission-fresh",
        action="store_true",
        help="drive all missions, also those whose runs are in pytest's cache",
    )
    parser.addini(
        _FILES,
        type="linelist",
        help="patterns of mission files that are tests, relative to the root folder; pytest has to"
        " visit their folder (testpaths)",
        default=[],
    )


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker, and trust the project whose tests run: they are its code as well."""
    config.addinivalue_line("markers", MARKER)
    config.stash[_SEEDS] = _more_seeds(config)
    config.stash[_CHECKED] = set()
    from navfw.config.lookup import project_folder
    from navfw.config.project_trust import trusting

    try:
        project = project_folder(config.rootpath)
    except InputError:  # a damaged pyproject.toml: an error only where it is used
        return
    if project is not None:
        trust = contextlib.ExitStack()
        trust.enter_context(trusting(project))
        config.add_cleanup(trust.close)


def _more_seeds(config: pytest.Config) -> tuple[int, ...]:
    text = config.getoption("mission_seeds")
    if text is None:
        return ()
    from navfw.suite.suitefile import parse_seeds

    try:
        return tuple(parse_seeds(text))
    except InputError as error:
        raise pytest.UsageError(str(error).replace("--seeds", "--mission-seeds")) from None


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> MissionYaml | None:
    """Collect a mission file that matches a pattern of ``navfw_missions``."""
    if file_path.suffix not in {".yaml", ".yml"}:
        return None
    config = parent.config
    inside = file_path.is_relative_to(config.rootpath)
    name = file_path.relative_to(config.rootpath) if inside else file_path
    if not any(name.match(pattern) for pattern in config.getini(_FILES)):
        return None
    return MissionYaml.from_parent(parent, path=file_path)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Make one test for each mission and seed of the marker; errors in them fail the collection."""
    if _MISSION not in metafunc.fixturenames:
        return
    marker = metafunc.definition.get_closest_marker(_MISSION)
    if marker is None:
        return  # the fixture reports it, with the name of the test
    where = f"{metafunc.definition.nodeid}: @pytest.mark.mission"
    seeds: tuple[int, ...] = metafunc.config.stash[_SEEDS]
    try:
        cases = list(cases_of(marker, seeds))
        for case in (param.values[0] for param in cases):
            drive = (case.world, case.mission, case.stack, case.overrides)
            if drive not in metafunc.config.stash[_CHECKED]:
                metafunc.config.stash[_CHECKED].add(drive)
                case.prepare()
    except InputError as error:
        raise pytest.fail.Exception(f"{where}: {error}", pytrace=False) from None
    metafunc.parametrize(_MISSION, cases, indirect=True)


def pytest_collection_finish(session: pytest.Session) -> None:
    """Compile the missing kernels of imported modules before the first test that uses them."""
    config, scenes = session.config, "navfw.testing.behavior_check" in sys.modules
    drives = any(_MISSION in getattr(item, "fixturenames", (_MISSION,)) for item in session.items)
    if not (drives or scenes) or config.option.collectonly:
        return
    from navfw.process.kernel_compilation import COMPILING, Compiled, compile_kernels

    capture: Any = config.pluginmanager.getplugin("capturemanager")
    reports = itertools.count()

    def show(state: Compiled) -> None:
        if (report := next(reports)) % 20 == 0:  # every 10 s
            with capture.global_and_fixture_disabled() if capture else contextlib.nullcontext():
                sys.stderr.write("" if report else f"\n{COMPILING}\n")
                sys.stderr.write(f"compiling: {state}\n")

    compile_kernels(show, loaded=True)


def run_for(item: pytest.Item, case: MissionCase) -> MissionRun:
    """Return the run of ``case`` for a test: from this session, from the cache, or driven now."""
    from navfw.testing.mission_run import properties

    config = item.config
    keep = config.getoption("mission_runs")
    # the temporary folder of the session; under xdist, that of the worker
    temporary: pytest.TempPathFactory = config._tmp_path_factory  # type: ignore[attr-defined]
    parent = Path(keep) if keep else temporary.mktemp("mission", numbered=True)
    cache = _cache_of(config)
    try:
        run = cache.run(case, parent / case.folder_name)
    except InputError as error:  # from None, or pytest shows the cause a second time
        what = f"the mission cannot be driven: {error}"
        raise pytest.fail.Exception(what, pytrace=False) from None
    item.stash[_RUN] = run
    item.user_properties.extend(properties(run))
    if keep:
        run.save()
    return run


def _cache_of(config: pytest.Config) -> MissionCache:
    """The runs of this session, and those in pytest's cache folder, if pytest has a cache."""
    if CACHE not in config.stash:
        from navfw.testing.mission_cache import MissionCache

        cache = getattr(config, "cache", None)
        folder = None if cache is None else cache.mkdir("navfw-missions")
        config.stash[CACHE] = MissionCache(folder, config.getoption("mission_fresh"))
    return config.stash[CACHE]


@pytest.fixture
def mission(request: pytest.FixtureRequest) -> MissionRun:
    """The run of the mission in the test's ``mission`` marker; see ``MissionRun``.

    Tests with equal missions and seeds share one run, as it gives the same commands.
    """
    case = getattr(request, "param", None)
    if case is None:
        pytest.fail("the mission fixture needs @pytest.mark.mission(world=..., mission=...)", False)
    return run_for(request.node, case)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, None, None]:
    """Fail a test in whose mission a plugin failed too often, unless its marker allows it."""
    yield
    run = item.stash.get(_RUN, None)
    if run is not None and run.objections and not run.case.allow_faults:
        faults = "\n".join(f"  {fault}" for fault in (*run.objections, *run.faults))
        what = (
            f"a plugin faulted; @pytest.mark.mission(..., allow_faults=True) allows it:\n{faults}"
        )
        pytest.fail(what, pytrace=False)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add the run of the mission to the report of a failed test, and save its run folder."""
    report = yield
    run = item.stash.get(_RUN, None)
    if run is not None and call.when == "call" and report.failed:
        from navfw.testing.mission_run import describe, saved_properties

        saved = saved_properties(run)
        item.user_properties.extend(saved)
        report.user_properties = list(item.user_properties)
        report.sections.append(("mission", "\n".join(describe(run, saved))))
    return report
