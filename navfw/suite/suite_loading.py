"""The runs of a suite's folder as a table of pandas, which is imported when it is needed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from navfw.suite.suite_folder import SuiteFolder

if TYPE_CHECKING:
    from navfw.suite.suite_frame import SuiteFrame


def load_suite(folder: str | Path) -> SuiteFrame:
    """The runs in a ``folder`` of ``navfw suite``, also while it runs.

    Raises:
        MissingExtraError: pandas is not installed.
        InputError: it is no folder of a suite, or its journal is damaged.

    """
    from navfw.suite.suite_frame import SuiteFrame

    return SuiteFrame.of(SuiteFolder(Path(folder)).rows())
