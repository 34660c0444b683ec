"""The visual model of a world: textured meshes in parts, of which the visible ones are drawn.

The meshes are in a rasteriser, apart from the physics: there they would add to the cost of every
step, here their number is free. A display window shows them as well.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from navfw.features.landmark_appearance import plate_image
from navfw.meshes.furniture_meshes import furniture_mesh
from navfw.numerics import Array, Image
from navfw.signals import Pose
from navfw.sim import textures
from navfw.sim.engine import Display, quaternion
from navfw.sim.raster import Raster
from navfw.sim.shapes import Rectangle
from navfw.sim.solids import Solid, solids_of
from navfw.sim.surface_patches import (
    drop_patches,
    floor_patches,
    merged_parts,
    plate_bounds,
    plate_mesh,
    solid_mesh,
    solid_patch,
    texture_shift,
    wall_patches,
)
from navfw.sim.textured_mesh import TexturedMesh, cylinder_mesh, triangle_mesh
from navfw.sim.visibility import PartBounds, Visibility
from navfw.sim.worldspec import TextureSpec, WalkerSpec, WorldSpec

_MAX_SINGLE = 24
"""With more boxes and cylinders than this, they are merged by texture and area."""
_KEPT_WORLDS = 8
"""Number of worlds whose surfaces are kept, up to 5 MB each: one for each of some environments."""
_known_surfaces: dict[str, tuple[tuple[str, TexturedMesh, PartBounds], ...]] = {}
_COVER_DISTANCE = 0.003
"""Distance [m] of a textureless cover from the surface that it hides."""


class Scenery:
    """The visible bodies of a world, in ``raster`` and, if given, in ``display``.

    ``cull`` False draws everything always, as the display does.
    """

    def __init__(self, world: WorldSpec, display: Display | None = None, cull: bool = True) -> None:
        self.world = world
        self.raster = Raster()
        self._display = display
        self._displayed: dict[int, int] = {}
        self._cull = cull
        self._textures: dict[str, int] = {}
        self._periods: dict[int, tuple[float, float]] = {}
        self._images: list[Image] = []
        solids = solids_of(world)
        furniture = [s for s in solids if s.kind in ("box", "cylinder")]
        self._bodies: list[int] = []
        bounds: list[PartBounds] = []
        # roughly front to back: surfaces drawn later are then seldom visible, and not shaded
        for mark in world.landmarks:
            grey = plate_image(mark.kind, mark.id)
            plate = self._load_image(np.repeat(grey[..., None], 3, axis=2))
            self._bodies.append(self._add(plate_mesh(mark), plate))
            bounds.append(plate_bounds(mark))
        for thing in world.meshes:
            triangles = furniture_mesh(thing.file, thing.scale, thing.up)
            visible = triangle_mesh(triangles.corners, texture_shift(thing.name))
            place = (*thing.at, thing.base)
            self._bodies.append(self._add(visible, thing.texture, place, thing.yaw))
            points = Pose(*thing.at, thing.yaw).points_to_parent(triangles.vertices[:, :2])
            bounds.append(PartBounds.around(points))
        if len(furniture) <= _MAX_SINGLE:
            for solid in furniture:
                self._bodies.append(self.add_solid(solid))
                bounds.append(PartBounds(solid.shape.corners))
        for texture, mesh, part_bounds in _surfaces(world):
            self._bodies.append(self._add(mesh, texture))
            bounds.append(part_bounds)
        self._visibility = _visibility(world, solids, bounds)
        self._visible = np.ones(len(bounds), np.bool_)

    def update_visible(self, eye: Array, middle: float, half: float) -> None:
        """Select the parts to draw from ``eye`` (3,) [m].

        The field of view extends ``half`` [rad] to both sides of the bearing ``middle`` [rad].
        """
        if not self._cull:
            return
        visible = self._visibility.visible(eye, middle, half)
        if (visible != self._visible).any():
            self.raster.hide([self._bodies[i] for i in np.flatnonzero(~visible)])
            self._visible = visible

    def add_solid(self, solid: Solid) -> int:
        """Add a solid as a body of its own; returns the body."""
        return self._add(solid_mesh(solid), solid.texture, solid.centre, solid.shape.yaw)

    def add_walker(self, walker: WalkerSpec) -> int:
        """Add a walker's cylinder at the origin; ``place`` moves it. Returns the body."""
        mesh = cylinder_mesh(walker.radius, walker.height, texture_shift(walker.name))
        return self._add(mesh, walker.texture)

    def add_cover(self, solids: Sequence[Solid], brightness: float) -> int:
        """Cover ``solids`` with a textureless surface [grey levels]; returns its body.

        Its distance from them is below the resolution of any sensor.
        """
        mesh = TexturedMesh()
        for solid in solids:
            mesh.add_mesh(solid_mesh(solid, _COVER_DISTANCE), solid.centre, solid.shape.yaw)
        if not solids:
            mesh = TexturedMesh.without_area()
        return self._add(mesh, self._load(TextureSpec(contrast=0.0, brightness=brightness)))

    def place(self, body: int, position: Sequence[float], turn: Sequence[float]) -> None:
        """Set a body's position [m] and orientation (x, y, z, w)."""
        self.raster.place(body, position, turn)
        if self._display is not None:
            self._display.place(self._displayed[body], position, turn)

    def remove(self, body: int) -> None:
        """Remove a body."""
        self.raster.remove(body)
        if self._display is not None:
            self._display.remove(self._displayed.pop(body))

    def _add(
        self,
        mesh: TexturedMesh,
        texture: str | int,
        position: tuple[float, float, float] = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
    ) -> int:
        turn = quaternion(yaw)
        index = self._texture(texture) if isinstance(texture, str) else texture
        if index in self._periods:
            mesh = mesh.with_period(*self._periods[index])
        body = self.raster.add(mesh, index, position, turn)
        if self._display is not None:
            self._displayed[body] = self._display.add(mesh, self._images[index], position, turn)
        return body

    def _texture(self, name: str) -> int:
        if name not in self._textures:
            self._textures[name] = self._load(self.world.textures.get(name) or textures.STOCK[name])
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


def _surfaces(world: WorldSpec) -> tuple[tuple[str, TexturedMesh, PartBounds], ...]:
    """Walls, floor, drops, and furniture where there is much of it, merged by texture and area.

    Kept for the next runs in an equal world: making them takes half of a run's set-up.
    """
    key = world.model_dump_json()
    if key not in _known_surfaces:
        if len(_known_surfaces) == _KEPT_WORLDS:
            del _known_surfaces[next(iter(_known_surfaces))]
        solids = solids_of(world)
        furniture = [solid for solid in solids if solid.kind in ("box", "cylinder")]
        walls = [solid for solid in solids if solid.kind in ("wall", "lintel")]
        patches = [solid_patch(s) for s in furniture] if len(furniture) > _MAX_SINGLE else []
        patches += [patch for wall in walls for patch in wall_patches(world, wall)]
        patches += [*floor_patches(world), *drop_patches(world)]
        _known_surfaces[key] = tuple(merged_parts(patches))
    return _known_surfaces[key]


def _visibility(
    world: WorldSpec, solids: Sequence[Solid], bounds: Sequence[PartBounds]
) -> Visibility:
    """Visibility with the walls that nothing overtops as occluders."""
    walls, walkers = (wall.height for wall in world.walls), (m.height for m in world.movers)
    highest = max([0.0, *walls, *walkers, *(solid.top for solid in solids)])
    occluders = [
        solid.shape
        for solid in solids
        if solid.kind == "wall" and solid.top >= highest and isinstance(solid.shape, Rectangle)
    ]
    return Visibility(occluders, highest, bounds)
