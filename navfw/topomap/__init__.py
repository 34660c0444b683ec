"""The topological map: places, passages and landmarks; its files, checks, and maps from geometry.

``elements`` and ``mapspec`` are plain data, ``topological_map`` holds
them as a graph, ``mapfile`` and ``map_formats`` read and write them. ``map_check`` reports what is
suspect in a valid map; ``map_builder`` derives a map from a world's geometry. ``occupancy_map`` is
the floor plan that a map may come with.

Names are imported on first access: the keys and limits of a map file need no library for graphs.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
