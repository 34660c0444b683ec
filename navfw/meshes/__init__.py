"""Triangle meshes from files, of bounded size: furniture of a world, collision shapes to import.

``mesh_file`` reads all formats, and has sections and surfaces; ``furniture_meshes`` scales a mesh,
or a URDF's shapes, to metres, and covers it with boxes for plans.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
