"""Read and write the folder of a run's results; it is written atomically."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from navfw.config.input_file import is_file, is_folder, read_json_object
from navfw.errors import ConfigError, InputError
from navfw.process.atomic import AtomicTarget
from navfw.process.target_lock import TargetLock, lock_first_free

if TYPE_CHECKING:
    from navfw.topomap import TopoMap

RESULT = "result.json"
"""The file with outcome, metrics and configuration of a run."""

PICTURE = "trajectory.png"
"""The file with the picture of the trajectory in top view."""

ESTIMATED, TRUTH = "trajectory.tum", "truth.tum"
"""Files with the estimated and the true poses over time, in ``map``, in the format of TUM."""

RECORDING = "run.mcap"
"""The file with the recording of a run."""

REPORT = "report.html"
"""The report that ``navfw report`` writes."""

LAYOUT = "foxglove_layout.json"
"""The layout of Foxglove for the channels of a recording."""

MAP, PLAN = "map.yaml", "plan.yaml"
"""Files of the map of a recorded run, and of its floor plan, if any; its image is beside it."""

EXPLORED, PLANS = "explored.yaml", "plans"
"""The map that an exploration made, and the folder of its floor plan."""

_BAGS = {".bag", ".active", ".mcap", ".db3"}
"""Suffixes of bags; ``.bag.active`` is left by a recorder that was killed."""

FILES = frozenset(
    {RESULT, PICTURE, ESTIMATED, TRUTH, RECORDING, REPORT, LAYOUT, EXPLORED, PLANS}
    | {MAP, "stack.yaml", PLAN, "plan.png", f".{RESULT}"},
)
"""All files of a run folder; a folder with any other file in it is never replaced."""


def is_bag(path: Path) -> bool:
    """Return whether ``path`` is named as a bag's file, or is a bag's folder; nothing is read."""
    return path.suffix in _BAGS or is_file(path / "metadata.yaml") or bag_files(path) != [path]


def bag_files(path: Path) -> list[Path]:
    """List the files with the messages of a bag: in a folder of ROS 2, else ``path`` itself.

    A folder that also holds images or a run is not a bag: ``path`` itself is returned for it.
    """
    inside = sorted(path.glob("*")) if is_folder(path) else []
    names = {file.suffix for file in inside} | {file.name for file in inside}
    files = [file for file in inside if file.suffix in {".mcap", ".db3"} and is_file(file)]
    return files if files and not names & {RECORDING, RESULT, ".png", ".jpg"} else [path]


def recording_in(folder: str | Path) -> Path:
    """Return the path of the recording in a run folder.

    Raises:
        ConfigError: there is none; the message says how to get one.

    """
    path = Path(folder) / RECORDING
    if is_file(path):
        return path
    raise ConfigError("contains no sensor readings; run again with --record", file=folder)


def plain_json(value: Any, digits: int = 17) -> Any:
    """Convert ``value`` (numpy, tuples, paths) to JSON values; inf and nan become null.

    Floats are rounded to at most ``digits`` significant digits.
    """
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, float):
        rounded = value if digits >= 17 else float(f"{value:.{digits}g}")
        return rounded if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): plain_json(item, digits) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain_json(item, digits) for item in value]
    if hasattr(value, "tolist"):  # a numpy scalar or array
        return plain_json(value.tolist(), digits)
    return str(value)


class RunFolder(AtomicTarget):
    """A context manager: files are written to ``path`` beside the target, then renamed into place.

    ``with RunFolder(target) as folder:`` gives a folder whose ``path`` is temporary; leaving the
    block without an exception moves it to ``target`` (see ``final``), leaving it with one removes
    it. An earlier run at ``target`` is replaced; anything else there is refused. If other files get
    there during the run, the folder is kept beside it, with a number, and the error says so.

    Raises:
        InputError: the target exists and is not a run folder, cannot be written, or is being
            written by another process.

    """

    def __init__(self, target: str | Path, *, numbered: bool = False) -> None:
        super().__init__(Path(target), numbered=numbered)
        self.final: Path | None = None
        if not numbered and (why := self._foreign(self.place)):
            raise InputError(why, file=self.target)

    def write_json(self, name: str, value: Any) -> None:
        """Write ``value`` as indented JSON (see ``plain_json``) to the file ``name`` inside."""
        text = json.dumps(plain_json(value), indent=2, allow_nan=False)
        part = self.path / f".{name}"
        try:
            part.write_text(text + "\n", encoding="utf-8")
            part.replace(self.path / name)
        finally:
            part.unlink(missing_ok=True)

    def show_unfinished(self) -> None:
        """Rename the temporary folder to ``NAME-unfinished``, for people to find.

        It stays when the process dies, if it has a recording. An earlier one is replaced.

        Raises:
            InputError: there are other files.

        """
        visible = self._lock.unfinished
        if why := self._foreign(visible):
            raise InputError(why, file=visible)
        shutil.rmtree(visible, ignore_errors=True)
        self.path = self.path.rename(visible)

    def adopt_unfinished(self) -> dict[str, Any]:
        """Take over the folder of a process that died; return its result so far, or {}."""
        if not is_file(self._lock.unfinished / RESULT):
            return {}
        self.path.rmdir()
        self.path = self._lock.unfinished
        return read_result(self.path)

    @property
    def kept(self) -> bool:
        """Whether unfinished content stays after an exception: only if it has a recording."""
        return self.path == self._lock.unfinished and is_file(self.path / RECORDING)

    def write_inputs(self, stack: Mapping[str, Any], topo_map: TopoMap) -> None:
        """Write the files beside a recording: inputs of a replay, and Foxglove's layout."""
        from navfw.topomap.mapfile import map_data
        from navfw.topomap.occupancy_map import save_ros_map

        plan = topo_map.floor_plan
        if plan is not None:
            save_ros_map(plan, self.path / PLAN)
        self.write_json(MAP, map_data(topo_map, None if plan is None else PLAN))
        self.write_json("stack.yaml", stack)
        shutil.copyfile(Path(__file__).with_name(LAYOUT), self.path / LAYOUT)

    def _move_into_place(self) -> None:
        why = self._foreign(self.place)
        if not why:
            self._replace()
            self.final = self.target
            return
        beside = lock_first_free(self.place)
        try:
            self.path.rename(beside.target)
        finally:
            beside.release()
        self.final = self.target.with_name(beside.target.name)
        raise InputError(f"{why}; the run is in {self.final}", file=self.target)

    def _foreign(self, place: Path) -> str:
        """Return why what is at ``place`` must not be replaced; "" if it is nothing or a run."""
        if not place.exists():
            return ""
        if not place.is_dir():
            return "is a file; the run needs a folder"
        names = {entry.name for entry in place.iterdir()}
        foreign = sorted(names - FILES)
        if not names or (RESULT in names and not foreign):
            return ""
        reason = f"it contains {foreign[0]!r}" if foreign else f"it has no {RESULT}"
        what = f"is not a run folder ({reason}), so it is not overwritten"
        return f"{what}; choose another {self.option}"


def read_result(folder: str | Path) -> dict[str, Any]:
    """Read the ``result.json`` of a run folder.

    Raises:
        ConfigError: the folder is not a run folder, or its result cannot be read.

    """
    path = Path(folder) / RESULT
    if not is_file(path):
        what = f"is not a run folder: it has no {RESULT}"
        unfinished = TargetLock(path.parent).unfinished
        what += f"; a run that has not ended is in {unfinished}" if unfinished.exists() else ""
        raise ConfigError(what, file=folder)
    return read_json_object(path)
