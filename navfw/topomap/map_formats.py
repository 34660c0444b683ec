"""Map files of several formats, chosen by their suffix: reading and writing.

``.yaml`` is navfw's own format (``mapfile``), ``.graphml`` that of graph tools such as networkx,
yEd and Gephi (``graphml``), ``.geojson`` that of Nav2's route server (``geojson``). All three
preserve the whole map; its floor plan is written beside it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from navfw.config.input_file import read_input_text, shown_path
from navfw.errors import MapError
from navfw.process.atomic import write_text
from navfw.topomap.geojson import geojson_text, read_geojson
from navfw.topomap.graphml import graphml_text, read_graphml
from navfw.topomap.mapfile import KindCheck, load_map, map_text
from navfw.topomap.mapspec import MAX_BYTES
from navfw.topomap.ros_map import save_ros_map
from navfw.topomap.topological_map import TopoMap

_WRITERS: dict[str, Callable[[TopoMap, str | None], str]] = {
    ".yaml": map_text,
    ".yml": map_text,
    ".graphml": graphml_text,
    ".geojson": geojson_text,
    ".json": geojson_text,
}

SUFFIXES: tuple[str, ...] = tuple(_WRITERS)
"""The suffixes of map files."""


def load_any_map(
    path: str | Path, both_ways: bool = False, check_kind: KindCheck | None = None
) -> TopoMap:
    """The map in a file of any format, chosen by its suffix.

    With ``both_ways`` a one-way edge becomes a passage, which is always two-way. ``check_kind``
    knows the kinds of landmark of YAML maps; other formats have the shipped ones alone.

    Raises:
        ConfigError: the file cannot be read, or is not of its format.
        MapError: the suffix is unknown, something that the format requires is missing, an edge is
            one-way, or the map is invalid.

    """
    path = Path(path)
    suffix = _suffix(path)
    if _WRITERS[suffix] is map_text:
        return load_map(path) if check_kind is None else load_map(path, check_kind)
    text = read_input_text(path, 4 * MAX_BYTES)
    if _WRITERS[suffix] is graphml_text:
        return read_graphml(text, shown_path(path), both_ways)
    return read_geojson(text, shown_path(path), both_ways)


def save_map(topo_map: TopoMap, path: str | Path) -> None:
    """Write the map in the format of the suffix, replacing an old file atomically.

    Its floor plan, if any, goes to ``plans/NAME.yaml`` below its folder: in a folder of maps, a
    file beside it would count as another map.

    Raises:
        MapError: the suffix is unknown.
        InputError: the file cannot be written.

    """
    path = Path(path)
    writer = _WRITERS[_suffix(path)]
    plan_file = None
    if topo_map.floor_plan is not None:
        plan_file = f"plans/{path.stem}.yaml"
        save_ros_map(topo_map.floor_plan, path.parent / plan_file)
    write_text(path, writer(topo_map, plan_file), parents=True)


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in _WRITERS:
        known = ", ".join(SUFFIXES)
        raise MapError(f"expected a map file ({known}), got {path.name!r}", file=shown_path(path))
    return suffix
