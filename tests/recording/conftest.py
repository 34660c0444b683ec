"""A recorded drive of six seconds, for all tests that read one and change none of its files."""

from pathlib import Path

import pytest

from navfw.missions import MissionResult, prepare
from navfw.missions.run_report import write_run
from navfw.recording import RunFolder


@pytest.fixture(scope="session")
def driven(tmp_path_factory: pytest.TempPathFactory) -> tuple[MissionResult, Path]:
    """The result of the drive, and its run folder."""
    session = prepare("paper-room", "through-the-door", seed=3, overrides=["mission.timeout=6"])
    result = session.run(record=True)
    with RunFolder(tmp_path_factory.mktemp("driven") / "run") as folder:
        write_run(result, folder)
    assert folder.final is not None
    return result, folder.final


@pytest.fixture(scope="session")
def folder(driven: tuple[MissionResult, Path]) -> Path:
    """The run folder of the drive."""
    return driven[1]
