"""The runs of missions in one session of pytest: each is driven once.

The plugin imports this module in every session: what is heavy is imported where it is used.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from navfw.testing.mission_case import MissionCase

if TYPE_CHECKING:
    from navfw.missions.session import MissionResult
    from navfw.testing.driven_run import DrivenRun
    from navfw.testing.mission_cache import MissionCache
    from navfw.testing.mission_run import MissionRun

RUN: pytest.StashKey[MissionRun] = pytest.StashKey()
"""The run of a test, in the stash of its item."""

RUNS: pytest.StashKey[dict[tuple[object, ...], DrivenRun]] = pytest.StashKey()
"""The runs of the session by the inputs of their cases, in the stash of its configuration."""

_LAST: pytest.StashKey[tuple[tuple[object, ...], MissionResult]] = pytest.StashKey()
_CACHE: pytest.StashKey[MissionCache | None] = pytest.StashKey()


def run_for(item: pytest.Item, case: MissionCase) -> MissionRun:
    """The run of ``case`` for a test: driven before in this session, cached, or driven now."""
    from navfw.errors import InputError
    from navfw.testing.mission_run import MissionRun, properties

    config = item.config
    keep = config.getoption("mission_runs")
    # the temporary folder of the session; under xdist, that of the worker
    temporary: pytest.TempPathFactory = config._tmp_path_factory  # type: ignore[attr-defined]
    parent = Path(keep) if keep else temporary.mktemp("mission", numbered=True)
    try:
        run, result, cached = _driven(config, case)
    except InputError as error:
        pytest.fail(f"the mission cannot be driven: {error}", pytrace=False)
    driven = MissionRun(case, run, parent / case.folder_name, cached, _cache_of(config))
    driven.driven.extend([] if result is None else [result])
    item.stash[RUN] = driven
    item.user_properties.extend(properties(driven))
    if keep:
        driven.save()
    return driven


def _driven(
    config: pytest.Config, case: MissionCase
) -> tuple[DrivenRun, MissionResult | None, bool]:
    """The run of ``case``, its result if that is the last one driven, whether it was cached."""
    from navfw.testing.driven_run import DrivenRun, drive

    runs, key = config.stash.setdefault(RUNS, {}), case.inputs
    result: MissionResult | None = None
    cached = False
    if key not in runs:
        cache = _cache_of(config)
        if cache is None:
            result = drive(case)
            runs[key] = DrivenRun.of(result)
        else:
            runs[key], result = cache.run(case)
            cached = result is None
        if result is not None:  # only the last one is kept: a recording may be large
            config.stash[_LAST] = (key, result)
    last = config.stash.get(_LAST, None)
    return runs[key], last[1] if last is not None and last[0] == key else None, cached


def _cache_of(config: pytest.Config) -> MissionCache | None:
    """The cache of runs in pytest's cache folder; None if pytest has no cache."""
    if _CACHE not in config.stash:
        from navfw.testing.mission_cache import MissionCache

        cache = getattr(config, "cache", None)
        folder = None if cache is None else cache.mkdir("navfw-missions")
        fresh = config.getoption("mission_fresh")
        config.stash[_CACHE] = None if folder is None else MissionCache(folder, fresh)
    return config.stash[_CACHE]


def finish(config: pytest.Config) -> None:
    """At the end of the session: remove what is too much from the cache."""
    cache = config.stash.get(_CACHE, None)
    if cache is not None:
        cache.prune()
