from .furniture_meshes import boxes_around as boxes_around
from .furniture_meshes import furniture_mesh as furniture_mesh
from .furniture_meshes import furniture_outline as furniture_outline
from .mesh_file import FURNITURE_LIMITS as FURNITURE_LIMITS
from .mesh_file import MeshLimits as MeshLimits
from .mesh_file import TriangleMesh as TriangleMesh
from .mesh_file import read_mesh as read_mesh
from .mesh_file import read_triangles as read_triangles
