"""Triangle meshes from files, of bounded size: of furniture, robots, and worlds to import.

``mesh_file`` reads all formats, and has sections and surfaces.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
