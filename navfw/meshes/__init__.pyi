from .mesh_file import read_triangles as read_triangles
