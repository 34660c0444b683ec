import sys
from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "behaviors"
    path.mkdir()
    return path


@pytest.fixture(autouse=True)
def _sys_path_stays() -> Iterator[None]:
    before = list(sys.path)
    yield
    assert sys.path == before
