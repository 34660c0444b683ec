"""The visual model of a world: textured meshes.

The meshes are in a rasteriser, apart from the physics: there they would make every step slower,
here their number costs nothing. A display window shows them as well.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from navfw.features.landmark_appearance import plate_image
from navfw.numerics import Image
from navfw.sim import textures
from navfw.sim.engine import Display
from navfw.sim.furniture_meshes import furniture_mesh
from navfw.sim.raster import Raster
from navfw.sim.soft_light import SoftLight
from navfw.sim.solids import Solid, solids_of
from navfw.sim.surface_patches import (
    STRETCHED,
    SurfacePatch,
    drop_patches,
    floor_patches,
    merged_parts,
    plate_mesh,
    solid_mesh,
    solid_patches,
    texture_shift,
    wall_patches,
)
from navfw.sim.textured_mesh import TexturedMesh, cylinder_mesh, triangle_mesh
from navfw.sim.worldspec import TextureSpec, WalkerSpec, WorldSpec

_KEPT_WORLDS = 8
"""Number of worlds whose surfaces are kept, up to 5 MB each."""
_Parts = tuple[tuple[str, TexturedMesh], ...]
_known_surfaces: dict[str, _Parts] = {}
_COVER_DISTANCE = 0.003
"""Distance [m] of a textureless cover from the surface that it hides."""


class Scenery:
    """The visible bodies of a world, in ``raster`` and, if given, in ``display``."""

    def __init__(self, world: WorldSpec, display: Display | None = None) -> None:
        self.world = world
        self.raster = Raster()
        self._display = display
        self._displayed: dict[int, int] = {}
        self._textures: dict[str, int] = {}
        self._periods: dict[int, tuple[float, float]] = {}
        self._images: list[Image] = []
        self._light = SoftLight(world)
        # roughly front to back: surfaces drawn later are then seldom visible, and not shaded
        for mark in world.landmarks:
            grey = plate_image(mark.kind, mark.id)
            plate = self._load_image(np.repeat(grey[..., None], 3, axis=2))
            self._add(self._light.lit(plate_mesh(mark)), plate)
        for thing in world.meshes:
            triangles = furniture_mesh(thing.file, thing.scale, thing.up)
            visible = triangle_mesh(triangles.corners, texture_shift(thing.name))
            placed = visible.placed((*thing.at, thing.base), thing.yaw)
            self._add(self._light.lit(placed), thing.texture)
        for texture, mesh in _surfaces(world, self._light):
            self._add(mesh, texture)

    def add_solid(self, solid: Solid, *, moves: bool = False) -> int:
        """Add a solid as a body; a ``front`` texture covers all its sides. Return the body.

        If it ``moves``, it is around the origin, to be moved by ``place``.
        """
        mesh, texture = solid_mesh(solid), solid.texture
        if solid.front:
            mesh, texture = mesh.stretched(), f"{STRETCHED}{solid.front}"
        placed = mesh.placed(solid.centre, solid.shape.yaw)
        return self._add(self._light.lit(placed, alone=moves), texture)

    def add_walker(self, walker: WalkerSpec) -> int:
        """Add a walker's cylinder at the origin, to be moved by ``place``; return the body."""
        mesh = cylinder_mesh(walker.radius, walker.height, texture_shift(walker.name))
        return self._add(self._light.lit(mesh, alone=True), walker.texture)

    def add_cover(self, solids: Sequence[Solid], brightness: float) -> int:
        """Cover ``solids`` with a plain surface of ``brightness`` [grey levels]; return its body.

        It is 3 mm in front of them, below the resolution of any sensor.
        """
        mesh = TexturedMesh()
        for solid in solids:
            mesh.append(solid_mesh(solid, _COVER_DISTANCE).placed(solid.centre, solid.shape.yaw))
        if not solids:
            mesh = TexturedMesh.without_area()
        plain = TextureSpec(contrast=0.0, brightness=brightness)
        return self._add(self._light.lit(mesh), self._load(plain))

    def place(self, body: int, position: Sequence[float], turn: Sequence[float]) -> None:
        """Set a body's position [m] and orientation (x, y, z, w) in ``map``."""
        self.raster.place(body, position, turn)
        if self._display is not None:
            self._display.place(self._displayed[body], position, turn)

    def remove(self, body: int) -> None:
        """Remove a body."""
        self.raster.remove(body)
        if self._display is not None:
            self._display.remove(self._displayed.pop(body))

    def _add(self, mesh: TexturedMesh, texture: str | int) -> int:
        index = self._texture(texture) if isinstance(texture, str) else texture
        if index in self._periods:
            mesh = mesh.with_period(*self._periods[index])
        body = self.raster.add(mesh, index)
        if self._display is not None:
            self._displayed[body] = self._display.add(mesh, self._images[index])
        return body

    def _texture(self, name: str) -> int:
        if name not in self._textures:
            plain = name.removeprefix(STRETCHED)
            spec = self.world.textures.get(plain) or textures.STOCK[plain]
            self._textures[name] = self._load(spec)
            if plain != name:
                self._periods.pop(self._textures[name], None)
        return self._textures[name]

    def _load(self, spec: TextureSpec) -> int:
        if spec.picture is None:
            return self._load_image(textures.synthesize(spec))
        picture = textures.read_picture(spec.picture)
        index = self._load_image(textures.picture_texture(spec))
        self._periods[index] = textures.covered_area(picture, spec.size)
        return index

    def _load_image(self, image: Image) -> int:
        self._images.append(image)
        return self.raster.add_texture(image)


def _surfaces(world: WorldSpec, light: SoftLight) -> _Parts:
    """Walls, furniture, floor and drops, merged by texture and area, in the world's light.

    Kept for the next runs in an equal world: making them takes half of a run's set-up.
    """
    key = world.model_dump_json()
    if key not in _known_surfaces:
        if len(_known_surfaces) == _KEPT_WORLDS:
            del _known_surfaces[next(iter(_known_surfaces))]
        patches: list[SurfacePatch] = []
        for solid in solids_of(world):
            if solid.kind in ("box", "cylinder"):
                patches += solid_patches(solid)
            elif solid.kind in ("wall", "lintel"):
                patches += wall_patches(world, solid)
        parts = merged_parts([*patches, *floor_patches(world), *drop_patches(world)])
        _known_surfaces[key] = tuple((name, light.lit(mesh)) for name, mesh in parts)
    return _known_surfaces[key]
