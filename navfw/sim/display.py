"""Display of a world's meshes in a PyBullet client: for its window, or its own renderer."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import cv2

from navfw.process.atomic import scratch_folder
from navfw.signals import Image
from navfw.sim.engine import bullet
from navfw.sim.meshes import Mesh


class Display:
    """Textured bodies without mass or collision shape in one PyBullet client."""

    def __init__(self, client: int) -> None:
        self._client = client
        self._textures: dict[int, int] = {}
        self._hidden: set[int] = set()

    def add(
        self, mesh: Mesh, image: Image, position: Sequence[float], turn: Sequence[float]
    ) -> int:
        """Add a body with a texture (height, width, 3), RGB; returns PyBullet's id of it."""
        visual = self._call(
            "createVisualShape",
            bullet.GEOM_MESH,
            vertices=mesh.vertices,
            indices=mesh.indices,
            uvs=mesh.uvs,
            normals=mesh.normals,
            specularColor=[0.0, 0.0, 0.0],
        )
        body = int(self._call("createMultiBody", 0.0, -1, visual, position, turn))
        self._call("changeVisualShape", body, -1, textureUniqueId=self._texture(image))
        return body

    def place(self, body: int, position: Sequence[float], turn: Sequence[float]) -> None:
        """Set a body's position [m] and orientation (x, y, z, w)."""
        self._call("resetBasePositionAndOrientation", body, position, turn)

    def remove(self, body: int) -> None:
        """Remove a body."""
        self._call("removeBody", body)
        self._hidden.discard(body)

    def hide(self, bodies: Iterable[int]) -> None:
        """Set the bodies that are not drawn."""
        hidden = set(bodies)
        for body in hidden ^ self._hidden:
            # TinyRenderer skips fully transparent bodies
            colour = [1.0, 1.0, 1.0, float(body not in hidden)]
            self._call("changeVisualShape", body, -1, rgbaColor=colour)
        self._hidden = hidden

    def _texture(self, image: Image) -> int:
        """PyBullet's id of a texture; PyBullet loads textures from files only."""
        if id(image) not in self._textures:
            with scratch_folder("textures") as folder:
                # uncompressed: ten times as fast as PNG
                path = folder / "texture.bmp"
                cv2.imwrite(str(path), cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
                self._textures[id(image)] = int(self._call("loadTexture", str(path)))
        return self._textures[id(image)]

    def _call(self, function: str, *args: Any, **kwargs: Any) -> Any:
        return getattr(bullet, function)(*args, physicsClientId=self._client, **kwargs)
