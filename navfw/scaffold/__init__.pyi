from .new_parts import write_part as write_part
from .new_project import write_project as write_project
from .part_kinds import PARTS as PARTS
