"""Files and frames of SDF worlds: inserts included models, and composes poses.

A model is looked up as Gazebo does, by its folder's name in folders of models.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote
from xml.etree.ElementTree import Element

import numpy as np

from navfw.config.foreign_files import element_error, read_xml
from navfw.config.input_file import is_file, real_path
from navfw.config.lookup import package_folders
from navfw.errors import ConfigError, did_you_mean
from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.robot.sdf_pose import sdf_pose

_PATHS = ("GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH")
"""Environment variables with folders of models."""
_FUEL = re.compile(r"https?://[^/]*(?:gazebosim|ignitionrobotics)[^/]*/.*/models/([^/]+)(?:/.*)?")
"""An address of a model on Fuel, Gazebo's collection."""
_FRAMES = ("joint", "frame", "model", "link")
"""Elements whose names are frames; if a name occurs twice, the last element is used."""
_HERE: Array = np.eye(4)


class SdfFiles:
    """Finds files that a world names: ``model://NAME/FILE``, or relative to the naming file.

    ``folders`` of models are the world's own, ``models`` in it and beside it, that of ``--models``,
    and those of Gazebo's variables.
    """

    def __init__(self, world: Path, models: Path | None) -> None:
        named = (os.environ.get(name, "").split(os.pathsep) for name in _PATHS)
        self.folders = [
            *(world.parent, world.parent / "models", world.absolute().parent.parent / "models"),
            *([] if models is None else [models]),
            *(Path(path) for paths in named for path in paths if path),
        ]

    def find(self, uri: str, near: Path) -> Path | None:
        """Find the file ``uri`` named in the file ``near``; None if it is not in the folders."""
        return next((path for path in self._paths(uri, near) if is_file(path)), None)

    def find_model(self, uri: str, near: Path) -> Path | None:
        """Find a model's SDF file, or None: the file ``uri``, or that in the folder ``uri``.

        ``near`` is the file that names it.
        """
        fuel = _FUEL.fullmatch(uri)
        for name in (unquote(fuel[1]), unquote(fuel[1]).lower()) if fuel else (uri,):
            for path in self._paths(name, near):
                versions = sorted(
                    path.glob("[0-9]*/model.sdf"), key=lambda f: _numbers(f.parent.name)
                )
                for file in (path, path / _sdf_name(path), *versions[-1:]):
                    if is_file(file):
                        return file
        return None

    def _paths(self, uri: str, near: Path) -> Iterator[Path]:
        name = re.sub(r"^(model|file|package)://", "", uri)
        if not name or "://" in name or "\0" in name:
            return
        allowed = [near.parent, *self.folders]
        first, _, rest = name.partition("/")
        folders = package_folders(first, allowed)
        for path in (folder / rest for folder in folders) if first else (Path(name),):
            if any(real_path(path).is_relative_to(real_path(folder)) for folder in allowed):
                yield real_path(path)


def _sdf_name(folder: Path) -> str:
    """Return the name of the SDF file of the model in ``folder``: that of the last version."""
    try:
        files = read_xml(folder / "model.config", "a model.config").findall("sdf")
    except ConfigError:
        return "model.sdf"  # Gazebo needs no model.config, and reads damaged ones
    files.sort(key=lambda sdf: _numbers(sdf.get("version", "0")))
    return (files[-1].text or "").strip() if files else "model.sdf"


def _numbers(version: str) -> list[int]:
    return [int(number) for number in re.findall(r"\d+", version)]


def included_model(include: Element, found: Path) -> Element:
    """Return the model in the file ``found`` with the name, pose and other values of <include>.

    Raises:
        ConfigError: the file is not an SDF file of a model.

    """
    root = read_xml(found, "an SDF model")
    model = root.find("model")
    if root.tag != "sdf" or model is None:
        raise element_error(root, f"expected <sdf> with a <model>, got <{root.tag}>")
    model.set("name", (include.findtext("name") or model.get("name") or "model").strip())
    for own in include:
        if own.tag == "placement_frame":
            model.set(own.tag, (own.text or "").strip())
        elif own.tag in {"pose", "static"}:
            model[:] = [own, *(child for child in model if child.tag != own.tag)]
    return model


class SdfFrames:
    """The frames within a world or model, relative to which its elements have their poses."""

    def __init__(self, element: Element) -> None:
        self.element = element
        self._named = {
            child.get("name", ""): child for tag in _FRAMES for child in element.findall(tag)
        }
        self._asked: list[Element] = []

    def place(self, element: Element, base: Array = _HERE) -> Array:
        """Return the transform (4, 4) of an element to the frame of ``self.element``.

        A pose that names no frame is relative to ``base``, itself a transform to that frame.

        Raises:
            ConfigError: the pose is damaged, or its frame does not exist, or depends on itself.

        """
        pose = element.find("pose")
        frame = element.get("attached_to", "")
        if element.tag == "joint":
            frame = (element.findtext("child") or "").strip()
        own = _HERE
        if pose is not None:
            frame = pose.get("relative_to") or pose.get("frame") or frame
            own = sdf_pose(pose)
        placed: Array = product(self._frame(frame, element) if frame else base, own)
        placement = element.get("placement_frame")
        if placement:
            inner = SdfFrames(element)._frame(placement, element)
            back = np.eye(4)
            back[:3, :3] = inner[:3, :3].T
            back[:3, 3] = -product(back[:3, :3], inner[:3, 3])
            placed = product(placed, back)
        return placed

    def _frame(self, name: str, asker: Element) -> Array:
        first, _, rest = name.partition("::")
        if first in {"__model__", "world" if self.element.tag == "world" else ""}:
            return _HERE
        element = self._named.get(first)
        if element is None or element in self._asked:
            what = f"unknown frame {name!r}; {did_you_mean(first, self._named)}"
            if element is not None:
                what = f"the frame {name!r} depends on itself"
            raise element_error(asker, what, "pose")
        self._asked.append(element)
        frame = self.place(element)
        self._asked.pop()
        return product(frame, SdfFrames(element)._frame(rest, asker)) if rest else frame
