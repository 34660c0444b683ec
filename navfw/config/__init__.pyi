from .lookup import find as find
from .lookup import list_files as list_files
