from .furniture_meshes import boxes_around as boxes_around
from .furniture_meshes import furniture_mesh as furniture_mesh
from .furniture_meshes import furniture_outline as furniture_outline
from .mesh_file import MAX_TRIANGLES as MAX_TRIANGLES
from .mesh_file import TriangleMesh as TriangleMesh
from .mesh_file import read_mesh as read_mesh
from .mesh_file import read_triangles as read_triangles
