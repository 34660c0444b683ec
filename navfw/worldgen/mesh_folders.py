"""Where the meshes of a Gazebo world are: beside it, or in a folder of models; nowhere else."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path

from navfw.config.input_file import is_file, shown_path
from navfw.errors import InputError
from navfw.signals import Array
from navfw.worldgen.collision_mesh import read_triangles

_MODEL = "model://"
_FILE = "file://"


class MissingMeshError(InputError):
    """A mesh is in none of the folders in which it may be."""


class MeshFolders:
    """Finds meshes by the URIs of a world in the folder ``world``; each file is read once.

    ``model://NAME/FILE`` is looked up in the world's folder, its folder ``models``, and ``models``;
    other names are files relative to the world's folder or to ``models``.
    """

    def __init__(self, world: Path, models: Path | None) -> None:
        self._folders = [world, world / "models", *([] if models is None else [models])]
        self._read = cache(read_triangles)

    def read(self, uri: str) -> Array:
        """The triangles (n, 3, 3) [m] of the mesh with this URI.

        Raises:
            MissingMeshError: there is none, or it lies outside of the folders.
            ConfigError: the file is no mesh, or too large.
            InputError: the extra for meshes is not installed.

        """
        for path in self._candidates(uri):
            if is_file(path):
                return self._read(path)
        folders = ", ".join(str(shown_path(folder)) for folder in self._folders)
        raise MissingMeshError(
            f"no such file within {folders}; copy it there, or name the folder that has its model"
            " with --models"
        )

    def _candidates(self, uri: str) -> Iterator[Path]:
        """Where the mesh may be, within the folders once links are followed."""
        name = uri.removeprefix(_MODEL).removeprefix(_FILE)
        if not name or "://" in name or "\0" in name:
            return
        for folder in self._folders:
            path = (folder / name).resolve()
            if any(path.is_relative_to(allowed.resolve()) for allowed in self._folders):
                yield path
