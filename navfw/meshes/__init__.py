"""Triangle meshes from files, of bounded size: of furniture, robots, and imported worlds.

``mesh_file`` reads all formats, and computes sections and surfaces.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
