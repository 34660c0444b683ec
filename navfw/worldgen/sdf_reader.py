"""Reads Gazebo's world files (SDF): their cylinders, boxes and meshes, and included models.

Other shapes than upright cylinders and boxes become upright parts (``mesh_solids``). The XML must
have no document type or entities, and a bounded size and depth. Unsupported elements are listed by
line and name.
"""

from __future__ import annotations

import math
import re
from collections import defaultdict
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from navfw.assumption import Assumption
from navfw.config.foreign_files import element_error, file_of, line_of, read_xml
from navfw.errors import ConfigError, WorldError
from navfw.meshes.mesh_file import MESH_SUFFIXES, read_triangles, solid_mesh
from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.robot.sdf_pose import sdf_numbers
from navfw.sim.shapes import Circle, Rectangle, Shape
from navfw.sim.upright_parts import UprightPart, mesh_solids
from navfw.worldgen.sdf_models import SdfFiles, SdfFrames, included_model

_MAX_TRIANGLES = 500_000
"""Largest number of triangles of a collision mesh; those of rooms have hundreds."""

_UPRIGHT = 1e-3
"""Largest tilt of an upright shape [rad]."""
_SOLIDS = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "cone": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "ellipsoid": {"radii": 3},
}
"""Shapes that are solids, with the keys of their sizes and the count of numbers of each."""

_IGNORED = frozenset(
    {
        *("light", "physics", "gravity", "magnetic_field", "atmosphere", "scene", "gui", "wind"),
        *("spherical_coordinates", "state", "plugin", "audio", "frame", "joint", "include"),
    }
)
"""Elements of a world that are not solids."""
_FLAT = ("plane", "empty")
"""Shapes that are not solids."""
_GROUND = re.compile(r"(?:.*/)?(ground(?:_| |%20)?plane|sun)(?:/\d+|/tip)?", re.IGNORECASE)
"""Included models that a world of navfw has itself."""
_DRIVEN = re.compile("drive|planar_?move|velocity_?control", re.IGNORECASE)
"""Pattern in the names of plugins that drive a robot."""
_LEVEL = 0.9
"""Smallest upward component of the normal of a plane that is not a wall."""
_MIN_HALF = 0.01
"""Smallest half width of a solid [m]; thinner ones are made that wide."""


@dataclass
class SdfWorld:
    """The content of a file: shapes, what is ``assumed``, messages on ``unsupported`` elements.

    ``meshes`` is the number of meshes, and of round or leaning shapes, whose parts are among the
    shapes; ``folders`` are those in which files are looked up.
    """

    shapes: list[UprightPart] = field(default_factory=list)
    unsupported: list[str] = field(default_factory=list)
    assumed: list[Assumption] = field(default_factory=list)
    folders: list[Path] = field(default_factory=list)
    meshes: int = 0


def read_sdf(path: str | Path, models: Path | None = None) -> SdfWorld:
    """Read the shapes in an SDF file of a world or model, with included models and meshes.

    ``models`` is a folder of models, besides those of ``SdfFiles``.

    Raises:
        ConfigError: a file cannot be read, is not SDF, or has an invalid number or frame.

    """
    path = Path(path)
    root = read_xml(path, "an SDF world")
    if root.tag != "sdf":
        raise element_error(root, f"expected an SDF world, got <{root.tag}>")
    worlds = root.findall("world") or ([root] if root.find("model") is not None else [])
    if len(worlds) != 1:
        raise ConfigError(f"expected one <world>, found {len(worlds)}", file=path, line=1)
    return _SdfReader(path, models).read(worlds[0])


class _SdfReader:
    """Collects the shapes of one world; each mesh is read once."""

    def __init__(self, path: Path, models: Path | None) -> None:
        self._files = SdfFiles(path, models)
        self._triangles = cache(read_triangles)
        self.content = SdfWorld(folders=self._files.folders)
        self._taken: set[str] = set()
        self._moved: dict[str, Element] = {}
        self._left: defaultdict[tuple[str, str], list[str]] = defaultdict(list)

    def read(self, world: Element) -> SdfWorld:
        self._file = file_of(world)
        self._include(world, ())
        # a saved state has the models' poses at which Gazebo starts
        state = world.find("state")
        if state is not None:
            self._moved = {m.get("name", ""): m for m in state.findall("model")}
        frames = SdfFrames(world)
        for element in world:
            name = element.get("name", "")
            if element.tag == "model":
                self._outermost(element, frames)
            elif element.tag == "actor":
                self._left["left out", "they walk"].append(name)
            elif element.tag not in _IGNORED:
                self._unsupported(element, f"<{element.tag}> {name}".strip())
        self.content.assumed += [
            Assumption(", ".join(names), taken, reason)
            for (taken, reason), names in self._left.items()
        ]
        return self.content

    def _include(self, element: Element, above: tuple[Path, ...]) -> None:
        """Put the included models, and theirs, into the places of their <include>.

        ``above`` are the files of the models that include the element.
        """
        for index, child in enumerate(list(element)):
            if child.tag == "model":
                self._include(child, above)
            if child.tag != "include":
                continue
            uri = " ".join((child.findtext("uri") or "").split())
            ground = _GROUND.fullmatch(uri)
            inner = None if ground else self._files.find_model(uri, file_of(child))
            if ground and "sun" not in ground[1].lower():
                self._left["the floor, at z = 0", "it is the included one"].append("ground plane")
            elif inner in above:
                raise element_error(child, f"the model {uri!r} includes itself")
            elif inner is not None:
                element[index] = included_model(child, inner)
                self._include(element[index], (*above, inner))
            elif not ground:
                self._unsupported(child, f"the included model {uri!r}: not found")

    def _outermost(self, model: Element, frames: SdfFrames) -> None:
        name = model.get("name", "model")
        moved = self._moved.get(name)
        pose = frames.place(model)
        if moved is not None:
            scale = self._numbers(moved, "scale", 3, [1.0, 1.0, 1.0])
            if scale != [1.0, 1.0, 1.0]:
                self._unsupported(moved, f"the scaled model {name!r}")
                return
            if moved.find("pose") is not None:
                self._left["where <state> has them", "Gazebo starts there"].append(name)
                pose = frames.place(moved)
        static = any(
            (one.findtext("static") or "").strip().lower() in ("1", "true")
            for one in model.iter("model")
        )
        shapes = (shape for shapes in model.iterfind(".//collision/geometry") for shape in shapes)
        if not static and any(shape.tag not in _FLAT for shape in shapes):
            plugins = (p.get("name", "") + p.get("filename", "") for p in model.iter("plugin"))
            if any(map(_DRIVEN.search, plugins)):
                self._left["left out", "a plugin drives it"].append(name)
                return
            self._left["standing still", "not static in the file"].append(name)
        self._model(model, pose, name)

    def _model(self, model: Element, placed: Array, name: str) -> None:
        frames = SdfFrames(model)
        for link in model.findall("link"):
            at = frames.place(link)
            for collision in link.findall("collision"):
                self._collision(collision, product(placed, frames.place(collision, at)), name)
        for nested in model.findall("model"):
            at = product(placed, frames.place(nested))
            self._model(nested, at, f"{name}-{nested.get('name', 'model')}")

    def _collision(self, collision: Element, pose: Array, model: str) -> None:
        for shape in collision.iterfind("geometry/*"):
            if shape.tag == "mesh":
                self._mesh(shape, pose, model)
            elif shape.tag in _SOLIDS:
                self._solid(shape, pose, model)
            elif shape.tag not in _FLAT:
                self._unsupported(shape, f"a <{shape.tag}> of the model {model!r}")
            elif shape.tag == "plane":
                normal = np.array(self._numbers(shape, "normal", 3, [0.0, 0.0, 1.0]))
                if abs(product(pose[2, :3], normal)) < _LEVEL * math.hypot(*normal):
                    self._unsupported(shape, f"an upright <plane> of the model {model!r}")
                elif abs(height := float(pose[2, 3])) > 2.0 * _MIN_HALF:
                    what = f"a <plane> of the model {model!r} at z = {height:g} m, the floor is at"
                    self._unsupported(shape, f"{what} 0: move the world by it")

    def _solid(self, shape: Element, pose: Array, model: str) -> None:
        """Add an upright cylinder or box, or the upright parts of another shape."""
        size = np.array(self._extent(shape))
        half = np.maximum(0.5 * size, _MIN_HALF)
        x, y, z = pose[:3, 3].tolist()
        # a box may rest on any of its faces: its two other edges are horizontal
        upright = int(np.argmax(np.abs(pose[2, :3])))
        standing = abs(pose[2, upright]) >= math.cos(_UPRIGHT)
        low, high = z - 0.5 * size[upright], z + 0.5 * size[upright]
        if shape.tag == "cylinder" and standing and upright == 2:
            self._add(model, Circle(x, y, half[0]), low, high)
        elif shape.tag == "box" and standing:
            first, second = ((upright + 1) % 3, (upright + 2) % 3)
            yaw = math.atan2(pose[1, first], pose[0, first])
            self._add(model, Rectangle(x, y, half[first], half[second], yaw), low, high)
        else:
            self._parts(solid_mesh(shape.tag, size).corners, shape, pose, model)

    def _extent(self, shape: Element) -> list[float]:
        """Return the extent (x, y, z) [m] of a shape along its own axes."""
        keys = _SOLIDS[shape.tag].items()
        sizes = [number for key, count in keys for number in self._size(shape, key, count)]
        if shape.tag in {"box", "ellipsoid"}:
            return [size if shape.tag == "box" else 2.0 * size for size in sizes]
        across, *straight = 2.0 * sizes[0], *sizes[1:]
        ends = across if shape.tag in {"sphere", "capsule"} else 0.0
        return [across, across, sum(straight) + ends]

    def _mesh(self, shape: Element, pose: Array, model: str) -> None:
        uri = (shape.findtext("uri") or "").strip()
        if shape.find("submesh") is not None:
            self._unsupported(shape, f"a part of a mesh (<submesh>) of the model {model!r}")
            return
        scale = self._numbers(shape, "scale", 3, [1.0, 1.0, 1.0])
        file = self._files.find(uri, file_of(shape))
        if file is None or file.suffix.lower() not in MESH_SUFFIXES:
            reason = f"not one of {', '.join(MESH_SUFFIXES)}" if file else "not found"
            self._unsupported(shape, f"the mesh {uri!r} of the model {model!r}: {reason}")
            return
        self._parts(self._triangles(file, _MAX_TRIANGLES) * scale, shape, pose, model, uri)

    def _parts(
        self, triangles: Array, shape: Element, pose: Array, model: str, uri: str = ""
    ) -> None:
        """Add the upright parts of triangles (n, 3, 3) [m] at ``pose``."""
        try:
            parts = mesh_solids(product(triangles, pose[:3, :3].T) + pose[:3, 3])
        except WorldError as error:
            what = f"the {shape.tag} {uri!r} {error}"
            raise WorldError(what, file=file_of(shape), line=line_of(shape)) from None
        self.content.meshes += 1
        for solid in parts:
            self._add(model, solid.shape, solid.bottom, solid.top, self.content.meshes)

    def _add(self, model: str, shape: Shape, bottom: float, top: float, mesh: int = 0) -> None:
        """Add a solid with a unique name."""
        name, number = model[:50], 1
        while name in self._taken:
            number += 1
            name = f"{model[:50]}-{number}"
        self._taken.add(name)
        self.content.shapes.append(UprightPart(shape, bottom, top, name, mesh))

    def _unsupported(self, element: Element, what: str) -> None:
        at = "line " if file_of(element) == self._file else f"{file_of(element)}:"
        self.content.unsupported.append(f"{at}{line_of(element)}: {what}")

    def _size(self, shape: Element, key: str, count: int) -> list[float]:
        numbers = self._numbers(shape, key, count, [])
        if not numbers or min(numbers) <= 0.0:
            what = f"expected {'sizes' if count > 1 else 'a size'} above 0 m"
            raise element_error(shape, f"{what}, got {numbers or 'none'}", f"{shape.tag}.{key}")
        return numbers

    def _numbers(self, element: Element, key: str, count: int, missing: list[float]) -> list[float]:
        child = element.find(key)
        if child is None:
            return missing
        return sdf_numbers(child, count, missing, f"{element.tag}.{key}")
