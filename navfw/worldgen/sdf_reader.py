"""Reader of Gazebo's world files (SDF): their static cylinders, boxes and meshes.

Cylinders and boxes must be upright; meshes become upright parts (``mesh_solids``). The XML must
have no document type or entities, and a bounded size and depth. Unsupported elements are listed by
line and name.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from navfw.config.foreign_files import line_of, read_xml
from navfw.config.input_file import is_file, real_path, shown_path
from navfw.errors import ConfigError, WorldError
from navfw.meshes import read_triangles
from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.robot.urdf_model import rigid_transform
from navfw.sim.shapes import Circle, Rectangle, Shape
from navfw.sim.upright_parts import UprightPart, mesh_solids

_MAX_TRIANGLES = 500_000
"""Of a collision mesh; those of rooms have hundreds."""

_UPRIGHT = 1e-3
"""Largest tilt of an upright shape [rad]."""

_IGNORED = frozenset(
    {
        *("light", "physics", "gravity", "magnetic_field", "atmosphere", "scene", "gui", "wind"),
        *("spherical_coordinates", "state", "plugin", "audio", "frame", "joint"),
    }
)
"""Elements of a world that are no solids."""
_FLAT = ("plane", "empty")
"""Shapes that are no solids."""
_GROUND = ("model://ground_plane", "model://sun", "ground_plane", "sun")
"""Included models that are ignored."""


@dataclass
class SdfWorld:
    """The content of a file: shapes, and a message for each ``unsupported`` element.

    ``meshes`` is the number of meshes whose parts are among the shapes.
    """

    shapes: list[UprightPart] = field(default_factory=list)
    unsupported: list[str] = field(default_factory=list)
    meshes: int = 0


def read_sdf(path: str | Path, models: Path | None = None) -> SdfWorld:
    """The shapes in an SDF world file; meshes are looked up beside it, and in ``models``.

    Raises:
        ConfigError: the file cannot be read, is not an SDF world, or has an invalid number.

    """
    path = Path(path)
    root = read_xml(path, "an SDF world")
    if root.tag != "sdf":
        raise ConfigError(f"expected an SDF world, got <{root.tag}>", file=path, line=line_of(root))
    worlds = root.findall("world")
    if len(worlds) != 1:
        raise ConfigError(f"expected one <world>, found {len(worlds)}", file=path, line=1)
    return _SdfReader(path, models).read(worlds[0])


class _SdfReader:
    """Collects the shapes of one world.

    A mesh ``model://NAME/FILE`` is looked up in the world's folder, its folder ``models``, and
    ``models``; other names are files relative to the world's folder or to ``models``. Each file is
    read once.
    """

    def __init__(self, path: Path, models: Path | None) -> None:
        self.path = path
        self._folders = [path.parent, path.parent / "models", *([] if models is None else [models])]
        self._triangles = cache(read_triangles)
        self.content = SdfWorld()
        self._taken: set[str] = set()
        self._moved: dict[str, Element] = {}

    def read(self, world: Element) -> SdfWorld:
        # a saved state has the models' poses at which Gazebo starts
        state = world.find("state")
        if state is not None:
            self._moved = {m.get("name", ""): m for m in state.findall("model")}
        for element in world:
            if element.tag == "model":
                self._model(element, np.eye(4), element.get("name", "model"), outermost=True)
            elif element.tag == "include":
                self._include(element)
            elif element.tag not in _IGNORED:
                self._unsupported(element, f"<{element.tag}> {element.get('name', '')}".strip())
        return self.content

    def _include(self, element: Element) -> None:
        uri = (element.findtext("uri") or "").strip()
        if uri not in _GROUND:
            self._unsupported(element, f"the included model {uri!r}")

    def _model(self, model: Element, parent: Array, name: str, *, outermost: bool = False) -> None:
        pose = self._pose(model, name)
        moved = self._moved.get(name) if outermost else None
        if moved is not None:
            if moved.find("pose") is not None:
                pose = self._pose(moved, name)
            scale = self._numbers(moved, "scale", 3, [1.0, 1.0, 1.0])
            if scale != [1.0, 1.0, 1.0]:
                self._unsupported(moved, f"the scaled model {name!r}")
                return
        if pose is None:
            return
        placed = product(parent, pose)
        static = (model.findtext("static") or "0").strip() in ("1", "true")
        shapes = (shape for shapes in model.iterfind(".//collision/geometry") for shape in shapes)
        if outermost and not static and any(shape.tag not in _FLAT for shape in shapes):
            self._unsupported(model, f"the model {name!r}, which is not static")
            return
        for link in model.findall("link"):
            link_pose = self._pose(link, name)
            if link_pose is None:
                continue
            for collision in link.findall("collision"):
                collision_pose = self._pose(collision, name)
                if collision_pose is not None:
                    self._collision(collision, product(placed, link_pose, collision_pose), name)
        for nested in model.findall("model"):
            self._model(nested, placed, f"{name}-{nested.get('name', 'model')}")
        for include in model.findall("include"):
            self._include(include)

    def _pose(self, element: Element, model: str) -> Array | None:
        """The pose; None, listed as unsupported, when it refers to another frame."""
        pose = element.find("pose")
        if pose is None:
            return np.eye(4)
        if pose.get("relative_to") or pose.get("frame"):
            self._unsupported(pose, f"a pose in another frame of the model {model!r}")
            return None
        return rigid_transform(*self._numbers(element, "pose", 6, [0.0] * 6))

    def _collision(self, collision: Element, pose: Array, model: str) -> None:
        geometry = collision.find("geometry")
        for shape in geometry if geometry is not None else ():
            if shape.tag == "cylinder":
                self._cylinder(shape, pose, model)
            elif shape.tag == "box":
                self._box(shape, pose, model)
            elif shape.tag == "mesh":
                self._mesh(shape, pose, model)
            elif shape.tag not in _FLAT:
                self._unsupported(shape, f"a <{shape.tag}> of the model {model!r}")

    def _cylinder(self, shape: Element, pose: Array, model: str) -> None:
        if abs(pose[2, 2]) < math.cos(_UPRIGHT):
            self._unsupported(shape, f"a tilted cylinder of the model {model!r}")
            return
        radius, length = (self._size(shape, key, 1)[0] for key in ("radius", "length"))
        x, y, z = pose[:3, 3].tolist()
        self._add(model, Circle(x, y, radius), z - 0.5 * length, z + 0.5 * length)

    def _box(self, shape: Element, pose: Array, model: str) -> None:
        size = self._size(shape, "size", 3)
        upright = int(np.argmax(np.abs(pose[2, :3])))
        if abs(pose[2, upright]) < math.cos(_UPRIGHT):
            self._unsupported(shape, f"a tilted box of the model {model!r}")
            return
        # a box may rest on any of its faces: its two other edges are horizontal
        first, second = ((upright + 1) % 3, (upright + 2) % 3)
        yaw = math.atan2(pose[1, first], pose[0, first])
        x, y, z = pose[:3, 3].tolist()
        outline = Rectangle(x, y, 0.5 * size[first], 0.5 * size[second], yaw)
        self._add(model, outline, z - 0.5 * size[upright], z + 0.5 * size[upright])

    def _mesh(self, shape: Element, pose: Array, model: str) -> None:
        uri = (shape.findtext("uri") or "").strip()
        if shape.find("submesh") is not None:
            self._unsupported(shape, f"a part of a mesh (<submesh>) of the model {model!r}")
            return
        scale = self._numbers(shape, "scale", 3, [1.0, 1.0, 1.0])
        file = next((path for path in self._candidates(uri) if is_file(path)), None)
        if file is None:
            folders = ", ".join(str(shown_path(folder)) for folder in self._folders)
            self._unsupported(
                shape,
                f"the mesh {uri!r} of the model {model!r}: no such file within {folders}; copy it"
                " there, or name the folder that has its model with --models",
            )
            return
        triangles = self._triangles(file, _MAX_TRIANGLES)
        try:
            parts = mesh_solids(product(triangles * scale, pose[:3, :3].T) + pose[:3, 3])
        except WorldError as error:
            raise WorldError(
                f"the mesh {uri!r} {error}", file=self.path, line=line_of(shape)
            ) from None
        self.content.meshes += 1
        for solid in parts:
            self._add(model, solid.shape, solid.bottom, solid.top, self.content.meshes)

    def _candidates(self, uri: str) -> Iterator[Path]:
        """Where the mesh may be, within the folders once links are followed."""
        name = uri.removeprefix("model://").removeprefix("file://")
        if not name or "://" in name or "\0" in name:
            return
        for folder in self._folders:
            path = real_path(folder / name)
            if any(path.is_relative_to(real_path(allowed)) for allowed in self._folders):
                yield path

    def _add(self, model: str, shape: Shape, bottom: float, top: float, mesh: int = 0) -> None:
        """Add a solid with a unique name."""
        name, number = model[:50], 1
        while name in self._taken:
            number += 1
            name = f"{model[:50]}-{number}"
        self._taken.add(name)
        self.content.shapes.append(UprightPart(shape, bottom, top, name, mesh))

    def _unsupported(self, element: Element, what: str) -> None:
        self.content.unsupported.append(f"line {line_of(element)}: {what}")

    def _size(self, shape: Element, key: str, count: int) -> list[float]:
        numbers = self._numbers(shape, key, count, [])
        if not numbers or min(numbers) <= 0.0:
            raise ConfigError(
                f"expected {'sizes' if count > 1 else 'a size'} above 0 m, got {numbers or 'none'}",
                file=self.path,
                line=line_of(shape),
                key=f"{shape.tag}.{key}",
            )
        return numbers

    def _numbers(self, element: Element, key: str, count: int, missing: list[float]) -> list[float]:
        child = element.find(key)
        if child is None:
            return missing
        text = (child.text or "").split()
        if not text and missing:
            return missing
        try:
            numbers = [float(word) for word in text]
        except ValueError:
            numbers = []
        if len(numbers) != count or not all(abs(number) < 1e6 for number in numbers):
            raise ConfigError(
                f"expected {count} number{'s' if count > 1 else ''}, got {' '.join(text)!r}",
                file=self.path,
                line=line_of(child),
                key=f"{element.tag}.{key}",
            )
        return numbers
