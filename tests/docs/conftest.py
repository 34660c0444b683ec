"""The project of a reader who types every file of the README and the docs."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from docs_pages import write_files


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """That project, the working folder while the tests of a module run."""
    folder = tmp_path_factory.mktemp("my-robot")
    write_files(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        yield folder
