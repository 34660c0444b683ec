"""Robot files: a robot by name, and the robot of a mission with the mission's own changes.

A robot with ``base: NAME`` lists only its differences from that robot; without, from the defaults.
A mission names a robot, or changes single values of one::

    robot: husky
    robot: {base: husky, max_v: 0.4}
    robot: {max_v: 0.4}              # of the robot called default
"""

from __future__ import annotations

import copy
from pathlib import Path
from types import MappingProxyType

from pydantic import Field

from navfw.config.document import YamlDocument, load_yaml
from navfw.config.input_file import shown_path
from navfw.config.lookup import URDF_SUFFIXES, find
from navfw.config.overrides import layered, on_its_base
from navfw.config.yaml_text import Data, KeyPath, key_text
from navfw.config.yamlfile import validate
from navfw.robot import RobotModel
from navfw.robot.camera_models import LensCalibration
from navfw.robot.urdf import read_urdf, urdf_path
from navfw.robot.urdf_drive import with_urdf
from navfw.robot.urdf_measures import measured

_DEFAULT_ROBOT = "default"
"""The robot of a mission that names none."""

_SECTION = "robot"
"""Key of a mission's robot."""
_URDF = ("urdf", "file")
"""Path of the key of a robot that names its URDF."""
_PACKAGES = ("urdf", "packages")
"""The path of the key with folders of packages."""
_CALIBRATION = ("camera", "calibration")
"""The path of the key that names a calibration file."""


class RobotSpec(RobotModel):
    """The schema of a robot file."""

    description: str = Field(default="", description="one line for people")
    base: str | None = Field(
        default=None, description="name or file of a robot from which this one differs"
    )


def load_robot(name: str | Path) -> RobotSpec:
    """Load the robot of that name, or from that robot file or URDF.

    Raises:
        UnknownNameError: there is no robot of that name.
        ConfigError: the file or its base breaks the schema.

    """
    document = _measured(_read(find("robot", name)), ())
    robot = validate(document, RobotSpec)
    return robot.model_copy(update={"camera": with_urdf(robot, document).camera})


def robot_section(value: Data) -> Data:
    """Return the value of a mission's key ``robot`` as a mapping; a name becomes ``base: name``.

    >>> robot_section("husky"), robot_section({"max_v": 0.4})
    ({'base': 'husky'}, {'max_v': 0.4})
    """
    return {"base": value} if isinstance(value, str) else value


def with_section(mission: YamlDocument) -> YamlDocument:
    """Return ``mission`` with ``robot`` as a mapping, so that options may change single values."""
    section = mission.at((_SECTION,))
    return _with(mission, robot_section(section)) if isinstance(section, str) else mission


def with_robot(mission: YamlDocument, folder: Path) -> YamlDocument:
    """Return ``mission`` with all values of its robot: those of the named one, then its own.

    Paths of files are relative to ``folder``; one given by an option, to the working folder.

    Raises:
        UnknownNameError: there is no robot of that name.
        ConfigError: the robot's file breaks the schema.

    """
    section = mission.at((_SECTION,))
    section = {} if section is None else robot_section(section)
    name = section.get("base", _DEFAULT_ROBOT) if isinstance(section, dict) else None
    if not isinstance(name, str):
        return mission  # the mission's schema says what is wrong
    origin = mission.origin_of((_SECTION, "base"))
    with mission.locating((_SECTION, "base"), key=_SECTION):
        file = find("robot", name, base=None if origin.option else folder)
    robot = _read(file)
    if file.suffix not in URDF_SUFFIXES:  # a URDF alone may need what the mission changes
        validate(_measured(robot, ()), RobotSpec)
    changes = {key: value for key, value in section.items() if key != "base"}
    located = _located(_with(mission, changes), (_SECTION,), folder)
    return _measured(layered(_as_section(robot), located), (_SECTION,))


def _read(path: Path) -> YamlDocument:
    """Read the robot file at ``path`` on top of the one that it is based on, unchecked."""
    return on_its_base(_load(path), path, "robot", load=_load)


def _load(path: Path) -> YamlDocument:
    if path.suffix in URDF_SUFFIXES:
        data = {"urdf": {"file": path.name}, "description": f"by {path.name}"}
        return _located(YamlDocument(shown_path(path), data), (), path.parent)
    return _located(load_yaml(path), (), path.parent)


def _measured(document: YamlDocument, at: KeyPath) -> YamlDocument:
    """Return ``document`` on top of the values measured from the URDF of its part ``at``."""
    part = document.at((*at, _URDF[0]))
    file = part.get(_URDF[1]) if isinstance(part, dict) else None
    lists = [part.get(key) or [] for key in ("packages", "args")] if isinstance(file, str) else []
    if not isinstance(file, str) or not all(isinstance(names, list) for names in lists):
        return document
    with document.locating((*at, *_URDF), key=key_text(_URDF)):
        model = read_urdf(Path(file), *(tuple(map(str, names)) for names in lists))
        radius = document.at((*at, "wheel_radius"))
        lower: Data = measured(model, {**part, "wheel_radius": radius})
    for step in reversed(at):
        lower = {step: lower}
    return layered(YamlDocument(shown_path(Path(file)), lower), document)


def _located(document: YamlDocument, at: KeyPath, folder: Path) -> YamlDocument:
    """Return ``document`` with paths of the files that its part ``at`` names, from ``folder``.

    The path of the URDF is made absolute, the calibration is read.
    """
    data = copy.deepcopy(document.data)
    for key in (_URDF, _CALIBRATION, _PACKAGES):
        from_here = Path() if document.origin_of((*at, *key)).option else folder
        section = YamlDocument(None, data).at((*at, key[0]))
        match key[1], document.at((*at, *key)):
            case "file", str(name) if name:
                section["file"] = str(urdf_path(name, from_here).absolute())
            case "calibration", str(name) if name:
                with document.locating((*at, *key), key=key_text(key)):
                    section["calibration"] = LensCalibration.load(from_here / name).model_dump()
            case "packages", list(names) if all(isinstance(name, str) for name in names):
                section["packages"] = [str((from_here / name).absolute()) for name in names]
    return YamlDocument(document.file, data, document.origins)


def _as_section(robot: YamlDocument) -> YamlDocument:
    """Return a mission's document with only this robot, without keys that only its file has."""
    data = {key: value for key, value in robot.data.items() if key in RobotModel.model_fields}
    origins = {(_SECTION, *path): origin for path, origin in robot.origins.items()}
    return YamlDocument(robot.file, {_SECTION: data}, MappingProxyType(origins))


def _with(mission: YamlDocument, section: Data) -> YamlDocument:
    return YamlDocument(mission.file, {**mission.data, _SECTION: section}, mission.origins)
