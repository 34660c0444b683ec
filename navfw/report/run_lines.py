"""The runs of a suite as lines of its report, with their pictures reduced and embedded."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import numpy as np

from navfw.config.image_file import read_image
from navfw.config.input_file import is_file
from navfw.errors import ConfigError
from navfw.recording.run_folder import RECORDING, REPORT
from navfw.report.report_page import reduced_source
from navfw.suite.run_table import RunRow
from navfw.suite.suite_folder import SuiteFolder

_MAX_PICTURES = 400
"""Largest number of embedded pictures of a suite: about 10 MB. Of other runs there are links."""

_WIDTH, _QUALITY = 640, 60
"""Width [px] and quality (WebP, of 100) of an embedded picture: its labels can be read."""


@dataclass(frozen=True, slots=True)
class RunLine:
    """One run on a page.

    ``image`` is a data URL, ``link`` the relative URL of the picture's file, and ``report`` that of
    the report of a recorded run; "" without one.
    """

    row: RunRow
    image: str
    link: str
    report: str

    @property
    def name(self) -> str:
        """Entry, world and mission, each once."""
        return " / ".join(dict.fromkeys((self.row.entry, self.row.world, self.row.mission)))


class RunLines:
    """Makes the lines of the suite in ``folder`` for a page in the folder ``page``.

    ``damaged`` says of each picture that cannot be read why; its run has the link alone.
    """

    def __init__(self, folder: SuiteFolder, page: Path) -> None:
        self._folder = folder
        self._page = page
        self._left = _MAX_PICTURES
        self.damaged: list[str] = []

    def of(self, rows: Iterable[RunRow]) -> list[RunLine]:
        """The lines of ``rows``; the first ones get the embedded pictures."""
        return [self.line(row) for row in rows]

    def line(self, row: RunRow) -> RunLine:
        """The line of one run."""
        recording = self._folder.recording(row)
        known = is_file(recording / RECORDING) or is_file(recording / REPORT)
        report = relative_link(recording / REPORT, self._page) if known else ""
        file = self._folder.pictures / Path(row.picture).name
        if not row.picture or not is_file(file):
            return RunLine(row, "", "", report)
        return RunLine(row, self._image(file), relative_link(file, self._page), report)

    def _image(self, file: Path) -> str:
        """The picture as a data URL; "" where there are too many, or it cannot be read."""
        if not self._left:
            return ""
        try:
            image = np.asarray(read_image(file), dtype=np.uint8)
        except ConfigError as error:
            self.damaged.append(str(error))
            return ""
        self._left -= 1
        return reduced_source(image, _WIDTH, _QUALITY)


def relative_link(file: Path, folder: Path) -> str:
    """The URL of ``file`` on a page in ``folder``."""
    return quote(os.path.relpath(file.absolute(), folder.absolute()))
